"""An excitation whose frequency follows the structure while the joint wears.

Each state of a history has its own frequency, an unknown with one more equation: a given phase lag of the vibration
(`solver.continuation.phase_lag`). In phase resonance the lag is pi/2. At the largest amplitude of the first response
the lag follows from the rise of the amplitude with the lag, which is zero there, by a secant. The lag changes little
from step to step, so that most steps take one or two solves.
"""

from __future__ import annotations

import math

import numpy as np

from solver.continuation.phase_lag import rise_of_response, solve_at_lag
from solver.harmonic_balance.converged import PathPoint, final_history
from solver.harmonic_balance.dlft import Balance
from solver.model import FloatArray
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Budget
from solver.outcome import Outcome
from solver.settings import FollowedFrequency
from solver.structure.joint import Case
from solver.wear.options import WEAR
from solver.wear.state import Failure, Reached, WearState


def end_at_resonance(
    case: Case,
    balance: Balance,
    start: FloatArray,
    state: WearState,
    follow: FollowedFrequency,
    solver: JacobianSolver,
    budget: Budget,
    most: int = WEAR.step_iterations,
) -> Reached | None:
    """The state of a balance at the frequency that is followed; None where it is not found.

    Parameters
    ----------
    case, balance, start
        As in `solve_at_lag`.
    state
        The state before.
    follow
        What the frequency follows.
    solver, budget, most
        As in `solve_balance`.
    """
    below, above, accuracy = 0.0, math.pi, _accepted_rise(case.settings.rtol)
    before: tuple[float, float] | None = None
    lag, half_width = state.lag, state.half_width
    for _ in range(WEAR.peak_solves):
        found = solve_at_lag(case, balance, start, lag, solver, case.settings.tolerance, budget, most)
        if found is None:
            return None
        rise, turn = 0.0, found.turn
        if follow.of == "peak" or (half_width == 0.0 and math.isnan(turn)):
            rise, turn = rise_of_response(case, found, solver)
        if follow.of == "peak" and not turn > 0.0:
            # where the lag falls with the frequency there is no resonance
            return None
        half_width = half_width if math.isnan(turn) else abs(1.0 / turn) if turn != 0.0 else math.inf
        rise = rise * half_width if follow.of == "peak" else 0.0
        below, above = (lag, above) if rise > 0.0 else (below, lag)
        if abs(rise) <= accuracy or above - below <= accuracy:
            point = PathPoint(0.0, found.at, final_history(found.balance, found.at))
            return Reached(point, found.omega, lag, half_width)
        # of a linear oscillator with one degree of freedom the rise falls by 1 per rad
        slope = -1.0 if before is None or before[0] == lag else (rise - before[1]) / (lag - before[0])
        step = float(np.clip(-rise / min(slope, -WEAR.least_peak_slope), -WEAR.largest_lag_step, WEAR.largest_lag_step))
        before = lag, rise
        lag = lag + step if below < lag + step < above else 0.5 * (below + above)
        balance, start = found.balance, found.at.predicted_h
    return None


def frequency_error(follow: FollowedFrequency | None, state: WearState, response_error: float, rtol: float) -> float:
    """Error of the frequency of a state, Hz, by the relative error of its response; 0 for a given frequency.

    The phase of the vibration is wrong by as much as the amplitude, and so is the phase lag. The amplitude is flat at
    its maximum: every amplitude that is less than the largest one by its error may be the largest one.
    """
    if follow is None:
        return 0.0
    lag = response_error
    if follow.of == "peak":
        lag = math.sqrt(2.0 * response_error) + _accepted_rise(rtol)
    return state.half_width * lag / (2.0 * math.pi)


def _accepted_rise(rtol: float) -> float:
    """Rise of the logarithm of an amplitude with the phase lag, 1/rad, at which the amplitude counts as the largest."""
    return min(WEAR.peak_rise * rtol, WEAR.largest_peak_rise)


def lost_resonance(follow: FollowedFrequency, state: WearState) -> Failure:
    """The end of a history beyond whose last state nothing is left to follow."""
    at = f"at cycle {state.cycle:.6g} and {state.omega / (2.0 * math.pi):.6g} Hz"
    return Failure(Outcome.RESONANCE_LOST, f"the {follow.of} ends {at}: no state beyond is found to go on with")


def out_of_range(follow: FollowedFrequency | None, state: WearState) -> Failure | None:
    """The end of a history whose frequency leaves its range; None within."""
    frequency = state.omega / (2.0 * math.pi)
    if follow is None or follow.low <= frequency <= follow.high:
        return None
    said = f"at cycle {state.cycle:.6g} the {follow.of} is at {frequency:.6g} Hz"
    return Failure(Outcome.RESONANCE_LOST, f"{said}, out of the range from {follow.low:g} to {follow.high:g} Hz")

"""An excitation whose frequency follows the structure while the joint wears.

Each state of a history has its own frequency, an unknown with one more equation: a given phase lag of the vibration
(`solver.continuation.phase_lag`), or that of the largest amplitude (`solver.continuation.largest_response`). The lag of
the largest amplitude changes little from step to step, so that most steps take one or two solves.
"""

from __future__ import annotations

import math

from solver.continuation.largest_response import accepted_rise, rise_of_response, solve_at_peak
from solver.continuation.options import CONTINUATION
from solver.continuation.phase_lag import solve_at_lag
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import Failure, State, final_history
from solver.model import FloatArray
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import FollowedFrequency
from solver.structure.joint import Case
from solver.wear.state import Reached, WearState


def end_at_resonance(
    case: Case,
    balance: Balance,
    start: FloatArray,
    state: WearState,
    follow: FollowedFrequency,
    run: Run,
    most: int = CONTINUATION.near_iterations,
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
    run, most
        As in `Run.solve`.
    """
    lag = state.lag
    if follow.of == "peak":
        peak = solve_at_peak(case, balance, start, lag, run, most)
        found, lag = (None, lag) if peak is None else peak
    else:
        found = solve_at_lag(case, balance, start, lag, run, most)
    if found is None:
        return None
    turn = math.nan if found.reduced is None else abs(float(found.reduced[0, 0]))
    if math.isnan(turn) and state.half_width == 0.0:
        turn = abs(rise_of_response(found, run, accepted_rise(case.settings.rtol))[1])
    half_width = state.half_width if math.isnan(turn) else 1.0 / max(turn, 1e-300)
    point = State(found.at, final_history(found.balance, found.at))
    return Reached(point, float(found.values[0]), lag, half_width)


def frequency_error(follow: FollowedFrequency | None, state: WearState, response_error: float, rtol: float) -> float:
    """Error of the frequency of a state, Hz, by the relative error of its response; 0 for a given frequency.

    The phase of the vibration is wrong by as much as the amplitude, and so is the phase lag. The amplitude is flat at
    its maximum: every amplitude that is less than the largest one by its error may be the largest one.
    """
    if follow is None:
        return 0.0
    lag = response_error
    if follow.of == "peak":
        lag = math.sqrt(2.0 * response_error) + accepted_rise(rtol)
    return state.half_width * lag / (2.0 * math.pi)


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

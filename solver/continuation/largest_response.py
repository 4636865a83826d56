"""The largest amplitude of the first response over the frequency, at a phase lag of its own.

In phase resonance the lag is pi/2 (`phase_lag`). At the largest amplitude of the first response, in its first harmonic,
the rise of the amplitude with the lag is zero; a secant finds this lag. For a linear oscillator of one degree of
freedom with the damping ratio zeta the frequency is then omega_0 sqrt(1 - 2 zeta^2), in phase resonance omega_0.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np

from solver.continuation.options import CONTINUATION
from solver.continuation.phase_lag import LaggingState, excitation_product, frequency_derivative, solve_at_lag
from solver.harmonic_balance.dlft import Balance
from solver.model import FloatArray
from solver.newton.linear_solver import JacobianSolver
from solver.newton.options import NEWTON
from solver.newton.solve_balance import Budget
from solver.options import COMMON
from solver.structure.fourier import to_complex
from solver.structure.joint import Case


def solve_at_peak(
    case: Case,
    balance: Balance,
    start: FloatArray,
    lag: float,
    solver: JacobianSolver,
    budget: Budget,
    most: int | None = None,
) -> tuple[LaggingState, float] | None:
    """The state of the largest amplitude near a phase lag, rad, and its lag; None where it is not found.

    Arguments as in `solve_at_lag`. Along the frequency the wear depth is constant, also where the depth grows with the
    motion in a step.
    """
    below, above, accuracy = 0.0, math.pi, accepted_rise(case.settings.rtol)
    before: tuple[float, float] | None = None
    for _ in range(CONTINUATION.attempts):
        found = solve_at_lag(case, balance, start, lag, solver, case.settings.tolerance, budget, most)
        if found is None:
            return None
        rise, turn = rise_of_response(case, found, solver)
        # where the lag falls with the frequency there is no resonance
        if not (turn > 0.0 and math.isfinite(rise)):
            return None
        rise /= turn
        below, above = (lag, above) if rise > 0.0 else (below, lag)
        if abs(rise) <= accuracy or above - below <= accuracy:
            return replace(found, turn=turn), lag
        # of a linear oscillator with one degree of freedom the rise falls by 1 per rad
        slope = -1.0 if before is None or before[0] == lag else (rise - before[1]) / (lag - before[0])
        largest = CONTINUATION.largest_lag_step
        step = float(np.clip(-rise / min(slope, -COMMON.negligible), -largest, largest))
        before = lag, rise
        lag = lag + step if below < lag + step < above else 0.5 * (below + above)
        balance, start = found.balance, found.at.predicted_h
    return None


def accepted_rise(rtol: float) -> float:
    """Rise of the logarithm of an amplitude with the phase lag, 1/rad, at which the amplitude counts as the largest."""
    return CONTINUATION.peak_rise * rtol


def rise_of_response(case: Case, state: LaggingState, solver: JacobianSolver) -> tuple[float, float]:
    """Changes along the frequency at fixed wear depth and tangential history, both s/rad.

    Returns
    -------
    rise : float
        Of the logarithm of the amplitude of the first response, in the first harmonic.
    turn : float
        Of the lag.
    """
    held = Balance.frozen(state.balance.joint, state.at.history, state.at.wear_depth)
    state = replace(state, balance=held)
    by_frequency, tangent, joint = frequency_derivative(case, state), held.linearise(state.at), held.joint
    # the rise is a small difference: two more digits than a Newton direction
    step = solver.solve(tangent, -by_frequency.residual, NEWTON.forcing**2)
    moved = state.at.displacement_h + by_frequency.length * tangent.transmit(step)[0]
    if joint.penalty.inertial.any():
        ahead = replace(held, joint=by_frequency.ahead).evaluate(state.at.predicted_h)
        moved = moved + ahead.displacement_h - state.at.displacement_h
    values = [
        (to_complex(at.structure.response_h(at.to_relative(motion)))[0, 0], excitation_product(at, motion))
        for at, motion in ((joint, state.at.displacement_h), (by_frequency.ahead, moved))
    ]
    (response, product), (response_ahead, product_ahead) = values
    rise = math.log(abs(response_ahead) / abs(response)) / by_frequency.length
    return rise, -cmath.phase(product_ahead / product) / by_frequency.length

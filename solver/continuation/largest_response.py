"""The largest amplitude of the first response over the frequency, at a phase lag of its own.

In phase resonance the lag is pi/2 (`phase_lag`). At the largest amplitude of the first response, in its first harmonic,
the rise of the amplitude with the lag is zero; a secant finds this lag. For a linear oscillator of one degree of
freedom with the damping ratio zeta the frequency is then omega_0 sqrt(1 - 2 zeta^2), in phase resonance omega_0.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from solver.continuation.natural import ATTEMPTS
from solver.continuation.phase_lag import (
    excitation_product,
    first_response,
    frequency_derivative,
    product_change,
    solve_at_lag,
)
from solver.harmonic_balance.dlft import Balance
from solver.model import FloatArray
from solver.newton.linear_solver import FORCING
from solver.newton.run import Bordered, Run
from solver.settings import NEGLIGIBLE
from solver.structure.fourier import to_complex
from solver.structure.joint import Case

PEAK_RISE = 2.0
"""Largest rise of the logarithm of the response with the phase lag, 1/rad, over rtol, at which an amplitude counts as
the largest one: its frequency is then within 2 rtol of half the width of the resonance. The states of single samples
change with the frequency, so that the rise is rough: by 0.005 for the dovetail with rtol 0.01."""

LARGEST_LAG_STEP = 0.2
"""Largest change of the phase lag between two solves, rad."""


def solve_at_peak(
    case: Case, balance: Balance, start: FloatArray, lag: float, run: Run, most: int | None = None
) -> tuple[Bordered, float] | None:
    """The state of the largest amplitude near a phase lag, rad, and its lag; None where it is not found.

    Arguments as in `solve_at_lag`. Along the frequency the wear depth is constant, also in an implicit step.
    """
    below, above, accuracy = 0.0, math.pi, accepted_rise(case.settings.rtol)
    before: tuple[float, float] | None = None
    for _ in range(ATTEMPTS):
        found = solve_at_lag(case, balance, start, lag, run, most)
        if found is None:
            return None
        rise, turn = rise_of_response(found, run, accuracy)
        # where the lag falls with the frequency there is no resonance
        if not (turn > 0.0 and math.isfinite(rise)):
            return None
        rise /= turn
        below, above = (lag, above) if rise > 0.0 else (below, lag)
        if abs(rise) <= accuracy or above - below <= accuracy:
            return replace(found, reduced=np.array([[turn]])), lag
        # of a linear oscillator with one degree of freedom the rise falls by 1 per rad
        slope = -1.0 if before is None or before[0] == lag else (rise - before[1]) / (lag - before[0])
        step = float(np.clip(-rise / min(slope, -NEGLIGIBLE), -LARGEST_LAG_STEP, LARGEST_LAG_STEP))
        before = lag, rise
        lag = lag + step if below < lag + step < above else 0.5 * (below + above)
        balance, start = found.balance, found.at.predicted_h
    return None


def accepted_rise(rtol: float) -> float:
    """Rise of the logarithm of an amplitude with the phase lag, 1/rad, at which the amplitude counts as the largest."""
    return PEAK_RISE * rtol


def rise_of_response(state: Bordered, run: Run, accuracy: float) -> tuple[float, float]:
    """Changes along the frequency at fixed wear depth and tangential history, both s/rad: of the logarithm of the
    amplitude of the first response, in the first harmonic, and of the lag.

    accuracy: first change over the second one that does not count.
    """
    joint, at = state.balance.joint, state.at
    held = Balance(joint, at.history, at.wear_depth)
    by_frequency = frequency_derivative(held, at)
    step = run.step(held, at, -by_frequency.residual, min(FORCING, 0.1 * accuracy))
    moved = held.linearise(at).transmit(step)[0]
    response = to_complex(joint.structure.response_h(joint.to_relative(at.displacement_h)))[0, 0]
    rise = (by_frequency.response + first_response(joint, moved)) / response
    product = by_frequency.product + product_change(joint, moved)
    return rise.real, -(product / excitation_product(joint, at.displacement_h)).imag

"""The state of a wearing joint, from which a history goes on."""

from __future__ import annotations

import math
from dataclasses import dataclass

from solver.accuracy.error_estimate import NOTHING, Estimate
from solver.harmonic_balance.state import State
from solver.model import FloatArray
from solver.packing import packable
from solver.settings import Resolution
from solver.structure.joint import Hold

# Fraction of `WearState.most_rate`: a joint that wears less sticks, and its rate is round-off.
_NO_WEAR = 1e-12


@packable
@dataclass(frozen=True)
class Choice:
    """The last choice of harmonics and samples, and the state for which they were chosen.

    left_out: fraction of the contact force of this state in harmonics that are left out (`harmonic_levels.left_out`).
    estimate: errors of response and wear rate with these harmonics and samples.
    accurate: whether these errors are below rtol; always true for given harmonics and samples.
    """

    left_out: float
    estimate: Estimate
    accurate: bool


@packable
@dataclass(frozen=True)
class LastStep:
    """The last step, for BDF2 and for the extrapolation to the next state.

    length: cycles.
    depth (n_contact,), m, predicted_h (n_rel, 2H+1), N, omega, rad/s, resolution: at its start.
    """

    length: float
    depth: FloatArray
    predicted_h: FloatArray
    omega: float
    resolution: Resolution


@packable
@dataclass(frozen=True)
class WearState:
    """A wearing joint at one cycle count; the next step depends on this state only.

    cycle: cycle count.
    omega: angular frequency of the excitation, rad/s.
    point: periodic state, its worn depth and the tangential history for the next state.
    resolution: harmonics and samples of the periodic state.
    choice: last choice of the resolution.
    rates, largest_rates (n_contact + 1,): wear rates of the pairs and, as the last entry, of all together, and their
        largest values so far, m3 per cycle; NaN and zero before the first state.
    most_rate: wear rate if every pair slipped as far as it moves, m3 per cycle; rates far below are round-off.
    step_limit: largest stable explicit step at the first state that wears, cycles; NaN as long as nothing wears.
    previous: the last step; None at the first state and after a jump.
    length, first_length: largest length of the next step, and length of the first adaptive step, cycles.
    judged_h (n_rel, 2H+1): predicted force at the last stability check, N; None before.
    lag: phase lag of the vibration where the frequency is followed, rad (`solver.continuation.phase_lag`).
    half_width: change of a followed frequency over the change of the phase lag, rad/s; 0 for a given frequency.
    hold: soft hold of the mean position of a joint that slides as a whole; None for none.
    held_from: count from which on the joint is held, NaN if never.
    jump_cycle: count of the first jump to another branch, NaN if none.
    inaccurate_from: count from which on harmonics and samples no longer bring the errors below rtol, inf if never.
    worst: largest errors from `inaccurate_from` on.
    """

    cycle: float
    omega: float
    point: State
    resolution: Resolution
    choice: Choice
    rates: FloatArray
    largest_rates: FloatArray
    most_rate: float = 0.0
    step_limit: float = math.nan
    previous: LastStep | None = None
    length: float = 0.0
    first_length: float = 0.0
    judged_h: FloatArray | None = None
    lag: float = 0.5 * math.pi
    half_width: float = 0.0
    hold: Hold | None = None
    held_from: float = math.nan
    jump_cycle: float = math.nan
    inaccurate_from: float = math.inf
    worst: Estimate = NOTHING

    @property
    def depth(self) -> FloatArray:
        """Worn depth (n_contact,), m."""
        return self.point.evaluation.wear_depth

    @property
    def wears(self) -> bool:
        """Whether the wear rate is above the round-off of the slip by the static load."""
        return bool(self.rates[-1] > _NO_WEAR * self.most_rate)

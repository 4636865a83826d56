"""The state of a joint that wears: data that a step takes and gives, and from which a history goes on."""

from __future__ import annotations

from dataclasses import dataclass, replace

from solver.accuracy.error_estimate import NOTHING, Estimate
from solver.harmonic_balance.converged import PathPoint
from solver.model import FloatArray
from solver.outcome import Outcome
from solver.packing import packable
from solver.settings import Resolution
from solver.structure.joint import Hold
from solver.wear.rates import WearRates


@packable
@dataclass(frozen=True)
class Choice:
    """The state for which harmonics and samples were chosen last.

    left_out: part of its contact force that lies in harmonics which are left out (`period_events.left_out`).
    estimate: errors of response and wear rate with these harmonics and samples.
    accurate: whether these errors are below rtol; always true where harmonics and samples are given.
    """

    left_out: float
    estimate: Estimate
    accurate: bool


@packable
@dataclass(frozen=True)
class WearState:
    """A wearing joint at one cycle count.

    Everything that the next step depends on is here. A factorisation that is kept from one solve to the next only
    makes the solve faster.

    cycle: count.
    point: periodic state, its worn depth (`point.evaluation.wear_depth`) and the tangential history for the next one.
    resolution: harmonics and samples of the periodic state.
    choice: for which state these were chosen.
    rates: wear rates so far.
    most_rate: m3 per cycle, the rate if every pair slipped as far as it moves; rates far below are round-off.
    step_limit: cycles, largest stable explicit step at the first state that wears; NaN as long as nothing wears.
    change: length, cycles, of the last step and change (n_rel, 2H+1), N, of the predicted force in this step. The next
        state is extrapolated from them; None behind a jump and with other harmonics.
    previous: length, cycles, of the last step and depth (n_contact,), m, at its start, for BDF2; None behind a jump.
    length: cycles, of the next step; the control of the steps plans this length.
    first_length: cycles, of the first step.
    judged_h (n_rel, 2H+1): predicted force, N, of the state whose stability was judged last; None before.
    hold: soft hold of the mean position of a joint that slides all over; None for none.
    held_from: count from which on the joint is held, NaN if never.
    jump_cycle: count of the first jump to another branch, NaN if none.
    inaccurate_from: count from which on harmonics and samples no longer bring the errors below rtol, inf if never.
    worst: the largest errors from there on.
    """

    cycle: float
    point: PathPoint
    resolution: Resolution
    choice: Choice
    rates: WearRates
    most_rate: float = 0.0
    step_limit: float = float("nan")
    change: tuple[float, FloatArray] | None = None
    previous: tuple[float, FloatArray] | None = None
    length: float = 0.0
    first_length: float = 0.0
    judged_h: FloatArray | None = None
    hold: Hold | None = None
    held_from: float = float("nan")
    jump_cycle: float = float("nan")
    inaccurate_from: float = float("inf")
    worst: Estimate = NOTHING

    @property
    def depth(self) -> FloatArray:
        """Worn depth (n_contact,), m."""
        return self.point.evaluation.wear_depth

    def planned(self, length: float) -> WearState:
        """With another length of the next step, cycles."""
        return replace(self, length=length)


@packable
@dataclass(frozen=True)
class Failure:
    """Why a history does not go on; message: what the outcome does not say by itself."""

    outcome: Outcome
    message: str = ""

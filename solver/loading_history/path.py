"""What a sweep goes along (`Path`), the unworn joint along its frequency or its excitation (`LoadingPath`), and where a
sweep along the frequency begins.

It begins well away from the point: for "up" between 0.49 and 0.7 times its frequency, for "down" between 1.3 and 1.85
times. All points of a cell, a quarter octave, have one first frequency, whatever the other points of a study are: the
one at which the vibration loads the stuck joint least, so that no sweep begins at a resonance.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar, Generic, Self, TypeVar

import numpy as np

from solver.accuracy.refinement import VIBRATION_RECHECK, refine, with_level_above
from solver.accuracy.resolved_state import Estimate, ResolvedState, left_out, nothing_happens
from solver.contact.coulomb import SEPARATED, SLIP, friction_limit
from solver.continuation.natural import FINE_STEP, NEAR_ITERATIONS, SMOOTH_CHANGE, follow_naturally
from solver.continuation.phase_lag import frequency_derivative
from solver.continuation.transient import relax_to_periodic
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.harmonic_balance.state import Failure, State, balance_after, transfer, vibration_change, vibration_size
from solver.model import FloatArray, ReducedModel
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import SHARE_OF_CAUSE, SMALL, Direction, Resolution, SolverSettings, first_resolution
from solver.structure.condensation import build_structure
from solver.structure.joint import Case, Joint

STEP_LIMITS = (2e-5, 0.1)
"""Limits of the length of a step along frequency or load, as a fraction of the parameter. An undamped slider passes its
resonance in the shortest steps. Half and twice: masses, ring and blocks are equal, slider and damper within 2e-3."""

CHANGE_LIMITS = (0.025, SMOOTH_CHANGE)
"""Limits of the largest relative change of the vibration in a step: in proportion to rtol, and the upper one at the
default of rtol. Dovetail of 48 pairs, 211 to 212.5 Hz: errors of the motion up to 0.8 % with 0.2, up to 0.1 %
with 0.05. Dovetail of 16 pairs, `rtol` 1e-3: wear rates at the start 0.06 and 0.02 % off by the sweep with 0.05 (loads
16 and 18 of `error_bars`), 0.001 % with 0.025."""

SMALL_VIBRATION = 0.3
"""Fraction of the friction limits to which changes of a smaller vibration are relative. With 1 the error of the motion
of the dovetail at 211 Hz is three times as large, with 0 there are a few nodes more. Half and twice: slider, masses,
blocks and ring are equal, the damper is within 8e-4."""

BEGIN_AWAY = 0.3
"""Least distance from the start of a sweep to the point over its frequency. With 0.22 and 0.38 the dovetail has the
same state within 2e-3, as have slider and damper; a bouncing block comes to another vibration with 0.22."""

CELLS_PER_OCTAVE = 4
"""Cells in an octave. The first frequency of the dovetail is 105 Hz, half the resonance. With 2 and 8 slider, masses,
ring and damper are within their errors, with 8 a bouncing block comes to another vibration."""

START_CANDIDATES = 8
"""Candidates for the first frequency of a cell, of which the one with the least load on the stuck joint is chosen. With
4 and 16 slider, masses, blocks and ring are equal, the damper is within 8e-4."""

S = TypeVar("S", bound=State)


@dataclass(frozen=True)
class Step(Generic[S]):
    """End of a step: its state, and the parameter at each of the folds that the step has jumped over."""

    state: S
    folds: tuple[float, ...] = ()


@dataclass(frozen=True)
class Path(ABC, Generic[S]):
    """The joint along a parameter, with the harmonics and samples of its case. shortest, longest: limits of a step."""

    case: Case
    shortest: ClassVar[float]
    longest: ClassVar[float]

    def joint_of(self, state: S) -> Joint:
        """The joint, with the harmonics and samples of the path, at the frequency and load of a state."""
        return self.case.joint(state.omega, state.excitation_amplitude)

    @abstractmethod
    def ahead(self, parameter: float, length: float) -> float:
        """The parameter a step farther, or back where the length is below 0."""

    @abstractmethod
    def solve(self, states: tuple[S, ...], target: float, run: Run) -> S | None:
        """Stable state at a target near the last of some states, which leaves its history to it; None if not found."""

    def rescue(self, _: S, __: float, ___: Run) -> Step[S] | Failure:
        """State at a target that `solve` does not find, or why there is none: by default no path that turns back."""
        return Failure(Outcome.BRANCH_LOST, "Newton's method finds no state in the shortest step")

    @abstractmethod
    def change(self, before: S, after: S) -> float:
        """Change over a step, over the largest one allowed."""

    @abstractmethod
    def differs(self, before: S, after: S) -> float:
        """Relative change of the vibration between two states."""

    def largest_change(self) -> float:
        """Largest relative change of the vibration in a step, over which pairs leave their history to the next."""
        return float(np.clip(CHANGE_LIMITS[1] * self.case.settings.rtol / SolverSettings.rtol, *CHANGE_LIMITS))

    def rests(self, _: S) -> bool:
        """Whether no pair slips or opens within the period, so that no history is left behind."""
        return False

    def forgets(self, _: S) -> bool:
        """Whether each pair slips or opens within the period, so that the state follows from its parameter alone."""
        return False

    def suits(self, checked: S, _: float, state: S) -> bool:
        """Whether the harmonics chosen for an earlier state, with an estimated error, are about those of a state."""
        return self.differs(checked, state) <= VIBRATION_RECHECK

    def at(self, resolution: Resolution) -> Self:
        """The path with other harmonics and samples."""
        return self if resolution == self.case.resolution else replace(self, case=self.case.at(resolution))

    @abstractmethod
    def near(self, state: S, predicted_h: FloatArray, history: FloatArray, run: Run) -> S | None:
        """As `solve`, at the parameter of a state, from a first predicted force (n_rel, m), N, with a history, m."""

    def moved(self, state: S, run: Run) -> S | None:
        """A state of other harmonics and samples with those of the path; None where not found."""
        balance, start = transfer(self.case, state, self.joint_of(state))
        return self.near(state, start, balance.history, run.fresh())

    @abstractmethod
    def choose(self, state: S, run: Run) -> tuple[S, Estimate]:
        """The state with the harmonics that it needs, and its estimated error."""

    @abstractmethod
    def describe(self, state: S) -> str:
        """Where the path is, in words."""


@dataclass(frozen=True)
class LoadingPath(Path[State]):
    """The unworn joint along its frequency, rad/s, or along the load factor on its excitation.

    excitation_amplitude: N. omega: of a path along the load, rad/s; None along the frequency.
    """

    excitation_amplitude: float
    omega: float | None = None
    shortest, longest = STEP_LIMITS

    def joint_at(self, parameter: float) -> Joint:
        """Joint at a value of the parameter."""
        if self.omega is None:
            return self.case.joint(parameter, self.excitation_amplitude)
        return self.case.joint(self.omega, parameter * self.excitation_amplitude)

    def balance_from(self, parameter: float, state: State) -> Balance:
        """Unworn balance at a value of the parameter, after a state."""
        return balance_after(self.joint_at(parameter), state)

    def slope(self, balance: Balance, at: Evaluation) -> FloatArray:
        """Derivative (n_rel, m) of the residual by the parameter at a fixed predicted force, N s/rad or N."""
        if self.omega is None:
            return frequency_derivative(balance, at).force
        slope = -self.case.joint(self.omega, self.excitation_amplitude).structure.force_h
        slope[:, 0] = 0.0
        return slope

    def ahead(self, parameter: float, length: float) -> float:  # noqa: D102
        if self.omega is None:
            return parameter + length * parameter
        # a ramp ends at its whole load
        return min(parameter + length, 1.0) if length > 0.0 else max(parameter + length, 1.0)

    def solve(self, states: tuple[State, ...], target: float, run: Run) -> State | None:
        """As in Path, by Newton's method alone, from the polynomial through the states."""
        start, at = states[-1], np.array([state.parameter for state in states])
        begin = np.zeros_like(start.evaluation.predicted_h)
        for place, state in enumerate(states):
            others = np.delete(at, place)
            begin += np.prod((target - others) / (at[place] - others)) * state.evaluation.predicted_h
        return self._stable(self.balance_from(target, start), begin, target, run)

    def near(self, state: State, predicted_h: FloatArray, history: FloatArray, run: Run) -> State | None:  # noqa: D102
        return self._stable(Balance(self.joint_of(state), history), predicted_h, state.parameter, run)

    def _stable(self, balance: Balance, predicted_h: FloatArray, parameter: float, run: Run) -> State | None:
        """Stable state of a balance near a predicted force (n_rel, m), N; None where not found."""
        found = run.state(balance, predicted_h, parameter, NEAR_ITERATIONS)
        return found if found is not None and run.is_stable(balance.joint, found.evaluation) else None

    def rescue(self, start: State, target: float, run: Run) -> Step[State] | Failure:
        """As in Path: natural steps to the end of the branch, then settling in time beyond it, in turns."""
        state, fine, folds = start, FINE_STEP * (target if self.omega is None else 1.0), list[float]()
        while not run.budget.exhausted:
            end, arrived = follow_naturally(self.balance_from, state, target, run, fine=fine)
            if arrived and run.is_stable(self.joint_of(end), end.evaluation):
                return Step(end, tuple(folds))
            # natural steps may have passed the start of an unstable part: then the search begins before them
            end = state if arrived else end
            beyond = end.parameter + float(np.clip(target - end.parameter, -fine, fine))
            settled = relax_to_periodic(self.joint_at(beyond), end.evaluation.slow, end, self.joint_of(end), run)
            if isinstance(settled, Failure):
                return settled
            # a fold with a smaller change is a corner of the branch
            if vibration_change(end.evaluation, settled.evaluation) > SMOOTH_CHANGE:
                folds.append(end.parameter)
            state = replace(settled, parameter=beyond)
            if beyond == target:
                return Step(state, tuple(folds))
        at = self.describe(state)
        return Failure(Outcome.BRANCH_LOST, f"the search ends {at}, after {run.budget.iterations} iterations")

    def change(self, before: State, after: State) -> float:  # noqa: D102
        one, other = before.evaluation, after.evaluation
        if self.rests(before) and self.rests(after):
            # over a linear resonance it changes by twice its size
            return vibration_change(one, other)
        limit = np.linalg.norm(friction_limit(self.case.model.contact.friction, one.force_h[:, 0, 0]))
        size = max(vibration_size(one), SMALL_VIBRATION * float(limit))
        moved = float(np.linalg.norm((other.predicted_h - one.predicted_h)[:, 1:]))
        # no history is handed on that a short step would make more accurate
        forget = self.forgets(before) and self.forgets(after)
        return moved / (size * (CHANGE_LIMITS[1] if forget else self.largest_change()))

    def differs(self, before: State, after: State) -> float:  # noqa: D102
        one, other = before.evaluation, after.evaluation
        return max(vibration_change(one, other), vibration_change(other, one))

    def rests(self, state: State) -> bool:  # noqa: D102
        return nothing_happens(state.evaluation)

    def forgets(self, state: State) -> bool:  # noqa: D102
        at = state.evaluation
        opens = (at.status_t == SEPARATED).any(axis=1)
        slip = np.ptp(at.state_t, axis=2).max(axis=1) / state.joint(self.case).law.state_stiffness
        moved = np.abs(at.displacement_h[:, 1:, 1:]).sum(axis=(1, 2))
        return bool((opens | (slip > SMALL * moved)).all())

    def suits(self, checked: State, error: float, state: State) -> bool:
        """As in Path: the error grows and falls with the part of the contact force in harmonics that are left out."""
        settings, resolution = self.case.settings, self.case.resolution
        fewest = resolution == first_resolution(settings)
        if super().suits(checked, error, state) or (fewest and self.rests(state)):
            return True
        # where all pairs slip and none opens, a node only serves to begin the next one: any harmonics suffice
        if self.forgets(state) and not (state.evaluation.status_t == SEPARATED).any():
            return True
        before, now = left_out(checked), left_out(state)
        if self.rests(state) or not (0.0 < error < np.inf and before > 0.0):
            return False
        foreseen = error * now / before
        enough = fewest or foreseen >= SHARE_OF_CAUSE**2 * settings.rtol
        # where the error is above rtol already, there are no more harmonics
        return enough and (foreseen <= settings.rtol or error > settings.rtol)

    def choose(self, state: State, run: Run) -> tuple[State, Estimate]:  # noqa: D102
        found = refine(ResolvedState(self.case, state), run, node=True)
        found = with_level_above(found, run, node=True)
        return found.point, found.estimate

    def describe(self, state: State) -> str:  # noqa: D102
        at = f"{state.parameter / (2.0 * np.pi):.6g} Hz" if self.omega is None else f"load factor {state.parameter:.3g}"
        status_t = state.evaluation.status_t
        moving = int(np.count_nonzero(((status_t == SLIP) | (status_t == SEPARATED)).any(axis=1)))
        return f"at {at}, {moving} of {len(state.evaluation.status_t)} pairs slip or open"


# --- where a sweep begins ---


def cell_of(frequency: float) -> int:
    """Number of the cell of a frequency, Hz."""
    return math.floor(CELLS_PER_OCTAVE * math.log2(frequency))


def edge_of(cell: int) -> float:
    """Lower end of a cell, Hz."""
    return float(2.0 ** (cell / CELLS_PER_OCTAVE))


def first_frequency(model: ReducedModel, cell: int, sweep: Direction) -> float:
    """Frequency, Hz, with which a sweep "up" or "down" to the points of a cell begins."""
    near, away = (1.0 - BEGIN_AWAY) * edge_of(cell), 1.0 / edge_of(1)
    if sweep == "down":
        near, away = (1.0 + BEGIN_AWAY) * edge_of(cell + 1), edge_of(1)
    frequencies = [float(at) for at in np.geomspace(near * away, near, START_CANDIDATES + 1)]
    structures = (build_structure(model, 2.0 * np.pi * at, 1.0, (1,)) for at in frequencies)
    loads = [float(np.linalg.norm(each.harmonic_force)) for each in structures]
    # of equally good frequencies the farthest: round-off must not decide
    least = min(loads) * (1.0 + 1e-6)
    return next(at for at, load in zip(frequencies, loads, strict=True) if load <= least)

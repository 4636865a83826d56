"""The sweep along the frequencies of a study: where it begins, nodes common to many points, the state at each point.

The joint keeps the history of the frequencies that a machine passes before a point. So a sweep begins well away from
the point: for "up" between 0.49 and 0.7 times its frequency, for "down" between 1.3 and 1.85 times. All points of a
cell, a quarter octave, have one first frequency: the one at which the vibration loads the stuck joint least, so that no
sweep begins at a resonance. It depends on the scene and on the cell, not on the other points of a study.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from solver.accuracy.certificate import certify
from solver.accuracy.refinement import Refined, refine
from solver.accuracy.resolved_state import NOTHING, ResolvedState
from solver.continuation.first_state import solve_first_state
from solver.harmonic_balance.state import Failure, State
from solver.loading_history.path import FREE_STEP, LoadingPath, Path, Step
from solver.loading_history.sweep import NODE_ITERATIONS, SWEEP_ITERATIONS, Sweep
from solver.model import FloatArray, ReducedModel
from solver.newton.run import Budget, Run
from solver.outcome import Outcome
from solver.packing import Packed, pack, unpack
from solver.results.history import StartState
from solver.results.state_report import periodic_state
from solver.settings import Direction, Resolution, SolverSettings, allowed
from solver.stability.floquet import find_instability
from solver.structure.condensation import build_structure
from solver.structure.joint import Case, build_case

FIRST_ITERATIONS = SWEEP_ITERATIONS // 8
"""Most Newton iterations to begin a sweep, or to find a state where the sweep is lost. Tens to hundreds suffice."""

OTHER_START = Resolution((1,), 64)
"""Harmonics and samples of a further attempt to find a first state: four of 54 random scenes need it."""

BEGIN_AWAY = 0.3
"""Least distance from the start of a sweep to the point over its frequency. With 0.22 and 0.38 the dovetail has the
same state within 2e-3."""

CELLS_PER_OCTAVE = 4
"""Cells in an octave. The first frequency of the dovetail is 105 Hz, half the resonance."""

START_CANDIDATES = 8
"""Candidates for the first frequency of a cell, of which the one with the least load on the stuck joint is chosen."""


@dataclass(eq=False)
class FrequencySweep:
    """The sweep over frequencies: one `Sweep` for all points of a cell, or one for each point (ramp).

    with_switching: for which states stability is tested, as in `find_instability`.
    known: frequencies, Hz, and resolutions. Where there are some, each state takes that of the nearest one; its error
        is not estimated, and there is no reference sweep.
    keep: called with the saved state, and with the position in words.
    present, cell, omega: the present sweep, its cell, and the frequency of a ramp, rad/s, else None.
    run: of the state at the current frequency, without the sweep to this frequency.
    """

    model: ReducedModel
    friction_coefficient: float | FloatArray | None
    excitation_amplitude: float
    direction: Direction
    settings: SolverSettings
    with_switching: bool = True
    known: tuple[tuple[float, Resolution], ...] = ()
    keep: Callable[[Packed | str], None] = lambda _: None
    present: Sweep[State] | None = None
    cell: int = 0
    omega: float | None = None
    run: Run = field(init=False)

    def __post_init__(self) -> None:
        self.run = Run(self.settings.tolerance, Budget(report=self.keep))

    @property
    def n_iterations(self) -> int:
        """Newton iterations to the current frequency: of the sweep from its start, and of the state."""
        return self.run.budget.iterations + (0 if self.present is None else self.present.budget.iterations)

    def set_deadline(self, deadline: float) -> None:
        """Set the CPU time of the thread, s, after which the search for the present state ends."""
        self.run.budget.deadline = deadline
        if self.present is not None:
            self.present.budget.deadline = deadline

    def save(self) -> None:
        """Give `keep` what another sweep needs to go on."""
        if self.present is not None and self.present.saved:
            self.keep(pack((self.cell, self.omega, self.present.saved)))

    def load(self, saved: Packed) -> None:
        """Go on from what another sweep has given to `keep`."""
        cell, omega, present = unpack(saved)
        self._new_sweep(cell, omega).load(present)

    def go_on_from(self, case: Case, state: State, frequency: float) -> bool:
        """Begin at a known state; False where the state is rejected.

        case: harmonics, samples and penalty of the state. state: its parameter is the frequency, rad/s, or for a ramp
        its amplitude over that of the sweep. frequency: to which the sweep goes, Hz.
        """
        omega = 2.0 * np.pi * frequency
        present = self._new_sweep(cell_of(frequency), omega if self.direction == "ramp" else None)
        present.sign = 1.0 if (omega if self.omega is None else 1.0) >= state.parameter else -1.0
        return present.begin(replace(present.path, case=case), state)

    def advance(self, frequency: float) -> StartState | Failure:
        """State at the next frequency, Hz, with the harmonics it needs, or why there is none. Raises LinAlgError."""
        # the state must not depend on those at other frequencies
        self.run = run = self.run.fresh()
        run.budget.iterations, run.budget.limit = 0, NODE_ITERATIONS
        present = self.sweep_to(frequency)
        target = 2.0 * np.pi * frequency if self.omega is None else 1.0
        present.advance_to(target)
        path, reached = present.path, present.state_at(target, run.fresh())
        if isinstance(reached, Failure):
            run.budget.limit = run.budget.iterations + FIRST_ITERATIONS
            first = self._first(path, target, run)
            if isinstance(first, Failure):
                return lost(present, first)
            path, reached = first[0], Step(first[1])
        refined = self._at_known(path, reached.state) if self.known else None
        refined = refined or refine(path.case, path.joint_of(reached.state), reached.state, run)
        return self._judged(refined, present, reached.folds)

    def without_state(self, failure: Failure) -> StartState:
        """No state at the current frequency, and why."""
        present = self.present
        return StartState(
            outcome=failure.outcome,
            state=None,
            penalty_omega=math.nan if present is None else present.path.case.penalty_omega,
            resolution=Resolution((1,), 4) if present is None else present.path.case.resolution,
            response_error=math.inf,
            wear_rate_error=math.inf,
            message=failure.message,
        )

    def sweep_to(self, frequency: float, *, beyond: bool = False) -> Sweep[State]:
        """The sweep that leads to a frequency, Hz, at its first node or farther on; without a state if none is found.

        beyond: whether the present sweep will do although it has passed the frequency.
        """
        omega, cell, present = 2.0 * np.pi * frequency, cell_of(frequency), self.present
        ramp = omega if self.direction == "ramp" else None
        if present is not None and (self.cell, self.omega) == (cell, ramp):
            passed = present.last is not None and (omega - present.last.parameter) * present.sign < 0.0
            if ramp or beyond or not passed:
                return present
        present = self._new_sweep(cell, ramp)
        present.budget.limit = FIRST_ITERATIONS
        place = 2.0 * np.pi * first_frequency(self.model, cell, self.direction) if ramp is None else FREE_STEP
        present.budget.report(f"first state at {(ramp or place) / (2.0 * np.pi):.6g} Hz")
        first = self._first(present.path, place, present.run)
        if isinstance(first, Failure):
            present.failure = first
        else:
            present.begin(*first)
        return present

    def _new_sweep(self, cell: int, omega: float | None) -> Sweep[State]:
        """A sweep before its first node. omega: of a ramp, rad/s, else None."""
        # the penalty belongs to the upper end of the cell
        case = build_case(self.model, self.friction_coefficient, 2.0 * np.pi * edge_of(cell + 1), self.settings)
        path, of = LoadingPath(case, self.excitation_amplitude, omega), self.run.budget
        budget, sign = Budget(deadline=of.deadline, report=of.report), -1.0 if self.direction == "down" else 1.0
        self.cell, self.omega = cell, omega
        self.present = Sweep(path, sign, budget, with_reference=not self.known, save=self.save)
        return self.present

    def _first(self, path: Path[State], place: float, run: Run) -> tuple[Path[State], State] | Failure:
        """A state from the static one at a value of the parameter, and its path, with the harmonics of a path, or else
        with one; or the reason of the first attempt.
        """
        others = [allowed(OTHER_START, self.settings)] if self.settings.automatic else []
        omega, load = (place, 1.0) if self.omega is None else (self.omega, place)
        unworn, why = np.zeros(self.model.contact.n_contact), list[Failure]()
        for resolution in (path.case.resolution, *others):
            at = path.at(resolution)
            found = solve_first_state(at.case, omega, load * self.excitation_amplitude, unworn, run.fresh())
            if isinstance(found, State):
                return at, replace(found, parameter=place)
            why.append(found)
            if found.outcome.static or run.budget.exhausted:
                break
        return why[0]

    def _at_known(self, path: Path[State], state: State) -> Refined | None:
        """The state with the known resolution; None where it is not found with it."""
        omega = path.joint_of(state).omega
        _, resolution = min(self.known, key=lambda each: abs(2.0 * np.pi * each[0] - omega))
        wanted = path.at(resolution)
        moved = state if wanted.case is path.case else path.move(state, wanted, self.run)
        return None if moved is None else Refined(wanted.case, wanted.joint_of(moved), moved, NOTHING, accurate=True)

    def _judged(self, found: Refined, present: Sweep[State], folds: tuple[float, ...]) -> StartState | Failure:
        """A refined state with its errors and the state of the reference sweep, or why it is no result.

        folds: that the sweep has jumped over between its last node and the state.
        """
        joint, at, estimate = found.joint, found.point.evaluation, found.estimate
        if not certify(joint, at).holds(self.settings.tolerance):
            return Failure(Outcome.CERTIFICATE_FAILED)
        if unstable := find_instability(found.case, joint, at, self.run, self.with_switching):
            return unstable
        reference = present.reference_of(replace(present.path, case=found.case), found.point, self.run)
        if reference is not None:
            estimate = estimate + found.difference(ResolvedState(found.case, joint, reference))
        # folds of a ramp are load factors
        fold = (present.fold, *folds)[-1] / (2.0 * np.pi) if self.omega is None else math.nan
        return StartState(
            outcome=Outcome.CONVERGED if found.accurate else Outcome.INACCURATE,
            state=periodic_state(joint, found.point),
            penalty_omega=found.case.penalty_omega,
            resolution=found.case.resolution,
            response_error=estimate.response,
            wear_rate_error=estimate.wear_rate,
            branch=present.branch + len(folds),
            fold_frequency=float(fold),
            reference=None if reference is None else periodic_state(joint, reference),
        )


def lost(present: Sweep[State], failure: Failure) -> Failure:
    """Why a sweep has no state, and where its states end. failure: of the last search."""
    if present.last is None:
        return failure
    reason = Outcome.BRANCH_LOST if failure.outcome is Outcome.START_FAILED else failure.outcome
    return Failure(reason, f"stable states end {present.path.describe(present.last)}")


def cell_of(frequency: float) -> int:
    """Number of the cell of a frequency, Hz."""
    return math.floor(CELLS_PER_OCTAVE * math.log2(frequency))


def edge_of(cell: int) -> float:
    """Lower end of a cell, Hz."""
    return float(2.0 ** (cell / CELLS_PER_OCTAVE))


def first_frequency(model: ReducedModel, cell: int, sweep: Direction) -> float:
    """Frequency, Hz, with which a sweep "up" or "down" to the points of a cell begins."""
    width = 2.0 ** (1.0 / CELLS_PER_OCTAVE)
    near, away = (1.0 - BEGIN_AWAY) * edge_of(cell), 1.0 / width
    if sweep == "down":
        near, away = (1.0 + BEGIN_AWAY) * edge_of(cell + 1), width
    frequencies = [float(at) for at in np.geomspace(near * away, near, START_CANDIDATES + 1)]
    structures = (build_structure(model, 2.0 * np.pi * at, 1.0, (1,)) for at in frequencies)
    loads = [float(np.linalg.norm(each.harmonic_force)) for each in structures]
    # of equally good frequencies the farthest: round-off must not decide
    least = min(loads) * (1.0 + 1e-6)
    return next(at for at, load in zip(frequencies, loads, strict=True) if load <= least)

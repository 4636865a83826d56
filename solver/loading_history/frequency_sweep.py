"""The sweep along the frequencies of a study: nodes common to many points, and the state at each point."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import replace
from typing import TypedDict

import numpy as np

from solver.accuracy.certificate import certify
from solver.accuracy.error_estimate import NOTHING, UNKNOWN
from solver.accuracy.refinement import Refined, refine, state_difference
from solver.continuation.first_state import solve_first_state
from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.converged import PathPoint
from solver.loading_history.options import LOADING
from solver.loading_history.path_step import Step
from solver.loading_history.sweep import NodeSweep, SweepState
from solver.loading_history.sweep_start import Origin, Sweep, find_origin
from solver.model import FloatArray, ReducedModel
from solver.newton.journal import Journal, Results
from solver.newton.linear_solver import JacobianSolver
from solver.newton.options import NEWTON
from solver.newton.solve_balance import Budget, move_point
from solver.outcome import Outcome
from solver.results.history import PeriodicState
from solver.results.state_report import periodic_state
from solver.settings import Resolution, SolverSettings, all_orders, allowed
from solver.stability.floquet import find_instability
from solver.structure.joint import Case, build_case

_REASONS = (Outcome.UNSTABLE, Outcome.ADRIFT, Outcome.UNSETTLED)
"""Outcomes that tell the reason for the end of a sweep, not only its end."""


class Found:
    """The state at a frequency with its errors, or the reason why there is none.

    branch: number of folds jumped over before this frequency.
    fold: frequency of the last of them, rad/s.
    """

    def __init__(self, outcome: Outcome, branch: int = 0, fold: float = float("nan")) -> None:
        self.outcome = outcome
        self.branch, self.fold = branch, fold
        self.state: PeriodicState | None = None
        self.reference: PeriodicState | None = None
        self.resolution: Resolution | None = None
        self.estimate = UNKNOWN
        self.message = ""


class FrequencySweepState(TypedDict):
    """State of a `FrequencySweep` with which another one goes on.

    origin, omega: of the current `NodeSweep`, as its arguments.
    nodes, results: its saved state, and its journal since then.
    frequency, own_results: the frequency to which the sweep is under way, Hz, and the journal of the state there.
    """

    origin: Origin
    omega: float | None
    nodes: SweepState | None
    results: Results
    frequency: float
    own_results: Results


class FrequencySweep:
    """The sweep over frequencies: one `NodeSweep` for all points with a common origin, or one for each point (ramp).

    budget: of the state at the current frequency, without the sweep to this frequency.
    save: called at each save point of the sweep and of the state.
    every: for which states stability is tested, as in `find_instability`.
    known: frequencies, Hz, and the resolutions that states need there. Each state then takes that of the nearest one;
        its error is not estimated, and no reference sweep runs beside. Empty: errors are estimated.
    """

    def __init__(
        self,
        model: ReducedModel,
        friction_coefficient: float | FloatArray | None,
        excitation_amplitude: float,
        sweep: Sweep,
        settings: SolverSettings,
    ) -> None:
        self.model = model
        self.friction_coefficient = friction_coefficient
        self.excitation_amplitude = excitation_amplitude
        self.sweep = sweep
        self.settings = settings
        self.every = True
        self.known: tuple[tuple[float, Resolution], ...] = ()
        self.save: Callable[[], None] = lambda: None
        self.journal = Journal(lambda: self.save())
        self.budget = Budget(journal=self.journal)
        self.frequency = float("nan")
        self.origin: Origin | None = None
        self.nodes: NodeSweep | None = None
        self._begun = False

    @property
    def penalty_omega(self) -> float:
        """Frequency at which the penalty is taken, rad/s."""
        return float("nan") if self.origin is None else 2.0 * np.pi * self.origin.penalty

    @property
    def resolution(self) -> Resolution:
        """Harmonics and samples of the nodes."""
        return Resolution((1,), 4) if self.nodes is None else self.nodes.case.resolution

    @property
    def n_iterations(self) -> int:
        """Newton iterations to the current frequency: of the sweep from its origin, and of the state."""
        return self.budget.iterations + (0 if self.nodes is None else self.nodes.budget.iterations)

    def set_deadline(self, deadline: float) -> None:
        """Set the CPU time of the thread, s, after which the search for the present state ends."""
        self.budget.deadline = deadline
        if self.nodes is not None:
            self.nodes.budget.deadline = deadline

    def state_dict(self) -> FrequencySweepState | None:
        """Values with which another sweep goes on, to be packed; None where nothing is saved yet."""
        if self.nodes is None or self.origin is None or not (self.nodes.saved or self.nodes.journal.saved):
            return None
        return {
            "origin": self.origin,
            "omega": self.nodes.path.omega,
            "nodes": self.nodes.saved,
            "results": self.nodes.journal.saved,
            "frequency": self.frequency,
            "own_results": self.journal.saved,
        }

    def load_state(self, state: FrequencySweepState) -> None:
        """Go on from the saved state of another sweep."""
        self.origin, self.frequency = state["origin"], state["frequency"]
        self.nodes = self._new_sweep(self.origin, state["omega"])
        self.nodes.load_state(state["nodes"], state["results"])
        self._begun = state["nodes"] is not None
        self.journal.begin(state["own_results"])

    def go_on_from(self, case: Case, point: PathPoint, frequency: float) -> bool:
        """Begin at a known state; False where the state is rejected.

        Parameters
        ----------
        case
            Harmonics, samples and penalty of the state.
        point
            The state. Its parameter is the frequency, rad/s, or for a ramp its amplitude over that of the sweep.
        frequency
            The frequency to which the sweep goes, Hz.
        """
        ramp, target = self.sweep == "ramp", 2.0 * np.pi * frequency
        origin = find_origin(self.model, frequency, self.sweep)
        self.origin, self._begun = replace(origin, penalty=case.penalty_omega / (2.0 * np.pi)), True
        direction = 1.0 if (1.0 if ramp else target) >= point.parameter else -1.0
        self.nodes = NodeSweep(case, self.excitation_amplitude, direction, target if ramp else None)
        self.nodes.budget.deadline, self.nodes.budget.tell = self.budget.deadline, self.budget.tell
        return self.nodes.begin(case, point)

    def abandon(self) -> None:
        """Forget the results of a search that an error has ended: what follows begins elsewhere."""
        if self.nodes is not None and (self.nodes.here is not None or self.nodes.saved is not None):
            self.nodes.save()
        elif self.nodes is not None:
            self.nodes.budget.journal = None
            self.nodes.journal.begin()
        self.journal.begin()

    def _sweep_to(self, origin: Origin, omega: float) -> NodeSweep:
        """The current sweep, or a new one where the current one does not lead to this frequency, rad/s."""
        nodes, ramp = self.nodes, self.sweep == "ramp"
        passed = nodes is not None and (nodes.path.omega != omega if ramp else nodes.has_passed(omega))
        if nodes is None or passed or self.origin is None or origin.cell != self.origin.cell:
            self.origin, self._begun = origin, False
            nodes = self.nodes = self._new_sweep(origin, omega if ramp else None)
        return nodes

    def _new_sweep(self, origin: Origin, omega: float | None) -> NodeSweep:
        case = build_case(self.model, self.friction_coefficient, 2.0 * np.pi * origin.penalty, self.settings)
        nodes = NodeSweep(case, self.excitation_amplitude, -1.0 if self.sweep == "down" else 1.0, omega)
        nodes.budget.deadline, nodes.budget.tell = self.budget.deadline, self.budget.tell
        nodes.journal.save = lambda: self.save()
        nodes.alone = bool(self.known)
        return nodes

    def advance(self, frequency: float) -> Found:
        """State at the next frequency, Hz, with the harmonics that it needs."""
        origin, omega = find_origin(self.model, frequency, self.sweep), 2.0 * np.pi * frequency
        ramp = self.sweep == "ramp"
        self.budget.iterations, self.budget.limit = 0, LOADING.node_iterations
        if frequency != self.frequency:
            self.frequency = frequency
            self.journal.begin()
        nodes, target = self._begun_sweep(origin, self._sweep_to(origin, omega)), 1.0 if ramp else omega
        self.advance_nodes(nodes, target)
        try:
            reached, reference = nodes.state_at(target, self.budget)
            case = nodes.case
            if reached is None:
                self.budget.limit = self.budget.iterations + LOADING.first_iterations
                case, point = self._first(omega, self.budget)
                reached = None if point is None else Step(point)
            if reached is None:
                lost = Found(self.why_lost(nodes))
                lost.message = self._where_lost(nodes)
                return lost
            refined = self._at_known(case, omega, reached.point)
            if refined is None:
                refined = refine(case, omega, self.excitation_amplitude, reached.point, self.budget)
            # with impacts a small joint has many other states
            small = nodes.case.joint(omega, 0.0).component_index.size <= NEWTON.small_joint_displacements
            if not refined.accurate and small:
                refined = self._restarted_from_static(omega) or refined
        except np.linalg.LinAlgError:
            return Found(Outcome.SINGULAR)
        # folds of a ramp are load factors
        fold = float("nan") if ramp else (nodes.state.fold, *reached.folds)[-1]
        found = Found(Outcome.CONVERGED, nodes.state.branch + len(reached.folds), fold)
        return self._judge(refined, omega, found, nodes.reference_path.case, reference)

    def _at_known(self, case: Case, omega: float, point: PathPoint) -> Refined | None:
        """The state with the known resolution; None where none is known, or where the state is not found with it."""
        if not self.known:
            return None
        _, resolution = min(self.known, key=lambda each: abs(each[0] - self.frequency))
        if resolution == case.resolution:
            return Refined(case, point, NOTHING, accurate=True)
        wanted = case.at(resolution)
        moved = move_point(case, wanted, wanted.joint(omega, self.excitation_amplitude), point, self.budget)
        return None if moved is None else Refined(wanted, moved, NOTHING, accurate=True)

    def sweep_in_cell(self, frequency: float) -> NodeSweep:
        """The sweep that passes all frequencies in the quarter octave of a frequency, Hz, at its present node."""
        origin = find_origin(self.model, frequency, self.sweep)
        if self.nodes is None or self.origin is None or origin.cell != self.origin.cell:
            return self._begun_sweep(origin, self._sweep_to(origin, 2.0 * np.pi * frequency))
        return self._begun_sweep(origin, self.nodes)

    def _begun_sweep(self, origin: Origin, nodes: NodeSweep) -> NodeSweep:
        """A sweep at its first node or beyond."""
        if not self._begun:
            self._begun = True
            self._begin(nodes, origin)
        return nodes

    def _judge(
        self, refined: Refined, omega: float, found: Found, reference_case: Case, reference: PathPoint | None
    ) -> Found:
        """The outcome of a refined state, with its error and the state of the reference sweep."""
        joint = refined.case.joint(omega, self.excitation_amplitude)
        found.state, found.resolution = periodic_state(joint, refined.point), refined.case.resolution
        found.estimate = refined.estimate
        if reference is not None:
            moved = move_point(reference_case, refined.case, joint, reference, self.budget)
            if moved is not None:
                found.reference = periodic_state(joint, moved)
                found.estimate = found.estimate + state_difference(refined.case, joint, refined.point, moved)
        if not certify(joint, refined.point.evaluation).holds(self.settings.tolerance):
            found.outcome, found.state, found.reference = Outcome.CERTIFICATE_FAILED, None, None
        elif unstable := find_instability(refined.case, joint, refined.point.evaluation, self.budget, self.every):
            found.outcome, found.state, found.reference = unstable.outcome, None, None
            found.message = unstable.sentence
        elif not refined.accurate:
            found.outcome = Outcome.INACCURATE
        return found

    def _begin(self, nodes: NodeSweep, origin: Origin) -> None:
        """Find the first state of the sweep; no success where there is none, or where the structure is singular."""
        nodes.budget.limit = nodes.budget.iterations + LOADING.first_iterations
        places = [2.0 * np.pi * start for start in origin.starts] or [LOADING.free_step]
        for place in places:
            if self._begin_at(nodes, place):
                return

    def _begin_at(self, nodes: NodeSweep, place: float) -> bool:
        omega, load_factor = (place, 1.0) if nodes.path.omega is None else (nodes.path.omega, place)
        nodes.budget.tell(f"first state at {omega / (2.0 * np.pi):.6g} Hz")
        before, point = nodes.budget.iterations, None
        with contextlib.suppress(np.linalg.LinAlgError):
            case, point = self._first(omega, nodes.budget, load_factor)
        if not np.isnan(nodes.state.lost_at):
            searched = nodes.state.searched + nodes.budget.iterations - before
            nodes.state = replace(nodes.state, searched=searched)
        return point is not None and nodes.begin(case, PathPoint(place, point.evaluation, point.history))

    def advance_nodes(self, nodes: NodeSweep, target: float) -> None:
        """Advance the sweep to the target; where the sweep is lost before, begin it again a little further on."""
        while True:
            try:
                nodes.advance_to(target)
            except np.linalg.LinAlgError:
                nodes.lose()
            if nodes.here is not None or nodes.path.omega is not None or np.isnan(nodes.state.lost_at):
                return
            behind = nodes.state.lost_at * (1.0 + CONTINUATION.arc_span * nodes.direction)
            if (behind - target) * nodes.direction >= 0.0:
                return
            # budget of all attempts: where every pair slips, all of them fail
            left = LOADING.first_iterations - nodes.state.searched
            if left < 0:
                return
            nodes.budget.limit = nodes.budget.iterations + left
            if not self._begin_at(nodes, behind):
                nodes.state = replace(nodes.state, lost_at=behind)

    def why_lost(self, nodes: NodeSweep) -> Outcome:
        """The reason why a sweep has no state."""
        never = np.isnan(nodes.state.lost_at)
        return nodes.state.failure if never or nodes.state.failure in _REASONS else Outcome.BRANCH_LOST

    def _where_lost(self, nodes: NodeSweep) -> str:
        """Sentence with the last parameter of a lost sweep; empty for a sweep that never began."""
        if np.isnan(nodes.state.lost_at):
            return ""
        if nodes.path.omega is not None:
            return f"the vibration repeats up to {100.0 * nodes.state.lost_at:.3g} % of the excitation"
        return f"the sweep goes on in stable states as far as {nodes.state.lost_at / (2.0 * np.pi):.6g} Hz"

    def _restarted_from_static(self, omega: float) -> Refined | None:
        """An accurate state from the static one with other harmonics than the branch; None if there is none."""
        for resolution in _other_starts()[1:]:
            case, point = self._first_at(omega, 1.0, resolution, self.budget)[1:]
            refined = None
            if point is not None:
                refined = refine(case, omega, self.excitation_amplitude, point, self.budget)
            if refined is not None and refined.accurate:
                return refined
        return None

    def _first(self, omega: float, budget: Budget, load_factor: float = 1.0) -> tuple[Case, PathPoint | None]:
        """A state from the static one with the harmonics of the sweep, or else with others."""
        assert self.nodes is not None
        others = _other_starts() if self.settings.automatic else ()
        why = Outcome.START_FAILED
        for attempt, resolution in enumerate((self.nodes.case.resolution, *others)):
            outcome, case, point = self._first_at(omega, load_factor, resolution, budget)
            if point is not None:
                return case, point
            # the reason comes from the first attempt
            why = outcome if attempt == 0 else why
            if outcome.static:
                why = outcome
            if outcome.static or budget.exhausted:
                break
        self.nodes.state = replace(self.nodes.state, failure=why)
        return self.nodes.case, None

    def _first_at(
        self, omega: float, load_factor: float, resolution: Resolution, budget: Budget
    ) -> tuple[Outcome, Case, PathPoint | None]:
        """A state from the static one with these harmonics and samples, as far as the settings allow them."""
        assert self.nodes is not None
        case = self.nodes.case.at(allowed(resolution, self.settings))
        unworn = np.zeros(self.model.contact.n_contact)
        outcome, found = solve_first_state(
            case, omega, load_factor * self.excitation_amplitude, unworn, JacobianSolver(), budget
        )
        return outcome, case, None if found is None else PathPoint(omega, found.evaluation, found.history)


def _other_starts() -> tuple[Resolution, ...]:
    """Harmonics and samples of further attempts to find a first state."""
    return tuple(Resolution(all_orders(highest), samples) for highest, samples in LOADING.other_starts)

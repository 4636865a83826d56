"""The sweep along the frequencies of a study: nodes common to many points, and the state at each point."""

from __future__ import annotations

from dataclasses import replace
from typing import TypedDict

import numpy as np

from solver.accuracy.certificate import certify
from solver.accuracy.error_estimate import UNKNOWN
from solver.accuracy.refinement import Refined, refine, state_difference
from solver.continuation.first_state import solve_first_state
from solver.harmonic_balance.converged import PathPoint
from solver.loading_history.options import LOADING
from solver.loading_history.path_step import Step
from solver.loading_history.sweep import NodeSweep, SweepState
from solver.loading_history.sweep_start import Origin, Sweep, find_origin
from solver.model import FloatArray, ReducedModel
from solver.newton.linear_solver import JacobianSolver
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
        self.coarse: PeriodicState | None = None
        self.resolution: Resolution | None = None
        self.estimate = UNKNOWN
        self.message = ""


class FrequencySweepState(TypedDict):
    """Saved attributes of a `FrequencySweep` and of its current `NodeSweep`, with which the sweep goes on."""

    origin: Origin
    omega: float | None
    own_iterations: int
    sweep_iterations: int
    nodes: SweepState


class FrequencySweep:
    """The sweep over frequencies: one `NodeSweep` for all points with a common origin, or one for each point (ramp)."""

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
        self.budget = Budget()
        self.origin: Origin | None = None
        self.nodes: NodeSweep | None = None
        self._counted = 0

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
        """Newton iterations so far."""
        return self.budget.iterations + (0 if self.nodes is None else self.nodes.budget.iterations)

    def set_deadline(self, deadline: float) -> None:
        """Set the CPU time of the thread, s, after which the search for the present state ends."""
        self.budget.deadline = deadline
        if self.nodes is not None:
            self.nodes.budget.deadline = deadline

    def state_dict(self) -> FrequencySweepState:
        """Values with which another sweep goes on, to be packed."""
        assert self.nodes is not None
        assert self.nodes.saved is not None
        assert self.origin is not None
        return {
            "origin": self.origin,
            "omega": self.nodes.path.omega,
            "own_iterations": self.budget.iterations,
            "sweep_iterations": max(self.nodes.budget.iterations, self._counted),
            "nodes": self.nodes.saved,
        }

    def load_state(self, state: FrequencySweepState) -> None:
        """Go on from the saved state of another sweep."""
        self.origin = state["origin"]
        self.budget.iterations = state["own_iterations"]
        self._counted = state["sweep_iterations"]
        self.nodes = self._new_sweep(self.origin, state["omega"])
        self.nodes.load_state(state["nodes"])

    def _new_sweep(self, origin: Origin, omega: float | None) -> NodeSweep:
        case = build_case(self.model, self.friction_coefficient, 2.0 * np.pi * origin.penalty, self.settings)
        nodes = NodeSweep(case, self.excitation_amplitude, -1.0 if self.sweep == "down" else 1.0, omega)
        nodes.budget.deadline, nodes.budget.tell = self.budget.deadline, self.budget.tell
        return nodes

    def advance(self, frequency: float) -> Found:
        """State at the next frequency, Hz, with the harmonics that it needs."""
        origin, omega = find_origin(self.model, frequency, self.sweep), 2.0 * np.pi * frequency
        other_cell = self.origin is None or origin.cell != self.origin.cell
        if self.nodes is None or self.sweep == "ramp" or other_cell or self.nodes.has_passed(omega):
            self.origin = origin
            # a loaded sweep stands at an earlier node with fewer iterations
            self.budget.iterations += max(0 if self.nodes is None else self.nodes.budget.iterations, self._counted)
            self._counted = 0
            self.nodes = self._new_sweep(origin, omega if self.sweep == "ramp" else None)
            self._begin(self.nodes, origin)
        nodes, target = self.nodes, 1.0 if self.sweep == "ramp" else omega
        self._advance_to(nodes, target)
        self.budget.limit = self.budget.iterations + LOADING.node_iterations
        try:
            reached, coarse = nodes.state_at(target, self.budget)
            case = nodes.case
            if reached is None:
                self.budget.limit = self.budget.iterations + LOADING.first_iterations
                case, point = self._first(omega)
                reached = None if point is None else Step(point)
            if reached is None:
                lost = Found(self._why_lost(nodes))
                lost.message = self._where_lost(nodes)
                return lost
            refined = refine(case, omega, self.excitation_amplitude, reached.point, self.budget)
        except np.linalg.LinAlgError:
            return Found(Outcome.SINGULAR)
        # folds of a ramp are load factors
        fold = float("nan") if self.sweep == "ramp" else (nodes.state.fold, *reached.folds)[-1]
        found = Found(Outcome.CONVERGED, nodes.state.branch + len(reached.folds), fold)
        return self._judge(refined, omega, found, nodes.reference_path.case, coarse)

    def _judge(
        self, refined: Refined, omega: float, found: Found, coarse_case: Case, coarse: PathPoint | None
    ) -> Found:
        """The outcome of a refined state, with its error and the state of the reference sweep."""
        joint = refined.case.joint(omega, self.excitation_amplitude)
        found.state, found.resolution = periodic_state(joint, refined.point), refined.case.resolution
        found.estimate = refined.estimate
        if coarse is not None:
            moved = move_point(coarse_case, refined.case, joint, coarse, self.budget)
            if moved is not None:
                found.coarse = periodic_state(joint, moved)
                found.estimate = found.estimate + state_difference(refined.case, joint, refined.point, moved)
        if not certify(joint, refined.point.evaluation).holds(self.settings.tolerance):
            found.outcome, found.state, found.coarse = Outcome.CERTIFICATE_FAILED, None, None
        elif unstable := find_instability(refined.case, joint, refined.point.evaluation, self.budget):
            found.outcome, found.state, found.coarse = unstable.outcome, None, None
            found.message = unstable.sentence
        elif not refined.accurate:
            found.outcome = Outcome.INACCURATE
        return found

    def _begin(self, nodes: NodeSweep, origin: Origin) -> None:
        """Find the first state of the sweep; no success where there is none, or where the structure is singular."""
        self.budget.limit = self.budget.iterations + LOADING.first_iterations
        places = [2.0 * np.pi * start for start in origin.starts] or [LOADING.free_step]
        for place in places:
            if self._begin_at(nodes, place):
                return

    def _begin_at(self, nodes: NodeSweep, place: float) -> bool:
        omega, load_factor = (place, 1.0) if nodes.path.omega is None else (nodes.path.omega, place)
        self.budget.tell(f"first state at {omega / (2.0 * np.pi):.6g} Hz")
        try:
            case, point = self._first(omega, load_factor)
        except np.linalg.LinAlgError:
            return False
        if point is None:
            return False
        return nodes.begin(case, PathPoint(place, point.evaluation, point.history))

    def _advance_to(self, nodes: NodeSweep, target: float) -> None:
        """Advance the sweep to the target; where the sweep is lost before, begin it again a little further on."""
        # budget of all attempts: where every pair slips, all of them fail
        self.budget.limit = self.budget.iterations + LOADING.first_iterations
        while True:
            try:
                nodes.advance_to(target)
            except np.linalg.LinAlgError:
                nodes.lose()
            if nodes.here is not None or nodes.path.omega is not None or np.isnan(nodes.state.lost_at):
                return
            behind = nodes.state.lost_at * (1.0 + LOADING.search_distance * nodes.direction)
            if (behind - target) * nodes.direction >= 0.0:
                return
            if self.budget.exhausted:
                return
            if not self._begin_at(nodes, behind):
                nodes.state = replace(nodes.state, lost_at=behind)

    def _why_lost(self, nodes: NodeSweep) -> Outcome:
        never = np.isnan(nodes.state.lost_at)
        return nodes.state.failure if never or nodes.state.failure in _REASONS else Outcome.BRANCH_LOST

    def _where_lost(self, nodes: NodeSweep) -> str:
        """Sentence with the last parameter of a lost sweep; empty for a sweep that never began."""
        if np.isnan(nodes.state.lost_at):
            return ""
        if nodes.path.omega is not None:
            return f"the vibration repeats up to {100.0 * nodes.state.lost_at:.3g} % of the excitation"
        return f"the sweep goes on in stable states as far as {nodes.state.lost_at / (2.0 * np.pi):.6g} Hz"

    def _first(self, omega: float, load_factor: float = 1.0) -> tuple[Case, PathPoint | None]:
        """A state from the static one with the harmonics of the sweep, or else with others."""
        assert self.nodes is not None
        others = _other_starts() if self.settings.automatic else ()
        why = Outcome.START_FAILED
        for attempt, resolution in enumerate((self.nodes.case.resolution, *others)):
            outcome, case, point = self._first_at(omega, load_factor, resolution)
            if point is not None:
                return case, point
            # the reason comes from the first attempt
            why = outcome if attempt == 0 else why
            if outcome is Outcome.STATIC_FAILED:
                why = outcome
            if outcome is Outcome.STATIC_FAILED or self.budget.exhausted:
                break
        self.nodes.state = replace(self.nodes.state, failure=why)
        return self.nodes.case, None

    def _first_at(
        self, omega: float, load_factor: float, resolution: Resolution
    ) -> tuple[Outcome, Case, PathPoint | None]:
        """A state from the static one with these harmonics and samples, as far as the settings allow them."""
        assert self.nodes is not None
        case = self.nodes.case.at(allowed(resolution, self.settings))
        unworn = np.zeros(self.model.contact.n_contact)
        outcome, found = solve_first_state(
            case, omega, load_factor * self.excitation_amplitude, unworn, JacobianSolver(), self.budget
        )
        return outcome, case, None if found is None else PathPoint(omega, found.evaluation, found.history)


def _other_starts() -> tuple[Resolution, ...]:
    """Harmonics and samples of further attempts to find a first state."""
    return tuple(Resolution(all_orders(highest), samples) for highest, samples in LOADING.other_starts)

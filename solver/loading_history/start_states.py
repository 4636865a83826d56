"""Unworn periodic states of a study's frequencies, each with the loading history that leads to it.

- "up", "down": the excitation frequency is swept slowly, as when a machine is run up or down. Along a branch that bends
  over, the two directions find different states.
- "ramp": the excitation is raised slowly at the frequency of the point, as when a flutter or a flow disturbance sets in
  at speed. Every point is independent of all others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TypedDict

import numpy as np

from solver.accuracy.certificate import certify
from solver.accuracy.error_estimate import UNKNOWN
from solver.accuracy.refinement import Refined, refine, state_difference
from solver.clock import computing_time
from solver.continuation.first_state import solve_first_state
from solver.harmonic_balance.converged import PathPoint
from solver.loading_history.options import LOADING
from solver.loading_history.path_step import Step
from solver.loading_history.sweep import NodeSweep, SweepState
from solver.loading_history.sweep_start import Origin, Sweep, find_origin
from solver.model import FloatArray, ReducedModel
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Effort, OutOfTimeError, move_point
from solver.outcome import Outcome, describe_error
from solver.packing import Packed, pack, unpack
from solver.results.history import PeriodicState, StartState
from solver.results.state_report import periodic_state
from solver.settings import Resolution, SolverSettings, all_orders, allowed
from solver.stability.floquet import find_instability
from solver.structure.joint import Case, build_case


def follow_branch(
    model: ReducedModel,
    friction_coefficient: float | FloatArray | None,
    excitation_amplitude: float,
    frequencies: FloatArray,
    sweep: Sweep,
    settings: SolverSettings,
    keep: Callable[[Packed], None] | None = None,
    resume: Packed | None = None,
    tell: Callable[[str], None] | None = None,
) -> Iterator[tuple[int, StartState]]:
    """Unworn periodic states at some frequencies: index and state, one by one.

    A state depends on its own frequency and on no other: the sweep to it begins at a frequency that is the same for
    all points of a quarter octave (`origin`) and has steps of its own (`sweep`). Where the branch ends at a fold it is
    followed by arc length until it reaches the next node in a stable state, which is where a slow sweep of the machine
    would land if the branch is one curve; where that fails, the structure is left to settle in time from the last
    state, and at last the state is sought from the static one.

    Parameters
    ----------
    model, friction_coefficient
        The case.
    excitation_amplitude
        N.
    frequencies
        Hz, ascending.
    sweep
        How the states are reached: "up" or "down" along the frequency, "ramp" at a fixed one.
    settings
        Harmonics, samples, tolerances, limit of time.
    keep
        Called now and then, after the state was taken from the iterator, with the progress of the sweep.
    resume
        Such progress of a sweep that differs in its frequencies only. Frequencies beyond those that it had passed are
        reached from there; the states are the same to the last bit, but for `run_time`.
    tell
        Called with where the sweep is and what it does there, in words.

    Yields
    ------
    tuple of int and StartState
        Index of the frequency, in the order of the sweep, and its state or why there is none.
    """
    order = np.arange(frequencies.size)[:: -1 if sweep == "down" else 1]
    line = FrequencySweep(model, friction_coefficient, excitation_amplitude, sweep, settings)
    line.effort.tell = tell or line.effort.tell
    counted = 0
    if resume is not None:
        counted, state = unpack(resume)
        line.load_state(state)
    kept = counted
    started = computing_time()
    for index in order:
        line.set_deadline(started + settings.time_limit)
        message = ""
        try:
            found = line.advance(float(frequencies[index]))
        except OutOfTimeError:
            found = _Found(Outcome.TIME_LIMIT)
        except Exception as error:
            # one bad point is one bad point: the sweep goes on from the state before
            found, message = _Found(Outcome.EXCEPTION), describe_error(error)
        now = computing_time()
        yield (
            int(index),
            StartState(
                outcome=found.outcome,
                state=found.state,
                coarse=found.coarse,
                penalty_omega=line.penalty_omega,
                resolution=found.resolution or line.resolution,
                response_error=found.estimate.response,
                wear_rate_error=found.estimate.wear_rate,
                newton_iterations=line.n_iterations - counted,
                run_time=now - started,
                branch=found.branch,
                fold_frequency=found.fold / (2.0 * np.pi),
                message=message or found.message,
            ),
        )
        started, counted = now, line.n_iterations
        # a sweep that has found no state to begin with has nothing to go on from
        begun = line.nodes is not None and line.nodes.saved is not None
        if keep is not None and begun and counted >= kept + LOADING.iterations_per_report:
            keep(pack((counted, line.state_dict())))
            kept = counted


_REASONS = (Outcome.UNSTABLE, Outcome.ADRIFT, Outcome.UNSETTLED)
"""Why a sweep has ended: they say more than that it has."""


class _Found:
    """What is known of the state at a frequency. branch, fold: folds jumped over before it, and the last, rad/s."""

    def __init__(self, outcome: Outcome, branch: int = 0, fold: float = float("nan")) -> None:
        self.outcome = outcome
        self.branch, self.fold = branch, fold
        self.state: PeriodicState | None = None
        self.coarse: PeriodicState | None = None
        self.resolution: Resolution | None = None
        self.estimate = UNKNOWN
        self.message = ""


class FrequencySweepState(TypedDict):
    """What goes on from frequency to frequency: attributes of a `FrequencySweep` and of its current sweep by nodes."""

    origin: Origin
    omega: float | None
    own_iterations: int
    sweep_iterations: int
    nodes: SweepState


class FrequencySweep:
    """The sweep over frequencies: one sweep for all points with the same origin, or one for each point of a ramp."""

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
        self.effort = Effort()
        self.origin: Origin | None = None
        self.nodes: NodeSweep | None = None
        self._counted = 0

    @property
    def penalty_omega(self) -> float:
        """rad/s, where the penalty is taken."""
        return float("nan") if self.origin is None else 2.0 * np.pi * self.origin.penalty

    @property
    def resolution(self) -> Resolution:
        """Harmonics and samples of the nodes."""
        return Resolution((1,), 4) if self.nodes is None else self.nodes.case.resolution

    @property
    def n_iterations(self) -> int:
        """Newton iterations so far."""
        return self.effort.iterations + (0 if self.nodes is None else self.nodes.effort.iterations)

    def set_deadline(self, deadline: float) -> None:
        """CPU time of the thread, s, after which the state that is sought is given up."""
        self.effort.deadline = deadline
        if self.nodes is not None:
            self.nodes.effort.deadline = deadline

    def state_dict(self) -> FrequencySweepState:
        """What goes on from frequency to frequency, to be packed."""
        assert self.nodes is not None
        assert self.nodes.saved is not None
        assert self.origin is not None
        return {
            "origin": self.origin,
            "omega": self.nodes.path.omega,
            "own_iterations": self.effort.iterations,
            "sweep_iterations": max(self.nodes.effort.iterations, self._counted),
            "nodes": self.nodes.saved,
        }

    def load_state(self, state: FrequencySweepState) -> None:
        """Go on from the state of another one."""
        self.origin = state["origin"]
        self.effort.iterations = state["own_iterations"]
        self._counted = state["sweep_iterations"]
        self.nodes = self._new_sweep(self.origin, state["omega"])
        self.nodes.load_state(state["nodes"])

    def _new_sweep(self, origin: Origin, omega: float | None) -> NodeSweep:
        case = build_case(self.model, self.friction_coefficient, 2.0 * np.pi * origin.penalty, self.settings)
        nodes = NodeSweep(case, self.excitation_amplitude, -1.0 if self.sweep == "down" else 1.0, omega)
        nodes.effort.deadline, nodes.effort.tell = self.effort.deadline, self.effort.tell
        return nodes

    def advance(self, frequency: float) -> _Found:
        """State at the next frequency, Hz, with the harmonics that it needs."""
        origin, omega = find_origin(self.model, frequency, self.sweep), 2.0 * np.pi * frequency
        other_cell = self.origin is None or origin.cell != self.origin.cell
        if self.nodes is None or self.sweep == "ramp" or other_cell or self.nodes.has_passed(omega):
            self.origin = origin
            # one that was loaded has not gone again to where it was
            self.effort.iterations += max(0 if self.nodes is None else self.nodes.effort.iterations, self._counted)
            self._counted = 0
            self.nodes = self._new_sweep(origin, omega if self.sweep == "ramp" else None)
            self._begin(self.nodes, origin)
        nodes, target = self.nodes, 1.0 if self.sweep == "ramp" else omega
        self._advance_to(nodes, target)
        self.effort.limit = self.effort.iterations + LOADING.node_iterations
        try:
            reached, coarse = nodes.state_at(target, self.effort)
            case = nodes.case
            if reached is None:
                self.effort.limit = self.effort.iterations + LOADING.first_iterations
                case, point = self._first(omega)
                reached = None if point is None else Step(point)
            if reached is None:
                lost = _Found(self._why_lost(nodes))
                lost.message = self._where_lost(nodes)
                return lost
            refined = refine(case, omega, self.excitation_amplitude, reached.point, self.effort)
            if not refined.accurate and self.model.contact.n_contact <= LOADING.few_pairs:
                refined = self._restarted_from_static(omega) or refined
        except np.linalg.LinAlgError:
            return _Found(Outcome.SINGULAR)
        # those of a ramp are no frequencies
        fold = float("nan") if self.sweep == "ramp" else (nodes.state.fold, *reached.folds)[-1]
        found = _Found(Outcome.CONVERGED, nodes.state.branch + len(reached.folds), fold)
        return self._judge(refined, omega, found, nodes.reference_path.case, coarse)

    def _judge(
        self, refined: Refined, omega: float, found: _Found, coarse_case: Case, coarse: PathPoint | None
    ) -> _Found:
        """Whether a refined state is a result, with its error and what the reference sweep has come to."""
        joint = refined.case.joint(omega, self.excitation_amplitude)
        found.state, found.resolution = periodic_state(joint, refined.point), refined.case.resolution
        found.estimate = refined.estimate
        if coarse is not None:
            moved = move_point(coarse_case, refined.case, joint, coarse, self.effort)
            if moved is not None:
                found.coarse = periodic_state(joint, moved)
                found.estimate = found.estimate + state_difference(refined.case, joint, refined.point, moved)
        if not certify(joint, refined.point.evaluation).holds(self.settings.tolerance):
            found.outcome, found.state, found.coarse = Outcome.CERTIFICATE_FAILED, None, None
        elif unstable := find_instability(refined.case, joint, refined.point.evaluation, self.effort):
            found.outcome, found.state, found.coarse = unstable.outcome, None, None
            found.message = unstable.sentence
        elif not refined.accurate:
            found.outcome = Outcome.INACCURATE
        return found

    def _begin(self, nodes: NodeSweep, origin: Origin) -> None:
        """A state where the sweep begins; none where there is none, or where the structure is singular there."""
        self.effort.limit = self.effort.iterations + LOADING.first_iterations
        places = [2.0 * np.pi * start for start in origin.starts] or [LOADING.first_load_factor]
        for place in places:
            if self._begin_at(nodes, place):
                return

    def _begin_at(self, nodes: NodeSweep, place: float) -> bool:
        omega, load_factor = (place, 1.0) if nodes.path.omega is None else (nodes.path.omega, place)
        self.effort.tell(f"first state at {omega / (2.0 * np.pi):.6g} Hz")
        try:
            case, point = self._first(omega, load_factor)
        except np.linalg.LinAlgError:
            return False
        if point is None:
            return False
        return nodes.begin(case, PathPoint(place, point.evaluation, point.history))

    def _advance_to(self, nodes: NodeSweep, target: float) -> None:
        """As far as the target; where the sweep ends before, it is begun anew a little behind its end."""
        # all attempts together: where a joint has no grip none of them leads on
        self.effort.limit = self.effort.iterations + LOADING.first_iterations
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
            if self.effort.exhausted:
                return
            if not self._begin_at(nodes, behind):
                nodes.state = replace(nodes.state, lost_at=behind)

    def _why_lost(self, nodes: NodeSweep) -> Outcome:
        never = np.isnan(nodes.state.lost_at)
        return nodes.state.failure if never or nodes.state.failure in _REASONS else Outcome.BRANCH_LOST

    def _where_lost(self, nodes: NodeSweep) -> str:
        """How far a sweep came that has lost its branch; empty for one that never began, and for a ramp."""
        if np.isnan(nodes.state.lost_at):
            return ""
        if nodes.path.omega is not None:
            return f"the vibration repeats up to {100.0 * nodes.state.lost_at:.3g} % of the excitation"
        return f"the sweep goes on in stable states as far as {nodes.state.lost_at / (2.0 * np.pi):.6g} Hz"

    def _restarted_from_static(self, omega: float) -> Refined | None:
        """An accurate state from the static one with other harmonics, where those of the branch lead to none."""
        for resolution in _other_starts()[1:]:
            case, point = self._first_at(omega, 1.0, resolution)[1:]
            refined = None
            if point is not None:
                refined = refine(case, omega, self.excitation_amplitude, point, self.effort)
            if refined is not None and refined.accurate:
                return refined
        return None

    def _first(self, omega: float, load_factor: float = 1.0) -> tuple[Case, PathPoint | None]:
        """A state from the static one; where the harmonics of the sweep find none, with others."""
        assert self.nodes is not None
        others = _other_starts() if self.settings.automatic else ()
        why = Outcome.START_FAILED
        for attempt, resolution in enumerate((self.nodes.case.resolution, *others)):
            outcome, case, point = self._first_at(omega, load_factor, resolution)
            if point is not None:
                return case, point
            # the first attempt says why there is none
            why = outcome if attempt == 0 else why
            if outcome is Outcome.STATIC_FAILED:
                why = outcome
            if outcome is Outcome.STATIC_FAILED or self.effort.exhausted:
                break
        self.nodes.state = replace(self.nodes.state, failure=why)
        return self.nodes.case, None

    def _first_at(
        self, omega: float, load_factor: float, resolution: Resolution
    ) -> tuple[Outcome, Case, PathPoint | None]:
        """A state from the static one with these harmonics and samples, as far as they are not fixed."""
        assert self.nodes is not None
        case = self.nodes.case.at(allowed(resolution, self.settings))
        unworn = np.zeros(self.model.contact.n_contact)
        outcome, found = solve_first_state(
            case, omega, load_factor * self.excitation_amplitude, unworn, JacobianSolver(), self.effort
        )
        return outcome, case, None if found is None else PathPoint(omega, found.evaluation, found.history)


def _other_starts() -> tuple[Resolution, ...]:
    """Harmonics and samples with which a first state is sought where those of the sweep find none."""
    return tuple(Resolution(all_orders(highest), samples) for highest, samples in LOADING.other_starts)

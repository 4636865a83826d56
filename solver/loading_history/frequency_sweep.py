"""The sweep along the frequencies of a study: nodes common to many points, and the state at each point."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from solver.accuracy.certificate import certify
from solver.accuracy.error_estimate import NOTHING, UNKNOWN, Estimate
from solver.accuracy.refinement import Refined, refine, state_difference
from solver.continuation.first_state import solve_first_state
from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.state import State
from solver.loading_history.options import LOADING
from solver.loading_history.path import LoadingPath
from solver.loading_history.path_of_states import Step
from solver.loading_history.sweep import Sweep, SweepState
from solver.loading_history.sweep_start import Direction, Origin, find_origin
from solver.model import FloatArray, ReducedModel
from solver.newton.linear_solver import SMALL_JOINT
from solver.newton.run import Budget, Run
from solver.outcome import Outcome
from solver.packing import packable
from solver.results.history import PeriodicState
from solver.results.state_report import periodic_state
from solver.settings import Resolution, SolverSettings, all_orders, allowed
from solver.stability.floquet import find_instability
from solver.structure.joint import Case, build_case

_REASONS = (Outcome.UNSTABLE, Outcome.ADRIFT, Outcome.UNSETTLED)
"""Outcomes that give the reason for the end of a sweep, not only its end."""


@dataclass(frozen=True)
class Found:
    """The state at a frequency with its errors, or the reason why there is none.

    branch: number of folds jumped over before this frequency. fold: frequency of the last of them, rad/s.
    """

    outcome: Outcome
    branch: int = 0
    fold: float = float("nan")
    state: PeriodicState | None = None
    reference: PeriodicState | None = None
    resolution: Resolution | None = None
    estimate: Estimate = UNKNOWN
    message: str = ""


@packable
@dataclass(frozen=True)
class FrequencySweepState:
    """Saved state of a `FrequencySweep`, with which another one goes on.

    origin, omega: of the current sweep; omega: frequency of a ramp, rad/s, None for a sweep in frequency.
    nodes: saved state of the sweep.
    """

    origin: Origin
    omega: float | None
    nodes: SweepState


class FrequencySweep:
    """The sweep over frequencies: one `Sweep` for all points with a common origin, or one for each point (ramp).

    run: of the state at the current frequency, without the sweep to this frequency.
    save: called where the sweep was saved.
    every: for which states stability is tested, as in `find_instability`.
    known: frequencies, Hz, and the resolutions that states need there. Each state then takes that of the nearest one;
        its error is not estimated, and there is no reference sweep. Empty: errors are estimated.
    """

    def __init__(
        self,
        model: ReducedModel,
        friction_coefficient: float | FloatArray | None,
        excitation_amplitude: float,
        sweep: Direction,
        settings: SolverSettings,
    ) -> None:
        self.model, self.friction_coefficient = model, friction_coefficient
        self.excitation_amplitude, self.sweep, self.settings = excitation_amplitude, sweep, settings
        self.every = True
        self.known: tuple[tuple[float, Resolution], ...] = ()
        self.save: Callable[[], None] = lambda: None
        self.run = Run(settings.tolerance)
        self.origin: Origin | None = None
        self.nodes: Sweep[State] | None = None
        self._begun = False

    @property
    def penalty_omega(self) -> float:
        """Frequency at which the penalty is taken, rad/s."""
        return float("nan") if self.origin is None else 2.0 * np.pi * self.origin.penalty

    @property
    def resolution(self) -> Resolution:
        """Harmonics and samples of the nodes."""
        return Resolution((1,), 4) if self.nodes is None else self.nodes.state.resolution

    @property
    def n_iterations(self) -> int:
        """Newton iterations to the current frequency: of the sweep from its origin, and of the state."""
        return self.run.budget.iterations + (0 if self.nodes is None else self.nodes.n_iterations)

    def set_deadline(self, deadline: float) -> None:
        """Set the CPU time of the thread, s, after which the search for the present state ends."""
        self.run.budget.deadline = deadline
        if self.nodes is not None:
            self.nodes.set_deadline(deadline)

    def state(self) -> FrequencySweepState | None:
        """What another sweep needs to go on, to be packed; None where nothing is saved yet."""
        if self.nodes is None or self.origin is None or self.nodes.saved is None:
            return None
        return FrequencySweepState(self.origin, _path(self.nodes).omega, self.nodes.saved)

    def load(self, state: FrequencySweepState) -> None:
        """Go on from the saved state of another sweep."""
        self._new_sweep(state.origin, state.omega).load(state.nodes)
        self._begun = True

    def go_on_from(self, case: Case, state: State, frequency: float) -> bool:
        """Begin at a known state; False where the state is rejected.

        Parameters
        ----------
        case
            Harmonics, samples and penalty of the state.
        state
            Its parameter is the frequency, rad/s, or for a ramp its amplitude over that of the sweep.
        frequency
            The frequency to which the sweep goes, Hz.
        """
        ramp, target = self.sweep == "ramp", 2.0 * np.pi * frequency
        origin = replace(find_origin(self.model, frequency, self.sweep), penalty=case.penalty_omega / (2.0 * np.pi))
        up = (1.0 if ramp else target) >= state.parameter
        nodes = self._new_sweep(origin, target if ramp else None, case, 1.0 if up else -1.0)
        self._begun = True
        return nodes.begin(LoadingPath(case, self.excitation_amplitude, target if ramp else None), state)

    def advance(self, frequency: float) -> Found:
        """State at the next frequency, Hz, with the harmonics that it needs."""
        origin, omega = find_origin(self.model, frequency, self.sweep), 2.0 * np.pi * frequency
        ramp, budget = self.sweep == "ramp", self.run.budget
        budget.iterations, budget.limit = 0, LOADING.node_iterations
        # the state must not depend on those at other frequencies
        self.run = run = self.run.fresh()
        nodes, target = self._sweep_to(origin, omega), 1.0 if ramp else omega
        try:
            self.advance_nodes(nodes, target)
            reached = nodes.state_at(target, run.fresh())
            case = _path(nodes).case
            if isinstance(reached, Outcome):
                failed = nodes.state if nodes.here is None else replace(nodes.state, failure=reached)
                nodes.state = failed
                budget.limit = budget.iterations + LOADING.first_iterations
                first = self._first(omega, run)
                if first is None:
                    return Found(self.why_lost(nodes), message=self._where_lost(nodes))
                case, reached = first[0], Step(first[1])
            refined = self._at_known(frequency, case, omega, reached.state)
            if refined is None:
                refined = refine(case, omega, self.excitation_amplitude, reached.state, run)
            # with impacts a small joint has many other states
            small = case.joint(omega, 0.0).component_index.size <= SMALL_JOINT
            if not refined.accurate and small:
                refined = self._restarted_from_static(omega) or refined
        except np.linalg.LinAlgError:
            return Found(Outcome.SINGULAR)
        # folds of a ramp are load factors
        fold = float("nan") if ramp else (nodes.state.fold, *reached.folds)[-1]
        branch = nodes.state.branch + len(reached.folds)
        return self._judge(refined, omega, nodes, Found(Outcome.CONVERGED, branch, fold))

    def sweep_in_cell(self, frequency: float) -> Sweep[State]:
        """The sweep that passes all frequencies in the quarter octave of a frequency, Hz, at its present node."""
        origin = find_origin(self.model, frequency, self.sweep)
        if self.nodes is None or self.origin is None or origin.cell != self.origin.cell:
            return self._sweep_to(origin, 2.0 * np.pi * frequency)
        return self._at_begin(self.nodes, origin)

    def _sweep_to(self, origin: Origin, omega: float) -> Sweep[State]:
        """The sweep that leads to a frequency, rad/s, at its first node or beyond."""
        nodes, ramp = self.nodes, self.sweep == "ramp"
        passed = nodes is not None and (_path(nodes).omega != omega if ramp else nodes.has_passed(omega))
        if nodes is None or passed or self.origin is None or origin.cell != self.origin.cell:
            nodes = self._new_sweep(origin, omega if ramp else None)
        return self._at_begin(nodes, origin)

    def _new_sweep(
        self, origin: Origin, omega: float | None, case: Case | None = None, direction: float | None = None
    ) -> Sweep[State]:
        """A sweep before its first node. omega: frequency of a ramp, rad/s, else None."""
        case = case or build_case(self.model, self.friction_coefficient, 2.0 * np.pi * origin.penalty, self.settings)
        direction = direction or (-1.0 if self.sweep == "down" else 1.0)
        path, of = LoadingPath(case, self.excitation_amplitude, omega), self.run.budget
        self.origin, self._begun = origin, False
        budget = Budget(deadline=of.deadline, report=of.report)
        self.nodes = Sweep(path, direction, budget, with_reference=not self.known)
        self.nodes.save = lambda: self.save()
        return self.nodes

    def _at_begin(self, nodes: Sweep[State], origin: Origin) -> Sweep[State]:
        """A sweep at its first node or beyond; without a state where none is found."""
        if not self._begun:
            self._begun = True
            nodes.run.budget.limit = nodes.run.budget.iterations + LOADING.first_iterations
            places = [2.0 * np.pi * start for start in origin.starts] or [LOADING.free_step]
            any(self._begin_at(nodes, place) for place in places)
        return nodes

    def _begin_at(self, nodes: Sweep[State], place: float) -> bool:
        """Begin a sweep at a value of its parameter; False where there is no state."""
        ramp, before, first = _path(nodes).omega, nodes.run.budget.iterations, None
        omega, load_factor = (place, 1.0) if ramp is None else (ramp, place)
        nodes.run.budget.report(f"first state at {omega / (2.0 * np.pi):.6g} Hz")
        with contextlib.suppress(np.linalg.LinAlgError):
            first = self._first(omega, nodes.run, load_factor)
        if not np.isnan(nodes.state.lost_at):
            searched = nodes.state.searched + nodes.run.budget.iterations - before
            nodes.state = replace(nodes.state, searched=searched)
        if first is None:
            return False
        case, state = first
        return nodes.begin(replace(_path(nodes), case=case), replace(state, parameter=place))

    def advance_nodes(self, nodes: Sweep[State], target: float) -> None:
        """Advance the sweep to the target; where the sweep is lost before, begin it again a little further on."""
        while True:
            try:
                nodes.advance_to(target)
            except np.linalg.LinAlgError:
                nodes.lose()
            if nodes.here is not None or _path(nodes).omega is not None or np.isnan(nodes.state.lost_at):
                return
            behind = nodes.state.lost_at * (1.0 + CONTINUATION.arc_span * nodes.direction)
            # budget of all attempts: where every pair slips, all of them fail
            left = LOADING.first_iterations - nodes.state.searched
            if (behind - target) * nodes.direction >= 0.0 or left < 0:
                return
            nodes.run.budget.limit = nodes.run.budget.iterations + left
            if not self._begin_at(nodes, behind):
                nodes.state = replace(nodes.state, lost_at=behind)

    def _first(self, omega: float, run: Run, load_factor: float = 1.0) -> tuple[Case, State] | None:
        """A state from the static one with the harmonics of the sweep, or else with others, and its case."""
        assert self.nodes is not None
        why: Outcome | None = None
        others = _other_starts() if self.settings.automatic else ()
        for case, found in self._firsts(omega, run, load_factor, (self.nodes.state.resolution, *others)):
            if isinstance(found, State):
                return case, found
            # the reason comes from the first attempt
            why = found if why is None or found.static else why
            if found.static or run.budget.exhausted:
                break
        self.nodes.state = replace(self.nodes.state, failure=why or Outcome.START_FAILED)
        return None

    def _firsts(
        self, omega: float, run: Run, load_factor: float, resolutions: tuple[Resolution, ...]
    ) -> Iterator[tuple[Case, State | Outcome]]:
        """States from the static one with some harmonics and samples, as far as the settings allow them."""
        assert self.nodes is not None
        amplitude, unworn = load_factor * self.excitation_amplitude, np.zeros(self.model.contact.n_contact)
        for resolution in resolutions:
            case = _path(self.nodes).case.at(allowed(resolution, self.settings))
            yield case, solve_first_state(case, omega, amplitude, unworn, run.fresh())

    def _restarted_from_static(self, omega: float) -> Refined | None:
        """An accurate state from the static one with other harmonics than the branch; None if there is none."""
        for case, found in self._firsts(omega, self.run, 1.0, _other_starts()[1:]):
            if isinstance(found, State):
                refined = refine(case, omega, self.excitation_amplitude, found, self.run)
                if refined.accurate:
                    return refined
        return None

    def why_lost(self, nodes: Sweep[State]) -> Outcome:
        """The reason why a sweep has no state."""
        never = np.isnan(nodes.state.lost_at)
        return nodes.state.failure if never or nodes.state.failure in _REASONS else Outcome.BRANCH_LOST

    def _where_lost(self, nodes: Sweep[State]) -> str:
        """Sentence with the last parameter of a lost sweep; empty for a sweep that never began."""
        if np.isnan(nodes.state.lost_at):
            return ""
        if _path(nodes).omega is not None:
            return f"the vibration repeats up to {100.0 * nodes.state.lost_at:.3g} % of the excitation"
        return f"the sweep goes on in stable states as far as {nodes.state.lost_at / (2.0 * np.pi):.6g} Hz"

    def _at_known(self, frequency: float, case: Case, omega: float, state: State) -> Refined | None:
        """The state with the known resolution; None where none is known, or where the state is not found with it."""
        if not self.known:
            return None
        _, resolution = min(self.known, key=lambda each: abs(each[0] - frequency))
        wanted = case.at(resolution)
        if resolution != case.resolution:
            moved = self.run.move(case, wanted.joint(omega, self.excitation_amplitude), state)
            return None if moved is None else Refined(wanted, moved, NOTHING, accurate=True)
        return Refined(case, state, NOTHING, accurate=True)

    def _judge(self, refined: Refined, omega: float, nodes: Sweep[State], found: Found) -> Found:
        """The outcome of a refined state, with its error and the state of the reference sweep."""
        case, at = refined.case, refined.point.evaluation
        joint = case.joint(omega, self.excitation_amplitude)
        lost = replace(found, resolution=case.resolution, estimate=refined.estimate)
        if not certify(joint, at).holds(self.settings.tolerance):
            return replace(lost, outcome=Outcome.CERTIFICATE_FAILED)
        if unstable := find_instability(case, joint, at, self.run, self.every):
            return replace(lost, outcome=unstable.outcome, message=unstable.sentence)
        found = replace(lost, state=periodic_state(joint, refined.point))
        if (reference := self._reference(nodes, case, refined.point)) is not None:
            estimate = found.estimate + state_difference(case, joint, refined.point, reference)
            found = replace(found, reference=periodic_state(joint, reference), estimate=estimate)
        return found if refined.accurate else replace(found, outcome=Outcome.INACCURATE)

    def _reference(self, nodes: Sweep[State], case: Case, state: State) -> State | None:
        """A state with the history that the reference sweep leaves; None where there is none."""
        with contextlib.suppress(np.linalg.LinAlgError):
            if (found := nodes.reference_node(state.parameter)) is not None:
                path, node = found
                assert isinstance(path, LoadingPath)
                return path.like(node, replace(path, case=case), state, self.run)
        return None


def _path(sweep: Sweep[State]) -> LoadingPath:
    """The path of a sweep."""
    assert isinstance(sweep.path, LoadingPath)
    return sweep.path


def _other_starts() -> tuple[Resolution, ...]:
    """Harmonics and samples of further attempts to find a first state."""
    return tuple(Resolution(all_orders(highest), samples) for highest, samples in LOADING.other_starts)

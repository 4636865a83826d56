"""The sweep along the frequencies of a study: nodes common to many points, and the state at each point."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from solver.accuracy.certificate import certify
from solver.accuracy.error_estimate import NOTHING, UNKNOWN, Estimate
from solver.accuracy.refinement import Refined, refine, state_difference
from solver.continuation.first_state import solve_first_state
from solver.harmonic_balance.state import State
from solver.loading_history.path import FREE_STEP, LoadingPath
from solver.loading_history.path_of_states import Step
from solver.loading_history.sweep import NODE_ITERATIONS, SWEEP_ITERATIONS, Sweep, SweepState
from solver.loading_history.sweep_start import Direction, Origin, cell_of, find_origin
from solver.model import FloatArray, ReducedModel
from solver.newton.run import Budget, Run
from solver.outcome import Outcome
from solver.packing import packable
from solver.results.history import StartState
from solver.results.state_report import periodic_state
from solver.settings import Resolution, SolverSettings, all_orders, allowed
from solver.stability.floquet import find_instability
from solver.structure.joint import Case, build_case

FIRST_ITERATIONS = SWEEP_ITERATIONS // 8
"""Most Newton iterations of all attempts to begin a sweep, or to find a state where the sweep is lost. Tens to hundreds
suffice where some pairs stick; a joint that slips everywhere takes all of them in vain."""

OTHER_STARTS = ((1, 64), (3, 256), (15, 256))
"""Harmonics and samples of further attempts to find a first state."""

_REASONS = (Outcome.UNSTABLE, Outcome.ADRIFT, Outcome.UNSETTLED)
"""Outcomes that give the reason for the end of a sweep, not only its end."""


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
        return FrequencySweepState(self.origin, path_of(self.nodes).omega, self.nodes.saved)

    def load(self, state: FrequencySweepState) -> None:
        """Go on from the saved state of another sweep."""
        self._new_sweep(state.origin, state.omega).load(state.nodes)

    def go_on_from(self, case: Case, state: State, frequency: float) -> bool:
        """Begin at a known state; False where the state is rejected.

        case: harmonics, samples and penalty of the state. state: its parameter is the frequency, rad/s, or for a ramp
        its amplitude over that of the sweep. frequency: to which the sweep goes, Hz.
        """
        ramp, target = self.sweep == "ramp", 2.0 * np.pi * frequency
        origin = Origin((), case.penalty_omega / (2.0 * np.pi), cell_of(frequency))
        nodes = self._new_sweep(origin, target if ramp else None)
        nodes.direction = 1.0 if (1.0 if ramp else target) >= state.parameter else -1.0
        return nodes.begin(replace(path_of(nodes), case=case), state)

    def advance(self, frequency: float) -> StartState:
        """State at the next frequency, Hz, with the harmonics that it needs. Raises OutOfTimeError."""
        omega, ramp = 2.0 * np.pi * frequency, self.sweep == "ramp"
        # the state must not depend on those at other frequencies
        self.run = run = self.run.fresh()
        run.budget.iterations, run.budget.limit = 0, NODE_ITERATIONS
        nodes, target = self.sweep_to(frequency), 1.0 if ramp else omega
        nodes.advance_to(target)
        try:
            path, reached = path_of(nodes), nodes.state_at(target, run.fresh())
            if isinstance(reached, Outcome):
                run.budget.limit = run.budget.iterations + FIRST_ITERATIONS
                first = self._first(path, target, run)
                if isinstance(first, Outcome):
                    return self.without_state(why_lost(nodes, first), _where_lost(nodes))
                path, reached = first[0], Step(first[1])
            refined = self._at_known(frequency, path.case, omega, reached.state)
            if refined is None:
                refined = refine(path.case, omega, self.excitation_amplitude, reached.state, run)
        except np.linalg.LinAlgError:
            return self.without_state(Outcome.SINGULAR)
        # folds of a ramp are load factors
        fold = np.nan if ramp else (nodes.state.fold, *reached.folds)[-1] / (2.0 * np.pi)
        found = self._judged(refined, nodes)
        return replace(found, branch=nodes.state.branch + len(reached.folds), fold_frequency=float(fold))

    def without_state(
        self, outcome: Outcome, message: str = "", resolution: Resolution | None = None, estimate: Estimate = UNKNOWN
    ) -> StartState:
        """No state at the current frequency, and why; of a state that is found all but the state itself."""
        used = Resolution((1,), 4) if self.nodes is None else self.nodes.state.nodes.resolution
        return StartState(
            outcome=outcome,
            state=None,
            penalty_omega=float("nan") if self.origin is None else 2.0 * np.pi * self.origin.penalty,
            resolution=resolution or used,
            response_error=estimate.response,
            wear_rate_error=estimate.wear_rate,
            newton_iterations=self.n_iterations,
            run_time=0.0,
            message=message,
        )

    def sweep_to(self, frequency: float, *, beyond: bool = False) -> Sweep[State]:
        """The sweep that leads to a frequency, Hz, at its first node or farther on; without a state if none is found.

        beyond: whether the present sweep will do although it has passed the frequency.
        """
        omega, cell, nodes = 2.0 * np.pi * frequency, cell_of(frequency), self.nodes
        ramp = omega if self.sweep == "ramp" else None
        same_cell = self.origin is not None and self.origin.cell == cell
        there = nodes is not None and same_cell and path_of(nodes).omega == ramp
        if nodes is not None and there and (ramp or beyond or not nodes.has_passed(omega)):
            return nodes
        origin = find_origin(self.model, cell, self.sweep)
        nodes = self._new_sweep(origin, ramp)
        nodes.run.budget.limit = FIRST_ITERATIONS
        places = [2.0 * np.pi * start for start in origin.starts] or [FREE_STEP]
        any(self._begin_at(nodes, place) for place in places)
        return nodes

    def _new_sweep(self, origin: Origin, omega: float | None) -> Sweep[State]:
        """A sweep before its first node. omega: frequency of a ramp, rad/s, else None."""
        case = build_case(self.model, self.friction_coefficient, 2.0 * np.pi * origin.penalty, self.settings)
        path, of = LoadingPath(case, self.excitation_amplitude, omega), self.run.budget
        budget = Budget(deadline=of.deadline, report=of.report)
        self.origin = origin
        self.nodes = Sweep(path, -1.0 if self.sweep == "down" else 1.0, budget, with_reference=not self.known)
        self.nodes.save = lambda: self.save()
        return self.nodes

    def _begin_at(self, nodes: Sweep[State], place: float) -> bool:
        """Begin a sweep at a value of its parameter; False where there is no state."""
        nodes.run.budget.report(f"first state at {(path_of(nodes).omega or place) / (2.0 * np.pi):.6g} Hz")
        first: tuple[LoadingPath, State] | Outcome = Outcome.START_FAILED
        with contextlib.suppress(np.linalg.LinAlgError):
            first = self._first(path_of(nodes), place, nodes.run)
            if not isinstance(first, Outcome):
                return nodes.begin(*first)
        nodes.state = replace(nodes.state, failure=first if isinstance(first, Outcome) else Outcome.START_FAILED)
        return False

    def _first(self, path: LoadingPath, place: float, run: Run) -> tuple[LoadingPath, State] | Outcome:
        """A state from the static one at a value of the parameter, with the harmonics of a path, or else with others as
        far as the settings allow them, and its path; or the reason of the first attempt.
        """
        others = [Resolution(all_orders(highest), samples) for highest, samples in OTHER_STARTS]
        allowed_others = [allowed(other, self.settings) for other in others if self.settings.automatic]
        omega, load = (place, 1.0) if path.omega is None else (path.omega, place)
        unworn, why = np.zeros(self.model.contact.n_contact), list[Outcome]()
        for resolution in (path.case.resolution, *allowed_others):
            at = path.at(resolution)
            found = solve_first_state(at.case, omega, load * self.excitation_amplitude, unworn, run.fresh())
            if isinstance(found, State):
                return at, replace(found, parameter=place)
            why.append(found)
            if found.static or run.budget.exhausted:
                break
        return why[-1] if why[-1].static else why[0]

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

    def _judged(self, refined: Refined, nodes: Sweep[State]) -> StartState:
        """The outcome of a refined state, with its error and the state of the reference sweep."""
        case, point, estimate = refined.case, refined.point, refined.estimate
        joint = replace(path_of(nodes), case=case).joint_at(point.parameter)
        if not certify(joint, point.evaluation).holds(self.settings.tolerance):
            return self.without_state(Outcome.CERTIFICATE_FAILED, "", case.resolution, estimate)
        if unstable := find_instability(case, joint, point.evaluation, self.run, self.every):
            return self.without_state(unstable.outcome, unstable.message, case.resolution, estimate)
        reference = self._reference(nodes, case, point)
        if reference is not None:
            estimate = estimate + state_difference(case, joint, point, reference)
        outcome = Outcome.CONVERGED if refined.accurate else Outcome.INACCURATE
        return replace(
            self.without_state(outcome, "", case.resolution, estimate),
            state=periodic_state(joint, point),
            reference=None if reference is None else periodic_state(joint, reference),
        )

    def _reference(self, nodes: Sweep[State], case: Case, state: State) -> State | None:
        """A state with the history that the reference sweep leaves; None where there is none."""
        with contextlib.suppress(np.linalg.LinAlgError):
            if nodes.here is not None and (reference := nodes.reference) is not None:
                path, states = reference
                assert isinstance(path, LoadingPath)
                return path.like(states[-1], replace(path, case=case), state, self.run)
        return None


def path_of(sweep: Sweep[State]) -> LoadingPath:
    """The path of a sweep."""
    assert isinstance(sweep.path, LoadingPath)
    return sweep.path


def why_lost(nodes: Sweep[State], failure: Outcome) -> Outcome:
    """The reason why a sweep has no state; failure: of the last search."""
    return failure if nodes.last is None or failure in _REASONS else Outcome.BRANCH_LOST


def _where_lost(nodes: Sweep[State]) -> str:
    """Sentence with the last parameter of a lost sweep; empty for a sweep that never began."""
    if nodes.last is None or not nodes.state.lost:
        return ""
    if path_of(nodes).omega is not None:
        return f"the vibration repeats up to {100.0 * nodes.last.parameter:.3g} % of the excitation"
    return f"the sweep goes on in stable states as far as {nodes.last.parameter / (2.0 * np.pi):.6g} Hz"

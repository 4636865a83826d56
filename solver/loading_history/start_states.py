"""Unworn periodic states at the frequencies of a study, each with the loading history that leads to the state.

The excitation frequency is swept slowly "up" or "down", as in the run-up or run-down of a machine; on a branch that
bends over, both find different states. In a "ramp" the excitation is raised slowly at the frequency of the point.

A history with followed frequency begins at the resonance that the sweep meets first in a range: between two nodes,
where the phase lag passes pi/2. A resonance that the sweep jumps over at a fold is none of its states. The largest
amplitude is sought from there, as it has small maxima where pairs begin to slip, far from any resonance.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise

import numpy as np

from solver.accuracy.certificate import certify
from solver.accuracy.refinement import refine
from solver.accuracy.resolved_state import UNKNOWN, ResolvedState
from solver.clock import computing_time
from solver.continuation.first_state import solve_first_state
from solver.continuation.natural import FINE_STEP
from solver.continuation.phase_lag import phase_lag, solve_at_lag, solve_at_peak
from solver.harmonic_balance.state import Failure, State, balance_after
from solver.loading_history.path import LoadingPath, Path, Step, cell_of, edge_of, first_frequency
from solver.loading_history.sweep import NODE_ITERATIONS, SWEEP_ITERATIONS, Sweep
from solver.model import FloatArray, ReducedModel
from solver.newton.run import Budget, Run, guarded
from solver.outcome import Outcome, is_known_to
from solver.packing import Keep, Packed, pack, unpack
from solver.results.history import StartState
from solver.results.state_report import evaluated, periodic_state
from solver.settings import FEWEST_SAMPLES, Direction, FollowedFrequency, Resolution, SolverSettings, allowed
from solver.stability.floquet import find_instability
from solver.structure.joint import Case, build_case

FIRST_ITERATIONS = SWEEP_ITERATIONS // 8
"""Most Newton iterations to begin a sweep, or to find a state where the sweep is lost. Tens to hundreds suffice."""

OTHER_START = Resolution((1,), FEWEST_SAMPLES)
"""Harmonics and samples of a further attempt to find a first state: four of 54 random scenes need it."""


@dataclass(eq=False)
class FrequencySweep:
    """The sweep over frequencies: one `Sweep` for all points of a cell, or one for each point (ramp).

    excitation_amplitude: N.
    keep: called from time to time, also on the way to a state.
    with_switching: for which states stability is tested, as in `find_instability`.
    known: frequencies, Hz, and resolutions. Where there are some, each state takes that of the nearest one; its error
        is not estimated, and there is no reference sweep.
    present, cell, omega: the present sweep, its cell, and the frequency of a ramp, rad/s, else None.
    run: of the state at the current frequency, without the sweep to this frequency.
    """

    model: ReducedModel
    excitation_amplitude: float
    direction: Direction
    settings: SolverSettings
    keep: Keep = lambda _: None
    with_switching: bool = True
    known: tuple[tuple[float, Resolution], ...] = ()
    present: Sweep[State] | None = None
    cell: int = 0
    omega: float | None = None
    run: Run = field(init=False)

    def __post_init__(self) -> None:
        self.run = Run(self.settings.tolerance, Budget(report=self.keep))

    def states(self, frequencies: FloatArray | FollowedFrequency) -> Iterator[tuple[int, StartState]]:
        """Index and unworn state, one by one, in the order of the sweep. A state depends on its own frequency only.

        frequencies: Hz, ascending. Or the resonance that is sought: the first one that the sweep meets in a range.
        """
        wanted = [frequencies] if isinstance(frequencies, FollowedFrequency) else frequencies.tolist()
        started = computing_time()
        for index in range(len(wanted))[:: -1 if self.direction == "down" else 1]:
            self.set_deadline(started + self.settings.time_limit)
            found = guarded(partial(self._next, wanted[index]))
            iterations = self.run.budget.iterations + (0 if self.present is None else self.present.budget.iterations)
            start, now = self._without_state(found) if isinstance(found, Failure) else found, computing_time()
            yield index, replace(start, newton_iterations=iterations, run_time=now - started)
            started = now
            self.save()

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
        """Go on from what another sweep, which may differ in its frequencies, has given to `keep`, to frequencies not
        yet passed. The states are equal to the last bit, except `run_time`.
        """
        cell, omega, present = unpack(saved)
        self._new_sweep(cell, omega).load(present)

    def go_on(self, start: StartState, case: Case, frequency: float) -> StartState:
        """The state at a frequency, Hz, to which a sweep leads from a known state, or why there is none.

        start: at the same frequency for a ramp, else under the same load. case: with its harmonics and penalty.
        """
        known, omega, ramp = start.state, 2.0 * np.pi * frequency, self.direction == "ramp"
        assert known is not None
        parameter = known.excitation_amplitude / self.excitation_amplitude if ramp else known.omega
        target = 1.0 if ramp else omega
        if parameter == target:
            return start
        present = self._new_sweep(cell_of(frequency), omega if ramp else None)
        present.sign = 1.0 if target > parameter else -1.0
        present.path = path = LoadingPath(case, self.excitation_amplitude, self.omega)
        joint, first = path.joint_at(parameter), replace(evaluated(case, known), parameter=parameter)
        if not present.begin(replace(first, omega=joint.omega, excitation_amplitude=joint.excitation_amplitude)):
            assert present.failure is not None
            return self._without_state(present.failure)
        _, after = next(self.states(np.array([frequency])))
        iterations = start.newton_iterations + after.newton_iterations
        return replace(after, branch=start.branch + after.branch, newton_iterations=iterations)

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
        present.budget.most_iterations = FIRST_ITERATIONS
        place = 2.0 * np.pi * first_frequency(self.model, cell, self.direction) if ramp is None else FINE_STEP
        present.budget.report(f"first state at {(ramp or place) / (2.0 * np.pi):.6g} Hz")
        first = self._first(present.path, place, present.run)
        if isinstance(first, Failure):
            present.failure = first
        else:
            present.begin(first)
        return present

    def _next(self, wanted: float | FollowedFrequency) -> StartState | Failure:
        """State at the next frequency, with the harmonics it needs, or why there is none. Raises as `guarded`."""
        frequency = find_resonance(self, wanted) if isinstance(wanted, FollowedFrequency) else wanted
        if isinstance(frequency, Failure):
            return frequency
        # the state must not depend on those at other frequencies
        self.run = run = self.run.fresh()
        run.budget.iterations, run.budget.most_iterations = 0, NODE_ITERATIONS
        present = self.sweep_to(frequency)
        target = 2.0 * np.pi * frequency if self.omega is None else 1.0
        reached = present.state_at(target, run.fresh())
        if isinstance(reached, Failure):
            run.budget.most_iterations = run.budget.iterations + FIRST_ITERATIONS
            first = self._first(present.path, target, run)
            if isinstance(first, Failure):
                return _lost(present, first)
            reached = Step(first)
        path = present.path.at(reached.state.resolution)
        found = self._at_known(path, reached.state) if self.known else None
        found = found or refine(ResolvedState(path.case, reached.state), run)
        return self._judged(found, present, reached.folds)

    def _without_state(self, failure: Failure) -> StartState:
        """No state at the current frequency, and why."""
        omega, resolution = math.nan, Resolution((1,), 4)
        if self.present is not None:
            omega, resolution = self.present.path.case.penalty_omega, self.present.path.case.resolution
        return StartState(failure.outcome, None, omega, resolution, math.inf, math.inf, message=failure.message)

    def _new_sweep(self, cell: int, omega: float | None) -> Sweep[State]:
        """A sweep before its first node. omega: of a ramp, rad/s, else None."""
        # the penalty belongs to the upper end of the cell
        case = build_case(self.model, 2.0 * np.pi * edge_of(cell + 1), self.settings)
        path, of = LoadingPath(case, self.excitation_amplitude, omega), self.run.budget
        budget, sign = Budget(deadline=of.deadline, report=of.report), -1.0 if self.direction == "down" else 1.0
        self.cell, self.omega = cell, omega
        self.present = Sweep(path, sign, budget, with_reference=not self.known, save=self.save)
        return self.present

    def _first(self, path: Path[State], place: float, run: Run) -> State | Failure:
        """First state at a value of the parameter, with the harmonics of a path, or else with one."""
        others = [allowed(OTHER_START, self.settings)] if self.settings.automatic else []
        omega, load = (place, 1.0) if self.omega is None else (self.omega, place)
        why = list[Failure]()
        for resolution in (path.case.resolution, *others):
            found = solve_first_state(path.at(resolution).case, omega, load * self.excitation_amplitude, run.fresh())
            if isinstance(found, State):
                return replace(found, parameter=place)
            why.append(found)
            if found.outcome.static or run.budget.exhausted:
                break
        return why[0]

    def _at_known(self, path: Path[State], state: State) -> ResolvedState | None:
        """The state with the known resolution; None where it is not found with it."""
        _, resolution = min(self.known, key=lambda each: abs(2.0 * np.pi * each[0] - state.omega))
        wanted = path.at(resolution)
        moved = state if wanted is path else wanted.moved(state, self.run)
        return None if moved is None else ResolvedState(wanted.case, moved)

    def _judged(self, found: ResolvedState, present: Sweep[State], folds: tuple[float, ...]) -> StartState | Failure:
        """A state with all its errors, or why it is no result. folds: jumped over behind the last node."""
        estimate = found.estimate
        if said := certify(found.joint, found.point.evaluation).sentence(self.settings.tolerance):
            return Failure(Outcome.CERTIFICATE_FAILED, said)
        unstable = find_instability(found.case, found.point, self.run, self.with_switching)
        if unstable is not None and not unstable.outcome.complete:
            return unstable
        reference = present.reference_of(found.point, self.run)
        if isinstance(reference, Failure):
            estimate, found, reference = UNKNOWN, replace(found, accurate=False), None
        elif reference is not None:
            estimate = estimate + found.difference(ResolvedState(found.case, reference))
        error, worse = max((estimate.wear_rate, "wear rate"), (estimate.response, "response"))
        # folds of a ramp are load factors
        fold = (present.fold, *folds)[-1] / (2.0 * np.pi) if self.omega is None else math.nan
        return StartState(
            outcome=Outcome.CONVERGED if found.accurate else Outcome.INACCURATE,
            state=periodic_state(found.point),
            penalty_omega=found.case.penalty_omega,
            resolution=found.case.resolution,
            response_error=estimate.response,
            wear_rate_error=estimate.wear_rate,
            message="" if found.accurate else f"the {worse} {is_known_to(error, self.settings.rtol)}",
            branch=present.branch + len(folds),
            fold_frequency=float(fold),
            unjudged="" if unstable is None else unstable.message,
            reference=None if reference is None else periodic_state(reference),
            by_resolution=found.estimate,
        )


def _lost(present: Sweep[State], failure: Failure) -> Failure:
    """Why a sweep has no state, and where its states end. failure: of the last search."""
    if present.last is None:
        return failure
    reason = Outcome.BRANCH_LOST if failure.outcome is Outcome.START_FAILED else failure.outcome
    return Failure(reason, f"stable states end {present.path.describe(present.last)}: {failure.message}")


def find_resonance(sweeps: FrequencySweep, follow: FollowedFrequency) -> float | Failure:
    """Frequency of the first resonance that a sweep "up" or "down" meets in a range, Hz, or why it meets none."""
    # parts of the range in each of which one sweep passes all frequencies
    edges = [edge_of(cell) for cell in range(cell_of(follow.low) + 1, cell_of(follow.high) + 1)]
    ends = [follow.low, *(edge for edge in edges if follow.low < edge < follow.high), follow.high]
    for near, far in pairwise(ends[::-1] if sweeps.direction == "down" else ends):
        present = sweeps.sweep_to(0.5 * (near + far), beyond=True)
        present.advance_to(2.0 * math.pi * near)
        while (here := present.here) is not None and (step := present.ahead) is not None:
            found = _resonance_between(sweeps, present, here, step, follow)
            if found is not None:
                return found
            end = step.state.parameter
            if (2.0 * math.pi * far - end) * present.sign <= 0.0:
                break
            present.advance_to(float(np.nextafter(end, present.sign * math.inf)))
        else:
            assert present.failure is not None
            return _lost(present, present.failure)
    within = f"between {follow.low:g} and {follow.high:g} Hz: give another range"
    return Failure(Outcome.RESONANCE_LOST, f"the sweep {sweeps.direction} meets no {follow.of} {within}")


def _resonance_between(
    sweeps: FrequencySweep, present: Sweep[State], here: State, step: Step[State], follow: FollowedFrequency
) -> float | Failure | None:
    """Frequency, Hz, of a resonance between two nodes, with the history of the first one; None where there is none."""
    path, load, ahead = present.path, sweeps.excitation_amplitude, step.state
    # positive before a resonance on the way of the sweep, negative behind
    one, other = (present.sign * math.cos(phase_lag(at.joint(path.case), at.evaluation)) for at in (here, ahead))
    if not one > 0.0 >= other:
        return None
    part = 0.0 if step.folds else one / (one - other)
    joint = path.case.joint(here.parameter + part * (ahead.parameter - here.parameter), load)
    before = here.evaluation.predicted_h
    run = Run(sweeps.settings.tolerance, Budget(deadline=sweeps.run.budget.deadline))
    start = before + part * (ahead.evaluation.predicted_h - before)
    found = solve_at_lag(path.case, balance_after(joint, here), start, 0.5 * math.pi, run)
    omega = math.nan if found is None else float(found.values[0])
    if not abs(omega - joint.omega) <= 2.0 * abs(ahead.parameter - here.parameter):
        # none, or another resonance
        found = None
    for fold in step.folds:
        before_fold = (fold - omega) * present.sign > FINE_STEP * fold
        if found is None or not before_fold or not run.is_stable(found.balance.joint, found.at):
            way = f'give sweep = "{"down" if sweeps.direction == "up" else "up"}"'
            over = f"the sweep {sweeps.direction} jumps over the resonance at {fold / (2.0 * math.pi):.6g} Hz"
            return Failure(Outcome.RESONANCE_LOST, f"{over}: {way}")
    if found is not None and not follow.low <= omega / (2.0 * math.pi) <= follow.high:
        return None
    if found is not None and follow.of == "peak":
        peak = solve_at_peak(path.case, found.balance, found.at.predicted_h, 0.5 * math.pi, run)
        found = None if peak is None else peak[0]
    if found is None:
        return Failure(Outcome.RESONANCE_LOST, f"no {follow.of} is found near {joint.omega / (2.0 * math.pi):.6g} Hz")
    return float(found.values[0]) / (2.0 * math.pi)

"""Unworn periodic states of a study's frequencies, each with the loading history that leads to it.

- "up", "down": the excitation frequency is swept slowly, as when a machine is run up or down. Along a branch that bends
  over, the two directions find different states.
- "ramp": the excitation is raised slowly at the frequency of the point, as when a flutter or a flow disturbance sets in
  at speed. Every point is independent of all others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from solver.accuracy.certificate import certify
from solver.accuracy.error_estimate import UNKNOWN
from solver.accuracy.refinement import Refined, refine, state_difference
from solver.clock import computing_time
from solver.continuation.first_state import solve_first_state
from solver.harmonic_balance.converged import PathPoint
from solver.loading_history.origin import Origin, find_origin
from solver.loading_history.origin import Sweep as Direction
from solver.loading_history.route import Step
from solver.loading_history.sweep import MOST_ITERATIONS, Sweep
from solver.model import FloatArray, ReducedModel
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Effort, OutOfTimeError, move_point
from solver.outcome import Outcome, describe_error
from solver.packing import Packed, pack, unpack
from solver.results.history import PeriodicState, StartState
from solver.results.state_report import periodic_state
from solver.settings import Resolution, SolverSettings, all_orders, allowed
from solver.stability.period_doubling import doubles_period
from solver.structure.joint import Case, build_case

OTHER_STARTS = (Resolution((1,), 64), Resolution((1, 2, 3), 256), Resolution(all_orders(15), 256))
FEW_PAIRS = 12  # up to which a state that is not accurate is sought from nothing as well: impacts have many others
AGAIN = 0.05  # of the frequency: how far behind the end of a walk, and how far apart, it is begun anew
MOST_AGAIN = 6  # attempts to begin it anew
FIRST_SHARE = 1e-3  # of the excitation: where a ramp begins
KEEP = 100  # iterations after which the progress is handed out


def follow_branch(
    model: ReducedModel,
    friction_coefficient: float | FloatArray | None,
    excitation_amplitude: float,
    frequencies: FloatArray,
    sweep: Direction,
    settings: SolverSettings,
    keep: Callable[[Packed], None] | None = None,
    resume: Packed | None = None,
) -> Iterator[tuple[int, StartState]]:
    """Unworn periodic states at the frequencies (Hz, ascending): index and state, one by one.

    A state depends on its own frequency and on no other: the sweep to it begins at a frequency that is the same for
    all points of a quarter octave (`origin`) and has steps of its own (`sweep`). Where the branch ends at a fold it is
    followed by arc length until it reaches the next node in a stable state, which is where a slow sweep of the machine
    would land if the branch is one curve; where that fails, the structure is left to settle in time from the last
    state, and at last the state is sought from nothing.
    excitation_amplitude in N.
    keep: called now and then, after the state was taken from the iterator, with the progress of the sweep. resume: such
        progress of a sweep that differs in its frequencies only. Frequencies beyond those that it had passed are
        reached from there; the states are the same to the last bit, but for `run_time`.
    """
    order = np.arange(frequencies.size)[:: -1 if sweep == "down" else 1]
    line = _Line(model, friction_coefficient, excitation_amplitude, sweep, settings)
    counted = 0
    if resume is not None:
        counted, carried = unpack(resume)
        line.load_state(carried)
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
                message=message,
            ),
        )
        started, counted = now, line.n_iterations
        if keep is not None and counted >= kept + KEEP and line.walk is not None:
            keep(pack((counted, line.state_dict())))
            kept = counted


class _Found:
    """What is known of the state at a frequency. branch, fold: folds jumped over before it, and the last, rad/s."""

    def __init__(self, outcome: Outcome, branch: int = 0, fold: float = float("nan")) -> None:
        self.outcome = outcome
        self.branch, self.fold = branch, fold
        self.state: PeriodicState | None = None
        self.coarse: PeriodicState | None = None
        self.resolution: Resolution | None = None
        self.estimate = UNKNOWN


class _Line:
    """The walks of a line of points: one for all that begin at the same origin, one for each of a ramp."""

    def __init__(
        self,
        model: ReducedModel,
        friction_coefficient: float | FloatArray | None,
        excitation_amplitude: float,
        sweep: Direction,
        settings: SolverSettings,
    ) -> None:
        self.model = model
        self.friction_coefficient = friction_coefficient
        self.excitation_amplitude = excitation_amplitude
        self.sweep = sweep
        self.settings = settings
        self.effort = Effort()
        self.origin: Origin | None = None
        self.walk: Sweep | None = None
        self._walked = 0

    @property
    def penalty_omega(self) -> float:
        """rad/s, where the penalty is taken."""
        return float("nan") if self.origin is None else 2.0 * np.pi * self.origin.penalty

    @property
    def resolution(self) -> Resolution:
        """Harmonics and samples of the walk."""
        return Resolution((1,), 4) if self.walk is None else self.walk.case.resolution

    @property
    def n_iterations(self) -> int:
        """Newton iterations so far."""
        return self.effort.iterations + (0 if self.walk is None else self.walk.effort.iterations)

    def set_deadline(self, deadline: float) -> None:
        """CPU time of the thread, s, after which the state that is sought is given up."""
        self.effort.deadline = deadline
        if self.walk is not None:
            self.walk.effort.deadline = deadline

    def state_dict(self) -> dict[str, Any]:
        """What goes on from frequency to frequency, to be packed."""
        assert self.walk is not None
        assert self.origin is not None
        own = {"own_iterations": self.effort.iterations, "omega": self.walk.omega}
        own["walked"] = max(self.walk.effort.iterations, self._walked)
        return self.walk.saved | own | {"origin": (self.origin.starts, self.origin.penalty, self.origin.cell)}

    def load_state(self, carried: dict[str, Any]) -> None:
        """Go on from what another one has carried so far."""
        self.origin = Origin(*carried.pop("origin"))
        self.effort.iterations = carried.pop("own_iterations")
        self._walked = carried.pop("walked")
        self.walk = self._new_walk(self.origin, carried.pop("omega"))
        self.walk.load_state(carried)

    def _new_walk(self, origin: Origin, omega: float | None) -> Sweep:
        case = build_case(self.model, self.friction_coefficient, 2.0 * np.pi * origin.penalty, self.settings)
        walk = Sweep(case, self.excitation_amplitude, -1.0 if self.sweep == "down" else 1.0, omega)
        walk.effort.deadline = self.effort.deadline
        return walk

    def advance(self, frequency: float) -> _Found:
        """State at the next frequency, Hz, with the harmonics that it needs."""
        origin, omega = find_origin(self.model, frequency, self.sweep), 2.0 * np.pi * frequency
        other_cell = self.origin is None or origin.cell != self.origin.cell
        if self.walk is None or self.sweep == "ramp" or other_cell or self.walk.has_passed(omega):
            self.origin = origin
            # one that was loaded has not gone again to where it was
            self.effort.iterations += max(0 if self.walk is None else self.walk.effort.iterations, self._walked)
            self._walked = 0
            self.walk = self._new_walk(origin, omega if self.sweep == "ramp" else None)
            self._begin(self.walk, origin)
        walk, target = self.walk, 1.0 if self.sweep == "ramp" else omega
        self._walk_to(walk, target)
        self.effort.limit = self.effort.iterations + MOST_ITERATIONS
        try:
            reached, coarse = walk.state_at(target, self.effort)
            case = walk.case
            if reached is None:
                case, point = self._first(omega)
                reached = None if point is None else Step(point)
            if reached is None:
                return _Found(self._why_lost(walk))
            refined = refine(case, omega, self.excitation_amplitude, reached.point, self.effort)
            if not refined.accurate and self.model.contact.n_contact <= FEW_PAIRS:
                refined = self._afresh(omega) or refined
        except np.linalg.LinAlgError:
            return _Found(Outcome.SINGULAR)
        # those of a ramp are no frequencies
        fold = float("nan") if self.sweep == "ramp" else (walk.fold, *reached.folds)[-1]
        found = _Found(Outcome.CONVERGED, walk.branch + len(reached.folds), fold)
        return self._judge(refined, omega, found, walk.coarse_route.case, coarse)

    def _judge(
        self, refined: Refined, omega: float, found: _Found, coarse_case: Case, coarse: PathPoint | None
    ) -> _Found:
        """Whether a refined state is a result, with its error and what the coarse walk has come to."""
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
        elif doubles_period(refined.case, joint, refined.point.evaluation, self.effort):
            found.outcome, found.state, found.coarse = Outcome.PERIOD_DOUBLED, None, None
        elif not refined.accurate:
            found.outcome = Outcome.INACCURATE
        return found

    def _begin(self, walk: Sweep, origin: Origin) -> None:
        """A state where the walk begins; none where there is none, or where the structure is singular there."""
        self.effort.limit = self.effort.iterations + MOST_ITERATIONS
        places = [2.0 * np.pi * start for start in origin.starts] or [FIRST_SHARE]
        for place in places:
            if self._begin_at(walk, place):
                return

    def _begin_at(self, walk: Sweep, place: float) -> bool:
        omega, share = (place, 1.0) if walk.omega is None else (walk.omega, place)
        try:
            case, point = self._first(omega, share)
        except np.linalg.LinAlgError:
            return False
        if point is None:
            return False
        walk.begin(case, PathPoint(place, point.evaluation, point.history))
        return True

    def _walk_to(self, walk: Sweep, target: float) -> None:
        """As far as the target; where the walk ends before, it is begun anew a little behind its end."""
        for _ in range(MOST_AGAIN):
            try:
                walk.walk_to(target)
            except np.linalg.LinAlgError:
                walk.lost_at = walk.here.parameter if walk.here is not None else walk.lost_at
                walk.here = walk.coarse = walk.ahead = None
            if walk.here is not None or walk.omega is not None or np.isnan(walk.lost_at):
                return
            behind = walk.lost_at * (1.0 + AGAIN * walk.direction)
            if (behind - target) * walk.direction >= 0.0:
                return
            self.effort.limit = self.effort.iterations + MOST_ITERATIONS
            if not self._begin_at(walk, behind):
                walk.lost_at = behind

    def _why_lost(self, walk: Sweep) -> Outcome:
        never = np.isnan(walk.lost_at)
        return walk.failure if never or walk.failure in (Outcome.UNSTABLE, Outcome.ADRIFT) else Outcome.BRANCH_LOST

    def _afresh(self, omega: float) -> Refined | None:
        """An accurate state from nothing with other harmonics, where those of the branch are a dead end."""
        for resolution in OTHER_STARTS[1:]:
            case, point = self._first_at(omega, 1.0, resolution)[1:]
            refined = None
            if point is not None:
                refined = refine(case, omega, self.excitation_amplitude, point, self.effort)
            if refined is not None and refined.accurate:
                return refined
        return None

    def _first(self, omega: float, share: float = 1.0) -> tuple[Case, PathPoint | None]:
        """A state from nothing; where the harmonics of the line find none, with others."""
        assert self.walk is not None
        others = OTHER_STARTS if self.settings.automatic else ()
        why = Outcome.START_FAILED
        for attempt, resolution in enumerate((self.walk.case.resolution, *others)):
            outcome, case, point = self._first_at(omega, share, resolution)
            if point is not None:
                return case, point
            # the first attempt says why there is none
            why = outcome if attempt == 0 else why
            if outcome is Outcome.STATIC_FAILED:
                why = outcome
                break
        self.walk.failure = why
        return self.walk.case, None

    def _first_at(self, omega: float, share: float, resolution: Resolution) -> tuple[Outcome, Case, PathPoint | None]:
        """A state from nothing with these harmonics and samples, as far as they are not fixed."""
        assert self.walk is not None
        case = self.walk.case.at(allowed(resolution, self.settings))
        unworn = np.zeros(self.model.contact.n_contact)
        outcome, found = solve_first_state(
            case, omega, share * self.excitation_amplitude, unworn, JacobianSolver(), self.effort
        )
        return outcome, case, None if found is None else PathPoint(omega, found.evaluation, found.history)

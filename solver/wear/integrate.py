"""The integration of a wear history over the slow time, and of its reference solution, step by step.

The reference solution is a second computation whose difference, pair by pair, is taken for the error. It starts from
another sweep, with a third of the nodes (`solver.loading_history`), and is coarser in all: its steps have twice the
tolerance, and it has the next lower harmonics and samples. Where pairs stick again, a resonance passes or a branch
ends, errors grow. The difference to the reference solution grows as well, a sum of local errors does not.

A history with given Euler steps is compared with the adaptive history, which all given steps share. A coarser history
with the same steps errs as they do: where a pair only just slips (dovetail, 16 pairs, 212.5 Hz) it sticks with implicit
steps, 1.89 mm3, with steps of 250 cycles 1.90; the truth is 2.03.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import astuple, dataclass, field, replace
from functools import partial
from typing import TypeVar

import numpy as np

from solver.accuracy.harmonic_levels import fewer, shifted
from solver.clock import computing_time
from solver.contact.wear_law import ARCHARD, WearLaw
from solver.continuation.natural import NEAR_ITERATIONS
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import Failure
from solver.model import FloatArray, ReducedModel
from solver.newton.run import OutOfTimeError
from solver.outcome import Outcome, describe_error
from solver.packing import Packed, in_rows, pack, packable
from solver.results.history import StartState
from solver.settings import FIRST_HARMONICS, FollowedFrequency, Resolution, SolverSettings, ToTheEnd, WearTarget
from solver.structure.joint import Case
from solver.wear.check import AS_ASKED, Checked, full_check, report_only, unstable_at_end, why_ended
from solver.wear.course import Course
from solver.wear.step import Adaptive, Steps, WearLine
from solver.wear.wearing_joint import WearingJoint, WearState

T = TypeVar("T")

Check = Callable[[WearingJoint, WearState], Checked | Failure]
"""Gives a state with its report, or the reason of its rejection."""

ENDS_ALL = (Outcome.TIME_LIMIT, Outcome.EXCEPTION)
"""Ends of an integration that end the whole history, and after which no other solution is integrated."""

RTOL_RATIO = 2.0
"""Ratio of the step tolerances of reference solution and adaptive history: BDF2 steps are then a quarter longer. With 4
the steps of a reference solution are too long for pairs that stick again: dovetail, 16 pairs, 13 harmonics, 212.75 Hz:
1.208 mm3 for 1.540, an error of 32 % where 0.4 % is true."""

HISTORY_ITERATIONS = 3000
"""Most Newton iterations of a history or a reference solution, in addition to `NEAR_ITERATIONS` for each step. A
travelling wave at its resonance: 1400 in a corner within 500 cycles."""

ITERATIONS_PER_SAVE = 100
"""Newton iterations after which a history is saved and its factorisation dropped, so that a resumed history is equal to
the last bit: 1 s of 48 pairs, 17 s of 336. The cost of one more factorisation is negligible."""


@dataclass(frozen=True)
class SlowTime:
    """What a wear history is asked for, Eqs. (20) to (26).

    wear_coefficient: k_w, 1/Pa. law: part of the slip work that wears.
    steps: `Given`, `LargestDepth` or `Adaptive`.
    cycles (n_output,): ascending counts to report, the first 0; the last Euler step ends at the last one. Or
        `ToTheEnd`: until nothing wears any more, at counts chosen from the result; not with explicit steps, which
        cannot grow.
    until: target of the wear; the history ends with the step that reaches the target. None for no target.
    loops: pairs with reported fretting loops.
    ends_at_last: whether the last adaptive step ends at the last count, for a joint that vibrates otherwise from there.
    follow: what the frequency of the excitation follows; None for that of the start state.
    """

    wear_coefficient: float
    steps: Steps
    cycles: FloatArray | ToTheEnd
    law: WearLaw = ARCHARD
    until: WearTarget | None = None
    loops: tuple[int, ...] = ()
    ends_at_last: bool = False
    follow: FollowedFrequency | None = None

    @property
    def adaptive(self) -> bool:
        """Whether the steps control their own error."""
        return self.steps.scheme == "adaptive"

    @property
    def end(self) -> float:
        """Last cycle count; inf where it is not known."""
        return math.inf if isinstance(self.cycles, ToTheEnd) else float(self.cycles[-1])

    @property
    def name(self) -> str:
        """Tells apart histories from one start state with one wear coefficient and law."""
        target = None if self.until is None else astuple(self.until)
        return f"{self.steps!r} {self.end!r} {target!r}"

    def adaptive_to(self, reached: float, rtol: float) -> SlowTime:
        """The adaptive history with which one with given steps is compared, that has come to the count `reached`.

        Equal for all given steps to one last count; to another end it is no longer than needed.
        """
        known = self.end < math.inf and self.until is None
        never = None if self.until is None else replace(self.until, value=math.inf)
        cycles = self.cycles if known else np.array([0.0, reached])
        return replace(self, steps=Adaptive(rtol), cycles=cycles, until=never)

    @property
    def shifts(self) -> bool:
        """Whether the history ends at a shift of the resonance of the vibration."""
        return self.until is not None and self.until.quantity == "frequency_shift"


@packable
@dataclass(frozen=True)
class Guide:
    """What a reference solution takes from its history.

    resolutions: cycle count from which on a resolution holds, and this resolution; of a passage the frequency, Hz.
    step_limit: largest stable explicit step, cycles.
    """

    resolutions: tuple[tuple[float, Resolution], ...]
    step_limit: float


@packable
@dataclass(frozen=True)
class Ended:
    """A finished integration.

    state: the last one; None where there is no first state. failure: reason of the end; CONVERGED for a regular end.
    course: all steps. iterations, seconds: Newton iterations and CPU time.
    """

    state: WearState | None
    failure: Failure
    course: Course
    iterations: int
    seconds: float


@packable
@dataclass(frozen=True)
class Progress:
    """How far the integrations from one start state are.

    done: those that are complete, by name. name: of the present one; state, course, iterations, seconds: its progress.
    """

    done: dict[str, Ended] = field(default_factory=dict)
    name: str = ""
    state: WearState | None = None
    course: Course | None = None
    iterations: int = 0
    seconds: float = 0.0


class Integrations:
    """Histories from one start state, which exists, and their reference solutions, each integrated once.

    keep: called from time to time with the packed progress. progress: to go on from.
    """

    def __init__(
        self,
        case: Case,
        start: StartState,
        keep: Callable[[Packed], None] | None = None,
        progress: Progress | None = None,
    ) -> None:
        self._case, self._start, self._keep, self._resumed = case, start, keep, progress or Progress()
        self._done = dict(self._resumed.done)

    def history(self, asked: SlowTime, spent: float = 0.0, *, stable_end: bool = True) -> Ended:
        """Integrate a history.

        spent: CPU seconds of its time limit that are gone. stable_end: whether the stability of its last state is
        tested.
        """
        work, counts, share = self._joint(asked), np.zeros(0), 0.0
        if isinstance(asked.cycles, ToTheEnd):
            share = asked.cycles.final_share
        else:
            counts = asked.cycles
        # adaptive steps go beyond the last count, where nothing else begins there
        line = WearLine(work, asked.steps, math.inf if asked.adaptive and not asked.ends_at_last else asked.end)
        check = partial(full_check, loops=asked.loops, with_resonance=asked.shifts)
        course = Course(work.area, asked.adaptive, counts, asked.until, share)
        return self._integrated(asked.name, line, check, work.begin, course, spent, stable_end=stable_end)

    def reference(self, asked: SlowTime, guide: Guide, compared: FloatArray, spent: float = 0.0) -> Ended:
        """Integrate the reference solution of an adaptive history of which the start state may be another one.

        compared (n,): ascending counts at which it is read, the first 0. spent: as for `history`.
        """
        work, end = self._joint(asked), float(compared[-1])
        work.run = work.run.to(self._case.settings.rough_tolerance)
        resolutions = tuple((count, coarser(resolution, self._case.model)) for count, resolution in guide.resolutions)
        # a short history may consist of its first steps, which do not depend on rtol
        steps = Adaptive(RTOL_RATIO * self._case.settings.rtol, 2.0 if asked.ends_at_last else 1.0)
        line = WearLine(work, steps, end if asked.ends_at_last else math.inf, bounded=False)
        check = partial(report_only, resolutions=resolutions, with_resonance=asked.shifts)
        first = partial(begin_reference, work, guide.step_limit)
        course = Course(work.area, smooth=True, counts=compared)
        return self._integrated(f"{asked.name} reference", line, check, first, course, spent)

    def _joint(self, asked: SlowTime) -> WearingJoint:
        return WearingJoint(self._case, self._start, asked.wear_coefficient, asked.law, asked.follow)

    def _integrated(
        self,
        name: str,
        line: WearLine,
        check: Check,
        first: Callable[[], WearState],
        course: Course,
        spent: float,
        *,
        stable_end: bool = False,
    ) -> Ended:
        """Integrate from the first or the saved state to the end. course: without steps."""
        if name in self._done:
            return self._done[name]
        work, budget, saved, state = line.work, line.work.run.budget, self._resumed, None
        began = computing_time()
        if saved.name == name and saved.course is not None:
            state, course, budget.iterations = saved.state, saved.course, saved.iterations
            began -= saved.seconds
        budget.deadline, saved_at = began + self._case.settings.time_limit - spent, budget.iterations
        while True:
            if state is not None:
                ended = why_ended(work, state, course)
                if ended is None and budget.iterations > HISTORY_ITERATIONS + NEAR_ITERATIONS * len(course.ends):
                    ended = Failure(Outcome.MARCH_FAILED)
                if ended is not None:
                    break
            after = guarded(partial(_next, line, check, first, state, course))
            if isinstance(after, Failure):
                ended = after
                break
            state, course = after
            if budget.iterations >= saved_at + ITERATIONS_PER_SAVE:
                # done in every history, so that an interrupted one gives equal numbers
                state, saved_at = in_rows(state), budget.iterations
                work.drop_factor()
                if self._keep is not None:
                    # what its time limit has ended is not complete
                    done = {key: each for key, each in self._done.items() if each.failure.outcome not in ENDS_ALL}
                    self._keep(pack(Progress(done, name, state, course, saved_at, computing_time() - began)))
        if state is not None and ended is AS_ASKED:
            if state.cycle < course.end < math.inf and not state.wears:
                # nothing wears any more: the state holds for all later counts
                course = course.after(course.end, course.nodes[-1].report, course.nodes[-1].rate, 0.0)
            if stable_end:
                ended = guarded(partial(unstable_at_end, work, state)) or ended
        self._done[name] = Ended(state, ended, course, budget.iterations, computing_time() - began)
        return self._done[name]


def coarser(resolution: Resolution, model: ReducedModel) -> Resolution:
    """Harmonics and samples of the reference solution: those of the next lower level.

    With one harmonic alone a joint that slips is another joint: three harmonics or one become more, where the model has
    matrices for them.
    """
    richer = shifted(resolution, 1)
    if resolution.highest <= FIRST_HARMONICS and model.holds(richer.highest):
        return richer
    # of automatic settings, which reduce both harmonics and samples
    return fewer(resolution, SolverSettings())


def begin_reference(work: WearingJoint, step_limit: float) -> WearState:
    """The unworn state of the reference solution.

    The state of the reference sweep has another tangential history, which may decide whether a pair goes on slipping
    while the joint wears. So the state is solved with twice the difference (dovetail, 212.5 Hz: 0.082 or 0.106 mm3;
    both sweeps lead to 0.082, twice their difference to 0.097); where it is not found, that of the sweep is taken.
    """
    begun, fine, reference = work.begin(step_limit, of_reference=True), work.start.state, work.start.reference
    if fine is None or reference is None:
        return begun
    history = fine.start_history + 2.0 * (reference.start_history - fine.start_history)
    balance, first = Balance(work.joint_of(begun), history, begun.depth), begun.point.evaluation.predicted_h
    point = work.run.state(balance, first, most=NEAR_ITERATIONS)
    return begun if point is None else work.with_rates(replace(begun, point=point))


def guarded(compute: Callable[[], T]) -> T | Failure:
    """Result of a computation, or its error as a failure."""
    try:
        return compute()
    except np.linalg.LinAlgError:
        return Failure(Outcome.SINGULAR)
    except OutOfTimeError:
        return Failure(Outcome.TIME_LIMIT)
    except Exception as error:
        # an error spoils one point only: the study goes on
        return Failure(Outcome.EXCEPTION, describe_error(error))


def _next(
    line: WearLine, check: Check, first: Callable[[], WearState], before: WearState | None, course: Course
) -> tuple[WearState, Course] | Failure:
    """The first state, or that at the end of the next step, checked and stored; or why there is none."""
    work, error = line.work, 0.0
    if before is None:
        found = work.at_followed(first())
    else:
        step = line.step(before)
        if isinstance(step, Failure):
            return step
        found, error = work.out_of_range(step.state) or step.state, step.error
    checked = found if isinstance(found, Failure) else check(work, found)
    if isinstance(checked, Failure):
        return checked
    state, report = checked
    course = course.after(state.cycle, report, work.rate(state.point.evaluation), error)
    return state if before is not None else line.begin(state), course

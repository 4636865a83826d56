"""The integration of a wear history over the slow time, and of its reference solution, step by step.

The reference solution is a second computation whose difference, pair by pair, is taken for the error. It starts from
another sweep: a third of the nodes, placed between those of the fine sweep (`solver.loading_history`). It is coarser in
all: its steps on the slow time have twice the tolerance, and it has the next lower harmonics (the next higher ones
where the harmonics are few) with the samples that belong to them. Some events make an error grow: pairs stick again, a
resonance passes, a branch ends. The difference to the reference solution grows as well, a sum of local errors does not.

A history with given Euler steps has no reference solution of its own: it is compared with the adaptive history, whose
errors are known, and which all given steps share. A coarser history with the same steps errs as they do: where a pair
only just slips (dovetail, 16 pairs, 212.5 Hz) it sticks with implicit steps, 1.89 mm3, with steps of 250 cycles 1.90;
the truth is 2.03.
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
from solver.packing import in_rows, packable
from solver.results.history import StartState
from solver.settings import FIRST_HARMONICS, FollowedFrequency, Resolution, SolverSettings, ToTheEnd, WearTarget
from solver.structure.joint import Case
from solver.wear.check import AS_ASKED, Checked, full_check, report_only, unstable_at_end, why_ended
from solver.wear.course import Course
from solver.wear.step import Adaptive, Steps, WearLine
from solver.wear.wearing_joint import WearingJoint, WearState

T = TypeVar("T")

RTOL_RATIO = 2.0
"""Ratio of the step tolerances of reference solution and adaptive history: BDF2 steps are then a quarter longer. With 4
the steps of a reference solution are too long for pairs that stick again: dovetail, 16 pairs, 13 harmonics, 212.75 Hz:
1.208 mm3 for 1.540, an error of 32 % where 0.4 % is true."""

HISTORY_ITERATIONS = 3000
"""Most Newton iterations of a history, in addition to `NEAR_ITERATIONS` for each step, and of its reference solution,
in addition to those of the history. A travelling wave at its resonance: 1400 in a corner within 500 cycles."""

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

        Equal for all histories with given steps to one last count; to another end it is no longer than needed.
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
class Like:
    """What a reference solution takes from its history.

    resolutions: cycle count from which on a resolution holds, and this resolution; of a passage the frequency, Hz.
    step_limit: largest stable explicit step, cycles. iterations: of Newton's method.
    """

    resolutions: tuple[tuple[float, Resolution], ...]
    step_limit: float
    iterations: int


@packable
@dataclass(frozen=True)
class Ended:
    """A finished integration.

    state: the last one; None where there is no first state. failure: reason of the end; CONVERGED for a regular end.
    course: all steps. iterations: Newton iterations spent.
    """

    state: WearState | None
    failure: Failure
    course: Course
    iterations: int


@packable
@dataclass(frozen=True)
class Saved:
    """The progress of a history and its reference solution, from which both go on.

    state, course, iterations: of the present integration.
    fine: the finished history, while its reference solution is integrated; else None.
    spent: CPU seconds so far.
    """

    state: WearState
    course: Course
    iterations: int
    fine: Ended | None
    spent: float


@dataclass
class Integration:
    """Integrates a history and, where its steps are adaptive, its reference solution, one after the other.

    case, start, asked: as in `history.integrate_wear`; the start state exists.
    keep: called from time to time with the progress; None for no calls.
    saved: progress to go on from; None to begin.
    began: CPU time, s, at which the computation would have begun without an interruption.
    """

    case: Case
    start: StartState
    asked: SlowTime
    keep: Callable[[Saved], None] | None = None
    saved: Saved | None = None
    began: float = field(init=False)

    def __post_init__(self) -> None:
        self.began = computing_time() - (self.saved.spent if self.saved is not None else 0.0)

    @property
    def spent(self) -> float:
        """CPU seconds so far, those before an interruption included."""
        return computing_time() - self.began

    def history(self, *, stable_end: bool = True) -> Ended:
        """Integrate the history. stable_end: whether the stability of its last state is tested."""
        if self.saved is not None and self.saved.fine is not None:
            return self.saved.fine
        asked, work, counts, share = self.asked, self._joint(), np.zeros(0), 0.0
        if isinstance(asked.cycles, ToTheEnd):
            share = asked.cycles.final_share
        else:
            counts = asked.cycles
        # adaptive steps go beyond the last count, where nothing else begins there
        line = WearLine(work, asked.steps, math.inf if asked.adaptive and not asked.ends_at_last else asked.end)
        check = partial(full_check, loops=asked.loops, with_resonance=asked.shifts)
        course = Course(work.area, asked.adaptive, counts, asked.until)
        ended = self._integrate(line, check, work.begin, course, HISTORY_ITERATIONS, share=share)
        state = ended.state
        if state is None or ended.failure.outcome is not Outcome.CONVERGED or not stable_end:
            return ended
        unstable = guarded(lambda: unstable_at_end(work, state))
        return replace(ended, failure=unstable or ended.failure, iterations=work.run.budget.iterations)

    def reference(self, fine: Ended, counts: FloatArray) -> Ended:
        """Integrate the reference solution of an adaptive history, read at counts (n,) and at the ends of its steps."""
        assert fine.state is not None
        like = Like(fine.course.resolutions, fine.state.step_limit, fine.iterations)
        reached = min(fine.course.ends[-1], self.asked.end)
        # NaN where no target was reached
        compared = np.concatenate([[0.0, fine.course.reached], counts, fine.course.dense.counts])
        return self.follow(like, np.unique(compared[compared <= reached]), fine)

    def follow(self, like: Like, compared: FloatArray, fine: Ended | None = None) -> Ended:
        """Integrate the reference solution of an adaptive history of which the start state may be another one.

        compared (n,): ascending counts at which it is read, the first 0.
        fine: the history, to be saved with the progress.
        """
        work, asked, end = self._joint(), self.asked, float(compared[-1])
        resolutions = tuple((count, coarser(resolution, self.case.model)) for count, resolution in like.resolutions)
        # a short history may consist of its first steps, which do not depend on rtol
        steps = Adaptive(RTOL_RATIO * self.case.settings.rtol, 2.0 if asked.ends_at_last else 1.0)
        line = WearLine(work, steps, end if asked.ends_at_last else math.inf)
        check = partial(report_only, resolutions=resolutions, with_resonance=asked.shifts)
        first = partial(begin_reference, work, like.step_limit)
        course = Course(work.area, smooth=True, counts=compared)
        return self._integrate(line, check, first, course, like.iterations + HISTORY_ITERATIONS, fine)

    def _joint(self) -> WearingJoint:
        """The joint, with the rest of the time limit."""
        asked = self.asked
        work = WearingJoint(self.case, self.start, asked.wear_coefficient, asked.law, asked.follow)
        work.run.budget.deadline = self.began + self.case.settings.time_limit
        return work

    def _integrate(
        self,
        line: WearLine,
        check: Callable[[WearingJoint, WearState], Checked | Failure],
        first: Callable[[], WearState],
        course: Course,
        most: int,
        fine: Ended | None = None,
        share: float = 0.0,
    ) -> Ended:
        """Integrate from the first or the saved state to the end.

        check: gives a state with its report, or the reason of its rejection. first: gives the first state.
        course: without steps. most: Newton iterations, in addition to `NEAR_ITERATIONS` for each step.
        share: `ToTheEnd.final_share` of a history to the end of wear.
        """
        work, budget, state = line.work, line.work.run.budget, None
        if self.saved is not None:
            state, course, budget.iterations = self.saved.state, self.saved.course, self.saved.iterations
            self.saved = None
        saved_at = budget.iterations
        while True:
            if state is not None:
                ended = why_ended(work, state, course, share)
                if ended is None and budget.iterations > most + NEAR_ITERATIONS * len(course.ends):
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
                if self.keep is not None:
                    self.keep(Saved(state, course, budget.iterations, fine, self.spent))
        if state is not None and ended is AS_ASKED and state.cycle < course.end < math.inf and not state.wears:
            # nothing wears any more: the state holds for all later counts
            course = course.after(course.end, course.nodes[-1].report, course.nodes[-1].rate, 0.0)
        return Ended(state, ended, course, budget.iterations)


def coarser(resolution: Resolution, model: ReducedModel) -> Resolution:
    """Harmonics and samples of the reference solution: those of the next lower level.

    With one harmonic alone a joint that slips is another joint. So the reference solution of a history with three
    harmonics or one has the next higher level, where the model has matrices for it.
    """
    richer = shifted(resolution, 1)
    if resolution.highest <= FIRST_HARMONICS and model.holds(richer.highest):
        return richer
    # of automatic settings, which reduce both harmonics and samples
    return fewer(resolution, SolverSettings())


def begin_reference(work: WearingJoint, step_limit: float) -> WearState:
    """The unworn state of the reference solution.

    The state of the reference sweep differs from the start state in its tangential history. Even a small difference may
    decide whether a pair goes on slipping while the joint wears. So the state is solved with twice the difference
    (dovetail, 212.5 Hz: the worn volume is 0.082 or 0.106 mm3; both sweeps lead to 0.082, twice their difference to
    0.097). Where this state is not found, the state of the reference sweep is taken.
    """
    begun, fine, reference = work.begin(step_limit, of_reference=True), work.start.state, work.start.reference
    if fine is None or reference is None:
        return begun
    history = fine.start_history + 2.0 * (reference.start_history - fine.start_history)
    balance, first = Balance(work.at(begun), history, begun.depth), begun.point.evaluation.predicted_h
    point = work.run.state(balance, first, most=NEAR_ITERATIONS)
    return begun if point is None else work.noted(replace(begun, point=point))


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
    line: WearLine,
    check: Callable[[WearingJoint, WearState], Checked | Failure],
    first: Callable[[], WearState],
    before: WearState | None,
    course: Course,
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

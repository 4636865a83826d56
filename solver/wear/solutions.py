"""The two integrations of a wear history: the history itself and its reference solution."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import astuple, dataclass, field, replace

import numpy as np

from solver.accuracy.reference import RTOL_RATIO, coarser
from solver.clock import computing_time
from solver.contact.wear_law import ARCHARD, WearLaw
from solver.continuation.natural import NEAR_ITERATIONS
from solver.harmonic_balance.dlft import Balance
from solver.model import FloatArray
from solver.outcome import Outcome
from solver.packing import packable
from solver.results.history import StartState
from solver.settings import Resolution, ToTheEnd, WearTarget
from solver.structure.joint import Case
from solver.wear.check import FullCheck, PlainCheck, unstable_at_end
from solver.wear.control import Adaptive, Steps, WearLine
from solver.wear.course import Course
from solver.wear.integrate import HISTORY_ITERATIONS, Ended, Integration, guarded
from solver.wear.state import WearState
from solver.wear.wearing_joint import FIXED, Fixed, WearingJoint


@dataclass(frozen=True)
class SlowTime:
    """What a wear history is asked for, Eqs. (20) to (26).

    wear_coefficient: k_w, 1/Pa.
    steps: `Given`, `LargestDepth` or `Adaptive`.
    cycles (n_output,): ascending counts to report, the first 0; the last Euler step ends at the last one. Or
        `ToTheEnd`: until nothing wears any more, at counts chosen from the result; not with explicit steps, which
        cannot grow.
    law: part of the slip work that wears.
    until: target of the wear; the history ends with the step that reaches the target. None for no target.
    loops: pairs with reported fretting loops.
    ends_at_last: whether the last adaptive step ends at the last count, for a joint that vibrates otherwise from there.
    where: at which frequency the joint is excited, `Fixed` or `Following`.
    """

    wear_coefficient: float
    steps: Steps
    cycles: FloatArray | ToTheEnd
    law: WearLaw = ARCHARD
    until: WearTarget | None = None
    loops: tuple[int, ...] = ()
    ends_at_last: bool = False
    where: Fixed = FIXED

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
    step_limit: largest stable explicit step of the history, cycles.
    iterations: Newton iterations of the history.
    """

    resolutions: tuple[tuple[float, Resolution], ...]
    step_limit: float
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
class Solutions:
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
        asked, work = self.asked, self._joint()
        counts, share = (
            (np.zeros(0), asked.cycles.final_share) if isinstance(asked.cycles, ToTheEnd) else (asked.cycles, 0.0)
        )
        # adaptive steps go beyond the last count, where nothing else begins there
        limit = math.inf if asked.adaptive and not asked.ends_at_last else asked.end
        integration = Integration(
            WearLine(work, asked.steps, limit),
            FullCheck(asked.loops, with_resonance=asked.shifts),
            lambda state, course: self._save(work, state, course, None),
            HISTORY_ITERATIONS,
            share,
        )
        course = Course(work.area, asked.adaptive, counts, asked.until)
        ended = self._run(integration, work.begin, course)
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
        compared = np.concatenate([[0.0, fine.course.reached], counts, fine.course.cycles])
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
        integration = Integration(
            WearLine(work, steps, end if asked.ends_at_last else math.inf, bounded=False),
            PlainCheck(resolutions, with_resonance=asked.shifts),
            lambda state, course: self._save(work, state, course, fine),
            like.iterations + HISTORY_ITERATIONS,
        )
        course = Course(work.area, smooth=True, counts=compared)
        return self._run(integration, lambda: begin_reference(work, like.step_limit), course)

    def _joint(self) -> WearingJoint:
        """The joint, with the rest of the time limit."""
        asked = self.asked
        work = WearingJoint(self.case, self.start, asked.wear_coefficient, asked.law, asked.where)
        work.run.budget.deadline = self.began + self.case.settings.time_limit
        return work

    def _run(self, integration: Integration, first: Callable[[], WearState], course: Course) -> Ended:
        """Run an integration from its first or its saved state."""
        saved, self.saved = self.saved, None
        if saved is None:
            return integration.begin(first, course)
        integration.line.work.run.budget.iterations = saved.iterations
        return integration.go_on(saved.state, saved.course)

    def _save(self, work: WearingJoint, state: WearState, course: Course, fine: Ended | None) -> None:
        """Pass the progress of an integration to `keep`."""
        if self.keep is not None:
            self.keep(Saved(state, course, work.run.budget.iterations, fine, self.spent))


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

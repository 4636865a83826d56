"""The two integrations of a wear history: the history itself and its reference solution."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import astuple, dataclass, field, replace

import numpy as np

from solver.accuracy.error_estimate import NOTHING, Estimate
from solver.accuracy.reference import RTOL_RATIO, coarser
from solver.clock import computing_time
from solver.contact.wear_law import ARCHARD, WearLaw
from solver.continuation.natural import NEAR_ITERATIONS
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import Failure
from solver.model import FloatArray
from solver.outcome import Outcome
from solver.packing import packable
from solver.results.history import StartState
from solver.settings import FollowedFrequency, Resolution, Scheme, ToTheEnd, WearTarget
from solver.structure.joint import Case
from solver.wear.check import FullCheck, PlainCheck, unstable_at_end
from solver.wear.control import Adaptive, Given, Growing, LargestDepth, Steps
from solver.wear.integrate import HISTORY_ITERATIONS, Integration, guarded
from solver.wear.output import DenseOutput, OutputState
from solver.wear.state import WearState
from solver.wear.wearing_joint import WearingJoint
from solver.wear.where import Fixed, Following


@dataclass(frozen=True)
class SlowTime:
    """Scheme, counts and wear law of a wear history, Eqs. (20) to (26).

    wear_coefficient: k_w, 1/Pa.
    scheme: "explicit" (Eq. (20)), "implicit" (Eq. (24)) or "adaptive" (`solver.wear.step`).
    cycles (n_output,): ascending counts to report, the first 0. Values are interpolated within the steps; the last
        Euler step ends at the last count. Or `ToTheEnd`: until nothing wears any more, at counts chosen from the
        result. Then the steps grow without bound, which is not allowed for explicit steps.
    step: h, cycles; the adaptive scheme chooses its own steps.
    largest_depth: m; if given, the steps of the explicit scheme follow from Eq. (22) instead of `step`.
    law: part of the slip work that wears.
    until: target of the wear; the history ends with the step that reaches the target. None for no target.
    loops: pairs with reported fretting loops.
    ends_at_last: whether the last adaptive step ends at the last count, for a joint that vibrates otherwise from there.
    follow: what the frequency of the excitation follows; None for the frequency of the start state.
    """

    wear_coefficient: float
    scheme: Scheme
    cycles: FloatArray | ToTheEnd
    step: float = math.inf
    largest_depth: float | None = None
    law: WearLaw = ARCHARD
    until: WearTarget | None = None
    loops: tuple[int, ...] = ()
    ends_at_last: bool = False
    follow: FollowedFrequency | None = None

    @property
    def end(self) -> float:
        """Last cycle count; inf where it is not known."""
        return math.inf if isinstance(self.cycles, ToTheEnd) else float(self.cycles[-1])

    @property
    def where(self) -> Fixed:
        """At which frequency the joint is excited."""
        return Fixed() if self.follow is None else Following(self.follow)

    def steps(self, work: WearingJoint) -> Steps:
        """The steps of the history."""
        if self.scheme == "adaptive":
            return Adaptive(work, work.case.settings.rtol, self.last_step_end(self.end))
        given = work, self.scheme, self.step, self.end
        if isinstance(self.cycles, ToTheEnd):
            return Growing(*given)
        if self.scheme == "explicit" and self.largest_depth is not None:
            return LargestDepth(*given, self.largest_depth)
        return Given(*given)

    @property
    def name(self) -> str:
        """Tells apart histories from one start state with one wear coefficient and law."""
        target = None if self.until is None else astuple(self.until)
        return f"{self.scheme} {self.step!r} {self.largest_depth!r} {self.end!r} {target!r}"

    def adaptive_to(self, reached: float) -> SlowTime:
        """The adaptive history with which one with given steps is compared, that has come to the count `reached`.

        Equal for all histories with given steps to one last count; to another end it is no longer than needed.
        """
        known = self.end < math.inf and self.until is None
        cycles = self.cycles if known else np.array([0.0, reached])
        never = None if self.until is None else replace(self.until, value=math.inf)
        return replace(self, scheme="adaptive", step=math.inf, largest_depth=None, cycles=cycles, until=never)

    def last_step_end(self, last: float) -> float:
        """Count beyond which no adaptive step goes; last: last count of the integration."""
        return last if self.ends_at_last else math.inf


@packable
@dataclass(frozen=True)
class Ended:
    """A finished integration.

    state: last state; None where there is no first state.
    failure: reason of the end; the outcome CONVERGED for a regular end.
    output: data of the output.
    iterations: Newton iterations spent.
    """

    state: WearState | None
    failure: Failure
    output: OutputState
    iterations: int


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

    state, n_steps, output, iterations: of the present integration.
    fine: the finished history, while its reference solution is integrated; else None.
    spent: CPU seconds so far.
    """

    state: WearState
    n_steps: int
    output: OutputState
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
    fine: Ended | None = field(init=False, default=None)
    began: float = field(init=False)

    def __post_init__(self) -> None:
        self.began = computing_time()
        if self.saved is not None:
            self.fine = self.saved.fine
            self.began -= self.saved.spent

    @property
    def spent(self) -> float:
        """CPU seconds so far, those before an interruption included."""
        return computing_time() - self.began

    def history(self, *, stable_end: bool = True) -> Ended:
        """Integrate the history. stable_end: whether the stability of its last state is tested."""
        if self.fine is not None:
            return self.fine
        asked, start = self.asked, self.start
        work = self._joint()
        integration = Integration(
            asked.steps(work),
            FullCheck(asked.loops, with_resonance=self._shifts),
            DenseOutput(work.area, asked.scheme == "adaptive", self._given_counts, asked.until),
            lambda state, n_steps: self._save(integration, state, n_steps, None),
            HISTORY_ITERATIONS,
            asked.end,
            asked.cycles.final_share if isinstance(asked.cycles, ToTheEnd) else 0.0,
        )
        estimate, accurate = Estimate(start.response_error, start.wear_rate_error), start.outcome is Outcome.CONVERGED
        first = start.state
        assert first is not None
        ended = self._run(integration, lambda: work.begin(first, start.resolution, estimate, accurate=accurate))
        if ended.state is None or ended.failure.outcome is not Outcome.CONVERGED or not stable_end:
            return ended
        state = ended.state
        unstable = guarded(lambda: unstable_at_end(work, state))
        return replace(ended, failure=unstable or ended.failure, iterations=work.run.budget.iterations)

    def reference(self, fine: Ended) -> Ended:
        """Integrate the reference solution of an adaptive history, for all counts at which both are read."""
        assert fine.state is not None
        like = Like(fine.output.course.resolutions, fine.state.step_limit, fine.iterations)
        reached = min(fine.output.course.ends[-1], self.asked.end)
        # NaN where no target was reached
        counts = np.concatenate([[0.0, fine.output.reached], self.counts(fine), fine.output.cycles])
        return self.follow(like, np.unique(counts[counts <= reached]), fine)

    def follow(self, like: Like, compared: FloatArray, fine: Ended | None = None) -> Ended:
        """Integrate the reference solution of an adaptive history of which the start state may be another one.

        compared (n,): ascending counts at which it is read, the first 0.
        fine: the history, to be saved with the progress.
        """
        work, asked, end = self._joint(), self.asked, float(compared[-1])
        resolutions = tuple((count, coarser(resolution, self.case.model)) for count, resolution in like.resolutions)
        # a short history may consist of its first steps, which do not depend on rtol
        first = 2.0 if asked.ends_at_last else 1.0
        integration = Integration(
            Adaptive(work, RTOL_RATIO * self.case.settings.rtol, asked.last_step_end(end), first, bounded=False),
            PlainCheck(resolutions, with_resonance=self._shifts),
            DenseOutput(work.area, smooth=True, counts=compared),
            lambda state, n_steps: self._save(integration, state, n_steps, fine),
            like.iterations + HISTORY_ITERATIONS,
            end,
        )
        return self._run(integration, lambda: begin_reference(work, self.start, like.step_limit))

    @property
    def _shifts(self) -> bool:
        """Whether the history ends at a shift of the resonance of the vibration."""
        return self.asked.until is not None and self.asked.until.quantity == "frequency_shift"

    def counts(self, fine: Ended) -> FloatArray:
        """Counts (n_output,) at which the history is read."""
        if not isinstance(self.asked.cycles, ToTheEnd):
            return self.asked.cycles
        if not fine.output.nodes:
            return np.zeros(self.asked.cycles.n_outputs)
        return self.output_of(fine).even_counts(self.asked.cycles.n_outputs)

    @property
    def _given_counts(self) -> FloatArray:
        return np.zeros(0) if isinstance(self.asked.cycles, ToTheEnd) else self.asked.cycles

    def output_of(self, fine: Ended) -> DenseOutput:
        """The output of the history, to be read."""
        return self._output(fine, smooth=self.asked.scheme == "adaptive")

    def output_of_reference(self, ended: Ended) -> DenseOutput:
        """The output of the reference solution, to be read."""
        return self._output(ended, smooth=True)

    def _output(self, ended: Ended, *, smooth: bool) -> DenseOutput:
        return DenseOutput(self.case.model.contact.area, smooth, np.zeros(0), self.asked.until, ended.output)

    def _joint(self) -> WearingJoint:
        """The joint, with the rest of the time limit."""
        asked = self.asked
        assert self.start.state is not None
        work = WearingJoint.of(self.case, self.start.state, asked.wear_coefficient, asked.law, asked.where)
        work.run.budget.deadline = self.began + self.case.settings.time_limit
        return work

    def _run(self, integration: Integration, begin: Callable[[], WearState]) -> Ended:
        """Run an integration from its first or its saved state."""
        output, budget = integration.output, integration.steps.work.run.budget
        n_steps, saved, self.saved = 0, self.saved, None
        first: WearState | Failure
        if saved is not None:
            budget.iterations, output.taken = saved.iterations, saved.output
            first, n_steps = saved.state, saved.n_steps
        else:
            first = guarded(lambda: integration.begin(begin()))
        if isinstance(first, Failure):
            return Ended(None, first, output.taken, budget.iterations)
        state, failure = integration.run(first, n_steps)
        last, over = output.last, state.cycle < integration.end < math.inf and not state.wears
        if failure.outcome is Outcome.CONVERGED and last is not None and over:
            # nothing wears any more: the state holds for all later counts
            output.add(integration.end, last.report, last.rate, 0.0)
        return Ended(state, failure, output.taken, budget.iterations)

    def _save(self, integration: Integration, state: WearState, n_steps: int, fine: Ended | None) -> None:
        """Pass the progress of an integration to `keep`."""
        if self.keep is not None:
            iterations = integration.steps.work.run.budget.iterations
            self.keep(Saved(state, n_steps, integration.output.taken, iterations, fine, self.spent))


def begin_reference(work: WearingJoint, start: StartState, step_limit: float) -> WearState:
    """The unworn state of the reference solution.

    The state of the reference sweep differs from the start state in its tangential history. Even a small difference may
    decide whether a pair goes on slipping while the joint wears. So the state is solved with twice the difference
    (dovetail, 212.5 Hz: the worn volume is 0.082 or 0.106 mm3; both sweeps lead to 0.082, twice their difference to
    0.097). Where this state is not found, the state of the reference sweep is taken.
    """
    fine, reference = start.state, start.reference
    assert fine is not None
    begun = work.begin(reference or fine, start.resolution, NOTHING, accurate=True, step_limit=step_limit)
    if reference is None:
        return begun
    history = fine.start_history + 2.0 * (reference.start_history - fine.start_history)
    balance = Balance(work.at(begun), history, begun.depth)
    first = begun.point.evaluation.predicted_h
    point = work.run.state(balance, first, most=NEAR_ITERATIONS)
    return begun if point is None else work.noted(replace(begun, point=point))

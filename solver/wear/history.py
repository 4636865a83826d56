"""One wear history: integration over the slow time, comparison with the reference solution, outcome."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from solver.accuracy.history_error import Both, HistoryError, error_of_given_steps, history_error
from solver.accuracy.target_error import error_of_wear, target_error
from solver.model import FloatArray, IntArray, ReducedModel
from solver.outcome import Outcome
from solver.packing import Packed, pack, packable, unpack
from solver.results.cut_off import first_cut_off
from solver.results.history import StartState, WearHistory
from solver.results.verdict import judge, last_error
from solver.settings import SolverSettings, ToTheEnd
from solver.structure.joint import Case, build_case
from solver.wear.output import DenseOutput, no_output
from solver.wear.solutions import Ended, Saved, SlowTime, Solutions
from solver.wear.state import WearState

ENDS_ALL = (Outcome.TIME_LIMIT, Outcome.EXCEPTION)
"""Ends of a history after which no reference solution is integrated, and of a reference solution that end a history."""


def integrate_wear(
    model: ReducedModel,
    friction_coefficient: float | FloatArray | None,
    settings: SolverSettings,
    start: StartState,
    asked: SlowTime,
    keep: Callable[[Packed], None] | None = None,
    resume: Packed | None = None,
) -> WearHistory:
    """One history, with arguments as for `integrate_together`."""
    return next(integrate_together(model, friction_coefficient, settings, start, (asked,), keep, resume))


def integrate_together(
    model: ReducedModel,
    friction_coefficient: float | FloatArray | None,
    settings: SolverSettings,
    start: StartState,
    asked: Sequence[SlowTime],
    keep: Callable[[Packed], None] | None = None,
    resume: Packed | None = None,
) -> Iterator[WearHistory]:
    """Wear histories from one start state, as far as computed; a history that fails raises no error.

    Each is that which it would be alone. All those with given steps are compared with one adaptive history.

    Parameters
    ----------
    model, friction_coefficient, settings, start
        The case, and the unworn state at the start of the histories.
    asked
        Scheme and steps of each history; they differ in nothing else but their counts up to one last count.
    keep
        Called from time to time with the progress.
    resume
        Progress, as given to `keep`, of a computation of some of these histories, which goes on from there. The results
        are equal to the last bit, except `run_time`.
    """
    if start.state is None:
        yield from (without_state(model, start, each) for each in asked)
        return
    case = build_case(model, friction_coefficient, start.penalty_omega, settings, start.resolution)
    integrations = _Integrations(case, start, keep, Progress() if resume is None else unpack(resume))
    for each in asked:
        history = integrations.assembled(each)
        if history.outcome is Outcome.CONVERGED:
            outcome, message = judge(history, known_rows(history), settings.rtol)
            history = replace(history, outcome=outcome, message=message)
        yield history


def known_rows(history: WearHistory) -> IntArray:
    """Indices of the counts that a history has reached."""
    return np.flatnonzero(np.isfinite(history.worn_volume))


@packable
@dataclass(frozen=True)
class Done:
    """A history that was integrated, with its reference solution where its steps are adaptive and there is one.

    name: `SlowTime.name`. seconds: CPU time of both.
    """

    name: str
    fine: Ended
    reference: Ended | None
    seconds: float

    @property
    def iterations(self) -> int:
        """Newton iterations of both."""
        return self.fine.iterations + (0 if self.reference is None else self.reference.iterations)


@packable
@dataclass(frozen=True)
class Progress:
    """How far the histories from one start state are.

    done: those that are complete. name: of the present one. saved: its progress; None where it has not begun.
    """

    done: tuple[Done, ...] = ()
    name: str = ""
    saved: Saved | None = None


class _Integrations:
    """Histories from one start state, each integrated once.

    case, start, keep: as in `integrate_together`. progress: from which the computation goes on.
    """

    def __init__(
        self, case: Case, start: StartState, keep: Callable[[Packed], None] | None, progress: Progress
    ) -> None:
        self._case, self._start, self._keep = case, start, keep
        self._done = {done.name: done for done in progress.done}
        self._resumed = progress

    def assembled(self, asked: SlowTime) -> WearHistory:
        """A history with its errors, not judged yet."""
        start, model = self._start, self._case.model
        done = self._integrated(asked)
        if (state := done.fine.state) is None:
            broken = replace(
                start,
                outcome=done.fine.failure.outcome,
                message=done.fine.failure.message,
                newton_iterations=start.newton_iterations + done.iterations,
            )
            return without_state(model, broken, asked)
        adaptive = done
        if asked.scheme != "adaptive" and _is_compared(asked, done.fine):
            reached = min(done.fine.output.course.ends[-1], asked.end)
            adaptive = self._integrated(asked.adaptive_to(reached), done.seconds)
        both = () if adaptive is done else (adaptive,)
        adaptive = done if adaptive.fine.state is None else adaptive
        failed = next((each.fine.failure for each in both if each.fine.failure.outcome in ENDS_ALL), done.fine.failure)
        history = _assembled(self._solutions(asked), done.fine, state, adaptive)
        history = replace(
            history,
            outcome=failed.outcome,
            message=failed.message,
            newton_iterations=start.newton_iterations + sum(each.iterations for each in (done, *both)),
            run_time=start.run_time + sum(each.seconds for each in (done, *both)),
        )
        return replace(history, error_estimate=last_error(history, known_rows(history), history.last_cycle))

    def _integrated(self, asked: SlowTime, spent: float = 0.0) -> Done:
        """A history with its reference solution; spent: CPU seconds of its time limit that are gone."""
        if asked.name not in self._done:
            solutions = self._solutions(asked, spent)
            fine, reference = solutions.history(), None
            if asked.scheme == "adaptive" and _is_compared(asked, fine):
                reference = solutions.reference(fine)
                if reference.failure.outcome in ENDS_ALL:
                    fine = replace(fine, failure=reference.failure)
            self._done[asked.name] = Done(asked.name, fine, reference, solutions.spent - spent)
        return self._done[asked.name]

    def _solutions(self, asked: SlowTime, spent: float = 0.0) -> Solutions:
        resumed = self._resumed.saved if self._resumed.name == asked.name else None

        def save(saved: Saved) -> None:
            if self._keep is not None:
                # what its time limit has ended is not complete
                done = (each for each in self._done.values() if each.fine.failure.outcome not in ENDS_ALL)
                self._keep(pack(Progress(tuple(done), asked.name, saved)))

        solutions = Solutions(self._case, self._start, asked, save, resumed)
        solutions.began -= spent
        return solutions


def _is_compared(asked: SlowTime, fine: Ended) -> bool:
    """Whether a history is compared with another one: without a step the errors of the start state suffice."""
    steps = len(fine.output.course.ends) > 1 or asked.follow is not None
    return fine.state is not None and steps and fine.failure.outcome not in ENDS_ALL


def reported(own: Mapping[str, Any]) -> dict[str, Any]:
    """The values from `DenseOutput.read` that a result has."""
    return {name: value for name, value in own.items() if name not in ("local", "depth_rate")}


def of_state(state: WearState) -> dict[str, Any]:
    """What the last state of a history says of the whole history."""
    return {
        "step_limit": state.step_limit if state.step_limit > 0.0 else math.inf,
        "inaccurate_from": state.inaccurate_from,
        "inaccurate_in": "wear rate" if state.worst.wear_rate >= state.worst.response else "response",
        "inaccurate_error": state.worst.largest,
        "held_from": math.inf if math.isnan(state.held_from) else state.held_from,
    }


@dataclass(frozen=True)
class _Compared:
    """A history and what its errors follow from.

    output: of the history. other: of its reference solution, or of the adaptive history where its steps are given; None
    where there is none. adaptive: this adaptive history; None where the history is adaptive itself.
    follows: whether the frequency of the excitation follows the structure.
    """

    output: DenseOutput
    other: DenseOutput | None
    follows: bool
    adaptive: _Compared | None = None

    def at(self, counts: FloatArray) -> Both:
        """Both solutions at ascending counts."""
        return Both(counts, self.output.read(counts), self.other.read(counts) if self.other else {}, self.follows)

    def errors(self, counts: FloatArray) -> HistoryError:
        """Errors of the history at ascending counts."""
        area = self.output.area
        if self.adaptive is not None:
            return error_of_given_steps(self.at(counts), self.adaptive.errors(counts), area)
        ends = self.output.taken.cycles
        steps = Both(ends, self.output.values(), self.other.read(ends) if self.other else {})
        return history_error(self.at(counts), steps, area)


def _compared(solutions: Solutions, fine: Ended, adaptive: Done) -> _Compared:
    """A history with the adaptive history with which it is compared, which it may be itself."""

    def smooth(ended: Ended | None) -> DenseOutput | None:
        return None if ended is None else solutions.output_of_reference(ended)

    follows, output, other = solutions.asked.follow is not None, solutions.output_of(fine), smooth(adaptive.reference)
    if adaptive.fine is fine or (own := smooth(adaptive.fine)) is None:
        return _Compared(output, other, follows)
    return _Compared(output, own, follows, _Compared(own, other, follows))


def _assembled(solutions: Solutions, fine: Ended, state: WearState, adaptive: Done) -> WearHistory:
    """The result, from the outputs of a history, with its last state, and of the adaptive history."""
    start, asked, model = solutions.start, solutions.asked, solutions.case.model
    counts, area, compared = solutions.counts(fine), model.contact.area, _compared(solutions, fine, adaptive)
    both, error = compared.at(counts), compared.errors(counts)
    own, target = both.fine, fine.output.reached
    ends_at_target = target <= asked.end
    return WearHistory(
        **reported(own)
        | {
            "response_error": error.response,
            "wear_rate_error": error.wear_rate,
            "worn_volume_error": error.worn_volume,
            "wear_depth_error": error.wear_depth,
            "excitation_frequency_error": error.frequency,
        },
        **of_state(state),
        outcome=fine.failure.outcome,
        message=fine.failure.message,
        cycles=counts,
        worn_volume=own["wear_depth"] @ area,
        reference_volume=both.other("wear_depth") @ area,
        error_estimate=math.nan,
        newton_iterations=0,
        run_time=0.0,
        last_cycle=min(fine.output.course.ends[-1], float(counts[-1])),
        branch=start.branch,
        fold_frequency=start.fold_frequency,
        # adaptive steps go beyond the last count
        jump_cycle=state.jump_cycle if state.jump_cycle <= asked.end else math.nan,
        cycles_to_target=target if ends_at_target else math.nan,
        cycles_to_target_error=_target_error(compared, asked) if ends_at_target else math.nan,
        cut_off_cycle=first_cut_off(model.contact, counts, own["mean_pressure"], own["wear_depth"]),
    )


def _target_error(compared: _Compared, asked: SlowTime) -> float:
    """Estimated error, cycles, of the count at which a history has reached its target."""
    output, other = compared.output, compared.other
    if other is None or asked.until is None:
        return math.inf
    at, quantity, area = output.taken.reached, asked.until.quantity, output.area
    counts = np.array([0.0, at])
    own, error = output.read(counts), compared.errors(counts)
    depth = own["wear_depth"][1]
    known_to = error_of_wear(quantity, depth, error.wear_depth[1], float(error.worn_volume[1] * (depth @ area)))
    deepest = np.arange(area.size) == depth.argmax()
    weights = deepest if quantity == "wear_depth" else area
    rate = min(float(rates @ weights) for rates in (own["depth_rate"][1], output.taken.nodes[-1].rate))
    return target_error(at, other.target_count(), known_to, rate) + output.target_within()


def without_state(model: ReducedModel, start: StartState, asked: SlowTime) -> WearHistory:
    """History of a point without a valid start state: NaN everywhere."""
    counts = np.zeros(asked.cycles.n_outputs) if isinstance(asked.cycles, ToTheEnd) else asked.cycles
    own = no_output(counts.size, model.contact.n_contact, len(model.response_names), len(asked.loops))
    nothing = own["wear_rate"]
    return WearHistory(
        **reported(own),
        outcome=start.outcome,
        message=start.message,
        cycles=counts,
        worn_volume=nothing,
        worn_volume_error=nothing,
        wear_depth_error=own["wear_depth"],
        reference_volume=nothing,
        error_estimate=math.nan,
        jump_cycle=math.nan,
        newton_iterations=start.newton_iterations,
        run_time=start.run_time,
        branch=start.branch,
        fold_frequency=start.fold_frequency,
    )

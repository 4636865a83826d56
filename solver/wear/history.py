"""Wear histories from one start state: integration, errors by comparison with other solutions, outcome."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from solver.accuracy.history_error import Both, HistoryError, error_of_given_steps, error_of_target, history_error
from solver.harmonic_balance.state import Failure
from solver.model import FloatArray, ReducedModel
from solver.outcome import Outcome
from solver.packing import Packed, pack, packable, unpack
from solver.results.history import StartState, WearHistory
from solver.results.verdict import first_cut_off, judge, last_error
from solver.settings import SolverSettings, ToTheEnd
from solver.structure.joint import Case, build_case
from solver.wear.course import unknown_course
from solver.wear.integrate import Ended, Integration, Saved, SlowTime
from solver.wear.wearing_joint import WearState

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
        Steps of each history; they differ in nothing else but their counts up to one last count.
    keep
        Called from time to time with the progress.
    resume
        Progress, as given to `keep`, of a computation of some of these histories, which goes on from there. The results
        are equal to the last bit, except `run_time`.
    """
    if start.state is None:
        for each in asked:
            nothing = Ended(None, Failure(start.outcome, start.message), unknown_course(model, len(each.loops)), 0)
            yield _assembled(model, start, each, (Done("", nothing, None, 0.0),))
        return
    case = build_case(model, friction_coefficient, start.penalty_omega, settings, start.resolution)
    integrations = _Integrations(case, start, keep, Progress() if resume is None else unpack(resume))
    for each in asked:
        history = _assembled(model, start, each, integrations.of(each))
        # the counts that were reached
        rows = np.flatnonzero(np.isfinite(history.worn_volume))
        history = replace(history, error_estimate=last_error(history, rows, history.last_cycle))
        if history.outcome is Outcome.CONVERGED:
            outcome, message = judge(history, rows, settings.rtol)
            history = replace(history, outcome=outcome, message=message)
        yield history


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
        self._case, self._start, self._keep, self._resumed = case, start, keep, progress
        self._done = {done.name: done for done in progress.done}

    def of(self, asked: SlowTime) -> tuple[Done, ...]:
        """A history, and the adaptive history with which one with given steps is compared."""
        done = self._integrated(asked)
        if asked.adaptive or not _is_compared(asked, done.fine):
            return (done,)
        reached = min(done.fine.course.ends[-1], asked.end)
        return done, self._integrated(asked.adaptive_to(reached, self._case.settings.rtol), done.seconds)

    def _integrated(self, asked: SlowTime, spent: float = 0.0) -> Done:
        """A history with its reference solution; spent: CPU seconds of its time limit that are gone."""
        if asked.name not in self._done:
            saved = self._resumed.saved if self._resumed.name == asked.name else None
            integration = Integration(self._case, self._start, asked, lambda now: self._save(asked.name, now), saved)
            integration.began -= spent
            fine, reference = integration.history(), None
            if fine.state is None:
                fine = replace(fine, course=unknown_course(self._case.model, len(asked.loops)))
            if asked.adaptive and _is_compared(asked, fine):
                reference = integration.reference(fine, _counts(asked, fine))
                if reference.failure.outcome in ENDS_ALL:
                    fine = replace(fine, failure=reference.failure)
            self._done[asked.name] = Done(asked.name, fine, reference, integration.spent - spent)
        return self._done[asked.name]

    def _save(self, name: str, saved: Saved) -> None:
        if self._keep is not None:
            # what its time limit has ended is not complete
            done = (each for each in self._done.values() if each.fine.failure.outcome not in ENDS_ALL)
            self._keep(pack(Progress(tuple(done), name, saved)))


def _is_compared(asked: SlowTime, fine: Ended) -> bool:
    """Whether a history is compared with another one: without a step the errors of the start state suffice."""
    steps = len(fine.course.ends) > 1 or asked.follow is not None
    return fine.state is not None and steps and fine.failure.outcome not in ENDS_ALL


def _counts(asked: SlowTime, fine: Ended) -> FloatArray:
    """Counts (n_output,) at which a history is read."""
    if not isinstance(asked.cycles, ToTheEnd):
        return asked.cycles
    return np.zeros(asked.cycles.n_outputs) if fine.state is None else fine.course.even_counts(asked.cycles.n_outputs)


def _compare(integrated: tuple[Done, ...], counts: FloatArray, *, follows: bool) -> tuple[Both, HistoryError]:
    """A history beside what it is compared with at ascending counts, and its errors there.

    integrated: as from `_Integrations.of`. follows: whether the frequency of the excitation follows the structure.
    """

    def at(fine: Ended, other: Ended | None, counts: FloatArray) -> Both:
        there = other.course.read(counts) if other is not None and other.course.nodes else {}
        return Both(counts, fine.course.read(counts), there, follows)

    history, adaptive = integrated[0].fine, integrated[-1]
    if adaptive.fine.state is None:
        adaptive = integrated[0]
    area, course = history.course.area, adaptive.fine.course
    both, steps = (at(adaptive.fine, adaptive.reference, each) for each in (counts, course.dense.counts))
    error = history_error(both, steps, area)
    if adaptive is integrated[0]:
        return both, error
    both = at(history, adaptive.fine, counts)
    return both, error_of_given_steps(both, error, area)


def _assembled(model: ReducedModel, start: StartState, asked: SlowTime, integrated: tuple[Done, ...]) -> WearHistory:
    """The result, not judged yet; integrated: the history, and the adaptive one where its steps are given."""
    fine, area, counts = integrated[0].fine, model.contact.area, _counts(asked, integrated[0].fine)
    failures = (each.fine.failure for each in integrated[1:] if each.fine.failure.outcome in ENDS_ALL)
    failure, state = next(failures, fine.failure), fine.state
    both, error = _compare(integrated, counts, follows=asked.follow is not None)
    own, target = both.fine, fine.course.reached
    ends_at_target = target <= asked.end
    solutions = [each for done in integrated for each in (done.fine, done.reference) if each is not None]
    return WearHistory(
        **{name: value for name, value in own.items() if name not in ("local", "depth_rate")}
        | {
            "response_error": error.response,
            "wear_rate_error": error.wear_rate,
            "worn_volume_error": error.worn_volume,
            "wear_depth_error": error.wear_depth,
            "excitation_frequency_error": error.frequency,
        }
        | ({} if state is None else _of_state(state, asked.end)),
        outcome=failure.outcome,
        message=failure.message,
        cycles=counts,
        worn_volume=own["wear_depth"] @ area,
        reference_volume=both.other("wear_depth") @ area,
        error_estimate=math.nan,
        newton_iterations=start.newton_iterations + sum(each.iterations for each in solutions),
        run_time=start.run_time + sum(each.seconds for each in integrated),
        last_cycle=math.nan if state is None else min(fine.course.ends[-1], float(counts[-1])),
        branch=start.branch,
        fold_frequency=start.fold_frequency,
        cycles_to_target=target if ends_at_target else math.nan,
        cycles_to_target_error=_target_error(integrated, asked) if ends_at_target else math.nan,
        cut_off_cycle=first_cut_off(model.contact, counts, own["mean_pressure"], own["wear_depth"]),
    )


def _of_state(state: WearState, end: float) -> dict[str, Any]:
    """What the last state of a history says of the whole history up to its last count."""
    return {
        "step_limit": state.step_limit if state.step_limit > 0.0 else math.inf,
        "inaccurate_from": state.inaccurate_from,
        "inaccurate_in": "wear rate" if state.worst.wear_rate >= state.worst.response else "response",
        "inaccurate_error": state.worst.largest,
        "held_from": math.inf if math.isnan(state.held_from) else state.held_from,
        # adaptive steps go beyond the last count
        "jump_cycle": state.jump_cycle if state.jump_cycle <= end else math.nan,
    }


def _target_error(integrated: tuple[Done, ...], asked: SlowTime) -> float:
    """Estimated error, cycles, of the count at which a history has reached its target."""
    course, until = integrated[0].fine.course, asked.until
    other = integrated[-1].reference if len(integrated) == 1 else integrated[-1].fine
    if other is None or until is None:
        return math.inf
    at, by_interpolation = course.reach(until)
    both, error = _compare(integrated, np.array([0.0, at]), follows=asked.follow is not None)
    depth = both.fine["wear_depth"][1]
    weights = np.arange(depth.size) == depth.argmax() if until.quantity == "wear_depth" else course.area
    rate = min(float(rates @ weights) for rates in (both.fine["depth_rate"][1], course.nodes[-1].rate))
    ahead = other.course.reach_ahead(until)
    return error_of_target(until, at, ahead, depth, error, rate, course.area) + by_interpolation

"""Wear histories from one start state: integration, errors by comparison with other solutions, outcome."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from solver.accuracy.certificate import NOT_CERTIFIED
from solver.accuracy.history_error import Compared, HistoryError, error_of_given_steps, error_of_target, history_error
from solver.harmonic_balance.state import Failure
from solver.model import FloatArray, ReducedModel
from solver.outcome import Outcome
from solver.packing import Packed
from solver.results.history import StartState, WearHistory, first_cut_off, judge, last_error
from solver.results.state_report import LOOP_PHASES
from solver.settings import SolverSettings, ToTheEnd
from solver.structure.joint import Case, build_case
from solver.wear.problem import Adaptive, Given, WearProblem, WearRequest, reference_of
from solver.wear.slow_time import ENDS_ALL, Course, Guide, Integrator, Node, Solution
from solver.wear.wearing_joint import WearState

_REPORTED = frozenset(each.name for each in fields(WearHistory))


def integrate_together(
    model: ReducedModel,
    friction_coefficient: float | FloatArray | None,
    settings: SolverSettings,
    start: StartState,
    asked: Sequence[WearRequest],
    keep: Callable[[Packed], None] | None = None,
    resume: Packed | None = None,
) -> Iterator[WearHistory]:
    """Wear histories from one start state, as far as computed; a history that fails raises no error.

    Each is that which it would be alone. All those with given steps are compared with one adaptive history.

    asked: they differ in nothing else but their steps, and their counts up to one last count.
    keep: called from time to time with the progress. resume: such progress of some of these histories, which go on from
        there; the results are equal to the last bit, except `run_time`.
    """
    integrator, case = Integrator(settings.time_limit, keep, resume), None
    if start.state is not None:
        case = build_case(model, friction_coefficient, start.penalty_omega, settings, start.resolution)
    for each in asked:
        if case is None:
            own = Solution(None, Failure(start.outcome, start.message), unknown_course(model, len(each.loops)))
        else:
            own = _solve(integrator, case, start, each)
        history = _assembled(model, start, each, own)
        # the counts that were reached
        rows = np.flatnonzero(np.isfinite(history.worn_volume))
        reached = (history.cycles[rows], history.worn_volume_error[rows], history.wear_rate[rows])
        history = replace(history, error_estimate=last_error(*reached, history.last_cycle))
        if history.outcome is Outcome.CONVERGED:
            outcome, message = judge(history, rows, settings.rtol)
            history = replace(history, outcome=outcome, message=message)
        yield history


def unknown_course(model: ReducedModel, n_loops: int) -> Course:
    """The course of a history without any state: all values are NaN."""
    of_pairs, of_responses = np.full(model.contact.n_contact, np.nan), np.full(len(model.response_names), np.nan)
    values: dict[str, Any] = dict.fromkeys(("mean_pressure", "slip_range", "open_fraction"), of_pairs)
    values |= dict.fromkeys(("response_mean", "response_peak"), of_responses) | {"response": of_responses + 0j}
    values |= dict.fromkeys(("loop_displacement", "loop_force"), np.full((n_loops, LOOP_PHASES, 3), np.nan))
    values |= dict.fromkeys(("excitation_frequency", "excitation_frequency_error", "local"), math.nan)
    values |= vars(NOT_CERTIFIED) | {"harmonics_used": 0, "samples_used": 0}
    # before all counts
    return Course(model.contact.area, nodes=(Node(-1.0, of_pairs, of_pairs, values),))


def _solve(integrator: Integrator, case: Case, start: StartState, asked: WearRequest, spent: float = 0.0) -> Solution:
    """A history with what it is compared with; without a step the errors of the start state suffice."""
    own = integrator.integrate(WearProblem(case, start, asked, stable_end=True), spent)
    if own.state is None:
        return replace(own, course=unknown_course(case.model, len(asked.loops)))
    if (len(own.course.ends) == 1 and asked.follow is None) or own.end.outcome in ENDS_ALL:
        return own
    spent += own.seconds
    if isinstance(asked.steps, Given):
        # one for all given steps to one last count; to another end no longer than needed
        known = not isinstance(asked.cycles, ToTheEnd) and asked.until is None
        cycles = _counts(asked, own) if known else np.array([0.0, min(own.course.ends[-1], asked.end)])
        adaptive = asked.with_steps(Adaptive(case.settings.rtol), cycles)
        return replace(own, compared=_solve(integrator, case, start, adaptive, spent))
    guide = Guide(own.state.resolutions, own.state.first_length)
    # NaN where no target was reached
    counts = np.concatenate([[0.0, own.course.reached], _counts(asked, own), own.course.counts])
    counts = np.unique(counts[counts <= min(own.course.ends[-1], asked.end)])
    return replace(own, compared=integrator.integrate(reference_of(case, start, asked, guide, counts), spent))


def _counts(asked: WearRequest, own: Solution) -> FloatArray:
    """Counts (n_output,) at which a history is read."""
    if not isinstance(asked.cycles, ToTheEnd):
        return asked.cycles
    return np.zeros(asked.cycles.n_outputs) if own.state is None else own.course.even_counts(asked.cycles.n_outputs)


def compare(
    counts: FloatArray,
    fine: Course,
    reference: Course | None,
    area: FloatArray,
    part: Callable[[dict[str, Any]], dict[str, Any]] = lambda values: values,
    *,
    follows: bool = False,
) -> tuple[Compared, HistoryError]:
    """An adaptive history beside its reference solution at ascending counts (n,), and its errors there.

    part: what is compared of the values of both. follows: whether the frequency of the excitation is followed.
    """
    known = reference if reference is not None and reference.nodes else None
    both, steps = (
        Compared(at, part(fine.read(at)), {} if known is None else part(known.read(at)), follows)
        for at in (counts, fine.counts)
    )
    return both, history_error(both, steps, area)


def _compare_own(own: Solution, counts: FloatArray, *, given: bool, follows: bool) -> tuple[Compared, HistoryError]:
    """A history, of given steps or adaptive, beside what it is compared with at ascending counts, and its errors."""
    area, other = own.course.area, own.compared
    if given and other is not None and other.state is not None:
        _, error = _compare_own(other, counts, given=False, follows=follows)
        both = Compared(counts, own.course.read(counts), other.course.read(counts), follows)
        return both, error_of_given_steps(both, error, area)
    return compare(counts, own.course, None if given or other is None else other.course, area, follows=follows)


def _assembled(model: ReducedModel, start: StartState, asked: WearRequest, own: Solution) -> WearHistory:
    """The result, not judged yet."""
    area, counts = model.contact.area, _counts(asked, own)
    both, error = _compare_own(own, counts, given=isinstance(asked.steps, Given), follows=asked.follow is not None)
    found, target = both.fine, own.course.reached
    ends_at_target = target <= asked.end
    return WearHistory(
        **{name: value for name, value in found.items() if name in _REPORTED}
        | {f"{name}_error": values for name, values in vars(error).items()}
        | ({} if own.state is None else _of_state(own.state, asked.end)),
        outcome=own.end_of_all.outcome,
        message=own.end_of_all.message,
        cycles=counts,
        worn_volume=found["wear_depth"] @ area,
        reference_volume=both.other("wear_depth") @ area,
        error_estimate=math.nan,
        newton_iterations=start.newton_iterations + sum(each.iterations for each in own.all),
        run_time=start.run_time + sum(each.seconds for each in own.all),
        last_cycle=math.nan if own.state is None else min(own.course.ends[-1], float(counts[-1])),
        branch=start.branch,
        fold_frequency=start.fold_frequency,
        cycles_to_target=target if ends_at_target else math.nan,
        cycles_to_target_error=_target_error(own, asked) if ends_at_target else math.nan,
        cut_off_cycle=first_cut_off(model.contact, counts, found["mean_pressure"], found["wear_depth"]),
    )


def _of_state(state: WearState, end: float) -> dict[str, Any]:
    """What the last state says of its history up to a count."""
    return {
        "step_limit": state.step_limit if state.step_limit > 0.0 else math.inf,
        "inaccurate_from": state.inaccurate_from,
        "inaccurate_in": "wear rate" if state.worst.wear_rate >= state.worst.response else "response",
        "inaccurate_error": state.worst.largest,
        "held_from": state.held_from,
        # adaptive steps go beyond the last count
        "jump_cycle": state.jump_cycle if state.jump_cycle <= end else math.nan,
    }


def _target_error(own: Solution, asked: WearRequest) -> float:
    """Estimated error, cycles, of the count at which a history has reached its target."""
    course, until = own.course, asked.until
    if own.compared is None or until is None:
        return math.inf
    at, by_interpolation = course.reach(until)
    given, follows = isinstance(asked.steps, Given), asked.follow is not None
    both, error = _compare_own(own, np.array([0.0, at]), given=given, follows=follows)
    of_other = own.compared.course.reach(until)[0]
    return error_of_target(until, at, of_other, both.fine, course.nodes[-1].rate, error, course.area) + by_interpolation

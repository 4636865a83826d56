"""One wear history: integration over the slow time, comparison with the reference solution, outcome."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from solver.accuracy.history_error import Both, HistoryError, history_error
from solver.accuracy.options import ACCURACY
from solver.accuracy.target_error import error_of_wear, target_error
from solver.model import FloatArray, ReducedModel
from solver.outcome import Outcome
from solver.packing import Packed, unpack
from solver.results.cut_off import first_cut_off
from solver.results.history import StartState, WearHistory
from solver.results.verdict import judge, last_error
from solver.settings import SolverSettings, ToTheEnd
from solver.structure.joint import build_case
from solver.wear.output import DenseOutput, no_output
from solver.wear.solutions import Ended, SlowTime, Solutions
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
    """Wear history of one point of a study, as far as computed; a history that fails raises no error.

    Parameters
    ----------
    model, friction_coefficient, settings, start
        The case, and the unworn state at the start of the history.
    asked
        Scheme, counts and wear law of the history.
    keep
        Called from time to time with the progress.
    resume
        Progress, as given to `keep`, of a history with equal arguments, which goes on from there. The result is equal
        to the last bit, except `run_time`.
    """
    if start.state is None:
        return without_state(model, start, asked)
    case = build_case(model, friction_coefficient, start.penalty_omega, settings, start.resolution)
    solutions = Solutions(case, start, asked, keep, None if resume is None else unpack(resume))
    fine = solutions.history()
    if (state := fine.state) is None:
        iterations = start.newton_iterations + fine.iterations
        failed = replace(
            start, outcome=fine.failure.outcome, message=fine.failure.message, newton_iterations=iterations
        )
        return without_state(model, failed, asked)
    reference = None
    # without a step the errors of the start state suffice
    compared = len(fine.output.course.ends) > 1 or asked.follow is not None
    if compared and fine.failure.outcome not in ENDS_ALL:
        reference = solutions.reference(fine)
        if reference.failure.outcome in ENDS_ALL:
            fine = replace(fine, failure=reference.failure)
    history = _assembled(solutions, fine, state, reference)
    rows = np.flatnonzero(np.isfinite(history.worn_volume))
    history = replace(history, error_estimate=last_error(history, rows, history.last_cycle))
    if history.outcome is not Outcome.CONVERGED:
        return history
    outcome, message = judge(history, rows, settings.rtol)
    return replace(history, outcome=outcome, message=message)


def reported(own: dict[str, Any]) -> dict[str, Any]:
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


def _assembled(solutions: Solutions, fine: Ended, state: WearState, reference: Ended | None) -> WearHistory:
    """The result, from the outputs of a history, with its last state, and of its reference solution."""
    start, asked, model = solutions.start, solutions.asked, solutions.case.model
    counts, area, output = solutions.counts(fine), model.contact.area, solutions.output_of(fine)
    own = output.read(counts)
    other = None if reference is None else solutions.output_of_reference(reference)
    both = Both(counts, own, other.read(counts) if other else {})
    at_steps = fine.output.cycles
    steps = Both(at_steps, output.values(), other.read(at_steps) if other else {})
    error = history_error(both, steps, area, asked.scheme)
    target = fine.output.reached
    ends_at_target = target <= asked.end
    return WearHistory(
        **reported(own) | _errors(both, error, follows=asked.follow is not None),
        **of_state(state),
        outcome=fine.failure.outcome,
        message=fine.failure.message,
        cycles=counts,
        worn_volume=own["wear_depth"] @ area,
        reference_volume=both.other("wear_depth") @ area,
        error_estimate=math.nan,
        newton_iterations=start.newton_iterations + fine.iterations + (reference.iterations if reference else 0),
        run_time=start.run_time + solutions.spent,
        last_cycle=min(fine.output.course.ends[-1], float(counts[-1])),
        branch=start.branch,
        fold_frequency=start.fold_frequency,
        # adaptive steps go beyond the last count
        jump_cycle=state.jump_cycle if state.jump_cycle <= asked.end else math.nan,
        cycles_to_target=target if ends_at_target else math.nan,
        cycles_to_target_error=_target_error(output, other, steps, asked) if ends_at_target else math.nan,
        cut_off_cycle=first_cut_off(model.contact, counts, own["mean_pressure"], own["wear_depth"]),
    )


def _errors(both: Both, error: HistoryError, *, follows: bool) -> dict[str, Any]:
    """Errors of a history at its outputs; follows: whether its frequency follows the structure."""
    frequency = both.fine["excitation_frequency_error"]
    if follows:
        apart = np.abs(both.fine["excitation_frequency"] - both.other("excitation_frequency"))
        whole = np.maximum(frequency, ACCURACY.history_safety * apart)
        frequency = np.where(np.isfinite(error.worn_volume) & np.isnan(whole), math.inf, whole)
    return {
        "response_error": error.response,
        "wear_rate_error": error.wear_rate,
        "worn_volume_error": error.worn_volume,
        "wear_depth_error": error.wear_depth,
        "excitation_frequency_error": frequency,
    }


def _target_error(output: DenseOutput, other: DenseOutput | None, steps: Both, asked: SlowTime) -> float:
    """Estimated error, cycles, of the count at which a history has reached its target.

    output, other: of the history and of its reference solution, None if there is none; steps: both at the ends of the
    steps.
    """
    if other is None or asked.until is None:
        return math.inf
    area, at, quantity = output.area, output.taken.reached, asked.until.quantity
    counts = np.array([0.0, at])
    own = output.read(counts)
    error = history_error(Both(counts, own, other.read(counts)), steps, area, asked.scheme)
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

"""One wear history: integration over the slow time, comparison with the reference solution, outcome."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from solver.accuracy.history_error import Both, history_error
from solver.accuracy.options import ACCURACY
from solver.accuracy.target_error import error_of_wear, target_error
from solver.harmonic_balance.state import Failure
from solver.model import FloatArray, ReducedModel
from solver.outcome import Outcome
from solver.packing import Packed, unpack
from solver.results.cut_off import first_cut_off
from solver.results.history import StartState, WearHistory
from solver.results.verdict import judge, last_error
from solver.settings import SolverSettings, ToTheEnd
from solver.structure.joint import build_case
from solver.wear.course import unknown_course
from solver.wear.integrate import Ended
from solver.wear.interpolation import TargetSearch
from solver.wear.solutions import SlowTime, Solutions
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
        Steps, counts and wear law of the history.
    keep
        Called from time to time with the progress.
    resume
        Progress, as given to `keep`, of a history with equal arguments, which goes on from there. The result is equal
        to the last bit, except `run_time`.
    """
    if start.state is None:
        nothing = Ended(None, Failure(start.outcome, start.message), unknown_course(model, len(asked.loops)), 0)
        return _assembled(model, start, asked, nothing, None)
    case = build_case(model, friction_coefficient, start.penalty_omega, settings, start.resolution)
    solutions = Solutions(case, start, asked, keep, None if resume is None else unpack(resume))
    fine, reference = solutions.history(), None
    if fine.state is None:
        fine = replace(fine, course=unknown_course(model, len(asked.loops)))
    # without a step the errors of the start state suffice
    elif fine.failure.outcome not in ENDS_ALL and (len(fine.course.ends) > 1 or asked.where.follows):
        reference = solutions.reference(fine, _counts(asked, fine))
        if reference.failure.outcome in ENDS_ALL:
            fine = replace(fine, failure=reference.failure)
    history = _assembled(model, start, asked, fine, reference)
    history = replace(history, run_time=start.run_time + (solutions.spent if fine.state else 0.0))
    rows = np.flatnonzero(np.isfinite(history.worn_volume))
    history = replace(history, error_estimate=last_error(history, rows, history.last_cycle))
    if history.outcome is not Outcome.CONVERGED:
        return history
    outcome, message = judge(history, rows, settings.rtol)
    return replace(history, outcome=outcome, message=message)


def _counts(asked: SlowTime, fine: Ended) -> FloatArray:
    """Counts (n_output,) at which a history is read."""
    if not isinstance(asked.cycles, ToTheEnd):
        return asked.cycles
    return np.zeros(asked.cycles.n_outputs) if fine.state is None else fine.course.even_counts(asked.cycles.n_outputs)


def _assembled(
    model: ReducedModel, start: StartState, asked: SlowTime, fine: Ended, reference: Ended | None
) -> WearHistory:
    """The result, from the steps of a history and of its reference solution."""
    counts, area, course = _counts(asked, fine), model.contact.area, fine.course
    own = course.read(counts)
    compared = reference is not None and bool(reference.course.nodes)
    both, steps = (
        Both(at, values, reference.course.read(at) if reference is not None and compared else {})
        for at, values in ((counts, own), (course.cycles, course.read(course.cycles)))
    )
    error = history_error(both, steps, area, asked.steps.scheme)
    state, target = fine.state, course.reached
    ends_at_target = target <= asked.end
    return WearHistory(
        **{name: value for name, value in own.items() if name not in ("local", "depth_rate")}
        | {"response_error": error.response, "wear_rate_error": error.wear_rate}
        | {"excitation_frequency_error": _frequency_error(both, error.worn_volume, follows=asked.where.follows)}
        | ({} if state is None else _of_state(state, asked.end)),
        outcome=fine.failure.outcome,
        message=fine.failure.message,
        cycles=counts,
        worn_volume=own["wear_depth"] @ area,
        worn_volume_error=error.worn_volume,
        wear_depth_error=error.wear_depth,
        reference_volume=both.other("wear_depth") @ area,
        error_estimate=math.nan,
        newton_iterations=start.newton_iterations + fine.iterations + (reference.iterations if reference else 0),
        run_time=start.run_time,
        last_cycle=math.nan if state is None else min(course.ends[-1], float(counts[-1])),
        branch=start.branch,
        fold_frequency=start.fold_frequency,
        cycles_to_target=target if ends_at_target else math.nan,
        cycles_to_target_error=_target_error(fine, reference, steps, asked) if ends_at_target else math.nan,
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


def _frequency_error(both: Both, volume_error: FloatArray, *, follows: bool) -> FloatArray:
    """Error (n_output,) of the frequency, Hz; follows: whether it follows the structure.

    volume_error (n_output,): relative error of the worn volume, finite where the history has come so far.
    """
    own: FloatArray = both.fine["excitation_frequency_error"]
    if not follows:
        return own
    apart = np.abs(both.fine["excitation_frequency"] - both.other("excitation_frequency"))
    whole = np.maximum(own, ACCURACY.history_safety * apart)
    return np.where(np.isfinite(volume_error) & np.isnan(whole), math.inf, whole)


def _target_error(fine: Ended, reference: Ended | None, steps: Both, asked: SlowTime) -> float:
    """Estimated error, cycles, of the count at which a history has reached its target.

    steps: the history and its reference solution at the ends of the steps.
    """
    if reference is None or asked.until is None or not reference.course.nodes:
        return math.inf
    course, quantity = fine.course, asked.until.quantity
    area, at = course.area, course.reached
    counts = np.array([0.0, at])
    own = course.read(counts)
    error = history_error(Both(counts, own, reference.course.read(counts)), steps, area, asked.steps.scheme)
    depth = own["wear_depth"][1]
    known_to = error_of_wear(quantity, depth, error.wear_depth[1], float(error.worn_volume[1] * (depth @ area)))
    weights = np.arange(area.size) == depth.argmax() if quantity == "wear_depth" else area
    rate = min(float(rates @ weights) for rates in (own["depth_rate"][1], course.nodes[-1].rate))
    other = TargetSearch(asked.until, area, smooth=True).count(reference.course.nodes)
    by_resonance = TargetSearch(asked.until, area, course.smooth).by_resonance(course.nodes, at)
    return target_error(at, other, known_to, rate) + course.reached_within + by_resonance

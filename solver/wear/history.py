"""Wear histories from one start state: integration, what each is compared with, result."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, replace
from functools import partial
from typing import Any

import numpy as np

from solver.accuracy.certificate import NOT_CERTIFIED
from solver.harmonic_balance.state import Failure
from solver.model import ContactInterface, FloatArray, IntArray, ReducedModel
from solver.modes.modal_model import linear_mode
from solver.packing import Packed
from solver.results.history import StartState, WearHistory, first_cut_off, judge, last_error
from solver.results.state_report import LOOP_PHASES
from solver.settings import SolverSettings, ToTheEnd
from solver.structure.joint import Case, build_case
from solver.wear.errors import compare, reach_target
from solver.wear.problem import WearProblem, reference_of
from solver.wear.slow_time import Course, Integrator, Node, Report, Solution
from solver.wear.wearing_joint import Record, WearRequest

LAG = 0.01
"""Change of the worn volume by a vibration that follows its contact late, above which a history says so. Dovetail,
212.42 Hz, 2000 cycles, friction from 0.3 to 0.5 within 2e4 J/m2: 8 % against an integration in time."""

_REPORTED = frozenset(each.name for each in fields(WearHistory))


def integrate_together(
    model: ReducedModel,
    settings: SolverSettings,
    start: StartState,
    requests: Sequence[WearRequest],
    keep: Callable[[Packed], None] | None = None,
    resume: Packed | None = None,
    report: Report = lambda *_: None,
) -> Iterator[WearHistory]:
    """Wear histories from one start state, as far as computed; a history that fails raises no error.

    Each is that which it would be alone. All those with given steps are compared with one adaptive history.

    requests: they differ in nothing else but their steps, and their counts up to one last count.
    keep: called from time to time with the progress; report: after each step. resume: such progress of some
        of these histories, which go on from there; the results are equal to the last bit, except `run_time`.
    """
    integrator, case = Integrator(settings.time_limit, keep, resume, report), None
    if start.state is not None:
        case = build_case(model, start.penalty_omega, settings, start.resolution)
    for request in requests:
        if case is None:
            solution = Solution(None, Course(model.contact.area), Failure(start.outcome, start.message))
        else:
            solution = _solve(integrator, case, start, request)
        if solution.state is None:
            solution = replace(solution, course=_unknown_course(model, len(request.loops)))
        history = _assembled(model, start, request, solution)
        if history.outcome.complete:
            history = replace(history, unjudged=history.message)
            rows = np.flatnonzero(np.isfinite(history.worn_volume))
            outcome, message = judge(history, rows, settings.rtol)
            lag = describe_lag(model, history, rows)
            history = replace(history, outcome=outcome, message="; ".join(filter(None, (message, lag))))
        yield history


def describe_lag(model: ReducedModel, history: WearHistory, rows: IntArray) -> str:
    """What it means for the worn volume that a vibration needs some periods to follow a change of the contact, while it
    is steady at each count of a history; "" below `LAG`.

    A vibration that follows n periods late wears n cycles at the first rate, and then as a steady one; at the end n
    cycles at the last rate are missing. n: within which a vibration of the stuck structure falls to 1/e, by its mode
    next to the frequency; slip damps more, so that it is less. rows: known counts.
    """
    last, stuck = rows[-1:], np.ones(model.contact.n_contact, bool)
    if not last.size or model.contact.relative_change(history.dissipated_energy[last[0]]) == 0.0:
        return ""
    if not (volume := float(history.worn_volume[last[0]])) > 0.0:
        return ""
    omega = 2.0 * math.pi * float(history.excitation_frequency[last[0]])
    if (mode := linear_mode(model, stuck, near=omega)) is None:
        return ""
    decay = mode.damping_ratio * mode.omega
    periods = omega / (2.0 * math.pi * decay) if decay > 0.0 else math.inf
    begun, ended = history.wear_rate[rows[[0, -1]]].tolist()
    off = abs(ended - begun) * min(periods, float(history.cycles[last[0]])) / volume
    if off <= LAG:
        return ""
    needs = f"the vibration needs up to {periods:.3g} periods to follow a change of the contact"
    return f"{needs}, which may change the worn volume by {100.0 * off:.2g} %: no error bar contains it"


def _unknown_course(model: ReducedModel, n_loops: int) -> Course:
    """The course of a history without any state: all values are NaN."""
    of_pairs, of_responses = np.full(model.contact.n_contact, np.nan), np.full(len(model.response_names), np.nan)
    values: dict[str, Any] = dict.fromkeys(("mean_pressure", "slip_range", "open_fraction", "friction_power"), of_pairs)
    values |= dict.fromkeys(("response_mean", "response_peak"), of_responses) | {"response": of_responses + 0j}
    values |= dict.fromkeys(("loop_displacement", "loop_force"), np.full((n_loops, LOOP_PHASES, 3), np.nan))
    values |= dict.fromkeys(("friction_use", "excitation_frequency", "excitation_frequency_error"), math.nan)
    values |= vars(NOT_CERTIFIED) | {"harmonics_used": 0, "samples_used": 0}
    values |= {"local": math.nan, "resolution_error": math.nan}
    # before all counts
    return Course(model.contact.area, nodes=(Node(-1.0, of_pairs, of_pairs, of_pairs, of_pairs, values),))


def _solve(integrator: Integrator, case: Case, start: StartState, request: WearRequest, spent: float = 0.0) -> Solution:
    """A history with what it is compared with; without a step the errors of the start state suffice."""
    solution = integrator.integrate(WearProblem(case, start, request, stable_end=True), spent)
    state, course = solution.state, solution.course
    if state is None or (len(course.ends) == 1 and request.follow is None) or solution.breaks_off:
        return solution
    spent += solution.seconds
    end = min(course.ends[-1], request.end)
    if request.steps is not None:
        # one for all given steps to one last count; to another end no longer than needed
        known = not isinstance(request.cycles, ToTheEnd) and request.until is None
        cycles = _counts(request, solution) if known else np.array([0.0, end])
        return replace(solution, compared=_solve(integrator, case, start, request.adaptive_to(cycles), spent))
    # NaN where no target was reached
    counts = np.concatenate([[0.0, course.reached], _counts(request, solution), course.counts])
    read, n_steps = np.unique(counts[counts <= end]), len(course.ends) - 1
    reference = reference_of(case, start, request, state.guide, read, n_steps)
    return replace(solution, compared=integrator.integrate(reference, spent))


def _counts(request: WearRequest, solution: Solution) -> FloatArray:
    """Counts (n_output,) at which a history is read."""
    if not isinstance(request.cycles, ToTheEnd):
        return request.cycles
    n_outputs = request.cycles.n_outputs
    return np.zeros(n_outputs) if solution.state is None else solution.course.even_counts(n_outputs)


def _assembled(model: ReducedModel, start: StartState, request: WearRequest, solution: Solution) -> WearHistory:
    """The result, not judged yet."""
    course, state, area, counts = solution.course, solution.state, model.contact.area, _counts(request, solution)
    compare_at = partial(compare, solution, given=request.steps is not None, follows=request.follow is not None)
    both, error = compare_at(counts)
    values, totals = both.values, solution.totals
    target, target_error = reach_target(solution, request.end, compare_at)
    last_cycle = math.nan if state is None else min(course.ends[-1], float(counts[-1]))
    return WearHistory(
        **{name: value for name, value in values.items() if name in _REPORTED}
        | {f"{name}_error": values for name, values in vars(error).items()}
        | ({} if state is None else _of_record(state.record, request.end))
        | totals
        | {
            "newton_iterations": start.newton_iterations + totals["newton_iterations"],
            "run_time": start.run_time + totals["run_time"],
        },
        cycles=counts,
        **_of_contact(model.contact, values["dissipated_energy"]),
        worn_volume=values["wear_depth"] @ area,
        reference_volume=both.other("wear_depth") @ area,
        error_estimate=last_error(counts, error.worn_volume, values["wear_rate"], last_cycle),
        last_cycle=last_cycle,
        adaptive=request.steps is None,
        branch=start.branch,
        fold_frequency=start.fold_frequency,
        cycles_to_target=target,
        cycles_to_target_error=target_error,
        undecided_from=both.undecided,
        cut_off_cycle=first_cut_off(model.contact, counts, values["mean_pressure"], values["wear_depth"]),
    )


def _of_contact(contact: ContactInterface, energy: FloatArray) -> dict[str, Any]:
    """Friction and contact stiffness of the pairs at dissipated energies (n_output, n_contact), J/m2."""
    found: dict[str, Any] = {}
    for name, table, plain in (
        ("pair_friction", "friction_coefficient", contact.friction),
        ("pair_stiffness", "contact_stiffness", np.full(contact.n_contact, np.inf)),
    ):
        evolved = (contact.after(each).evolution for each in energy)
        rows = [plain if each is None or (now := each.now(table)) is None else now[0] for each in evolved]
        found[name] = np.where(np.isnan(energy), np.nan, np.array(rows).reshape(energy.shape))
    return found


def _of_record(record: Record, end: float) -> dict[str, Any]:
    """What the record says of a history up to a count."""
    return {name: value for name, value in vars(record).items() if name in _REPORTED} | {
        "inaccurate_in": "wear rate" if record.worst.wear_rate >= record.worst.response else "response",
        "inaccurate_error": record.worst.largest,
        # adaptive steps go beyond the last count
        "jump_cycle": record.jump_cycle if record.jump_cycle <= end else math.nan,
    }

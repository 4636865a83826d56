"""Task -> result: the only place from which the solver computes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from solver.contact.wear_law import ARCHARD, WearLaw
from solver.model import ReducedModel
from solver.outcome import SENSITIVE_ERROR, Outcome, describe_error
from solver.packing import Packed, pack, unpack
from solver.results.cut_off import describe_cut_off
from solver.results.history import StartState, WearHistory
from solver.settings import Resolution, ToTheEnd
from studyrunner.percent import known_to
from studyrunner.plan.point_text import describe_reach, show_count
from studyrunner.plan.results import Evaluate, Keep, MarchResult, StartResult, failed_result
from studyrunner.plan.tasks import BranchTask, MarchTask
from studyrunner.study.study import AUTO
from studyrunner.system.machine_faults import (
    MachineFaultError,
    guard_kernel_cache,
    is_fault_of_machine,
    tells_of_machine,
)
from studyrunner.variables import KEPT

_ROUND_OFF = 1e-10
_METHODS = KEPT["final_method"].flags


def build_evaluator(model: ReducedModel, friction_coefficient: float | None, law: WearLaw = ARCHARD) -> Evaluate:
    """The function that does the tasks of a study on this model by this wear law and gives their results one by one."""

    def evaluate(task: BranchTask | MarchTask, keep: Keep) -> Iterator[StartResult | MarchResult]:
        guard_kernel_cache()
        if isinstance(task, BranchTask):
            yield from follow(model, friction_coefficient, task, keep)
        else:
            yield from march(model, friction_coefficient, task, keep, law)

    return evaluate


def follow(
    model: ReducedModel, friction_coefficient: float | None, task: BranchTask, keep: Keep
) -> Iterator[StartResult]:
    """Start states of one branch as the sweep reaches them, but those that are known; the last of them ends it."""
    # numba is loaded where a task runs, so that --plan and --help do without it.
    from solver.loading_history.start_states import follow_branch

    wanted = sorted(task.order_left)
    branch = follow_branch(
        model,
        friction_coefficient,
        task.excitation_amplitude,
        # no state depends on those that are known
        np.array([task.frequencies[position] for position in wanted]),
        cast("Literal['up', 'down', 'ramp']", task.sweep),
        task.settings,
        keep=keep,
        resume=task.resume,
        tell=keep,
    )
    n_displacements = int(np.count_nonzero(np.asarray(model.contact.dofs) >= 0))
    for place, start in branch:
        n_coefficients = 2 * len(start.resolution.orders) + 1
        n_unknowns = 0 if start.state is None else n_displacements * n_coefficients
        _raise_fault(start)
        yield StartResult(wanted[place], pack(start), _moves(start), n_unknowns)


def failed_results(task: BranchTask | MarchTask, n_given: int, error: Exception) -> Iterator[StartResult | MarchResult]:
    """What a task still owes after its first results, where it broke off with an error that it should not have.

    A fault of the machine is no result of the task: what it owes is not computed, and may be tried again.
    """
    lost = is_fault_of_machine(error)
    message = str(error) if isinstance(error, MachineFaultError) else describe_error(error)
    if isinstance(task, MarchTask):
        for place in range(n_given, task.n_results):
            yield failed_result(task, place, Outcome.NOT_COMPUTED if lost else Outcome.EXCEPTION, message)
        return
    nan = math.nan
    start = StartState(Outcome.EXCEPTION, None, nan, Resolution((1,), 4), nan, nan, 0, 0.0, message=message)
    for position in task.order_left[n_given:]:
        yield StartResult(position, pack(start), moves=False, n_unknowns=0, lost=message if lost else "")


def march(
    model: ReducedModel, friction_coefficient: float | None, task: MarchTask, keep: Keep, law: WearLaw = ARCHARD
) -> Iterator[MarchResult]:
    """The histories of a task, the one of the march itself first.

    One march gives all of them, as far as it went. Where its wear rate oscillates, that may have begun after the end of
    another history, which then takes a march of its own.
    """
    reached = task.resume

    def note(progress: Packed | str) -> None:
        nonlocal reached
        reached = reached if isinstance(progress, str) else progress
        keep(progress)

    history = _solve(model, friction_coefficient, task, law, note)
    # with more time it goes on from there
    left = reached if history.outcome is Outcome.TIME_LIMIT else None
    yield replace(build_result(task, history), progress=left)
    for place, scaled in enumerate(task.histories[1:], start=1):
        if not history.oscillates:
            yield replace(build_result(task, history, place), progress=left)
        else:
            alone = replace(task, histories=(scaled,), resume=None)
            yield replace(build_result(alone, _solve(model, friction_coefficient, alone, law)), place=place)


def _solve(
    model: ReducedModel,
    friction_coefficient: float | None,
    task: MarchTask,
    law: WearLaw,
    keep: Keep | None = None,
) -> WearHistory:
    """The march of a task from its start state, at all counts at which one of its histories is read."""
    from solver.wear.final_state.find import find_final_state
    from solver.wear.march import march_wear

    start = None if task.start is None else unpack(task.start)
    if not isinstance(start, StartState):
        raise TypeError(f"task without a start state: {task}")
    counts: NDArray[np.float64] | ToTheEnd
    if task.to_the_end is not None and not task.held:
        counts = task.to_the_end
    else:
        # The march begins at cycle 0, whether that count is kept or not.
        counts = np.unique(np.concatenate([[0.0], *(task.counts(scaled) for scaled in task.histories)]))
    if task.scheme == "final" and isinstance(counts, ToTheEnd):
        history = find_final_state(
            model,
            friction_coefficient,
            start,
            task.wear_coefficient,
            counts,
            task.settings,
            loops=task.loops,
            keep=keep,
            resume=task.resume,
            law=law,
        )
        _raise_fault(history)
        return history
    scheme = "adaptive" if task.scheme == "final" else task.scheme
    history = march_wear(
        model,
        friction_coefficient,
        start,
        task.wear_coefficient,
        task.step,
        cast("Literal['explicit', 'implicit', 'adaptive']", scheme),
        counts,
        task.settings,
        largest_depth=task.largest_depth,
        loops=task.loops,
        keep=keep,
        resume=task.resume,
        law=law,
        until=task.until,
    )
    _raise_fault(history)
    return history


def _raise_fault(ended: StartState | WearHistory) -> None:
    """The solver takes whatever breaks it off for an end: raises MachineFaultError where that was not its own."""
    if ended.outcome is Outcome.EXCEPTION and tells_of_machine(ended.message):
        raise MachineFaultError(ended.message)


def build_result(task: MarchTask, history: WearHistory, place: int = 0) -> MarchResult:
    """What the result file holds of one history of a task: the output counts and variables that the task asks for.

    What is per cycle is per cycle of that history. It knows nothing of what came after its last count: jumps, errors,
    the end of the march. What was computed of a history that ends early is kept. Effort is that of the march.
    """
    scaled, own = task.histories[place], task.histories[0]
    slower = scaled.wear_coefficient / own.wear_coefficient if place else 1.0
    endless = task.to_the_end is not None and not task.held
    counts = history.cycles if endless else np.array(task.counts(scaled))
    rows = np.arange(counts.size) if endless else np.searchsorted(history.cycles, counts)
    reached = counts <= (1.0 + _ROUND_OFF) * history.last_cycle
    if endless and history.final_method == "active_set":
        reached = np.isfinite(history.worn_volume)
    known = rows[reached]
    jump = history.jump_cycle
    if place:
        jump = jump / slower if endless or jump < (1.0 - _ROUND_OFF) * counts[-1] else math.nan
    target = history.cycles_to_target / slower
    if target > (1.0 + _ROUND_OFF) * counts[-1] / slower:
        # another history of the march goes farther
        target = math.nan
    outcome = history.outcome if endless else scaled_outcome(task, history, known, place, whole=bool(reached.all()))
    last = 0.0 if task.to_the_end is not None else task.cycles[-1]
    if endless:
        last = history.last_cycle / slower
    elif not reached.all():
        last = min(history.last_cycle / slower, last)
    elif not outcome.complete and not task.held:
        last = min(history.last_cycle, last)
    depths = history.wear_depth[known]
    message = _message(task, history, outcome, place, slower, known, last)
    of_its_own: dict[str, Any] = {
        "outcome": int(outcome),
        "jump_cycle": jump,
        "cycles_to_target": target,
        "error_estimate": _last_error(history, known, last),
        "step_limit": history.step_limit / slower,
        "last_cycle": last,
        "largest_wear_depth": float(depths.max(initial=0.0)) if known.size else math.nan,
        "final_method": _METHODS.index(history.final_method or "none"),
        "message": message or _of_target(task, history, known, target, whole=bool(reached.all())),
    }
    of_march = {name: getattr(history, name) for name in KEPT if name not in of_its_own}
    variables = {name: _variable(history, name, slower, rows, reached) for name in task.variables}
    return MarchResult(scaled.points, {**variables, **of_march, **of_its_own}, place)


def _last_error(history: WearHistory, known: NDArray[np.intp], last: float) -> float:
    """Estimated relative error of the last worn volume that the result holds; NaN where there is none.

    The unworn joint has no volume to be wrong, but where it is all that is held of a history that went on (a target may
    be reached before the first count) what has worn there is not known. last: count that the march has come to.
    """
    if not known.size or (history.cycles[known[-1]] == 0.0 and last > 0.0 and bool(history.wear_rate[known[-1]] > 0.0)):
        return math.nan
    return float(history.worn_volume_error[known[-1]])


def scaled_outcome(
    task: MarchTask, history: WearHistory, known: NDArray[np.intp], place: int, *, whole: bool
) -> Outcome:
    """How one history of a task ended, judged by its own rows.

    known: rows of the march at its own counts that were reached. whole: whether these are all. The march
    itself, which is the first one, ended as the history says; so did those that were not reached to their end.
    """
    ended = history.outcome
    if place == 0 or not whole:
        return ended
    if history.cycles[known[-1]] >= history.cut_off_cycle:
        return Outcome.CONTACT_CUT_OFF
    if history.worn_volume_error[known[-1]] > SENSITIVE_ERROR:
        return Outcome.SENSITIVE
    settings = task.settings
    # given numbers of both aim at nothing, and a march that kept below rtol did so up to every count
    judged = ended is Outcome.INACCURATE or (not ended.complete and AUTO in (settings.harmonics, settings.samples))
    errors = _state_errors(history, known)
    if judged and bool((errors > settings.rtol).any()):
        return Outcome.INACCURATE
    return Outcome.CONVERGED


def _state_errors(history: WearHistory, rows: NDArray[np.intp]) -> NDArray[np.float64]:
    """The larger of the estimated errors of response and wear rate; those that are not estimated count as 0."""
    response, rate = (np.nan_to_num(one[rows], posinf=np.inf) for one in _estimated(history))
    return np.asarray(np.maximum(response, rate))


def _estimated(history: WearHistory) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Estimated errors of response and wear rate."""
    return history.response_error, history.wear_rate_error


def _message(
    task: MarchTask,
    history: WearHistory,
    outcome: Outcome,
    place: int,
    slower: float,
    known: NDArray[np.intp],
    last: float,
) -> str:
    """What the outcome of a history does not say by itself.

    What the solver says counts the cycles of the march: it holds for the first history, and an error for all.
    """
    said = history.message if place == 0 or outcome is Outcome.EXCEPTION else ""
    if said or outcome is Outcome.CONVERGED or not known.size:
        return said
    worn = float(history.worn_volume_error[known[-1]])
    if outcome is Outcome.NO_FINAL_STATE:
        return f"at cycle {show_count(last)} the joint wears on at {slower * history.wear_rate[-1]:.6g} m3 a cycle"
    if outcome is Outcome.CONTACT_CUT_OFF:
        return describe_cut_off(history.cut_off_cycle / slower)
    if not outcome.complete:
        return describe_reach(last, math.inf if task.to_the_end is not None else task.cycles[-1], worn)
    if outcome is Outcome.SENSITIVE:
        return f"the worn volume {known_to(worn, task.settings.rtol)}"
    above = np.flatnonzero(_state_errors(history, known) > task.settings.rtol)
    if not above.size:
        return ""
    behind = known[above[0] :]
    response, rate = (float(np.nan_to_num(one[behind], posinf=np.inf).max()) for one in _estimated(history))
    cycle = float(history.cycles[behind[0]]) / slower
    begin = f"from cycle {show_count(cycle)} on " if cycle > 0.0 else ""
    what = "wear rate" if rate >= response else "response"
    return f"{begin}the {what} {known_to(max(rate, response), task.settings.rtol)}"


def _of_target(task: MarchTask, history: WearHistory, known: NDArray[np.intp], target: float, *, whole: bool) -> str:
    """That the target of a history was not reached, or that the counts behind it are not computed; else empty.

    known, whole: as in `scaled_outcome`.
    """
    if task.until is None or not known.size:
        return ""
    if not math.isnan(target):
        return "" if whole else f"at its target at cycle {show_count(target)}: later counts are not computed"
    if task.until.quantity == "frequency_shift":
        return f"frequency_shift stays below {task.until.value:g}"
    deepest, volume = history.wear_depth[known[-1]].max(initial=0.0), history.worn_volume[known[-1]]
    value, unit = (deepest, "m") if task.until.quantity == "wear_depth" else (volume, "m3")
    return f"{task.until.quantity} stays below {task.until.value:g} {unit}: it is {value:.3g} {unit} at the last count"


def _variable(
    history: WearHistory, name: str, slower: float, rows: NDArray[np.intp], reached: NDArray[np.bool_]
) -> NDArray[np.generic]:
    """A variable of the result at rows of the history; NaN, or 0 where it is a whole number, where not reached.

    slower: wear coefficient over that of the history.
    """
    values: NDArray[np.generic]
    if name == "response_amplitude":
        values = np.abs(history.response)
    elif name == "response_phase":
        values = np.angle(history.response)
    elif name == "wear_rate":
        values = slower * history.wear_rate
    elif name == "cycle_count":
        values = history.cycles / slower
    else:
        values = getattr(history, name)
    found = values[np.minimum(rows, len(values) - 1)]
    found[~reached] = np.nan if values.dtype.kind == "f" else 0
    return found


def _moves(start: StartState) -> bool:
    """Whether the relative motion in the joint is more than the round-off of its mean; no where there is no state."""
    if start.state is None:
        return False
    motion_h = start.state.displacement_h
    return bool(np.linalg.norm(motion_h[:, :, 1:]) > _ROUND_OFF * np.linalg.norm(motion_h))

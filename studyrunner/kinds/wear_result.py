"""What a result file holds of a wear history, for each of the points that share the history."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.outcome import Outcome
from solver.results.history import WearHistory, describe_cut_off, judge, last_error
from studyrunner.kinds.sharing import Integrated
from studyrunner.kinds.task import PointResult
from studyrunner.kinds.wear import History
from studyrunner.units import describe_reach, show_count
from studyrunner.variables import KEPT

_ROUND_OFF = 1e-10


def build_result(task: History, integrated: Integrated, history: WearHistory, place: int = 0) -> PointResult:
    """What the result file holds of one history of a task: the output counts and variables that the task asks for.

    integrated: the history that was integrated. place: number among those that are read from it.

    What is per cycle is per cycle of that history. It knows nothing of what came after its last count: jumps, errors,
    the end of the integrated history. What was computed of a history that ends early is kept. Effort is that of the
    integrated history.
    """
    scaled, own = integrated.histories[place], integrated.histories[0]
    slower = scaled.wear_coefficient / own.wear_coefficient if place else 1.0
    endless = task.to_the_end is not None and not integrated.unworn
    counts = history.cycles if endless else np.array(integrated.counts(task.cycles, scaled))
    rows = np.arange(counts.size) if endless else np.searchsorted(history.cycles, counts)
    reached = counts <= (1.0 + _ROUND_OFF) * history.last_cycle
    known = rows[reached]
    jump = history.jump_cycle
    if place:
        jump = jump / slower if endless or jump < (1.0 - _ROUND_OFF) * counts[-1] else math.nan
    target = history.cycles_to_target / slower
    if target > (1.0 + _ROUND_OFF) * counts[-1] / slower:
        # another history of the task goes farther
        target = math.nan
    life_error = math.nan if math.isnan(target) else history.cycles_to_target_error / slower
    whole = bool(reached.all())
    # one that was not reached to its end has ended as the integrated history has
    shared = place > 0 and whole and (not endless or history.outcome.complete)
    # of the integrated history, and of all without a start state
    own_message = place == 0 or not known.size or history.outcome is Outcome.EXCEPTION
    outcome, message = history.outcome, history.message if own_message else ""
    if shared:
        outcome, message = judge(history, known, task.settings.rtol, slower)
    last = 0.0 if task.to_the_end is not None else task.cycles[-1]
    if endless:
        last = history.last_cycle / slower
    elif not whole:
        last = min(history.last_cycle / slower, last)
    elif not outcome.complete and not integrated.unworn:
        last = min(history.last_cycle, last)
    depths = history.wear_depth[known]
    if not message and known.size and not outcome.complete:
        message = _end_of_shared(task, history, outcome, slower, known, last)
    of_its_own: dict[str, Any] = {
        "outcome": int(outcome),
        "jump_cycle": jump,
        "cycles_to_target": target,
        "cycles_to_target_error": life_error,
        "error_estimate": last_error(history, known, last),
        "step_limit": history.step_limit / slower,
        "last_cycle": last,
        "largest_wear_depth": float(depths.max(initial=0.0)) if known.size else math.nan,
        "message": message or _of_target(task, history, known, target, life_error, whole=whole),
    }
    of_task = {name: getattr(history, name) for name in KEPT if name not in of_its_own}
    variables = {name: _variable(history, name, slower, rows, reached) for name in task.variables}
    return PointResult(scaled.points, {**variables, **of_task, **of_its_own}, place)


def _end_of_shared(
    task: History, history: WearHistory, outcome: Outcome, slower: float, known: NDArray[np.intp], last: float
) -> str:
    """How far a history has come that ended before its last count, in cycles of its own.

    slower: wear coefficient over that of the integrated history. known: its rows. last: its last count.
    """
    if outcome is Outcome.NO_FINAL_STATE:
        return f"at cycle {show_count(last)} the joint wears on at {slower * history.wear_rate[-1]:.6g} m3 a cycle"
    if outcome is Outcome.CONTACT_CUT_OFF:
        return describe_cut_off(history.cut_off_cycle / slower)
    worn = float(history.worn_volume_error[known[-1]])
    return describe_reach(last, math.inf if task.to_the_end is not None else task.cycles[-1], worn)


def _of_target(
    task: History, history: WearHistory, known: NDArray[np.intp], target: float, error: float, *, whole: bool
) -> str:
    """That the target of a history was not reached, or that the counts after it are not computed; else empty.

    known: its rows that were reached. error: of the count `target`. whole: whether these are all.
    """
    if task.until is None or not known.size:
        return ""
    if not math.isnan(target):
        at = f"at its target at cycle {show_count(round(target))} +- {error:.2g}"
        return "" if whole else f"{at}: later counts are not computed"
    quantity, below = task.until.quantity, f"{task.until.quantity} stays below {task.until.value:g}"
    if quantity == "frequency_shift":
        return below
    deepest, volume = history.wear_depth[known[-1]].max(initial=0.0), history.worn_volume[known[-1]]
    value, unit = (deepest, "m") if quantity == "wear_depth" else (volume, "m3")
    return f"{below} {unit}: it is {value:.3g} {unit} at the last count"


def _variable(
    history: WearHistory, name: str, slower: float, rows: NDArray[np.intp], reached: NDArray[np.bool_]
) -> NDArray[np.generic]:
    """A variable of the result at rows of the history; NaN, or 0 where it is a whole number, where not reached.

    slower: wear coefficient over that of the history.
    """
    values: NDArray[np.generic]
    if name == "wear_depth_last":
        known = rows[reached]
        return history.wear_depth[known[-1]] if known.size else np.full_like(history.wear_depth[0], np.nan)
    if name == "response_amplitude":
        values = np.abs(history.response)
    elif name == "response_phase":
        values = np.angle(history.response)
    elif name == "wear_rate":
        values = slower * history.wear_rate
    elif name == "wear_depth_max":
        values = history.wear_depth.max(axis=1, initial=0.0)
    elif name == "wear_depth_max_error":
        deepest = np.nan_to_num(history.wear_depth).argmax(axis=1)
        values = np.take_along_axis(history.wear_depth_error, deepest[:, None], axis=1)[:, 0]
    elif name == "cycle_count":
        values = history.cycles / slower
    else:
        values = getattr(history, name)
    found = values[np.minimum(rows, len(values) - 1)]
    found[~reached] = np.nan if values.dtype.kind == "f" else 0
    return found

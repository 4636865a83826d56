"""What a result file holds of a wear history, for each of the points that share the history."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.outcome import Outcome
from solver.results.history import WearHistory, judge, last_error
from studyrunner.kinds.task import PointResult, deepest, describe_target, first_harmonic, named
from studyrunner.kinds.wear import History, Integrated
from studyrunner.units import describe_reach
from studyrunner.variables import OF_A_HISTORY

_ROUND_OFF = 1e-10


def build_result(task: History, integrated: Integrated, history: WearHistory, place: int = 0) -> PointResult:
    """What the result file holds of one history of a task: the output counts and variables that the task asks for.

    integrated: the history that was integrated. place: number among those that are read from it.

    What is per cycle is per cycle of that history. What came after its last count has no part in it: jumps, errors, the
    end of the integrated history. A history that ends early has the values up to there. Effort is that of the
    integrated history.
    """
    slower = integrated.wear_coefficients[place] / integrated.wear_coefficients[0] if place else 1.0
    endless = task.to_the_end is not None and not integrated.unworn
    counts = history.cycles if endless else np.array(integrated.counts(task.cycles, place))
    rows = np.arange(counts.size) if endless else np.searchsorted(history.cycles, counts)
    reached = counts <= (1.0 + _ROUND_OFF) * history.last_cycle
    known = rows[reached]
    # another history of the task may go farther
    farthest, whole = (1.0 + _ROUND_OFF) * counts[-1], bool(reached.all())
    jump = history.jump_cycle / slower if endless or history.jump_cycle <= farthest else math.nan
    target, life_error = math.nan, math.nan
    if history.cycles_to_target <= farthest:
        target, life_error = history.cycles_to_target / slower, history.cycles_to_target_error / slower
    # one that was not reached to its end has ended as the integrated history has
    shared = place > 0 and whole and (not endless or history.outcome.complete)
    # of the integrated history, and of all without a start state
    own_message = place == 0 or not known.size or history.outcome is Outcome.EXCEPTION
    outcome, message = history.outcome, history.message if own_message else ""
    if shared:
        outcome, message = judge(history, known, task.settings.rtol, slower)
    last = history.last_cycle / slower
    if not endless:
        asked = 0.0 if task.to_the_end is not None else task.cycles[-1]
        last = asked if whole else min(last, asked)
    depths = history.wear_depth[known]
    if not message and known.size and not outcome.complete:
        end = math.inf if task.to_the_end is not None else task.cycles[-1]
        message = describe_reach(last, end, float(history.worn_volume_error[known[-1]]))
    own: dict[str, Any] = {
        "outcome": int(outcome),
        "jump_cycle": jump,
        "cycles_to_target": target,
        "cycles_to_target_error": life_error,
        "error_estimate": last_error(
            history.cycles[known], history.worn_volume_error[known], history.wear_rate[known], last
        ),
        "step_limit": history.step_limit / slower,
        "last_cycle": last,
        "largest_wear_depth": float(depths.max(initial=0.0)) if known.size else math.nan,
        "message": message or (describe_target(task.until, target, "cycle", whole=whole) if known.size else ""),
    }
    values = _at_counts(history, task.variables, slower, rows, reached) | named(tuple(OF_A_HISTORY), own, history)
    return PointResult(values, place)


def _at_counts(
    history: WearHistory, names: Sequence[str], slower: float, rows: NDArray[np.intp], reached: NDArray[np.bool_]
) -> dict[str, NDArray[np.generic]]:
    """Variables of the result at rows of the history; NaN, or 0 in whole numbers, where not reached.

    slower: wear coefficient over that of the history.
    """
    own = {
        **first_harmonic(history.response),
        **deepest(history.wear_depth, history.wear_depth_error),
        "wear_rate": slower * history.wear_rate,
        "cycle_count": history.cycles / slower,
    }
    known, found = rows[reached], dict[str, NDArray[np.generic]]()
    for name in names:
        if name == "wear_depth_last":
            found[name] = history.wear_depth[known[-1]] if known.size else np.full_like(history.wear_depth[0], np.nan)
            continue
        values = own[name] if name in own else getattr(history, name)
        found[name] = values[np.minimum(rows, len(values) - 1)]
        found[name][~reached] = np.nan if values.dtype.kind == "f" else 0
    return found

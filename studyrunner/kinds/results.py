"""From what the solver returns to the variables of a result: of a wear history, and of a mission history."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from solver.outcome import Outcome
from solver.settings import WearTarget
from studyrunner.kinds.task import PointResult
from studyrunner.units import describe_reach, show_count
from studyrunner.variables import OF_A_HISTORY, OF_A_MISSION

if TYPE_CHECKING:
    from solver.missions.mission import MissionHistory
    from solver.results.history import WearHistory
    from studyrunner.kinds.missions import Mission
    from studyrunner.kinds.wear import History, Integrated

_ROUND_OFF = 1e-10


def first_harmonic(response: NDArray[np.complex128]) -> dict[str, NDArray[np.float64]]:
    """Variables of the first harmonic of the response, in the shape of the response."""
    return {"response_amplitude": np.abs(response), "response_phase": np.angle(response)}


def deepest(depth: NDArray[np.float64], error: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Variables of the deepest pair at each count, m, from depths (n_counts, n_contact) and their errors."""
    pair = np.nan_to_num(depth).argmax(axis=1)[:, None]
    of_deepest = np.take_along_axis(error, pair, axis=1)[:, 0]
    return {"wear_depth_max": depth.max(axis=1, initial=0.0), "wear_depth_max_error": of_deepest}


def describe_target(until: WearTarget | None, reached: float, counted: str, *, whole: bool) -> str:
    """That the target of a history was not reached, or that what comes after it is not computed; else empty.

    reached: count at which it was reached, else NaN. counted: what that counts. whole: whether all counts are computed.
    """
    if until is None or (whole and not math.isnan(reached)):
        return ""
    if math.isnan(reached):
        return f"{until.quantity} stays below {until.value:g}"
    return f"at its target at {counted} {show_count(round(reached))}: later {counted}s are not computed"


def named(names: Sequence[str], own: Mapping[str, Any], source: object) -> dict[str, Any]:
    """Variables by name: those of `own`, the others as the attributes of what the solver has returned."""
    return {name: own[name] if name in own else getattr(source, name) for name in names}


def build_result(task: "History", integrated: "Integrated", history: "WearHistory", place: int = 0) -> PointResult:
    """One history of a task at the output counts, with the variables that the task asks for.

    integrated: the history that was integrated. place: number among those that are read from it.

    What is per cycle is per cycle of that history. What came after its last count has no part in it: jumps, errors, the
    end of the integrated history. Effort is that of the integrated history.
    """
    from solver.results.history import judge, last_error  # a run alone needs it, and numba with it

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
    # of the integrated history, and of all without a start state
    own_message = place == 0 or not known.size or history.outcome is Outcome.EXCEPTION
    outcome, message = history.outcome, history.message if own_message else ""
    if place > 0 and whole and (not endless or history.outcome.complete):
        # one that was not reached to its end has ended as the integrated history has
        outcome, message = judge(history, known, task.settings.rtol, slower)
    last, end = history.last_cycle / slower, math.inf if task.to_the_end is not None else task.cycles[-1]
    if not endless:
        asked = 0.0 if task.to_the_end is not None else end
        last = asked if whole else min(last, asked)
    if known.size and not outcome.complete:
        reach = describe_reach(last, end, float(history.worn_volume_error[known[-1]]))
        message = "; ".join(filter(None, (message, reach)))
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
        "largest_wear_depth": float(history.wear_depth[known].max(initial=0.0)) if known.size else math.nan,
        "message": message or (describe_target(task.until, target, "cycle", whole=whole) if known.size else ""),
    }
    values = _at_counts(history, task.variables, slower, rows, reached) | named(tuple(OF_A_HISTORY), own, history)
    return PointResult(values, place)


def _at_counts(
    history: "WearHistory", names: Sequence[str], slower: float, rows: NDArray[np.intp], reached: NDArray[np.bool_]
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


def mission_values(task: "Mission", history: "MissionHistory") -> dict[str, Any]:
    """Variables of the result, at the numbers of missions that the task asks for."""
    from solver.results.history import last_error

    counts = np.array(task.missions)
    rows, ends = (np.searchsorted(history.missions, each) for each in (counts, np.clip(counts, 1.0, None)))
    in_mission = history.block_volume[ends] - history.block_volume[ends - 1]
    rate, worn = in_mission.sum(axis=1), history.worn_volume[rows]
    share = np.divide(in_mission, rate[:, None], out=np.full_like(in_mission, np.nan), where=rate[:, None] > 0.0)
    reached = np.flatnonzero(np.isfinite(worn))
    last = history.wear_depth[rows[reached[-1]] if reached.size else 0]
    is_state = np.isfinite(history.worn_volume).any() and np.isfinite(history.response_begin).any()
    of_depth = ("worn_volume", "worn_volume_error", "wear_depth", "wear_depth_error")
    whole, target = history.last_mission >= task.missions[-1], ""
    if history.outcome.complete:
        target = describe_target(task.until, history.missions_to_target, "mission", whole=whole)
    own: Mapping[str, object] = {
        **{name: getattr(history, name)[rows] for name in (*of_depth, "response_error", "response_peak_begin")},
        **deepest(history.wear_depth[rows], history.wear_depth_error[rows]),
        **first_harmonic(history.response_end[rows]),
        "wear_rate": np.where(np.isfinite(worn), rate, np.nan),
        "wear_depth_last": last,
        "block_worn_volume": history.block_volume[rows],
        "block_worn_volume_error": history.block_volume_error[rows],
        "block_share": share,
        "response_amplitude_begin": np.abs(history.response_begin[rows]),
        "response_peak": history.response_peak_end[rows],
        "excitation_frequency": history.excitation_frequency[:, 1],
        "excitation_frequency_begin": history.excitation_frequency[:, 0],
        "block_cycles": np.array([block.cycles for block in task.blocks]),
        "outcome": int(history.outcome),
        # a mission is computed for the vibration at 0
        "error_estimate": last_error(
            counts[reached],
            history.worn_volume_error[rows[reached]],
            rate[reached],
            min(history.last_mission, counts[-1]),
        ),
        "last_mission": min(history.last_mission, float(counts[-1])) if is_state else math.nan,
        "largest_wear_depth": float(last.max(initial=0.0)) if reached.size else math.nan,
        "message": "; ".join(filter(None, (history.message, target))),
    }
    return named((*task.variables, *OF_A_MISSION), own, history)

"""What a result file holds of a mission history."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from solver.missions.mission import MissionHistory
from solver.model import FloatArray
from studyrunner.kinds.missions import Mission
from studyrunner.kinds.task import PointResult
from studyrunner.percent import show_count


def missions_read(kept: Sequence[float]) -> tuple[int, ...]:
    """Numbers of missions at which a history is read: those of the result, and those before, for the wear of one."""
    counts = {int(count) for count in kept}
    return tuple(sorted({0, 1} | counts | {max(count - 1, 0) for count in counts}))


def build_mission_result(task: Mission, history: MissionHistory) -> PointResult:
    """The result of a task with a mission history, at the numbers of missions that the task asks for."""
    counts = np.array(task.missions)
    rows, ends = (np.searchsorted(history.missions, each) for each in (counts, np.clip(counts, 1.0, None)))
    in_mission = history.block_volume[ends] - history.block_volume[ends - 1]
    rate = in_mission.sum(axis=1)
    deepest = np.nan_to_num(history.wear_depth[rows]).argmax(axis=1)[:, None]
    reached = np.flatnonzero(np.isfinite(history.worn_volume[rows]))
    last = rows[reached[-1]] if reached.size else 0
    of_task: Mapping[str, object] = {
        "worn_volume": history.worn_volume[rows],
        "wear_rate": np.where(np.isfinite(history.worn_volume[rows]), rate, np.nan),
        "wear_depth": history.wear_depth[rows],
        "wear_depth_max": history.wear_depth[rows].max(axis=1, initial=0.0),
        "wear_depth_max_error": np.take_along_axis(history.wear_depth_error[rows], deepest, axis=1)[:, 0],
        "wear_depth_last": history.wear_depth[last],
        "block_worn_volume": history.block_volume[rows],
        "block_worn_volume_error": history.block_volume_error[rows],
        "block_share": _shares(in_mission, rate),
        "response_amplitude": np.abs(history.response_end[rows]),
        "response_phase": np.angle(history.response_end[rows]),
        "response_amplitude_begin": np.abs(history.response_begin[rows]),
        "response_peak": history.response_peak_end[rows],
        "response_peak_begin": history.response_peak_begin[rows],
        "response_error": history.response_error[rows],
        "excitation_frequency": history.excitation_frequency[:, 1],
        "excitation_frequency_begin": history.excitation_frequency[:, 0],
        "block_cycles": np.array([block.cycles for block in task.blocks]),
        "sweep_rate": history.sweep_rate,
        "worn_volume_error": history.worn_volume_error[rows],
        "wear_depth_error": history.wear_depth_error[rows],
    }
    kept = {
        "outcome": int(history.outcome),
        "missions_to_target": history.missions_to_target,
        "missions_to_target_error": history.missions_to_target_error,
        "newton_iterations": history.newton_iterations,
        "run_time": history.run_time,
        # a mission is computed for the vibration at 0
        "error_estimate": history.error_estimate if counts[-1] > 0.0 else 0.0,
        "last_mission": _last(history, counts),
        "largest_wear_depth": float(history.wear_depth[last].max(initial=0.0)) if reached.size else math.nan,
        "message": "; ".join(filter(None, (history.message, _of_target(task, history)))),
    }
    return PointResult(task.points(0), {**{name: of_task[name] for name in task.variables}, **kept})


def _shares(in_mission: FloatArray, rate: FloatArray) -> FloatArray:
    """Shares (n_output, n_block) of the blocks in the volume worn in a mission, NaN where nothing wears."""
    return np.divide(in_mission, rate[:, None], out=np.full_like(in_mission, np.nan), where=rate[:, None] > 0.0)


def _last(history: MissionHistory, counts: FloatArray) -> float:
    """Number of missions up to which the point was computed; NaN where there is no state at all."""
    if not np.isfinite(history.worn_volume).any() or not np.isfinite(history.response_begin).any():
        return math.nan
    return min(history.last_mission, float(counts[-1]))


def _of_target(task: Mission, history: MissionHistory) -> str:
    """What there is to say of the target."""
    if task.until is None or not history.outcome.complete:
        return ""
    if math.isnan(history.missions_to_target):
        return f"{task.until.quantity} stays below {task.until.value:g}"
    if history.last_mission < task.missions[-1]:
        return f"at its target at mission {show_count(round(history.missions_to_target))}: later ones are not computed"
    return ""

"""A mission of one block whose tangential history is carried on: one wear history over all its cycles."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from solver.loading_history.start_states import follow_branch
from solver.loading_history.sweep_start import Direction
from solver.missions.blocks import Mission, Passage
from solver.missions.result import MissionHistory
from solver.model import IntArray
from solver.packing import Packed
from solver.results.history import WearHistory
from solver.wear.history import integrate_wear
from solver.wear.solutions import SlowTime


def is_one_history(mission: Mission) -> bool:
    """Whether a mission history is one wear history."""
    block = mission.blocks[0]
    if len(mission.blocks) > 1 or isinstance(block.frequency, Passage):
        return False
    return block.way == "continue" or mission.missions[-1] == 1


def integrate_one_block(
    mission: Mission, keep: Callable[[Packed], None] | None = None, resume: Packed | None = None
) -> MissionHistory:
    """The wear history of the only block, read at its missions; arguments as of `integrate_missions`."""
    (block,) = mission.blocks
    frequency, cycles = block.steady
    sweep: Direction = mission.first if block.way == "continue" else block.way
    _, start = next(
        follow_branch(
            block.model,
            block.friction_coefficient,
            block.excitation_amplitude,
            np.array([frequency]),
            sweep,
            mission.settings,
        )
    )
    ends = np.array(mission.missions, np.float64)
    begins = np.clip(ends - 1.0, 0.0, None)
    read = np.unique(np.concatenate([ends, begins, begins + 1.0]))
    asked = SlowTime(mission.wear_coefficient, "adaptive", cycles * read, law=mission.law, until=mission.until)
    history = integrate_wear(block.model, block.friction_coefficient, mission.settings, start, asked, keep, resume)
    rows, of_begins = np.searchsorted(read, ends), np.searchsorted(read, begins)
    rows_of_missions = of_begins, np.searchsorted(read, begins + 1.0)
    return _as_missions(history, mission, rows, rows_of_missions)


def _as_missions(
    history: WearHistory, mission: Mission, rows: IntArray, mission_rows: tuple[IntArray, IntArray]
) -> MissionHistory:
    """A wear history in missions. rows: of the missions; mission_rows: of begin and end of the missions before."""
    _, cycles = mission.blocks[0].steady
    volume, error = history.worn_volume[rows], history.worn_volume_error[rows]
    responses: dict[str, Any] = {}
    for name in ("response", "response_peak"):
        for place, at in zip(("begin", "end"), mission_rows, strict=True):
            responses[f"{name}_{place}"] = np.where(
                np.isfinite(volume)[:, None, None], getattr(history, name)[at][:, None], np.nan
            )
    known = np.fmax(*(history.response_error[at] for at in mission_rows))
    return MissionHistory(
        **responses,
        response_error=np.where(np.isfinite(volume), known, np.nan)[:, None],
        excitation_frequency=mission.frequencies,
        outcome=history.outcome,
        message=history.message,
        missions=np.array(mission.missions, np.float64),
        worn_volume=volume,
        worn_volume_error=error,
        wear_depth=history.wear_depth[rows],
        wear_depth_error=history.wear_depth_error[rows],
        block_volume=volume[:, None],
        block_volume_error=error[:, None],
        reference_volume=history.reference_volume[rows],
        sweep_rate=np.zeros(1),
        error_estimate=history.error_estimate,
        last_mission=history.last_cycle / cycles,
        steps=np.array([history.last_cycle / cycles]),
        missions_to_target=history.cycles_to_target / cycles,
        missions_to_target_error=history.cycles_to_target_error / cycles,
        newton_iterations=history.newton_iterations,
        run_time=history.run_time,
    )

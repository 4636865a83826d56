"""Blocks of missions whose wear follows a formula, in place of their harmonic balance; and a study of such blocks."""

from typing import Any

import numpy as np
import pytest

from solver.harmonic_balance.state import Failure
from solver.missions import history
from solver.missions.block_run import BlockRun
from solver.missions.mission import Passage
from solver.outcome import Outcome
from solver.wear.slow_time import Guide

STUDY = """
[study]
name = "slider_missions"
[scene]
model = "sdof_slider"
[axes]
frequency = [160, 161]
wear_coefficient = [1e-11, 2e-11]
sweep = ["up", "down"]
[slow_time]
missions = 300
outputs = 4
[[mission]]
name = "run-up"
frequency = {start = 150, stop = 170, rate = 1.0}
excitation_amplitude = 10.0
[[mission]]
name = "cruise"
begin = "sweep"
seconds = 10
[[mission]]
name = "heavy"
normal_load = 12.0
frequency = 155.0
excitation_amplitude = 14.0
cycles = 1000
"""

_DEPTH = 1e-3
"""Depth, m, at which nothing would wear any more."""


class FakedBlocks:
    """Stands for `run_block` and `run_passage`. computed: cases so far. disturb: called with the number of each."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.computed: list[Any] = []
        self.fails: dict[str, Outcome] = {}
        self.disturb: Any = lambda _: None
        for name in ("run_block", "run_passage"):
            monkeypatch.setattr(history, name, self.run)

    def run(self, case: Any) -> BlockRun | Failure:
        """Wear with the rate k_w P A (1 - W / _DEPTH); the reference solution wears by 0.1 % more."""
        self.disturb(len(self.computed))
        self.computed.append(case)
        block, contact = case.block, case.block.model.contact
        cycles = block.frequency.cycles if isinstance(block.frequency, Passage) else block.cycles
        rate = case.mission.wear_coefficient * block.excitation_amplitude * load_of(block) * block.ends[1] * 1e-5
        rate = rate * (1.0 if case.guide is None else 1.001) * (1.0 - (case.depth + contact.gap) / _DEPTH)
        response = 1e-6 * block.excitation_amplitude * (1.0 + case.depth.sum() + np.array([[0.0], [1.0]]))
        if block.name in self.fails:
            return Failure(self.fails[block.name])
        slope = np.zeros((rate.size, rate.size)) if case.with_slope else None
        return BlockRun(
            cycles * rate, response.astype(complex), 1.5 * response, slope, 1e-3, guide=Guide((), 1.0), iterations=7
        )  # fmt: skip


def load_of(block: Any) -> float:
    """Static load of the model of a block, N."""
    return float(np.abs(block.model.linear[0].load_static).max())

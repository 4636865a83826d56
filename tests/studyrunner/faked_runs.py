"""Stand-ins for the solver in runs of the command, for its wear histories, and for blocks of missions."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import pytest

from solver.harmonic_balance.state import Failure
from solver.missions import history as missions
from solver.missions.block_run import BlockResult
from solver.outcome import Outcome
from solver.results.history import WearHistory
from solver.settings import Passage
from solver.wear.slow_time import Guide
from studyrunner.kinds.task import Keep, PointResult, Result, Task
from studyrunner.kinds.wear.histories import History, Sweep
from studyrunner.scene.scene import describe_scene
from tests.studyrunner.fakes import fake_evaluate


class Solver:
    """A stand-in that counts what it does.

    disturb: called with each task and the number of its result. change: makes another result of a history.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.tasks: list[Task] = []
        self.n_results = 0
        self.disturb: Callable[[Task, int], None] = lambda *_: None
        self.change: Callable[[Task, PointResult], PointResult] = lambda _, result: result
        for kind in (Sweep, History):
            monkeypatch.setattr(kind, "compute", lambda *given: self.evaluate(*given))

    def evaluate(self, task: Task, models: Mapping[int, object], _: Keep) -> Iterator[Result]:
        self.tasks.append(task)
        for result in fake_evaluate(task, describe_scene(models[task.scenes[0]])):
            self.n_results += 1
            self.disturb(task, self.n_results)
            yield self.change(task, result) if isinstance(result, PointResult) else result

    def end_at(self, number: int) -> None:
        """The run is interrupted at its result of this number, counted from the last beginning on."""

        def interrupt(_: Task, n_results: int) -> None:
            if n_results >= number:
                raise KeyboardInterrupt

        self.disturb = interrupt

    def begin_again(self) -> None:
        self.__dict__.update(tasks=[], n_results=0, disturb=lambda *_: None)


# --- histories ---

LIKE_VOLUME = ("worn_volume", "wear_rate", "penetration", "tension", "cone_violation", "energy_error", "friction_use")
LIKE_DEPTH = (
    *(
        "wear_depth",
        "dissipated_energy",
        "pair_friction",
        "pair_stiffness",
        "mean_pressure",
        "slip_range",
        "open_fraction",
        "friction_power",
    ),
    *("response_mean", "response_peak"),
)


def history(cycles: list[float], outcome: Outcome = Outcome.CONVERGED, loops: np.ndarray | None = None) -> WearHistory:
    """At these cycle counts: variables count from 0, or from what is theirs. loops: displacements, minus forces."""
    n = len(cycles)
    line, pair = np.arange(float(n)), np.arange(float(n)).reshape(n, 1)
    loops = np.zeros((n, 0, 128, 3)) if loops is None else loops
    of_cycles = {
        **dict.fromkeys(LIKE_VOLUME, line),
        **dict.fromkeys(LIKE_DEPTH, pair),
        "response": (1.0 + pair) * 1j,
        "excitation_frequency": 100.0 + line,
        "excitation_frequency_error": 0.1 * line,
        "residual": 1e-9 * line,
        "response_error": 1e-3 * line,
        "wear_rate_error": np.full(n, np.nan),
        "harmonics_used": np.arange(n) + 3,
        "samples_used": np.full(n, 64),
        "worn_volume_error": 0.03 * line,
        "wear_depth_error": 0.1 * pair,
        "dissipated_energy_error": 0.1 * pair,
        "reference_volume": 1.5 * line,
    }
    totals = {"jump_cycle": np.nan, "error_estimate": 0.0, "newton_iterations": 7, "run_time": 0.5, "branch": 2}
    totals |= {"last_cycle": float(cycles[-1]), "fold_frequency": 101.5, "step_limit": 250.0, "message": "lost"}
    at = np.array(cycles)
    return WearHistory(outcome=outcome, cycles=at, loop_displacement=loops, loop_force=-loops, **of_cycles, **totals)


# --- missions ---

_DEPTH = 1e-3
"""Depth, m, at which nothing would wear any more."""


class FakedBlocks:
    """Stands for `run_block` and `run_passage`. computed: cases so far. disturb: called with the number of each."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.computed: list[Any] = []
        self.fails: dict[str, Outcome] = {}
        self.disturb: Any = lambda _: None
        for name in ("run_block", "run_passage"):
            monkeypatch.setattr(missions, name, self.run)

    def run(self, case: Any) -> BlockResult | Failure:
        """Wear with the rate k_w P A (1 - W / _DEPTH); the reference solution wears by 0.1 % more."""
        self.disturb(len(self.computed))
        self.computed.append(case)
        block, contact = case.block, case.block.model.contact
        cycles = block.frequency.cycles if isinstance(block.frequency, Passage) else block.cycles
        rate = case.mission.wear_coefficient * block.excitation_amplitude * load_of(block) * block.ends[1] * 1e-5
        rate = rate * (1.0 if case.guide is None else 1.001) * (1.0 - (case.depth + contact.gap) / _DEPTH)
        response = 1e-6 * block.excitation_amplitude * (1.0 + case.depth.sum() + np.array([[0.0], [1.0]]))
        if block.name in self.fails:
            return Failure(self.fails[block.name], "lost")
        slope = np.zeros((rate.size, rate.size)) if case.with_slope else None
        growth, rest = cycles * rate, {"guide": Guide((), 1.0), "iterations": 7}
        return BlockResult(growth, 1e9 * growth, response.astype(complex), 1.5 * response, slope, 1e-3, **rest)


def load_of(block: Any) -> float:
    """Static load of the model of a block, N."""
    return float(np.abs(block.model.linear[0].load_static).max())

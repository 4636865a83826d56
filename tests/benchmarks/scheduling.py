"""How busy up to 4096 ranks are: recorded costs of tasks, replayed through the real scheduling code.

    python -m tests.benchmarks.scheduling [usual] [focus] [steps] [many_lines] [one_line] [samples]

The costs are those of the bundled dovetail sector in `dovetail_costs.csv`, and of the bundled study `scatter` in
`scatter_costs.csv`, see `record_costs`. Every line of a study gets the recorded one, shifted along the frequency and
scaled by a factor, and every task a factor of its own; all are drawn once and do not depend on the number of ranks.
`known` is the efficiency where all costs are known before, with the longest way first. `possible` is the efficiency
that no order of the tasks exceeds: the longest way along a sweep and through a history from it bounds the time of a
run.

4096 samples on 256 ranks are 0.965 busy. On 1024 ranks each has four samples, 8 tasks of about 3 to 6 s: 0.87, where
known costs give 0.95, and the ranks end half a task apart on average. What a history takes follows from its start state
only in part: the rank correlation with its unknowns, which the cost model uses, is 0.57, with the iterations and the
run time of the sweep it is below 0.1.
"""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studyrunner.kinds.kind import build_tasks
from studyrunner.kinds.task import StartResult, TaskPlan
from studyrunner.kinds.wear import History, Sweep
from studyrunner.study.study_file import read_study
from tests.benchmarks.frame import Table, arguments
from tests.benchmarks.simulation import Overheads, Replay, lognormal, replay

N_DISPLACEMENTS = 144
RANKS = (2, 16, 64, 256, 1024, 4096)
SHIFT = 0.2  # Hz, at most, from line to line
SPREAD_LINE, SPREAD_TASK = 0.3, 0.2
RECORDED_STEPS = 100
LEAST_WEAR = 3e-12  # recorded: this and ten times as much


@dataclass(frozen=True)
class Shape:
    """Sizes of the axes of a study of 10 000 points and the steps of a history; n_samples: of a study with samples."""

    n_frequencies: int = 1
    n_amplitudes: int = 1
    n_sweeps: int = 1
    n_wear: int = 1
    n_steps: int = 1
    first: float = 209.5
    last: float = 213.5
    most_wear: float = 3e-11
    n_step_sizes: int = 1
    n_samples: int = 0

    def build_plan(self) -> TaskPlan:
        """The tasks of such a study of the bundled dovetail sector."""
        if self.n_samples:
            # as they are where pairs have no draws of their own
            samples = [f"scatter.samples={self.n_samples}", "scatter.gap={normal={std=1e-7}}"]
            return build_tasks(read_study("scatter", samples), N_DISPLACEMENTS)
        sizes = (
            f"axes.frequency={{start = {self.first}, stop = {self.last}, num = {self.n_frequencies}}}",
            f"axes.excitation_amplitude={np.linspace(0.3, 0.7, self.n_amplitudes).tolist()}",
            f"axes.sweep={['up', 'down'][: self.n_sweeps]}",
            f"axes.wear_coefficient={np.linspace(LEAST_WEAR, self.most_wear, self.n_wear).tolist()}",
            "axes.scheme=implicit",
            f"slow_time.cycles={1000 * self.n_steps}",
            f"axes.step={[1000.0 * size for size in range(1, self.n_step_sizes + 1)]}",
        )
        return build_tasks(read_study("dovetail", sizes), N_DISPLACEMENTS)


SHAPES = {
    "usual": Shape(100, 5, 2, 10, 500),
    "focus": Shape(100, 5, 2, 10, 500, 210.9, 212.5),
    "steps": Shape(25, 20, 2, 1, 2000, 211.8, 211.9, 6e-12, 10),
    "many_lines": Shape(25, 20, 2, 10, 500, 210.9, 212.5),
    "one_line": Shape(1000, 1, 1, 10, 500, 210.9, 212.5),
    "samples": Shape(n_samples=4096),
}
"""usual: the range of the bundled study, most of which rests. focus: where the joint slips. steps: at a resonance with
little wear, uneven by the step axis, which the plan knows."""


def recorded(name: str) -> list[dict[str, str]]:
    """The rows of a file of recorded costs."""
    with Path(__file__).with_name(name).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


class RecordedCosts:
    """Costs of the tasks of a study with the shape of the recorded ones."""

    def __init__(self, plan: TaskPlan, n_steps: int) -> None:
        rows = recorded("dovetail_costs.csv")
        starts = [row for row in rows if float(row["wear_coefficient"]) == 0.0]
        self._lead_in = float(starts[0]["seconds"])
        # The first one has the lead-in; without, it costs what the second does.
        self._starts = [float(row["seconds"]) for row in (starts[1], *starts[1:])]
        self._unknowns = [int(row["n_unknowns"]) for row in starts]
        self._moves = [row["moves"] == "1" for row in starts]
        places = {row["frequency"]: place for place, row in enumerate(starts)}
        self._marches: dict[int, list[float]] = {}
        for row in rows:
            if float(row["wear_coefficient"]) > 0.0:
                self._marches.setdefault(places[row["frequency"]], []).append(float(row["seconds"]))
        self._n_steps, rng = n_steps, np.random.default_rng(0)
        self._shifts = rng.uniform(-SHIFT, SHIFT, len(plan.sweeps))
        self._factors = [lognormal(rng, SPREAD_LINE) for _ in plan.sweeps]
        self._start_factors = np.exp(SPREAD_TASK * rng.standard_normal((len(plan.sweeps), 10_000)))
        self._history_factors = np.exp(SPREAD_TASK * rng.standard_normal(len(plan.results)))
        self._recorded = [float(row["frequency"]) for row in starts]

    def start(self, sweep: Sweep, place: int) -> tuple[StartResult, float]:
        """A start state and its cost, s."""
        at = self._place(sweep.number, sweep.frequencies[place])
        seconds = self._starts[at] + (self._lead_in if place == sweep.order[0] else 0.0)
        seconds *= self._factors[sweep.number] * self._start_factors[sweep.number, place]
        return StartResult(place, None, self._moves[at], self._unknowns[at]), seconds

    def history(self, task: History) -> float:
        """Cost of a history, s."""
        place = self._place(task.sweep, task.frequency)
        nearest = min(self._marches, key=lambda other: (self._moves[other] != self._moves[place], abs(other - place)))
        # Between the two wear coefficients that were recorded, and beyond, as a power of it.
        least, most = self._marches[nearest]
        seconds = least * (most / least) ** np.log10(task.wear_coefficient / LEAST_WEAR)
        if self._moves[place]:
            seconds *= self._n_steps * sum(1000.0 / each.step for each in task.integrated) / RECORDED_STEPS
        return float(seconds) * self._factors[task.sweep] * float(self._history_factors[task.number])

    def _place(self, sweep: int, frequency: float) -> int:
        """Recorded frequency that stands for one of a line."""
        first, last = self._recorded[0], self._recorded[-1]
        share = (frequency + self._shifts[sweep] - first) / (last - first)
        return int(np.clip(round(share * (len(self._recorded) - 1)), 0, len(self._recorded) - 1))


class CostsOfSamples:
    """Costs of samples: each is one of the samples of the bundled study, see `record_costs`, times a factor."""

    def __init__(self, plan: TaskPlan) -> None:
        rows, rng = recorded("scatter_costs.csv"), np.random.default_rng(0)
        self._rows = [rows[number] for number in rng.integers(len(rows), size=len(plan.sweeps))]
        self._factors = np.exp(SPREAD_TASK * rng.standard_normal((len(plan.sweeps), 2)))

    def start(self, sweep: Sweep, place: int) -> tuple[StartResult, float]:
        """A start state and its cost, s."""
        row = self._rows[sweep.number]
        seconds = float(row["start_seconds"]) * float(self._factors[sweep.number, 0])
        return StartResult(place, None, row["moves"] == "1", int(row["n_unknowns"])), seconds

    def history(self, task: History) -> float:
        """Cost of a history, s."""
        return float(self._rows[task.sweep]["seconds"]) * float(self._factors[task.sweep, 1])


def replay_shape(shape: Shape, n_ranks: int, overheads: Overheads, *, known: bool = False) -> Replay:
    """A study of this shape on so many ranks. known: as in `replay`."""
    plan = shape.build_plan()
    costs = CostsOfSamples(plan) if shape.n_samples else RecordedCosts(plan, shape.n_steps)
    return replay(plan, costs.start, costs.history, n_ranks, overheads, known=known)


def main() -> None:
    """Prints a table for each shape."""
    overheads = Overheads()
    for name in arguments(__doc__, tuple(SHAPES)).chosen:
        table = Table(name, "time, s", "efficiency", "known", "possible")
        for n_ranks in RANKS:
            found, known = (replay_shape(SHAPES[name], n_ranks, overheads, known=known) for known in (False, True))
            table.row(f"{n_ranks} ranks", found.makespan, found.efficiency, known.efficiency, found.possible)


if __name__ == "__main__":
    main()

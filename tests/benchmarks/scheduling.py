"""How busy up to 4096 ranks are: recorded costs of tasks, replayed through the real scheduling code.

    python -m tests.benchmarks.scheduling [usual] [many_lines] [one_line] [samples] [--ranks 64 1024]

Only the computing and the messages are simulated. Which rank gets which task, what is learnt of costs and which tasks a
result makes possible is decided by `studyrunner.mpi.dispatch` and `studyrunner.task_runs`.

The costs are CPU seconds of one core. `dovetail_costs.csv`: the bundled dovetail, a sweep along 100 frequencies from
209.5 to 213.5 Hz, and two implicit histories of 100 steps from every fourth of them (wear coefficient 0: the start
state). `scatter_costs.csv`: the start state and the history of each sample of the bundled study. Every sweep of a study
gets the recorded one, shifted along the frequency and scaled by a factor, and every task a factor of its own; all are
drawn once and do not depend on the number of ranks. `possible` is the efficiency that no order of the tasks exceeds:
the longest way along a sweep and through a history from it bounds the time of a run.

4096 samples on 256 ranks are 0.965 busy. On 1024 ranks each has four samples, 8 tasks of about 3 to 6 s: 0.87, where
known costs would give 0.95. What a history takes follows from its start state only in part: the rank correlation with
its unknowns, which the cost model uses, is 0.57, with the iterations and the run time of the sweep it is below 0.1.
"""

import csv
import heapq
import itertools
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from studyrunner.kinds.task import PointResult, Result, StartResult, Task, TaskPlan
from studyrunner.kinds.wear.histories import History, Sweep
from studyrunner.mpi.dispatch import Dispatcher
from studyrunner.study.study_file import read_study
from studyrunner.task_runs import StudyRun
from tests.benchmarks.frame import Table, arguments
from tests.studyrunner.fakes import plan_of

N_DISPLACEMENTS = 144
SHIFT = 0.2  # Hz, at most, from sweep to sweep
SPREAD_SWEEP, SPREAD_TASK = 0.3, 0.2
RECORDED_STEPS = 100
LEAST_WEAR = 3e-12  # recorded: this and ten times as much
# s: of the master for a result and for an assignment, one after the other, and until a message is looked at
RESULT, ASSIGNMENT, LATENCY = 3e-4, 1e-4, 1e-3


def dovetail(n_frequencies: int, n_amplitudes: int, n_sweeps: int, first: float = 210.9, last: float = 212.5):
    """Study and overrides: sizes of its axes, and frequencies, Hz, between which the joint slips unless given."""
    return "dovetail", (
        f"axes.frequency={{start = {first}, stop = {last}, num = {n_frequencies}}}",
        f"axes.excitation_amplitude={np.linspace(0.3, 0.7, n_amplitudes).tolist()}",
        f"axes.sweep={['up', 'down'][:n_sweeps]}",
        f"axes.wear_coefficient={np.linspace(LEAST_WEAR, 3e-11, 10).tolist()}",
        "axes.scheme=implicit",
        "slow_time.cycles=500_000",
    )


STUDIES = {
    # the range of the bundled study, most of which rests
    "usual": dovetail(100, 5, 2, 209.5, 213.5),
    "many_lines": dovetail(25, 20, 2),
    "one_line": dovetail(1000, 1, 1),
    # as they are where pairs have no draws of their own
    "samples": ("scatter", ("scatter.samples=4096", "scatter.gap={normal={std=1e-7}}")),
}


def recorded(study: str) -> list[dict[str, float]]:
    with Path(__file__).with_name(f"{study}_costs.csv").open(encoding="utf-8") as file:
        return [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]


def start_result(place: int, row: dict[str, float]) -> StartResult:
    return StartResult(place, None, bool(row["moves"]), int(row["n_unknowns"]))


class DovetailCosts:
    """Costs, s, of the tasks of a study with the shape of the recorded one."""

    def __init__(self, plan: TaskPlan) -> None:
        rows, rng = recorded("dovetail"), np.random.default_rng(0)
        self._starts = [row for row in rows if row["wear_coefficient"] == 0.0]
        self._frequencies = [row["frequency"] for row in self._starts]
        self._histories: dict[int, list[float]] = {}
        for row in rows:
            if row["wear_coefficient"] > 0.0:
                place = self._frequencies.index(row["frequency"])
                self._histories.setdefault(place, []).append(row["seconds"])
        self._shifts = rng.uniform(-SHIFT, SHIFT, len(plan.sweeps))
        self._factors = np.exp(SPREAD_SWEEP * rng.standard_normal(len(plan.sweeps)))
        self._start_factors = np.exp(SPREAD_TASK * rng.standard_normal((len(plan.sweeps), 10_000)))
        self._history_factors = np.exp(SPREAD_TASK * rng.standard_normal(len(plan.results)))

    def start(self, sweep: Sweep, place: int) -> tuple[StartResult, float]:
        """A start state and its cost: the first of a sweep has the way to it, which the recorded one had."""
        at = self._place(sweep.number, sweep.frequencies[place])
        seconds = self._starts[max(at, 1)]["seconds"]
        seconds += self._starts[0]["seconds"] if place == sweep.order[0] else 0.0
        seconds *= self._factors[sweep.number] * self._start_factors[sweep.number, place]
        return start_result(place, self._starts[at]), float(seconds)

    def history(self, task: History) -> float:
        """As a power of the wear coefficient, by the two that were recorded nearby."""
        place = self._place(task.sweep, task.frequency)
        moves = self._starts[place]["moves"]
        nearest = min(self._histories, key=lambda at: (self._starts[at]["moves"] != moves, abs(at - place)))
        least, most = self._histories[nearest]
        seconds = least * (most / least) ** np.log10(task.wear_coefficient / LEAST_WEAR)
        if moves:
            seconds *= sum(task.cycles[-1] / each.step for each in task.integrated) / RECORDED_STEPS
        return float(seconds * self._factors[task.sweep] * self._history_factors[task.number])

    def _place(self, sweep: int, frequency: float) -> int:
        """Recorded frequency that stands for one of a sweep."""
        return int(np.argmin(np.abs(np.array(self._frequencies) - frequency - self._shifts[sweep])))


class ScatterCosts:
    """Costs, s, as those of `DovetailCosts`: each sample is one of the recorded samples, times a factor."""

    def __init__(self, plan: TaskPlan) -> None:
        rows, rng = recorded("scatter"), np.random.default_rng(0)
        self._rows = [rows[number] for number in rng.integers(len(rows), size=len(plan.sweeps))]
        self._factors = np.exp(SPREAD_TASK * rng.standard_normal((len(plan.sweeps), 2)))

    def start(self, sweep: Sweep, place: int) -> tuple[StartResult, float]:
        row = self._rows[sweep.number]
        return start_result(place, row), float(row["start_seconds"] * self._factors[sweep.number, 0])

    def history(self, task: History) -> float:
        return float(self._rows[task.sweep]["seconds"] * self._factors[task.sweep, 1])


class MemoryIndex:
    """Takes the place of `CompletionIndex`, without a disk: nothing is there from an earlier run."""

    n_points_finished = 0
    store = SimpleNamespace(crashes=())

    def __init__(self, plan: TaskPlan) -> None:
        # names as in a file
        self.plan = replace(
            plan,
            make_sweeps=lambda: (replace(task, names=(f"sweep {task.number}",)) for task in plan.make_sweeps()),
            make=[replace(task, names=(str(task.number),)) for task in plan.results].__iter__,
        )

    def sweeps_left(self) -> list[Task]:
        return list(self.plan.sweeps)

    def is_finished(self, _: Task) -> bool:
        return False

    def known_starts(self) -> list[tuple[Task, StartResult]]:
        return []

    def waiting_for(self, start: tuple[int, int] | None) -> Sequence[Task]:
        return () if start is None else self.plan.waiting.get(start, ())

    def add(self, task: Task, result: Result) -> None:
        """The result is not stored."""


def replay(plan: TaskPlan, costs: DovetailCosts | ScatterCosts, n_ranks: int) -> tuple[float, float, float]:
    """Tasks of a plan on ranks with a simulated clock: time, s, efficiency, and the one that no order exceeds."""
    clock = work = longest_way = 0.0
    index = MemoryIndex(plan)
    plan, progress = index.plan, StudyRun(index, None, None, n_ranks)  # type: ignore[arg-type]
    dispatcher: Dispatcher = Dispatcher(n_ranks, progress.costs, lambda: clock)
    ticket = itertools.count()
    arrivals: list[tuple[float, int, int, int, float, Result]] = []
    queues: list[list[tuple[float, int, Task]]] = [[] for _ in range(n_ranks)]
    free_at, computing = [0.0] * n_ranks, [False] * n_ranks
    ways: dict[tuple[int, int], float] = {}
    left: dict[int, int] = {}

    def begin(rank: int) -> None:
        """The rank takes the next task that it has been sent; what it will send is known at once."""
        nonlocal work, longest_way
        sent, number, task = queues[rank].pop(0)
        computing[rank] = True
        now = max(sent + LATENCY, free_at[rank])
        results: list[tuple[Result, float]] = []
        if isinstance(task, Sweep):
            results = [costs.start(task, place) for place in task.order]
            along = itertools.accumulate(seconds for _, seconds in results)
            ways.update({(task.number, place): way for place, way in zip(task.order, along, strict=True)})
        else:
            seconds = costs.history(task)
            longest_way = max(longest_way, ways[task.sweep, task.position] + seconds)
            points = (PointResult({"outcome": 0}, place) for place in task.order)
            results = [(point, 0.0 if point.place else seconds) for point in points]
        for result, seconds in results:
            now += seconds
            work += seconds
            heapq.heappush(arrivals, (now + LATENCY, next(ticket), rank, number, seconds, result))
        free_at[rank] = now

    def hand_out() -> None:
        nonlocal clock
        for rank, number, task in dispatcher.assign():
            clock += ASSIGNMENT
            queues[rank].append((clock, number, task))
            if not computing[rank]:
                begin(rank)

    dispatcher.add(list(plan.sweeps))
    hand_out()
    while arrivals:
        arrived, _, rank, number, seconds, result = heapq.heappop(arrivals)
        # The master takes one message after the other.
        clock = max(clock, arrived) + RESULT
        task = dispatcher.deliver(rank, number, seconds)
        left[number] = left.get(number, task.n_results) - 1
        if left[number] == 0:
            computing[rank] = False
            if queues[rank]:
                begin(rank)
        dispatcher.add(list(progress.take(task, result)))
        dispatcher.watch()
        hand_out()
    assert progress.n_points == plan.n_points
    return clock, work / (n_ranks * clock), min(1.0, work / (n_ranks * longest_way))


def main() -> None:
    given = arguments(__doc__, tuple(STUDIES), ranks=[2, 16, 64, 256, 1024, 4096])
    for name in given.chosen:
        study, overrides = STUDIES[name]
        plan = plan_of(read_study(study, overrides), N_DISPLACEMENTS)
        costs = (ScatterCosts if study == "scatter" else DovetailCosts)(plan)
        table = Table(name, "time, s", "efficiency", "possible")
        for n_ranks in given.ranks:
            table.row(f"{n_ranks} ranks", *replay(plan, costs, n_ranks))


if __name__ == "__main__":
    main()

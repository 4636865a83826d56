"""Ranks with a simulated clock that work on the tasks of a study under the real scheduling code.

Only the computing and the messages are simulated. Which rank gets which task, what is learnt of costs and which tasks a
result makes possible is decided by `studyrunner.mpi.dispatch` and `studyrunner.task_runs`.
"""

import heapq
import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from studyrunner.kinds.task import PointResult, Result, StartResult, Task, TaskPlan
from studyrunner.kinds.wear import History, Sweep
from studyrunner.mpi.dispatch import Assignment, CostKeys, CostModel, Dispatcher, Measurement
from studyrunner.task_runs import TaskProgress


@dataclass(frozen=True)
class Overheads:
    """What is not computing, s: the master's time for a result and for an assignment, one after the other, and the time
    until the other side looks at a message."""

    result: float = 3e-4
    assignment: float = 1e-4
    latency: float = 1e-3


class MemoryIndex:
    """Takes the place of `CompletionIndex`, without a disk: nothing is there from an earlier run."""

    n_points_finished = 0

    def __init__(self, plan: TaskPlan) -> None:
        # keys as in a file
        self.plan = replace(
            plan,
            sweeps=tuple(replace(task, key=f"sweep {task.number}") for task in plan.sweeps),
            results=tuple(replace(task, key=str(task.number)) for task in plan.results),
        )

    def sweeps_left(self) -> list[Task]:
        """All of them."""
        return list(self.plan.sweeps)

    def is_finished(self, task: Task) -> bool:
        """None is."""
        del task
        return False

    is_suspect = is_finished

    def known_starts(self) -> list[tuple[Task, StartResult]]:
        """None is known."""
        return []

    def waiting_for(self, start: tuple[int, int] | None) -> Sequence[Task]:
        """All of them."""
        return () if start is None else self.plan.waiting.get(start, ())

    def add(self, task: Task, result: Result) -> None:
        """It is not kept."""


@dataclass(frozen=True)
class Replay:
    """How a replay went. work: sum of all costs, s. longest_way: s, of a start state along its sweep and a history from
    it, which no number of ranks shortens. n_unfinished: 0 unless there is a bug."""

    n_ranks: int
    work: float
    makespan: float
    longest_way: float
    n_unfinished: int

    @property
    def efficiency(self) -> float:
        """Work over the time that all ranks had."""
        return self.work / (self.n_ranks * self.makespan)

    @property
    def possible(self) -> float:
        """Efficiency that no order of the tasks exceeds."""
        return min(1.0, self.work / (self.n_ranks * self.longest_way))


class KnownCosts(CostModel):
    """Takes the costs of tasks as they are."""

    def learn(self, cost_keys: CostKeys, estimated: float, measured: float) -> Measurement:  # noqa: ARG002
        """Learns nothing."""
        return ()

    def correction(self, cost_keys: CostKeys) -> float:  # noqa: ARG002
        """1."""
        return 1.0


def replay(
    plan: TaskPlan,
    started: Callable[[Sweep, int], tuple[StartResult, float]],
    history_seconds: Callable[[History], float],
    n_ranks: int,
    overheads: Overheads,
    *,
    known: bool = False,
) -> Replay:
    """Runs the tasks of a plan on simulated ranks. The same arguments give the same replay.

    started: start state of a sweep at a place and its cost, s. history_seconds: cost of a history, s. known: the costs
    are known before: sweeps with the longest way to the end of a history go first, then the longest histories.
    """
    clock = 0.0
    index = MemoryIndex(plan)
    plan, progress = index.plan, TaskProgress(index)  # type: ignore[arg-type]
    dispatcher: Dispatcher = Dispatcher(n_ranks, KnownCosts() if known else progress.costs, lambda: clock)

    def foreseen(tasks: Iterable[Task]) -> list[Task]:
        return [replace(task, cost=_longest_way(task)) for task in tasks] if known else list(tasks)

    def _longest_way(task: Task) -> float:
        if isinstance(task, History):
            return history_seconds(task)
        first = sum(started(task, place)[1] for place in task.order)
        return first + max((history_seconds(each) for each in plan.results if each.sweep == task.number), default=0.0)

    ticket = itertools.count()
    arrivals: list[tuple[float, int, int, int, float, Result]] = []
    queues: list[list[tuple[float, Assignment]]] = [[] for _ in range(n_ranks)]
    free_at = [0.0] * n_ranks
    computing = [False] * n_ranks
    work = longest_way = last_end = 0.0

    def begin(rank: int) -> None:
        """The rank takes the next task that it has been sent; what it will send is known at once."""
        nonlocal work, longest_way
        sent, assignment = queues[rank].pop(0)
        computing[rank] = True
        task = assignment.task
        now = max(sent + overheads.latency, free_at[rank])
        results: list[tuple[Result, float]] = []
        if isinstance(task, Sweep):
            way = 0.0
            for place in task.order:
                start, seconds = started(task, place)
                way += seconds
                ways[task.number, place] = way
                results.append((start, seconds))
        else:
            seconds = history_seconds(task)
            longest_way = max(longest_way, ways[task.sweep, task.position] + seconds)
            results += [(_history(task, place), seconds / task.n_results) for place in task.order]
        for result, seconds in results:
            now += seconds
            work += seconds
            heapq.heappush(arrivals, (now + overheads.latency, next(ticket), rank, assignment.number, seconds, result))
        free_at[rank] = now

    ways: dict[tuple[int, int], float] = {}

    def hand_out() -> None:
        nonlocal clock
        for rank, assignment in dispatcher.assign():
            clock += overheads.assignment
            queues[rank].append((clock, assignment))
            if not computing[rank]:
                begin(rank)

    dispatcher.add(foreseen(plan.sweeps))
    hand_out()
    left: dict[int, int] = {}
    while arrivals:
        arrived, _, rank, number, seconds, result = heapq.heappop(arrivals)
        # The master takes one message after the other.
        clock = max(clock, arrived) + overheads.result
        task = dispatcher.deliver(rank, number, seconds)
        left[number] = left.get(number, task.n_results) - 1
        if left[number] == 0:
            del left[number]
            computing[rank] = False
            if queues[rank]:
                begin(rank)
        dispatcher.add(foreseen(progress.take(task, result)))
        dispatcher.watch()
        hand_out()
        last_end = clock
    return Replay(n_ranks, work, last_end, longest_way, plan.n_points - progress.n_points)


def _history(task: History, place: int) -> PointResult:
    return PointResult(task.points(place), {"outcome": 0}, place)


def lognormal(rng: np.random.Generator, spread: float) -> float:
    """A factor around 1 with this standard deviation of its logarithm."""
    return float(np.exp(spread * rng.standard_normal()))

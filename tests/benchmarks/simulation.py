"""Ranks with a simulated clock that work on the tasks of a study under the real scheduling code.

Only the computing and the messages are simulated. Which rank gets which task, what is learnt of costs and which tasks a
result makes possible is decided by `studyrunner.mpi.dispatch` and `studyrunner.task_runs`.
"""

import heapq
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from studyrunner.kinds.task import PointResult, Result, StartResult, Task, TaskPlan
from studyrunner.kinds.wear import History, Sweep
from studyrunner.mpi.dispatch import Dispatcher
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
        return list(self.plan.sweeps)

    def is_finished(self, _: Task) -> bool:
        return False

    is_suspect = is_finished

    def known_starts(self) -> list[tuple[Task, StartResult]]:
        return []

    def waiting_for(self, start: tuple[int, int] | None) -> Sequence[Task]:
        return () if start is None else self.plan.waiting.get(start, ())

    def add(self, task: Task, result: Result) -> None:
        """The result is not stored."""


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


def replay(
    plan: TaskPlan,
    started: Callable[[Sweep, int], tuple[StartResult, float]],
    history_seconds: Callable[[History], float],
    n_ranks: int,
    overheads: Overheads,
) -> Replay:
    """Runs the tasks of a plan on simulated ranks. The same arguments give the same replay.

    started: start state of a sweep at a place and its cost, s. history_seconds: cost of a history, s.
    """
    clock = 0.0
    index = MemoryIndex(plan)
    plan, progress = index.plan, TaskProgress(index)  # type: ignore[arg-type]
    dispatcher: Dispatcher = Dispatcher(n_ranks, progress.costs, lambda: clock)
    ticket = itertools.count()
    arrivals: list[tuple[float, int, int, int, float, Result]] = []
    queues: list[list[tuple[float, int, Task]]] = [[] for _ in range(n_ranks)]
    free_at, computing = [0.0] * n_ranks, [False] * n_ranks
    work = longest_way = 0.0
    ways: dict[tuple[int, int], float] = {}
    left: dict[int, int] = {}

    def begin(rank: int) -> None:
        """The rank takes the next task that it has been sent; what it will send is known at once."""
        nonlocal work, longest_way
        sent, number, task = queues[rank].pop(0)
        computing[rank] = True
        now = max(sent + overheads.latency, free_at[rank])
        results: list[tuple[Result, float]] = []
        if isinstance(task, Sweep):
            results = [started(task, place) for place in task.order]
            along = itertools.accumulate(seconds for _, seconds in results)
            ways.update({(task.number, place): way for place, way in zip(task.order, along, strict=True)})
        else:
            seconds = history_seconds(task)
            longest_way = max(longest_way, ways[task.sweep, task.position] + seconds)
            points = (PointResult({"outcome": 0}, place) for place in task.order)
            results = [(point, seconds / task.n_results) for point in points]
        for result, seconds in results:
            now += seconds
            work += seconds
            heapq.heappush(arrivals, (now + overheads.latency, next(ticket), rank, number, seconds, result))
        free_at[rank] = now

    def hand_out() -> None:
        nonlocal clock
        for rank, number, task in dispatcher.assign():
            clock += overheads.assignment
            queues[rank].append((clock, number, task))
            if not computing[rank]:
                begin(rank)

    dispatcher.add(list(plan.sweeps))
    hand_out()
    while arrivals:
        arrived, _, rank, number, seconds, result = heapq.heappop(arrivals)
        # The master takes one message after the other.
        clock = max(clock, arrived) + overheads.result
        task = dispatcher.deliver(rank, number, seconds)
        left[number] = left.get(number, task.n_results) - 1
        if left[number] == 0:
            computing[rank] = False
            if queues[rank]:
                begin(rank)
        dispatcher.add(list(progress.take(task, result)))
        dispatcher.watch()
        hand_out()
    return Replay(n_ranks, work, clock, longest_way, plan.n_points - progress.n_points)

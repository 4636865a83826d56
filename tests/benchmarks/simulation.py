"""Ranks with a simulated clock that work on the tasks of a study under the real scheduling code.

Only the computing and the messages are simulated. Which rank gets which task, what is learnt of costs and which tasks a
result makes possible is decided by `studyrunner.mpi.dispatch`, `plan.cost_model` and `task_progress`.
"""

import heapq
import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from studyrunner.mpi.dispatch import Assignment, Dispatcher
from studyrunner.plan.cost_model import CostKeys, CostModel, Measurement
from studyrunner.plan.results import MarchResult, StartResult
from studyrunner.plan.tasks import BranchTask, MarchTask, TaskPlan
from studyrunner.task_progress import TaskProgress

Task = BranchTask | MarchTask


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
        self.plan = plan
        self.starts: list[tuple[BranchTask, StartResult]] = []
        self.histories: list[tuple[MarchTask, MarchResult]] = []

    def branches_left(self) -> list[BranchTask]:
        """All of them."""
        return list(self.plan.branches)

    def is_finished(self, march: MarchTask) -> bool:
        """None is."""
        del march
        return False

    def is_suspect(self, key: str) -> bool:
        """None is."""
        del key
        return False

    def known_starts(self, branch: BranchTask) -> list[StartResult]:
        """None is known."""
        del branch
        return []

    def marches_from(self, branch: int, position: int) -> tuple[MarchTask, ...]:
        """All of them."""
        return self.plan.marches_from(branch, position)

    def add_start(self, branch: BranchTask, result: StartResult) -> None:
        """Takes note of it."""
        self.starts.append((branch, result))

    def add_history(self, march: MarchTask, result: MarchResult) -> None:
        """Takes note of it."""
        self.histories.append((march, result))


@dataclass(frozen=True)
class Replay:
    """How a replay went. work: sum of all costs, s. longest_way: s, of a start state along its branch and a march from
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
        return Measurement(())

    def correction(self, cost_keys: CostKeys) -> float:  # noqa: ARG002
        """1."""
        return 1.0


def replay(
    plan: TaskPlan,
    started: Callable[[BranchTask, int], tuple[StartResult, float]],
    march_seconds: Callable[[MarchTask], float],
    n_ranks: int,
    overheads: Overheads,
    *,
    known: bool = False,
) -> Replay:
    """Runs the tasks of a plan on simulated ranks. The same arguments give the same replay.

    started: start state of a branch at a position and its cost, s. march_seconds: cost of a march, s. known: the costs
    are known before: branches with the longest way to the end of a history go first, then the longest histories.
    """
    clock = 0.0
    progress = TaskProgress(MemoryIndex(plan))
    dispatcher: Dispatcher[Task] = Dispatcher(n_ranks, KnownCosts() if known else progress.costs, lambda: clock)

    def foreseen(tasks: Iterable[Task]) -> list[Task]:
        return [replace(task, cost=_longest_way(task)) for task in tasks] if known else list(tasks)

    def _longest_way(task: Task) -> float:
        if isinstance(task, MarchTask):
            return march_seconds(task)
        first = sum(started(task, position)[1] for position in task.order)
        return first + max((march_seconds(march) for march in plan.marches[task.number]), default=0.0)

    ticket = itertools.count()
    arrivals: list[tuple[float, int, int, int, float, StartResult | MarchResult]] = []
    queues: list[list[tuple[float, Assignment[Task]]]] = [[] for _ in range(n_ranks)]
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
        results: list[tuple[StartResult | MarchResult, float]] = []
        if isinstance(task, BranchTask):
            way = 0.0
            for position in task.order:
                start, seconds = started(task, position)
                way += seconds
                ways[task.number, position] = way
                results.append((start, seconds))
        else:
            seconds = march_seconds(task)
            longest_way = max(longest_way, ways[task.branch, task.position] + seconds)
            results.append((_history(task), seconds))
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

    dispatcher.add(foreseen(plan.branches))
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


def _history(task: MarchTask) -> MarchResult:
    return MarchResult(task.points, {"outcome": 0})


def lognormal(rng: np.random.Generator, spread: float) -> float:
    """A factor around 1 with this standard deviation of its logarithm."""
    return float(np.exp(spread * rng.standard_normal()))

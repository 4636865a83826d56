"""Decides which rank gets which task, by expected run times that finished tasks correct. This module sends no messages
and is given its clock: the server on real ranks and a simulation with thousands of ranks make the same decisions.

Expected times decide the order of the tasks and the time left that a user sees. They decide no number of a result.

By hand: the pools of mpi4py and schwimmbad know no expected run times and leave rank 0 idle (speed-up 0.92 of 2 ranks,
here 1.97).
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

Task = Any
"""What is done as a whole by one rank. It has

- cost: estimated time, s, positive, of which each result takes an equal share;
- cost_keys: groups of similar tasks, see `CostModel`;
- n_results: that the task gives one after the other, at least 1;
- gives_starts: whether other tasks wait for the results.
"""

CostKeys = Sequence[tuple[Hashable, ...]]
"""Groups of similar tasks that a task belongs to: sequences of keys, each from a general group to a special one."""

Measurement = Sequence[tuple[Hashable, float, float]]
"""What is learnt from one task: keys of groups, each with the measured and the expected time, s. The expected time of a
key contains the corrections of all other sequences of keys."""

WATCH_SECONDS = 1.0
"""Shortest time between two looks at the running tasks, s. Without these looks 256 ranks are 0.81 busy for 0.97
(`tests.benchmarks.scheduling usual`)."""

_WATCH_SHARE = 0.02  # of the time since the start: later looks are rarer
_AS_LONG_AGAIN = 2.0  # a task is expected to take at least this often what it has taken
_WAITING = 1000
_WAITING_A_RANK = 16
_LEAST = 1e-6


class CostModel:
    """Corrects estimated times by the measured times of similar tasks.

    The correction is a product of factors, one for each sequence of keys. The factor of a key is the sum of the
    measured times over the sum of the expected times. The factor of the key before counts as one more measurement, so
    that a few unusual times do not decide. Before the first key the factor is 1.
    """

    def __init__(self) -> None:
        self._sums: dict[Hashable, tuple[float, float, int]] = {}
        # Factors asked for since the last measurement: most of thousands of waiting tasks share their keys.
        self._factors: dict[tuple[Hashable, ...], float] = {}

    def learn(self, cost_keys: CostKeys, estimated: float, measured: float) -> Measurement:
        """Adds the times of a task, s; the estimated time is positive."""
        factors = [self._factor(keys) for keys in cost_keys]
        expected = estimated * math.prod(factors)
        found = [
            (key, measured, expected / each) for keys, each in zip(cost_keys, factors, strict=True) for key in keys
        ]
        self._add(found, 1)
        return found

    def forget(self, measurement: Measurement) -> None:
        """Takes back a measurement."""
        self._add(measurement, -1)

    def correction(self, cost_keys: CostKeys) -> float:
        """Factor by which an estimated time is multiplied, positive."""
        return math.prod(self._factor(keys) for keys in cost_keys)

    def measured(self, key: Hashable) -> float:
        """Sum of the measured times, s, of all tasks with a key."""
        return self._sums.get(key, (0.0, 0.0, 0))[0]

    def _factor(self, keys: tuple[Hashable, ...]) -> float:
        if keys not in self._factors:
            found = 1.0
            for key in keys:
                measured, expected, n = self._sums.get(key, (0.0, 0.0, 0))
                if n > 0:
                    mean = expected / n
                    found = (measured + found * mean) / (expected + mean)
            self._factors[keys] = max(found, _LEAST)
        return self._factors[keys]

    def _add(self, measurement: Measurement, sign: int) -> None:
        self._factors.clear()
        for key, measured, expected in measurement:
            before = self._sums.get(key, (0.0, 0.0, 0))
            self._sums[key] = (before[0] + sign * measured, before[1] + sign * expected, before[2] + sign)


@dataclass(frozen=True)
class Assignment:
    """A task on its way to a rank."""

    number: int
    task: Task


@dataclass
class _Running:
    """A task that a rank has: results still to come, and when the last one came or the task was given.

    measurement: what the cost model has learnt from a task that takes longer than expected.
    """

    task: Task
    n_left: int
    began: float
    measurement: Measurement = ()


class _Waiting:
    """Waiting tasks; the one with the longest expected time comes first, of equal ones the earliest."""

    def __init__(self, costs: CostModel) -> None:
        self._costs = costs
        # with the keys, which are not computed twice
        self._tasks: dict[int, tuple[Task, CostKeys]] = {}
        self._order: list[tuple[float, int]] = []

    def __len__(self) -> int:
        return len(self._tasks)

    def add(self, number: int, task: Task) -> None:
        self._tasks[number] = task, task.cost_keys
        heapq.heappush(self._order, self._entry(number))

    def pop(self) -> tuple[int, Task]:
        number = heapq.heappop(self._order)[1]
        return number, self._tasks.pop(number)[0]

    def reorder(self) -> None:
        """Puts all tasks in the order of the times that are expected now."""
        self._order = [self._entry(number) for number in self._tasks]
        heapq.heapify(self._order)

    def _entry(self, number: int) -> tuple[float, int]:
        task, cost_keys = self._tasks[number]
        return -task.cost * self._costs.correction(cost_keys), number


class Dispatcher:
    """Decides which rank gets which task. No decision looks at all ranks.

    - Tasks that give starts go first, unless enough tasks wait for all ranks: so the memory for waiting tasks is
      bounded.
    - Of the other tasks the longest go first, so that the ranks end together.
    """

    def __init__(self, n_ranks: int, costs: CostModel, clock: Callable[[], float]) -> None:
        self._n_ranks = n_ranks
        self._costs = costs
        self._clock = clock
        self._n_known = 0
        self._began = clock()
        self._next_watch = self._began + WATCH_SECONDS
        self._first = _Waiting(costs)
        self._others = _Waiting(costs)
        self._given: dict[int, _Running] = {}
        # ranks without a task: the last is the next to get one
        self._free = dict.fromkeys(reversed(range(n_ranks)))

    @property
    def done(self) -> bool:
        """Whether no task waits and no task runs."""
        return not self._given and self._n_waiting == 0

    @property
    def wants_more(self) -> bool:
        """Whether fewer tasks wait than all ranks can use for some time."""
        return len(self._others) < _WAITING + _WAITING_A_RANK * self._n_ranks

    def add(self, tasks: Iterable[Task]) -> None:
        """Adds tasks that have become possible."""
        for task in tasks:
            (self._first if task.gives_starts else self._others).add(self._n_known, task)
            self._n_known += 1

    def assign(self) -> Iterator[tuple[int, Assignment]]:
        """Ranks that get a task now, and the tasks."""
        while self._free and self._n_waiting:
            rank, _ = self._free.popitem()
            is_first = self._first and (self.wants_more or not self._others)
            number, task = (self._first if is_first else self._others).pop()
            self._given[number] = _Running(task, task.n_results, self._clock())
            yield rank, Assignment(number, task)

    def deliver(self, rank: int, number: int, seconds: float) -> Task:
        """Notes a result, which took so many seconds; returns its task."""
        given = self._given[number]
        task = given.task
        self._costs.forget(given.measurement)
        given.measurement = ()
        self._costs.learn(task.cost_keys, task.cost / task.n_results, seconds)
        given.n_left -= 1
        given.began = self._clock()
        if given.n_left == 0:
            del self._given[number]
            self._free[rank] = None
        return task

    def task(self, number: int) -> Task:
        """A running task."""
        return self._given[number].task

    def running(self) -> list[tuple[Task, int, float]]:
        """Running tasks, longest first: the task, number of results to come, time since the last result, s."""
        now = self._clock()
        busy = [(each.task, each.n_left, now - each.began) for each in self._given.values()]
        return sorted(busy, key=lambda entry: -entry[2])

    def watch(self) -> None:
        """Called many times a second: now and then learns from tasks that take longer than expected, and orders anew.

        A history that takes a hundred times as long as most corrects the cost model long before its end, in time for
        the order of similar tasks.
        """
        now = self._clock()
        if now < self._next_watch or not self._n_waiting:
            return
        self._next_watch = now + max(WATCH_SECONDS, _WATCH_SHARE * (now - self._began))
        for given in self._given.values():
            task = given.task
            at_least = _AS_LONG_AGAIN * (now - given.began)
            if not task.gives_starts and at_least > task.cost * self._costs.correction(task.cost_keys):
                self._costs.forget(given.measurement)
                given.measurement = self._costs.learn(task.cost_keys, task.cost, at_least)
        self._others.reorder()

    @property
    def _n_waiting(self) -> int:
        return len(self._first) + len(self._others)

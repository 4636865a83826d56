"""Decides which rank gets which job, by expected run times that finished jobs correct. They decide no number of a
result. Without messages and with a given clock: a simulation with thousands of ranks makes the same decisions.

By hand: the pools of mpi4py and schwimmbad know no expected run times and leave rank 0 idle (speed-up 0.92 of 2 ranks,
here 1.97).
"""

import heapq
import math
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

Job = Any
"""What is done as a whole by one rank: a task of a study, or a scene to build. It has

- costs: estimated time of each result that the job gives, one after the other, s; 0 of one that comes with another;
- cost_keys: groups of similar jobs, see `CostModel`;
- gives_starts: whether other jobs wait for the results.
"""

CostKeys = Sequence[tuple[Hashable, ...]]
"""Groups of similar jobs: sequences of keys, each from a general group to a special one."""

WATCH_SECONDS = 1.0
"""Shortest time between two looks at the running jobs, s. Without these looks 256 ranks are 0.81 busy for 0.97, and
without corrections 0.80 (`tests.benchmarks.scheduling usual`)."""

_WATCH_SHARE = 0.02  # of the time since the start: later looks are rarer
_AS_LONG_AGAIN = 2.0  # a job is expected to take at least this often what it has taken
_WAITING = 1000
_WAITING_A_RANK = 16
_LEAST = 1e-6


class CostModel:
    """Corrects estimated times by the measured times of similar jobs.

    The correction is a product of factors, one for each sequence of keys. The factor of a key is the sum of the
    measured times over the sum of the expected times, which contain the corrections of all other sequences. The factor
    of the key before counts as one more measurement, so that a few unusual times do not decide.

    sums: measured and expected times, s, and their number, by key.
    """

    def __init__(self, sums: Mapping[Hashable, tuple[float, float, int]] | None = None) -> None:
        self.sums = dict(sums or {})
        # asked for since the last measurement: most of thousands of waiting jobs share their keys
        self._factors: dict[tuple[Hashable, ...], float] = {}

    def learn(self, cost_keys: CostKeys, estimated: float, measured: float) -> None:
        """Adds the times of a job, s; the estimated time is positive."""
        factors = [self._factor(keys) for keys in cost_keys]
        expected = estimated * math.prod(factors)
        for keys, factor in zip(cost_keys, factors, strict=True):
            for key in keys:
                before = self.sums.get(key, (0.0, 0.0, 0))
                self.sums[key] = before[0] + measured, before[1] + expected / factor, before[2] + 1
        self._factors.clear()

    def correction(self, cost_keys: CostKeys) -> float:
        """Factor by which an estimated time is multiplied, positive."""
        return math.prod(self._factor(keys) for keys in cost_keys)

    def _factor(self, keys: tuple[Hashable, ...]) -> float:
        if keys not in self._factors:
            found = 1.0
            for key in keys:
                measured, expected, n = self.sums.get(key, (0.0, 0.0, 0))
                if n > 0:
                    mean = expected / n
                    found = (measured + found * mean) / (expected + mean)
            self._factors[keys] = max(found, _LEAST)
        return self._factors[keys]


@dataclass
class _Running:
    """A job that a rank has: results still to come, and when the last one came or the job was given."""

    job: Job
    n_left: int
    began: float


class Dispatcher:
    """Decides which rank gets which job. No decision looks at all ranks.

    - Jobs that give starts go first, unless enough jobs wait for all ranks: so the memory for waiting jobs is bounded.
    - Of the other jobs the longest go first, so that the ranks end together.
    """

    def __init__(self, n_ranks: int, costs: CostModel, clock: Callable[[], float]) -> None:
        self._n_ranks, self._costs, self._clock = n_ranks, costs, clock
        self._n_known = 0
        self._began = clock()
        self._next_watch = self._began + WATCH_SECONDS
        # heaps: the job with the longest expected time first, of equal ones the earliest
        self._first: list[tuple[float, int, Job, CostKeys]] = []
        self._others: list[tuple[float, int, Job, CostKeys]] = []
        self._given: dict[int, _Running] = {}
        # ranks without a job: the last is the next to get one
        self._free = dict.fromkeys(reversed(range(n_ranks)))

    @property
    def done(self) -> bool:
        """Whether no job waits and no job runs."""
        return not (self._given or self._first or self._others)

    @property
    def wants_more(self) -> bool:
        """Whether fewer jobs wait than all ranks can use for some time."""
        return len(self._others) < _WAITING + _WAITING_A_RANK * self._n_ranks

    def add(self, jobs: Iterable[Job]) -> None:
        """Adds jobs that have become possible."""
        for job in jobs:
            keys = job.cost_keys
            entry = (-sum(job.costs) * self._costs.correction(keys), self._n_known, job, keys)
            heapq.heappush(self._first if job.gives_starts else self._others, entry)
            self._n_known += 1

    def assign(self) -> Iterator[tuple[int, int, Job]]:
        """Ranks that get a job now, with the number of the job and the job."""
        while self._free and (self._first or self._others):
            rank, _ = self._free.popitem()
            is_first = self._first and (self.wants_more or not self._others)
            _, number, job, _ = heapq.heappop(self._first if is_first else self._others)
            self._given[number] = _Running(job, len(job.costs), self._clock())
            yield rank, number, job

    def deliver(self, rank: int, number: int, seconds: float) -> Job:
        """Notes a result, which took so many seconds; returns its job."""
        given = self._given[number]
        job = given.job
        if (estimated := job.costs[-given.n_left]) > 0.0:
            self._costs.learn(job.cost_keys, estimated, seconds)
        given.n_left, given.began = given.n_left - 1, self._clock()
        if given.n_left == 0:
            del self._given[number]
            self._free[rank] = None
        return job

    def job(self, number: int) -> Job:
        """A running job."""
        return self._given[number].job

    def running(self) -> list[tuple[Job, int, float]]:
        """Running jobs, longest first: the job, number of results to come, time since the last result, s."""
        now = self._clock()
        busy = [(each.job, each.n_left, now - each.began) for each in self._given.values()]
        return sorted(busy, key=lambda entry: -entry[2])

    def watch(self) -> None:
        """Called many times a second: now and then orders the waiting jobs anew. A running job that takes long counts
        as measured before its end, in time for the order of similar jobs.
        """
        now = self._clock()
        if now < self._next_watch or not self._others:
            return
        self._next_watch = now + max(WATCH_SECONDS, _WATCH_SHARE * (now - self._began))
        costs = CostModel(self._costs.sums)
        for job, _, seconds in self.running():
            at_least, estimated = _AS_LONG_AGAIN * seconds, sum(job.costs)
            if not job.gives_starts and at_least > estimated * costs.correction(job.cost_keys):
                costs.learn(job.cost_keys, estimated, at_least)
        self._others = [
            (-sum(job.costs) * costs.correction(keys), number, job, keys) for _, number, job, keys in self._others
        ]
        heapq.heapify(self._others)

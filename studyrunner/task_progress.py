"""State of the tasks of a study, and the tasks that results make possible."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from studyrunner.checkpoint.completion_index import CompletionIndex
from studyrunner.kinds.task import Result, StartResult, Task
from studyrunner.mpi.cost_model import CostModel
from studyrunner.mpi.schedule import Office
from studyrunner.system.progress import Standing

_TRIES_AGAIN = 1
"""Number of tries again of a task that a fault of the machine has ended."""

_LATE = 0.3
"""Expected further time of a task that takes longer than estimated, over the time so far. For an estimate with an
uncertainty factor of two the mean further time is this fraction.
"""


class TaskProgress(Office[Task, Result]):
    """State of the tasks of a study, and the tasks that results make possible.

    A wear history becomes possible with its start state, while the sweep goes on. Results of a task do not depend on
    the order. tasks: those that are left, whether they are possible or not.
    """

    def __init__(self, completion: CompletionIndex) -> None:
        self.costs = CostModel()
        self.n_points = completion.n_points_finished
        self._completion = completion
        self._sweeps = completion.sweeps_left()
        self.tasks = [*self._sweeps, *(task for task in completion.plan.results if not completion.is_finished(task))]
        self._n_faults: Counter[str] = Counter()
        self._n_given: Counter[str] = Counter()
        self._words: dict[str, str] = {}
        self._shares: dict[str, float] = {}
        self._suspects: list[Task] = []
        self._tried = ""  # key of the suspect that is under way
        self._left: dict[str, float] = {}
        for task in self.tasks:
            self._plan(task, 1.0)

    def begin(self) -> Iterator[Task]:
        """Tasks that are possible at the beginning."""
        yield from self._without_suspects(self._sweeps)
        for sweep, result in self._completion.known_starts():
            yield from self._without_suspects(self._start(sweep, result))
        yield from self._without_suspects(self._completion.waiting_for(None))

    def take(self, task: Task, result: Result) -> Sequence[Task]:
        """Takes a result; returns tasks that the result makes possible, or that have to be done again."""
        is_first, is_last = self._count(task)
        self._left[task.group] -= task.cost_of(first=is_first)
        self._words.pop(task.key, None)
        self._shares.pop(task.key, None)
        new: Sequence[Task] = ()
        if not result.fault:
            self._completion.add(task, result)
            self.n_points += len(task.points(result.place))
            new = self._start(task, result) if isinstance(result, StartResult) else ()
        elif is_last:
            new = self._try_again(task)
        if task.key == self._tried and is_last and task.key not in {each.key for each in new}:
            self._tried = ""
            suspects, self._suspects = self._suspects, []
            return self._without_suspects([*new, *suspects])
        return self._without_suspects(new)

    def keep(self, task: Task, progress: object) -> None:
        """Takes the progress of a task as `Keep` does."""
        if isinstance(progress, str):
            self._words[task.key] = progress
        elif isinstance(progress, float):
            self._shares[task.key] = progress
        else:
            self._completion.keep(task, progress)

    def look(self, running: Sequence[tuple[Task, int, float]]) -> Standing:
        """State of the tasks. running: as `Dispatcher.running`."""
        factors = {group: self.costs.correction(((group,),)) for group in self._left}
        left = sum(max(0.0, seconds) * factors[group] for group, seconds in self._left.items())
        done = sum(map(self.costs.measured, factors))
        longest = 0.0
        for task, n_left, elapsed in running:
            expected = task.cost_of(first=n_left == task.n_results) * factors[task.group]
            still = self._still(task, expected, elapsed)
            left += still - expected
            done += elapsed
            longest = max(longest, still)
        return Standing(
            n_done=self.n_points,
            n_points=self._completion.plan.n_points,
            share=done / max(done + left, 1e-9),
            seconds_left=max(longest, left / max(1, len(running))),
            running=tuple(self._describe(task, n_left) for task, n_left, _ in running),
        )

    def _still(self, task: Task, expected: float, elapsed: float) -> float:
        """Time left, s, of a running task: by its expected time at first, then more and more by the share that is done.

        What a task takes that is late already is a guess.
        """
        planned = max(expected - elapsed, _LATE * elapsed)
        share = self._shares.get(task.key, 0.0)
        weight = min(1.0, 2.0 * share)
        return planned if share == 0.0 else (1.0 - weight) * planned + weight * elapsed * (1.0 - share) / share

    def _plan(self, task: Task, sign: float) -> None:
        """Adds a task to what is left, or takes it away."""
        self._left[task.group] = self._left.get(task.group, 0.0) + sign * task.cost

    def _count(self, task: Task) -> tuple[bool, bool]:
        """Whether a result that has come is the first, or the last, of its task."""
        self._n_given[task.key] += 1
        n_given = self._n_given[task.key]
        if n_given == task.n_results:
            del self._n_given[task.key]
        return n_given == 1, n_given == task.n_results

    def _without_suspects(self, tasks: Iterable[Task]) -> list[Task]:
        """The tasks, but of those with which runs have crashed one at a time: the others wait for its end."""
        now = []
        for task in tasks:
            if not self._completion.is_suspect(task) or task.key == self._tried:
                now.append(task)
            elif self._tried:
                self._suspects.append(task)
            else:
                self._tried = task.key
                now.append(task)
        return now

    def _try_again(self, task: Task) -> Sequence[Task]:
        """What is left of a task that a fault of the machine has ended, once; later it is left to another run."""
        self._n_faults[task.key] += 1
        again = self._completion.left(task) if self._n_faults[task.key] <= _TRIES_AGAIN else None
        if again is None:
            return ()
        self._plan(again, 1.0)
        return [again]

    def _start(self, sweep: Task, result: StartResult) -> Sequence[Task]:
        planned = self._completion.waiting_for((sweep.number, result.place))
        new = [task.from_start(result) for task in planned]
        for before, task in zip(planned, new, strict=True):
            self._plan(before, -1.0)
            self._plan(task, 1.0)
        return new

    def _describe(self, task: Task, n_left: int) -> str:
        """A running task in words."""
        what = task.describe(task.places[task.n_results - n_left])
        if task.key in self._shares:
            return f"{what} ({100.0 * self._shares[task.key]:.0f} %)"
        return f"{what} ({self._words[task.key]})" if task.key in self._words else what

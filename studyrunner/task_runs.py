"""The tasks of a study while they are done: by any rank its own, and on rank 0 the state of all of them."""

import time
from collections import Counter, OrderedDict, defaultdict
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from solver.model import ReducedModel
from solver.outcome import Outcome, describe_error, is_machine_fault
from solver.packing import Packed
from studyrunner.checkpoint.completion_index import CompletionIndex
from studyrunner.kinds.task import Keep, Part, PointResult, Result, StartResult, Task
from studyrunner.mpi.schedule import Run, TaskHandler
from studyrunner.scene_building import ModelCache, SceneBuilt, SceneModels, SceneTask, build_scene_task, hold_models
from studyrunner.system.machine import MappedFile, open_mapped
from studyrunner.system.process import raise_ending
from studyrunner.system.progress import ProgressDisplay, Standing

_TOLD = 4.0  # times the share that is done: weight of the time that it tells
_LATE = 0.3
"""Expected further time of a late task over its time: the mean, for estimates to a factor of two."""


def evaluator() -> Run:
    """The function that does tasks on a rank, and builds scenes. A fault of the machine is raised."""
    models: ModelCache[tuple[ReducedModel, ...]] = OrderedDict()

    def evaluate(task: Task | SceneTask, keep: Callable[[object], None]) -> Iterator[Result | SceneBuilt]:
        if isinstance(task, SceneTask):
            yield from build_scene_task(task, keep)
            return
        # first of all: rank 0 sends the models once, also where the task breaks off
        if task.models:
            own = tuple(open_mapped(each) if isinstance(each, MappedFile) else each for each in task.models)
        else:
            own = models[task.scenes]
        hold_models(models, task.scenes, own)
        yield from _compute(task, dict(zip(task.scenes, own, strict=True)), keep)

    return evaluate


def _compute(task: Task, models: Mapping[int, ReducedModel], keep: Keep) -> Iterator[Result]:
    """All results of a task, failed ones in place of those that it does not give."""
    left, last, is_limited = dict.fromkeys(task.places), task.resume, False

    def keep_last(progress: Packed | str | Part) -> None:
        nonlocal last
        last = progress if isinstance(progress, Packed) else last
        keep(progress)

    try:
        for result in task.compute(models, keep_last):
            if isinstance(result, PointResult):
                outcome = result.values["outcome"]
                if outcome == Outcome.EXCEPTION and task.resume is not None:
                    raise RuntimeError(result.values["message"])
                # a history that its time limit has ended goes on from there when it gets more
                is_limited = is_limited or outcome == Outcome.TIME_LIMIT
                result = replace(result, progress=last) if is_limited else result
            left.pop(result.place, None)
            yield result
    except Exception as error:
        # An exception from a signal is no failure of the task.
        raise_ending()
        if is_machine_fault(error):
            raise
        if task.resume is not None:
            # what an earlier run has left may have been altered: it is done without
            yield from _compute(replace(task, skipped=frozenset(task.order) - left.keys(), resume=None), models, keep)
            return
        for place in left:
            yield task.failed(place, Outcome.EXCEPTION, describe_error(error))


class StudyRun(TaskHandler):
    """Rank 0 while the tasks of a study are done: their state, and the tasks that results make possible.

    A wear history becomes possible with its start state, while the sweep goes on. Results go to `completion`. models:
    for the ranks that do not have them. n_ranks: that compute. tasks: those that are left. n_points: that are finished.
    """

    def __init__(
        self, completion: CompletionIndex, models: SceneModels, display: ProgressDisplay, n_ranks: int
    ) -> None:
        super().__init__()
        self.n_points = completion.n_points_finished
        self._completion, self._models, self._display = completion, models, display
        self._sweeps = completion.sweeps_left()
        self.tasks = [*self._sweeps, *(task for task in completion.plan.results if not completion.is_finished(task))]
        self._n_given: Counter[str] = Counter()
        self._words: dict[str, str] = {}  # where a task is
        self._parts: dict[str, tuple[float, float]] = {}  # share of a task that was done, and when
        self._suspects: list[Task] = []  # they wait for the one that is under way
        self._tried = ""
        self._n_ranks, self._n_left = n_ranks, len(self.tasks)
        self._left: dict[tuple[Hashable, ...], float] = defaultdict(float)  # estimated seconds, by group
        for task in self.tasks:
            self._left[task.group] += sum(task.costs)

    def begin(self) -> Iterator[Task]:
        """Tasks that are possible at the beginning."""
        yield from self._without_suspects(self._sweeps)
        for sweep, result in self._completion.known_starts():
            yield from self._without_suspects(self._start(sweep, result))
        yield from self._without_suspects(self._completion.waiting_for(None))

    def prepare(self, rank: int, task: Task, *, unseen: bool = False) -> Task:
        """The task with the models that the rank does not have."""
        self._completion.store.note_begin(task.key)
        return self._models.with_model(rank, task, unseen=unseen)

    def take(self, task: Task, result: Result) -> Sequence[Task]:
        """Takes a result; returns tasks that the result makes possible."""
        self._left[task.group] -= task.costs[self._n_given[task.key]]
        self._n_given[task.key] += 1
        is_last = self._n_given[task.key] == task.n_results
        self._completion.add(task, result)
        self.n_points += len(task.points(result.place))
        new = self._start(task, result) if isinstance(result, StartResult) else ()
        if is_last:
            del self._n_given[task.key]
            self._n_left -= 1
            if task.key == self._tried:
                self._tried = ""
                new, self._suspects = [*new, *self._suspects], []
        return self._without_suspects(new)

    def keep(self, task: Task, progress: object) -> None:
        """Takes the progress of a task as `Keep` does."""
        if isinstance(progress, Packed):
            self._completion.keep(task, progress)
            return
        if isinstance(progress, Part):
            self._parts[task.key] = progress.share, time.monotonic()
            progress = progress.words
        self._words[task.key] = str(progress)

    def tick(self, running: Callable[[], Sequence[tuple[Task, int, float]]]) -> None:
        """Writes and shows what is due."""
        self._completion.store.tick()
        self._display.tick(lambda: self.look(running()))

    def look(self, running: Sequence[tuple[Task, int, float]]) -> Standing:
        """State of the tasks. running: as `Dispatcher.running`."""
        factors = {group: self._factor(group) for group in self._left}
        known = self._by_their_parts(running, factors)
        for task, *_ in running:
            # what similar tasks have taken is worth more
            if task.key in known and task.group[-1] not in self.costs.sums:
                factors[task.group] = known[task.key] / sum(task.costs)
        left = sum(max(0.0, seconds) * factors[group] for group, seconds in self._left.items())
        done, longest = sum(self.costs.sums.get(group[-1], (0.0, 0.0, 0))[0] for group in factors), 0.0
        names = []
        for task, n_left, elapsed in running:
            planned = task.costs[-n_left] * factors[task.group]
            expected = known.get(task.key, planned)
            still = max(expected - elapsed, _LATE * elapsed * (task.key not in known))
            left, done, longest = left + still - planned, done + min(elapsed, expected), max(longest, still)
            words = f" ({self._words[task.key]})" if self._words.get(task.key) else ""
            names.append(task.describe(task.places[task.n_results - n_left]) + words)
        return Standing(
            n_done=self.n_points,
            n_points=self._completion.plan.n_points,
            share=done / max(done + left, 1e-9),
            seconds_left=max(longest, left / max(1, min(self._n_ranks, self._n_left))),
            running=tuple(names),
        )

    def _by_their_parts(
        self, running: Sequence[tuple[Task, int, float]], factors: Mapping[tuple[Hashable, ...], float]
    ) -> dict[str, float]:
        """Expected time of running tasks, s, of which is known how much was done at some time, by their keys. factors:
        of the estimates, which count as long as little is done.
        """
        now, found = time.monotonic(), dict[str, float]()
        for task, _, elapsed in running:
            share, at = self._parts.get(task.key, (0.0, now))
            if share > 0.0 and elapsed > now - at:
                told, planned = (elapsed - now + at) / share, factors[task.group] * sum(task.costs)
                weight = min(1.0, _TOLD * share)
                found[task.key] = weight * told + (1.0 - weight) * planned
        return found

    def _factor(self, group: tuple[Hashable, ...]) -> float:
        """Measured over estimated times of a group. In full from half of its work on: cheap results come first.

        Until then as much longer as all tasks have taken: where sweeps are hard, or the machine busy, so are histories.
        """
        done = self.costs.sums.get(group[-1], (0.0, 0.0, 0))[1]
        known = min(1.0, 2.0 * done / max(done + self._left[group], 1e-9))
        of_all = max(1.0, self.costs.correction((group[:1],)))
        return of_all + known * (self.costs.correction((group,)) - of_all)

    def _start(self, sweep: Task, result: StartResult) -> Sequence[Task]:
        """The tasks that begin from a start state, whose cost is known better now."""
        planned = self._completion.waiting_for((sweep.number, result.place))
        new = [task.from_start(result) for task in planned]
        for sign, tasks in ((-1.0, planned), (1.0, new)):
            for task in tasks:
                self._left[task.group] += sign * sum(task.costs)
        return new

    def _without_suspects(self, tasks: Iterable[Task]) -> list[Task]:
        """The tasks, but of those with which runs have crashed one at a time: the others wait for its end."""
        now = []
        for task in tasks:
            is_suspect = task.key in self._completion.store.crashes
            if is_suspect and self._tried not in ("", task.key):
                self._suspects.append(task)
            else:
                self._tried = task.key if is_suspect else self._tried
                now.append(task)
        return now

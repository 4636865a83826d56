"""State of the tasks of a study, and the tasks that results make possible."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

from solver.outcome import Outcome
from solver.packing import unpack
from studyrunner.checkpoint.completion_index import CompletionIndex
from studyrunner.mode_result import build_mode_result
from studyrunner.plan.cost_model import CostModel
from studyrunner.plan.results import MarchResult, StartResult
from studyrunner.plan.tasks import BRANCHES, MARCHES, RESTING, BranchTask, MarchTask
from studyrunner.system.progress import Standing

_TRIES_AGAIN = 1
"""Number of tries again of a task that a fault of the machine has ended."""

_COST_AT_REST = 0.01
"""Estimated time of a history in which nothing wears, over the time of a history with steps."""

_LATE = 0.3
"""Expected further time of a task that takes longer than estimated, over the time so far. For an estimate with an
uncertainty factor of two the mean further time is this fraction.
"""


class TaskProgress:
    """State of the tasks of a study, and the tasks that results make possible.

    A wear history becomes possible with its start state, while the branch goes on. Results of a task do not depend on
    the order.
    """

    def __init__(self, completion: CompletionIndex) -> None:
        self.costs = CostModel()
        self.branches = completion.branches_left()
        self.n_points = completion.n_points_finished
        self.n_starts_left = sum(branch.n_results for branch in self.branches)
        self._completion = completion
        self._n_faults: Counter[str] = Counter()
        self._n_given: Counter[int] = Counter()
        self._words: dict[str, str] = {}
        self._suspects: list[BranchTask | MarchTask] = []
        self._tried = ""  # key of the suspect that is under way
        self._left = dict.fromkeys((BRANCHES, MARCHES, RESTING), 0.0)
        self._left[BRANCHES] = sum(branch.cost for branch in self.branches)
        lines = completion.plan.marches
        self._left[MARCHES] = sum(march.cost for line in lines for march in line if not completion.is_finished(march))

    def begin(self) -> Iterator[BranchTask | MarchTask]:
        """Tasks that are possible at the beginning."""
        yield from self._without_suspects(self.branches)
        for branch in self._completion.plan.branches:
            for result in self._completion.known_starts(branch):
                yield from self._without_suspects(self._start(branch, result))
        yield from self._without_suspects(self._completion.marches_without_start())

    def take(self, task: BranchTask | MarchTask, result: StartResult | MarchResult) -> Sequence[BranchTask | MarchTask]:
        """Takes a result; returns tasks that the result makes possible, or that have to be done again."""
        new = self._take(task, result)
        place = result.position if isinstance(result, StartResult) else result.place
        if task.key == self._tried and place == _last_place(task) and task.key not in {each.key for each in new}:
            self._tried = ""
            return [*self._without_suspects(new), *self._without_suspects(self._suspects_left())]
        return self._without_suspects(new)

    def _without_suspects(self, tasks: Sequence[BranchTask | MarchTask]) -> list[BranchTask | MarchTask]:
        """The tasks, but of those with which runs have crashed one at a time: the others wait for its end."""
        now = []
        for task in tasks:
            if not self._completion.is_suspect(task.key) or task.key == self._tried:
                now.append(task)
            elif self._tried:
                self._suspects.append(task)
            else:
                self._tried = task.key
                now.append(task)
        return now

    def _suspects_left(self) -> list[BranchTask | MarchTask]:
        left, self._suspects = self._suspects, []
        return left

    def _take(
        self, task: BranchTask | MarchTask, result: StartResult | MarchResult
    ) -> Sequence[BranchTask | MarchTask]:
        self._left[task.kind] -= task.cost_of(first=_is_first(task, result))
        self._words.pop(task.key, None)
        self.n_starts_left -= isinstance(task, BranchTask)
        if fault_of(result):
            place = result.position if isinstance(result, StartResult) else result.place
            return self._try_again(task) if place == _last_place(task) else ()
        if isinstance(task, BranchTask) and isinstance(result, StartResult):
            self._completion.add_start(task, result)
            return self._start(task, result)
        if isinstance(task, MarchTask) and isinstance(result, MarchResult):
            self._completion.add_history(task, result)
            self.n_points += len(result.points)
            self._n_given[task.number] += len(result.points)
        return ()

    def keep(self, task: BranchTask | MarchTask, progress: object) -> None:
        """Takes the progress of a task: data to continue from, or words."""
        if isinstance(progress, str):
            self._words[task.key] = progress
        else:
            self._completion.keep(task, progress)

    def _try_again(self, task: BranchTask | MarchTask) -> Sequence[BranchTask | MarchTask]:
        """The task that a fault of the machine has ended, once; later its points are left to another run."""
        self._n_faults[task.key] += 1
        if self._n_faults[task.key] > _TRIES_AGAIN:
            return ()
        again = self._completion.renew(task)
        if isinstance(again, BranchTask):
            again = replace(again, cost=_cost_left(task, again.n_results))
            self.n_starts_left += again.n_results
        else:
            # The task gives all of its histories again.
            self.n_points -= self._n_given.pop(task.number, 0)
        self._left[again.kind] += again.cost
        return [again]

    def _start(self, branch: BranchTask, result: StartResult) -> Sequence[MarchTask]:
        planned = self._completion.marches_from(branch.number, result.position)
        if branch.mode is not None:
            # nothing is left to be computed
            for march in planned:
                self._completion.add_history(march, build_mode_result(march, unpack(result.start)))
                self._left[MARCHES] -= march.cost
                self.n_points += len(march.points)
            return ()
        new = start_marches(planned, result)
        for before, march in zip(planned, new, strict=True):
            self._left[MARCHES] -= before.cost
            self._left[march.kind] += march.cost
        return new

    def look(self, running: Sequence[tuple[BranchTask | MarchTask, int, float]]) -> Standing:
        """State of the tasks. running: as `Dispatcher.running`."""
        factors = {kind: self.costs.correction(((kind,),)) for kind in self._left}
        left = sum(max(0.0, seconds) * factors[kind] for kind, seconds in self._left.items())
        longest = 0.0
        for task, n_left, elapsed in running:
            expected = task.cost_of(first=n_left == task.n_results) * factors[task.kind]
            # The time left of a task that takes longer than expected is a guess.
            still = max(expected - elapsed, _LATE * elapsed)
            left += still - expected
            longest = max(longest, still)
        return Standing(
            n_done=self.n_points,
            n_points=self._completion.plan.n_points,
            seconds_left=max(longest, left / max(1, len(running))),
            running=tuple(self._describe(task, n_left) for task, n_left, _ in running),
        )

    def _describe(self, task: BranchTask | MarchTask, n_left: int) -> str:
        """A running task in words."""
        if isinstance(task, BranchTask):
            place = task.order_left[task.n_results - n_left]
            if task.mode is not None:
                return f"mode {task.mode} {task.sweep} to {task.frequencies[place]:.3g} m sqrt(kg)"
            how = "ramp" if task.sweep == "ramp" else f"sweep {task.sweep}"
            what = f"{how} to {task.frequencies[place]:.6g} Hz"
            return f"{what} ({self._words[task.key]})" if task.key in self._words else what
        if task.blocks:
            what = f"mission history {task.number + 1}"
            return f"{what} ({self._words[task.key]})" if task.key in self._words else what
        return f"{self._completion.plan.frequency_of(task):.6g} Hz {task.scheme}"


def _last_place(task: BranchTask | MarchTask) -> int:
    """Position or place of the last result of a task."""
    return task.order_left[-1] if isinstance(task, BranchTask) else task.n_results - 1


def _is_first(task: BranchTask | MarchTask, result: StartResult | MarchResult) -> bool:
    """Whether a result is the first of its task."""
    if isinstance(task, BranchTask) and isinstance(result, StartResult):
        return result.position == next(place for place in task.order if place not in task.known)
    return isinstance(result, MarchResult) and result.place == 0


def _cost_left(task: BranchTask | MarchTask, n_left: int) -> float:
    """Estimated time of the remaining results of a task, s."""
    return task.cost if n_left == task.n_results else n_left * task.cost_of(first=False)


def fault_of(result: StartResult | MarchResult) -> str:
    """Fault of the machine that a rank sends in place of a result; empty for a result."""
    if isinstance(result, StartResult):
        return result.lost
    return result.message if result.outcome == Outcome.NOT_COMPUTED else ""


def start_marches(planned: Sequence[MarchTask], started: StartResult) -> tuple[MarchTask, ...]:
    """Wear histories from a start state. Where something moves they take about the same time, whatever the motion.

    The time grows in proportion to the number of unknowns, as a history seldom factorises anew.
    """
    tasks = []
    for task in planned:
        n_unknowns = started.n_unknowns or task.n_unknowns
        cost = task.cost * (n_unknowns / task.n_unknowns * (1.0 if started.moves else _COST_AT_REST))
        tasks.append(replace(task, start=started.start, cost=cost, n_unknowns=n_unknowns, moves=started.moves))
    return tuple(tasks)

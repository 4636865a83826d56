"""One run: hands out the tasks of a study that are left, gathers the results and writes the file."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from studyrunner.costs import LearnedCosts
from studyrunner.crashes import Crash, Evaluate, Keep, crash_files, forget_crash, note_tasks, read_crashes
from studyrunner.evaluate import (
    COMPLETE,
    CRASHED,
    NOT_COMPUTED,
    build_evaluator,
    failed_results,
)
from studyrunner.identity import Identities, hash_of_kind
from studyrunner.ledger import Ledger
from studyrunner.output import parts_folder
from studyrunner.progress import RunProgress, Standing, count
from studyrunner.ranks import Ranks
from studyrunner.records import record_type
from studyrunner.results import MarchResult, StartResult
from studyrunner.scene import describe_scene, scene_to_keep
from studyrunner.scene_variables import build_scene_variables
from studyrunner.schedule import serve_tasks, work_on_tasks
from studyrunner.store import Store, StoreInUseError
from studyrunner.study import Study
from studyrunner.tasks import BRANCHES, MARCHES, RESTING, BranchTask, MarchTask, TaskPlan, build_tasks
from studyrunner.user_error import UserError, Verbatim

if TYPE_CHECKING:
    import numpy as np

    from solver.model import ReducedModel
    from studyrunner.gather import Gathered

_RANKS_A_TASK = 2
"""A task that as many ranks were at when they were lost is not given to another one."""

_COST_AT_REST = 0.01
"""Estimated time of a march where nothing wears, over that of one that takes its steps."""


_LATE = 1.0
"""A task that takes longer than expected is taken to go on for such a share of the time that it has taken."""


class Interrupted(KeyboardInterrupt):
    """A run was ended from outside; the file holds what was computed until then. summary: how far it was."""

    def __init__(self, summary: RunSummary) -> None:
        super().__init__(summary)
        self.summary = summary


@dataclass(frozen=True)
class Job:
    """What every rank needs for the tasks of a study. folder: of the run, which not all ranks need see."""

    model: ReducedModel
    friction_coefficient: float
    folder: Path


@dataclass(frozen=True)
class RunSummary:
    """How a run ended. n_complete: points computed to their last cycle. n_left: those that are not computed yet.

    n_found: points that an earlier run has left. findings: lines that name what failed or is less exact than asked for.
    certificates: the table that begins with the worn volume.
    """

    n_points: int
    n_complete: int
    n_left: int
    n_found: int
    findings: tuple[str, ...]
    certificates: str


def run_study(
    ranks: Ranks,
    study: Study,
    model: ReducedModel,
    path: Path,
    progress: RunProgress,
    *,
    fresh: bool = False,
    retry_failed: bool = False,
) -> RunSummary:
    """Rank 0: computes the study of this model together with the other ranks and writes the file `path`.

    It goes on from what an earlier run has left in the folder beside the file, unless `fresh`; retry_failed: points
    that failed there are computed again. Raises UserError where another run is at work there, StorageError where
    something cannot be written, and Interrupted.
    """
    facts = describe_scene(model)
    plan = build_tasks(study, facts.n_displacements)
    # Before anything else is computed: what the scene cannot tell is bad input.
    if "natural_frequency" in study.outputs.variables:
        progress.say("finding the natural frequencies of the scene")
    of_scene = build_scene_variables(study, model)
    kept_scene = scene_to_keep(study, model)
    kind = record_type(study, facts)
    store = _open_store(parts_folder(path), kind, fresh=fresh)
    with contextlib.closing(store):
        ledger = Ledger(plan, Identities(study, facts.digest, hash_of_kind(kind.descr)), store)
        take_crashes(ledger)
        if retry_failed:
            ledger.forget_failed(COMPLETE)
        n_found = ledger.n_points_finished
        if n_found:
            progress.say(f"{n_found} of {count(plan.n_points, 'point')} are there from an earlier run")

        def write() -> RunSummary:
            # netCDF4 takes a moment to load: on rank 0 only, and after the other ranks have got their last task.
            from studyrunner.gather import gather

            store.flush()
            return _summarise(plan, n_found, gather(study, facts, ledger, path, of_scene, kept_scene))

        try:
            job = Job(model, study.friction_coefficient, store.folder)
            for rank in range(1, ranks.size):
                ranks.send(job, rank)
            with _evaluator(job, rank=0) as evaluate:
                run_tasks(ranks, ledger, evaluate, progress)
            progress.say("writing the result")
            summary = write()
        except KeyboardInterrupt:
            raise Interrupted(write()) from None
        ledger.prune()
    return summary


def take_crashes(ledger: Ledger) -> None:
    """Points at which a process crashed in an earlier run have failed; what that run has said of it is removed."""
    for crash in read_crashes(ledger.store.folder):
        ledger.take_as_failed(crash.key, crash.position, CRASHED, crash.message)
    for path in crash_files(ledger.store.folder):
        path.unlink(missing_ok=True)


def _open_store(folder: Path, kind: np.dtype[np.void], *, fresh: bool) -> Store:
    try:
        return Store(folder, kind, fresh=fresh)
    except StoreInUseError as error:
        remedy = "another run is writing there: wait for its end, or give another result file with -o"
        raise UserError(str(folder), "in use", Verbatim(f"by {error}"), remedy) from None


def _summarise(plan: TaskPlan, n_found: int, gathered: Gathered) -> RunSummary:
    outcomes = gathered.outcomes
    return RunSummary(
        n_points=plan.n_points,
        n_complete=sum(outcomes[number] for number in COMPLETE),
        n_left=outcomes[NOT_COMPUTED],
        n_found=n_found,
        findings=gathered.findings,
        certificates=gathered.certificates,
    )


def work_on_job(ranks: Ranks, job: Job) -> None:
    """Any other rank: computes tasks until there are none."""
    with _evaluator(job, ranks.rank) as evaluate:
        work_on_tasks(ranks, evaluate)


def _evaluator(job: Job, rank: int) -> contextlib.AbstractContextManager[Evaluate]:
    """The function that does tasks on a rank. One that breaks off gives results that say so; others go on."""
    compute = build_evaluator(job.model, job.friction_coefficient)

    def compute_all(task: BranchTask | MarchTask, keep: Keep) -> Iterator[StartResult | MarchResult]:
        given: set[int] = set()
        for result in compute(task, keep):
            if isinstance(result, StartResult):
                given.add(result.position)
            yield result
        if isinstance(task, BranchTask) and len(given) < task.n_results and task.resume is not None:
            # the branch had passed states that are damaged or were not asked for then
            yield from compute(replace(task, known=task.known | given, resume=None), keep)

    def evaluate(task: BranchTask | MarchTask, keep: Keep) -> Iterator[StartResult | MarchResult]:
        n_given = 0
        try:
            for result in compute_all(task, keep):
                n_given += 1
                yield result
        except Exception as error:
            yield from failed_results(task, n_given, error)

    return note_tasks(evaluate, job.folder, rank)


class Course:
    """How far the tasks of a study are, and what their results make possible.

    A march becomes available with its start state, while its branch goes on. What a task computes never depends on the
    order.
    """

    def __init__(self, ledger: Ledger) -> None:
        self.costs = LearnedCosts()
        self.branches = ledger.branches_left()
        self.n_points = ledger.n_points_finished
        self.n_starts_left = sum(branch.n_results for branch in self.branches)
        self._ledger = ledger
        self._n_lost: Counter[str] = Counter()
        self._left = dict.fromkeys((BRANCHES, MARCHES, RESTING), 0.0)
        self._left[BRANCHES] = sum(branch.cost for branch in self.branches)
        lines = ledger.plan.marches
        self._left[MARCHES] = sum(march.cost for line in lines for march in line if not ledger.is_finished(march))

    def begin(self) -> Iterator[BranchTask | MarchTask]:
        """The tasks that are possible from the start."""
        yield from self.branches
        for branch in self._ledger.plan.branches:
            for result in self._ledger.known_starts(branch):
                yield from self._start(branch, result)

    def take(self, task: BranchTask | MarchTask, result: StartResult | MarchResult) -> Sequence[MarchTask]:
        """Takes a result; returns the tasks that it makes possible."""
        self._left[task.kind] -= task.cost / task.n_results
        if isinstance(task, BranchTask) and isinstance(result, StartResult):
            self.n_starts_left -= 1
            self._ledger.add_start(task, result)
            return self._start(task, result)
        if isinstance(task, MarchTask) and isinstance(result, MarchResult):
            self._ledger.add_history(task, result)
            self.n_points += len(result.points)
        return ()

    def take_back(
        self, lost: Sequence[tuple[BranchTask | MarchTask, int]], crashes: Mapping[str, Crash]
    ) -> list[BranchTask | MarchTask]:
        """What is to be done in place of the tasks of a lost rank, each with the number of results still to be given.

        The rank was at the first of them. crashes: by the key of the task. A task that crashes is not tried again, and
        neither is one with which several ranks were lost, as it may need more memory than there is.
        """
        left: list[BranchTask | MarchTask] = []
        for task, n_left in lost:
            self._n_lost[task.key] += task is lost[0][0]
            again = self._ledger.renew(task)
            crash = crashes.get(task.key)
            if crash is None and self._n_lost[task.key] >= _RANKS_A_TASK:
                position = next(iter(again.order_left)) if isinstance(again, BranchTask) else None
                crash = Crash(task.key, position, f"{_RANKS_A_TASK} ranks were lost while they were at it")
            if crash is not None:
                self.n_points += self._ledger.take_as_failed(crash.key, crash.position, CRASHED, crash.message)
            if isinstance(again, BranchTask):
                if crash is not None and crash.position is not None:
                    behind = again.order[again.order.index(crash.position) :]
                    again = replace(again, known=again.known.union(behind))
                again = replace(again, cost=task.cost * again.n_results / task.n_results)
                self._left[task.kind] -= task.cost * n_left / task.n_results - again.cost
                self.n_starts_left -= n_left - again.n_results
                left += [again] if again.n_results else []
            elif crash is not None:
                self._left[task.kind] -= task.cost * n_left / task.n_results
            else:
                # it gives all of its histories again
                n_given = task.n_results - n_left
                self.n_points -= sum(len(share.points) for share in again.shares[:n_given])
                self._left[task.kind] += task.cost * n_given / task.n_results
                left.append(again)
        return left

    def _start(self, branch: BranchTask, result: StartResult) -> Sequence[MarchTask]:
        planned = self._ledger.marches_from(branch.number, result.position)
        new = start_marches(planned, result)
        for before, march in zip(planned, new, strict=True):
            self._left[MARCHES] -= before.cost
            self._left[march.kind] += march.cost
        return new

    def look(self, running: Sequence[tuple[BranchTask | MarchTask, int, float]]) -> Standing:
        """How far the tasks are. running: as `Dispatcher.running`."""
        factors = {kind: self.costs.correction(((kind,),)) for kind in self._left}
        left = sum(max(0.0, seconds) * factors[kind] for kind, seconds in self._left.items())
        longest = 0.0
        for task, _, elapsed in running:
            expected = task.cost / task.n_results * factors[task.kind]
            # one that is late takes some time more, nobody knows how much
            still = max(expected - elapsed, _LATE * elapsed)
            left += still - expected
            longest = max(longest, still)
        return Standing(
            n_done=self.n_points,
            n_points=self._ledger.plan.n_points,
            seconds_left=max(longest, left / max(1, len(running))),
            running=tuple(self._describe(task, n_left) for task, n_left, _ in running),
        )

    def _describe(self, task: BranchTask | MarchTask, n_left: int) -> str:
        """A task that is computed, by what it is at."""
        if isinstance(task, BranchTask):
            place = task.order_left[task.n_results - n_left]
            how = "ramp" if task.sweep == "ramp" else f"sweep {task.sweep}"
            return f"{how} to {task.frequencies[place]:.6g} Hz"
        return f"{self._ledger.plan.branches[task.branch].frequencies[task.position]:.6g} Hz {task.scheme}"


def run_tasks(ranks: Ranks, ledger: Ledger, evaluate: Evaluate, progress: RunProgress) -> None:
    """Rank 0: has all tasks that are left done and their results written. The others work on tasks."""
    course = Course(ledger)

    def take(task: BranchTask | MarchTask, result: StartResult | MarchResult) -> Sequence[MarchTask]:
        new = course.take(task, result)
        if isinstance(task, BranchTask) and course.n_starts_left == 0:
            progress.say("marching through the remaining wear histories")
        return new

    def take_back(rank: int, lost: Sequence[tuple[BranchTask | MarchTask, int]]) -> list[BranchTask | MarchTask]:
        had = f", which had {count(len(lost), 'task')}" if lost else ""
        progress.note(f"rank {rank} is lost{had}: the others go on without it")
        crashes = {crash.key: crash for crash in read_crashes(ledger.store.folder)}
        forget_crash(ledger.store.folder, rank)
        return course.take_back(lost, crashes)

    def tick(running: Callable[[], Sequence[tuple[BranchTask | MarchTask, int, float]]]) -> None:
        ledger.store.tick()
        progress.tick(lambda: course.look(running()))

    if course.branches:
        n_branches = count(len(course.branches), "branch", "branches")
        n_starts = count(course.n_starts_left, "start state")
        progress.say(f"following {n_branches} through {n_starts}, marching through wear histories")
    progress.begin_tasks()
    serve_tasks(ranks, course.begin(), evaluate, take, course.costs, tick, ledger.keep, take_back)
    ledger.store.flush()


def start_marches(planned: Sequence[MarchTask], started: StartResult) -> tuple[MarchTask, ...]:
    """The marches from a start state. Where something moves they take about the same time, be it little or much.

    The time grows with the unknowns of the state itself, not with a power: marches seldom factorise anew.
    """
    tasks = []
    for task in planned:
        n_unknowns = started.n_unknowns or task.n_unknowns
        share = n_unknowns / task.n_unknowns
        share *= 1.0 if started.moves else _COST_AT_REST
        cost = task.cost * share
        tasks.append(replace(task, start=started.start, cost=cost, n_unknowns=n_unknowns, moves=started.moves))
    return tuple(tasks)

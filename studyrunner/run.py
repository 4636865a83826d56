"""One run: hands out the tasks of a study, gathers their results and writes the file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from studyrunner.costs import LearnedCosts
from studyrunner.evaluate import CONVERGED, build_evaluator, describe_failures
from studyrunner.output import parts_folder
from studyrunner.parts import Parts, record_type
from studyrunner.progress import RunProgress, count
from studyrunner.ranks import Ranks
from studyrunner.results import MarchResult, StartResult
from studyrunner.scene import describe_scene
from studyrunner.scene_variables import build_scene_variables
from studyrunner.schedule import serve_tasks, work_on_tasks
from studyrunner.study import Study
from studyrunner.tasks import BRANCHES, MARCHES, RESTING, BranchTask, MarchTask, TaskPlan, build_tasks

if TYPE_CHECKING:
    from solver.model import ReducedModel

Evaluate = Callable[[BranchTask | MarchTask], Iterator[StartResult | MarchResult]]

_COST_AT_REST = 0.01
"""Estimated time of a march where nothing wears, over that of one that takes its steps."""


@dataclass(frozen=True)
class Job:
    """What every rank needs for the tasks of a study."""

    model: ReducedModel
    friction_coefficient: float


@dataclass(frozen=True)
class RunSummary:
    """How a run ended. failures: a line for each way in which points failed. certificates: the table of the worst."""

    n_points: int
    n_converged: int
    failures: tuple[str, ...]
    certificates: str


def run_study(ranks: Ranks, study: Study, model: ReducedModel, path: Path, progress: RunProgress) -> RunSummary:
    """Rank 0: computes the study of this model together with the other ranks and writes the file `path`."""
    facts = describe_scene(model)
    plan = build_tasks(study, facts.n_displacements)
    # Before anything else is computed: what the scene cannot tell is bad input.
    if "natural_frequency" in study.outputs.variables:
        progress.say("finding the natural frequencies of the scene")
    of_scene = build_scene_variables(study, model)
    parts = Parts(parts_folder(path), record_type(study, facts))
    try:
        job = Job(model, study.friction_coefficient)
        for rank in range(1, ranks.size):
            ranks.send(job, rank)
        run_tasks(ranks, plan, build_evaluator(model, study.friction_coefficient), parts, progress)
        progress.say("writing the result")
        # netCDF4 takes a moment to load: on rank 0 only, and after the other ranks have got their last task.
        from studyrunner.gather import gather

        gathered = gather(study, facts, plan, parts, path, of_scene)
    finally:
        # Nothing goes on from an interrupted run.
        parts.remove()
    return RunSummary(
        plan.n_points, gathered.outcomes[CONVERGED], describe_failures(gathered.outcomes), gathered.certificates
    )


def work_on_job(ranks: Ranks, job: Job) -> None:
    """Any other rank: computes tasks until there are none."""
    work_on_tasks(ranks, build_evaluator(job.model, job.friction_coefficient))


class Course:
    """How far the tasks of a study are, and what their results make possible.

    keep: called with every finished march and its result. A march becomes available with its start state, while its
    branch goes on. What a task computes never depends on the order.
    """

    def __init__(self, plan: TaskPlan, keep: Callable[[MarchTask, MarchResult], None]) -> None:
        self.plan = plan
        self.costs = LearnedCosts()
        self.n_points = 0
        self.n_starts_left = sum(branch.n_results for branch in plan.branches)
        self._keep = keep
        self._left = dict.fromkeys((BRANCHES, MARCHES, RESTING), 0.0)
        self._left[BRANCHES] = sum(branch.cost for branch in plan.branches)
        self._left[MARCHES] = plan.cost - self._left[BRANCHES]

    def take(self, task: BranchTask | MarchTask, result: StartResult | MarchResult) -> Sequence[MarchTask]:
        """Takes a result; returns the tasks that it makes possible."""
        self._left[task.kind] -= task.cost / task.n_results
        if isinstance(task, BranchTask) and isinstance(result, StartResult):
            self.n_starts_left -= 1
            planned = self.plan.marches_from(task.number, result.position)
            new = start_marches(planned, result)
            for before, march in zip(planned, new, strict=True):
                self._left[MARCHES] -= before.cost
                self._left[march.kind] += march.cost
            return new
        if isinstance(task, MarchTask) and isinstance(result, MarchResult):
            self._keep(task, result)
            self.n_points += len(result.points)
        return ()

    @property
    def seconds(self) -> tuple[float, float]:
        """Seconds spent on all ranks together, and those expected in the end."""
        spent = sum(self.costs.measured(kind) for kind in self._left)
        left = sum(max(0.0, seconds) * self.costs.correction(((kind,),)) for kind, seconds in self._left.items())
        return spent, spent + left


def run_tasks(ranks: Ranks, plan: TaskPlan, evaluate: Evaluate, parts: Parts, progress: RunProgress) -> None:
    """Rank 0: has all tasks done and their results written to `parts`. The others work on tasks."""
    course = Course(plan, parts.add)

    def take(task: BranchTask | MarchTask, result: StartResult | MarchResult) -> Sequence[MarchTask]:
        new = course.take(task, result)
        if isinstance(task, BranchTask) and course.n_starts_left == 0:
            progress.say("marching through the remaining wear histories")
        return new

    def tick() -> None:
        parts.tick()
        progress.report(*course.seconds, course.n_points, plan.n_points)

    n_branches = count(len(plan.branches), "branch", "branches")
    n_frequencies = count(len(plan.branches[0].frequencies), "frequency", "frequencies")
    progress.say(f"following {n_branches} along {n_frequencies}, marching through wear histories")
    progress.report(0.0, plan.cost, 0, plan.n_points)
    first: list[BranchTask | MarchTask] = [*plan.branches]
    serve_tasks(ranks, first, evaluate, take, course.costs, tick)
    parts.flush()


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

"""One run: hands out the tasks of a study, gathers their results and writes the file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from studyrunner.evaluate import CONVERGED, build_evaluator, describe_failures
from studyrunner.progress import RunProgress, count
from studyrunner.ranks import Ranks
from studyrunner.results import BranchResult, MarchResult
from studyrunner.scene import describe_scene
from studyrunner.schedule import serve_tasks, work_on_tasks
from studyrunner.study import Study
from studyrunner.tasks import BranchTask, MarchTask, TaskPlan, build_tasks

if TYPE_CHECKING:
    from solver.model import ReducedModel

Evaluate = Callable[[BranchTask | MarchTask], BranchResult | MarchResult]

_QUIET_COST = 0.1
"""Estimated time of a march from a state that hardly moves, over that of the liveliest one of its branch."""


@dataclass(frozen=True)
class Job:
    """What every rank needs for the tasks of a study."""

    model: ReducedModel
    friction_coefficient: float


@dataclass(frozen=True)
class RunSummary:
    """How a run ended. failures: a line for each way in which points failed."""

    n_points: int
    n_converged: int
    failures: tuple[str, ...]


def run_study(ranks: Ranks, study: Study, model: ReducedModel, path: Path, progress: RunProgress) -> RunSummary:
    """Rank 0: computes the study of this model together with the other ranks and writes the file `path`."""
    facts = describe_scene(model)
    plan = build_tasks(study, facts.n_displacements)
    job = Job(model, study.friction_coefficient)
    for rank in range(1, ranks.size):
        ranks.send(job, rank)
    results = run_tasks(ranks, plan, build_evaluator(model, study.friction_coefficient), progress)
    progress.say("writing the result")
    # xarray takes most of a second to load: on rank 0 only, and after the other ranks have got their last task.
    from studyrunner.gather import build_dataset, write_dataset

    write_dataset(build_dataset(study, facts, results), path)
    outcomes = [result.outcome for result in results for _ in result.points]
    return RunSummary(plan.n_points, outcomes.count(CONVERGED), describe_failures(outcomes))


def work_on_job(ranks: Ranks, job: Job) -> None:
    """Any other rank: computes tasks until there are none."""
    work_on_tasks(ranks, build_evaluator(job.model, job.friction_coefficient))


def run_tasks(ranks: Ranks, plan: TaskPlan, evaluate: Evaluate, progress: RunProgress) -> tuple[MarchResult, ...]:
    """Results of all march tasks, in the order in which they arrive. Rank 0 only; the others work on tasks.

    A march becomes available when its branch is done. What a task computes never depends on the order.
    """
    results: list[MarchResult] = []
    costs = {"done": 0.0, "total": plan.cost, "points": 0.0, "branches": 0.0}
    n_branches = count(len(plan.branches), "branch", "branches")

    def take(task: BranchTask | MarchTask, result: BranchResult | MarchResult) -> Sequence[BranchTask | MarchTask]:
        costs["done"] += task.cost
        new: tuple[MarchTask, ...] = ()
        if isinstance(task, BranchTask) and isinstance(result, BranchResult):
            planned = plan.marches[task.number]
            new = start_marches(planned, result)
            costs["total"] += sum(march.cost for march in new) - sum(march.cost for march in planned)
            costs["branches"] += 1
            progress.say(f"marching through wear histories, {costs['branches']:.0f} of {n_branches} followed")
        elif isinstance(result, MarchResult):
            results.append(result)
            costs["points"] += len(result.points)
        progress.report(costs["done"], costs["total"], int(costs["points"]), plan.n_points)
        return new

    n_frequencies = len(plan.branches[0].frequencies)
    progress.say(f"following {n_branches} along {count(n_frequencies, 'frequency', 'frequencies')}")
    progress.report(0.0, plan.cost, 0, plan.n_points)
    first: list[BranchTask | MarchTask] = [*plan.branches]
    serve_tasks(ranks, first, evaluate, take, progress.tick)
    return tuple(results)


def start_marches(planned: Sequence[MarchTask], branch: BranchResult) -> tuple[MarchTask, ...]:
    """The marches of a branch with their start states, dearer where the joint moves more."""
    most = max(branch.activity, default=0.0)
    marches = []
    for task in planned:
        liveliness = branch.activity[task.position] / most if most > 0.0 else 1.0
        cost = task.cost * (_QUIET_COST + (1.0 - _QUIET_COST) * liveliness)
        marches.append(replace(task, start=branch.starts[task.position], cost=cost))
    return tuple(marches)

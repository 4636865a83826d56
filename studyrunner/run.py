"""One run: hands out the tasks of a study, gathers their results and writes the file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from studyrunner.evaluate import CONVERGED, build_evaluator, describe_failures
from studyrunner.progress import RunProgress, count
from studyrunner.ranks import Ranks
from studyrunner.results import MarchResult, StartResult
from studyrunner.scene import describe_scene
from studyrunner.schedule import serve_tasks, work_on_tasks
from studyrunner.study import Study
from studyrunner.tasks import BranchTask, MarchTask, TaskPlan, build_tasks

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
    job = Job(model, study.friction_coefficient)
    for rank in range(1, ranks.size):
        ranks.send(job, rank)
    results = run_tasks(ranks, plan, build_evaluator(model, study.friction_coefficient), progress)
    progress.say("writing the result")
    # xarray takes most of a second to load: on rank 0 only, and after the other ranks have got their last task.
    from studyrunner.gather import build_dataset, write_dataset

    dataset = build_dataset(study, facts, results)
    write_dataset(dataset, path)
    outcomes = [result.outcome for result in results for _ in result.points]
    return RunSummary(
        plan.n_points, outcomes.count(CONVERGED), describe_failures(outcomes), dataset.attrs["certificate_summary"]
    )


def work_on_job(ranks: Ranks, job: Job) -> None:
    """Any other rank: computes tasks until there are none."""
    work_on_tasks(ranks, build_evaluator(job.model, job.friction_coefficient))


def run_tasks(ranks: Ranks, plan: TaskPlan, evaluate: Evaluate, progress: RunProgress) -> tuple[MarchResult, ...]:
    """Results of all march tasks, in the order in which they arrive. Rank 0 only; the others work on tasks.

    A march becomes available with its start state, while its branch goes on. What a task computes never depends on the
    order.
    """
    results: list[MarchResult] = []
    sums = {"done": 0.0, "total": plan.cost}
    counts = {"points": 0, "starts": 0}
    n_starts = sum(len(branch.frequencies) for branch in plan.branches)

    def take(task: BranchTask | MarchTask, result: StartResult | MarchResult) -> Sequence[BranchTask | MarchTask]:
        new: tuple[MarchTask, ...] = ()
        if isinstance(task, BranchTask) and isinstance(result, StartResult):
            planned = [march for march in plan.marches[task.number] if march.position == result.position]
            new = start_marches(planned, result)
            sums["done"] += task.cost / len(task.frequencies)
            sums["total"] += sum(march.cost for march in new) - sum(march.cost for march in planned)
            counts["starts"] += 1
            if counts["starts"] == n_starts:
                progress.say("marching through the remaining wear histories")
        elif isinstance(result, MarchResult):
            results.append(result)
            sums["done"] += task.cost
            counts["points"] += len(result.points)
        progress.report(sums["done"], sums["total"], counts["points"], plan.n_points)
        return new

    n_branches = count(len(plan.branches), "branch", "branches")
    n_frequencies = count(len(plan.branches[0].frequencies), "frequency", "frequencies")
    progress.say(f"following {n_branches} along {n_frequencies}, marching through wear histories")
    progress.report(0.0, plan.cost, 0, plan.n_points)
    first: list[BranchTask | MarchTask] = [*plan.branches]
    serve_tasks(ranks, first, evaluate, take, progress.tick)
    return tuple(results)


def start_marches(planned: Sequence[MarchTask], started: StartResult) -> tuple[MarchTask, ...]:
    """The marches from a start state. Where something moves they take about the same time, be it little or much."""
    share = 1.0 if started.moves else _COST_AT_REST
    return tuple(replace(task, start=started.start, cost=task.cost * share) for task in planned)

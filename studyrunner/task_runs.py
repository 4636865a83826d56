"""The tasks of a run are done: by any rank its own, and by rank 0 the hand-out of all."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from solver.clock import n_compiled
from studyrunner.checkpoint.completion_index import CompletionIndex
from studyrunner.evaluate import build_evaluator, failed_results
from studyrunner.mpi.ranks import Ranks
from studyrunner.mpi.schedule import Handlers, serve_tasks
from studyrunner.plan.results import Evaluate, Keep, MarchResult, StartResult
from studyrunner.plan.tasks import BranchTask, MarchTask
from studyrunner.scene_building import Scenes
from studyrunner.system.endings import raise_ending
from studyrunner.system.progress import ProgressDisplay, count
from studyrunner.task_progress import TaskProgress, fault_of

if TYPE_CHECKING:
    from solver.model import ReducedModel


def evaluator(model: ReducedModel | None) -> Evaluate:
    """The function that does tasks on a rank. A task that breaks off gives failed results; the other tasks go on."""
    compute = build_evaluator(model)

    def compute_all(task: BranchTask | MarchTask, keep: Keep) -> Iterator[StartResult | MarchResult]:
        given: set[int] = set()
        for result in compute(task, keep):
            if isinstance(result, StartResult):
                given.add(result.position)
            yield result
        if isinstance(task, BranchTask) and len(given) < task.n_results and task.resume is not None:
            # The earlier run had passed states that are damaged, or that it did not need.
            yield from compute(replace(task, known=task.known | given, resume=None), keep)

    def evaluate(task: BranchTask | MarchTask, keep: Keep) -> Iterator[StartResult | MarchResult]:
        n_given = 0
        try:
            for result in compute_all(task, keep):
                n_given += 1
                yield result
        except Exception as error:
            # An exception from a signal is no failure of the task.
            raise_ending()
            yield from failed_results(task, n_given, error)

    return evaluate


def run_tasks(
    ranks: Ranks,
    completion: CompletionIndex,
    evaluate: Evaluate,
    progress: ProgressDisplay,
    scenes: Scenes,
) -> None:
    """Rank 0: has the remaining tasks done and their results saved."""
    tasks = TaskProgress(completion)

    def take(task: BranchTask | MarchTask, result: StartResult | MarchResult) -> Sequence[BranchTask | MarchTask]:
        new = tasks.take(task, result)
        if isinstance(task, BranchTask) and task.mode is None and tasks.n_starts_left == 0:
            progress.say("computing the remaining wear histories")
        return new

    said: set[tuple[int, str]] = set()

    def is_sick(rank: int, result: StartResult | MarchResult) -> bool:
        fault = fault_of(result)
        if fault and (rank, fault) not in said:
            said.add((rank, fault))
            progress.note(
                f"rank {rank}: {fault}: a fault of the machine; the task is tried once more, by another rank where"
                " there is one"
            )
        return bool(fault)

    known: int | None = n_compiled()

    def tick(running: Callable[[], Sequence[tuple[BranchTask | MarchTask, int, float]]]) -> None:
        nonlocal known
        if known is not None and n_compiled() > known:
            known = None
            progress.note("the solver is compiled for this machine, once after an installation")
        completion.store.tick()
        progress.tick(lambda: tasks.look(running()))

    if tasks.branches and tasks.branches[0].mode is not None:
        n_points = count(tasks.n_starts_left, "point")
        progress.say(f"following {count(len(tasks.branches), 'nonlinear mode')} through {n_points}")
    elif tasks.branches:
        n_branches = count(len(tasks.branches), "sweep")
        n_starts = count(tasks.n_starts_left, "start state")
        progress.say(f"computing {n_starts} along {n_branches}, and wear histories")
    if completion.plan.n_missions:
        progress.say(f"computing {count(completion.plan.n_missions, 'mission history', 'mission histories')}")
    progress.begin_tasks()

    def prepare(rank: int, task: BranchTask | MarchTask) -> BranchTask | MarchTask:
        completion.store.note_begin(task.key)
        return scenes.with_model(rank, task)

    handlers = Handlers(take, tick, tasks.keep, is_sick, prepare)
    serve_tasks(ranks, tasks.begin(), evaluate, handlers, tasks.costs)
    completion.store.flush()

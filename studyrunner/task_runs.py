"""The tasks of a run are done: by any rank its own, and by rank 0 the hand-out of all."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from solver.clock import n_compiled
from solver.outcome import Outcome, describe_error
from studyrunner.checkpoint.completion_index import CompletionIndex
from studyrunner.kinds.kind import kind_of
from studyrunner.kinds.task import Keep, Result, Task
from studyrunner.mpi.mapped_file import MappedFile, open_mapped
from studyrunner.mpi.ranks import Ranks
from studyrunner.mpi.schedule import Handlers, serve_tasks
from studyrunner.scene_building import Scenes
from studyrunner.scene_models import ModelCache
from studyrunner.study.study import Study
from studyrunner.system.endings import raise_ending
from studyrunner.system.machine_faults import MachineFaultError, is_fault_of_machine
from studyrunner.system.progress import ProgressDisplay
from studyrunner.task_progress import TaskProgress

if TYPE_CHECKING:
    from solver.model import ReducedModel

Evaluate = Callable[[Task, Keep], Iterator[Result]]
"""Does a task: gives the results one by one and hands over the progress from time to time."""


def build_evaluator(model: ReducedModel | None) -> Evaluate:
    """The function that does the tasks of a study.

    model: of the only scene; None where there are several scenes, whose models come with tasks.
    """
    models: ModelCache[tuple[ReducedModel, ...]] = ModelCache()
    if model is not None:
        models.add((0,), (model,))

    def evaluate(task: Task, keep: Keep) -> Iterator[Result]:
        # first of all: rank 0 sends the models once, also where the task breaks off
        if task.models:
            given = (open_mapped(each) if isinstance(each, MappedFile) else each for each in task.models)
            models.add(task.scenes, tuple(given))
        elif not models.use(task.scenes):
            raise RuntimeError(f"no model of scene {task.scenes} for {task}")
        own = dict(zip(task.scenes, models[task.scenes], strict=True))
        yield from replace(task, models=()).compute(own, keep)

    return evaluate


def evaluator(model: ReducedModel | None) -> Evaluate:
    """The function that does tasks on a rank. A task that breaks off gives failed results; the other tasks go on.

    A fault of the machine is no result of the task: it may be tried again.
    """
    compute = build_evaluator(model)

    def evaluate(task: Task, keep: Keep) -> Iterator[Result]:
        left = dict.fromkeys(task.places)
        try:
            for result in compute(task, keep):
                left.pop(result.place, None)
                yield result
        except Exception as error:
            # An exception from a signal is no failure of the task.
            raise_ending()
            outcome = Outcome.NOT_COMPUTED if is_fault_of_machine(error) else Outcome.EXCEPTION
            message = str(error) if isinstance(error, MachineFaultError) else describe_error(error)
            for place in left:
                yield task.failed(place, outcome, message)

    return evaluate


def run_tasks(
    ranks: Ranks,
    study: Study,
    completion: CompletionIndex,
    evaluate: Evaluate,
    progress: ProgressDisplay,
    scenes: Scenes,
) -> None:
    """Rank 0: has the remaining tasks done and their results saved."""
    tasks = TaskProgress(completion)
    said: set[tuple[int, str]] = set()

    def is_sick(rank: int, result: Result) -> bool:
        if result.fault and (rank, result.fault) not in said:
            said.add((rank, result.fault))
            progress.note(
                f"rank {rank}: {result.fault}: a fault of the machine; the task is tried once more, by another rank"
                " where there is one"
            )
        return bool(result.fault)

    known: int | None = n_compiled()

    def tick(running: Callable[[], Sequence[tuple[Task, int, float]]]) -> None:
        nonlocal known
        if known is not None and n_compiled() > known:
            known = None
            progress.note("the solver is compiled for this machine, once after an installation")
        completion.store.tick()
        progress.tick(lambda: tasks.look(running()))

    def prepare(rank: int, task: Task) -> Task:
        completion.store.note_begin(task.key)
        return scenes.with_model(rank, task)

    if tasks.tasks:
        progress.say(f"computing {kind_of(study).describe_tasks(tasks.tasks)}")
    progress.begin_tasks()
    handlers: Handlers[Task, Result] = Handlers(tasks.take, tick, tasks.keep, is_sick, prepare)
    serve_tasks(ranks, tasks.begin(), evaluate, handlers, tasks.costs)
    completion.store.flush()

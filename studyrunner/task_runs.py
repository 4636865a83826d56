"""The tasks of a run are done: by any rank its own, and by rank 0 the hand-out of all."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from solver.clock import n_compiled
from solver.outcome import Outcome, describe_error
from studyrunner.checkpoint.completion_index import CompletionIndex
from studyrunner.kinds.kind import kind_of
from studyrunner.kinds.task import Keep, Result, Task
from studyrunner.mpi.mapped_file import MappedFile, open_mapped
from studyrunner.mpi.ranks import Ranks
from studyrunner.mpi.schedule import Run, serve_tasks
from studyrunner.scene_building import ModelCache, SceneBuilt, Scenes, SceneTask, build_scene_task
from studyrunner.study.study import Study
from studyrunner.system.endings import raise_ending
from studyrunner.system.machine_faults import MachineFaultError, is_fault_of_machine
from studyrunner.system.progress import ProgressDisplay
from studyrunner.task_progress import TaskProgress

if TYPE_CHECKING:
    from solver.model import ReducedModel

Models = Mapping[int, "ReducedModel"]


def compute_task(task: Task, models: Models, keep: Keep) -> Iterator[Result]:
    """The results of a task, one by one. models: by number of the scene."""
    return task.compute(models, keep)


def evaluator() -> Run[Any, Any]:
    """The function that does tasks on a rank, and builds scenes.

    A task that breaks off gives failed results; the other tasks go on. A fault of the machine is no result.
    """
    models: ModelCache[tuple[ReducedModel, ...]] = ModelCache()

    def own_models(task: Task) -> Models:
        # first of all: rank 0 sends the models once, also where the task breaks off
        if task.models:
            given = (open_mapped(each) if isinstance(each, MappedFile) else each for each in task.models)
            models.add(task.scenes, tuple(given))
        elif not models.use(task.scenes):
            raise RuntimeError(f"no model of scene {task.scenes} for {task}")
        return dict(zip(task.scenes, models[task.scenes], strict=True))

    def evaluate(task: Task | SceneTask, keep: Callable[[object], None]) -> Iterator[Result | SceneBuilt]:
        if isinstance(task, SceneTask):
            yield from build_scene_task(task, keep)
            return
        left = dict.fromkeys(task.places)
        try:
            for result in compute_task(replace(task, models=()), own_models(task), keep):
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


class StudyRun(TaskProgress):
    """Rank 0 while the tasks of a study are done: results are saved, and the user sees how far they are."""

    def __init__(self, completion: CompletionIndex, scenes: Scenes, display: ProgressDisplay) -> None:
        super().__init__(completion)
        self._store = completion.store
        self._scenes = scenes
        self._display = display
        self._said: set[tuple[int, str]] = set()
        self._n_compiled: int | None = n_compiled()

    def prepare(self, rank: int, task: Task) -> Task:
        """The task with the models that the rank does not have."""
        self._store.note_begin(task.key)
        return self._scenes.models.with_model(rank, task)

    def is_sick(self, rank: int, result: Result) -> bool:
        """Whether the result is a fault of the machine."""
        if result.fault and (rank, result.fault) not in self._said:
            self._said.add((rank, result.fault))
            self._display.note(
                f"rank {rank}: {result.fault}: a fault of the machine; the task is tried once more, by another rank"
                " where there is one"
            )
        return bool(result.fault)

    def tick(self, running: Callable[[], Sequence[tuple[Task, int, float]]]) -> None:
        """Writes and shows what is due."""
        if self._n_compiled is not None and n_compiled() > self._n_compiled:
            self._n_compiled = None
            self._display.note("the solver is compiled for this machine, once after an installation")
        self._store.tick()
        self._display.tick(lambda: self.look(running()))


def run_tasks(ranks: Ranks, study: Study, run: StudyRun, display: ProgressDisplay) -> None:
    """Rank 0: has the remaining tasks done and their results saved."""
    if run.tasks:
        display.say(f"computing {kind_of(study).describe_tasks(run.tasks)}")
    serve_tasks(ranks, run, evaluator(), run.costs)

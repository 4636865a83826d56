"""The scenes of a run: each built once, by rank 0 or, where there are several, by all ranks side by side.

They are stored in the file of the run. A task brings the model to a rank that does not have it: as a file that the
ranks map (`write_mapped`), once in memory on each machine, or the model itself where the rank does not see that file.
"""

import contextlib
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from solver.model import ReducedModel
from solver.packing import Packed, pack, unpack_model
from studies.model_check import check_model
from studies.scene import WARNING, Progress
from studies.scene_error import SceneError
from studyrunner.checkpoint.store import COMPUTED, UNREADABLE, Store
from studyrunner.kinds.task import Task
from studyrunner.mpi.dispatch import CostKeys
from studyrunner.mpi.ranks import Ranks
from studyrunner.mpi.schedule import TaskHandler, serve_tasks
from studyrunner.scene import answers
from studyrunner.scene.scene import SceneFacts, build_study_scene, describe_study_scene, model_key
from studyrunner.scene.scene_set import SceneSet, find_scenes
from studyrunner.study.study import Study
from studyrunner.study.study_file import keys_in_file
from studyrunner.system.machine import MappedFile, new_partial, write_mapped
from studyrunner.user_error import UserError

_MODELS_A_RANK = 2
"""Models, or sets of models of the blocks of a mission, that a rank holds where a study has several scenes."""

Models = TypeVar("Models")
ModelCache = OrderedDict[tuple[int, ...], Models]
"""The models that a rank has computed with last, by the numbers of the scenes that a task needs. Rank 0 keeps such a
list for each rank, without models."""


def hold_models(cache: ModelCache[Models], scenes: tuple[int, ...], models: Models) -> None:
    """Adds models, or uses them again; removes those that were not used for longest where there are too many."""
    cache[scenes] = models
    cache.move_to_end(scenes)
    if len(cache) > _MODELS_A_RANK:
        cache.popitem(last=False)


class SceneModels:
    """Rank 0: which rank has which models (`ModelCache`), and the files of models in use."""

    def __init__(self, read: Callable[[int], ReducedModel], beside: Path) -> None:
        """read: the model of a scene. beside: the file that the files of models stand beside."""
        self._read = read
        self._beside = beside
        self._blind: set[int] = set()  # ranks that do not see the files
        self._of_ranks: dict[int, ModelCache[None]] = {}
        self._files: dict[int, MappedFile] = {}

    def with_model(self, rank: int, task: Task, *, unseen: bool = False) -> Task:
        """The task as a rank gets it: with the models that it does not have. unseen: whether it does not see files."""
        self._blind |= {rank} if unseen else set()
        own = self._of_ranks.setdefault(rank, OrderedDict())
        is_there = task.scenes in own and not unseen
        hold_models(own, task.scenes, None)
        if is_there:
            return task
        used = {number for each in self._of_ranks.values() for scenes in each for number in scenes}
        for number in self._files.keys() - used:
            self._files.pop(number).path.unlink(missing_ok=True)
        return replace(task, models=tuple(self._hand(rank, number) for number in task.scenes))

    def _hand(self, rank: int, number: int) -> "ReducedModel | MappedFile":
        if rank in self._blind:
            return self._read(number)
        if number not in self._files:
            # a full disk costs memory: each rank gets the model itself
            with contextlib.suppress(OSError):
                self._files[number] = write_mapped(self._read(number), new_partial(self._beside))
        return self._files[number] if number in self._files else self._read(number)


@dataclass(frozen=True)
class SceneTask:
    """One scene to build. study: of this scene alone. known: its model from an earlier run."""

    number: int
    study: Study
    known: Packed | None = None
    costs: tuple[float, ...] = (1.0,)
    gives_starts: bool = False
    cost_keys: CostKeys = (("scene",),)


@dataclass(frozen=True)
class SceneBuilt:
    """A scene that was built.

    facts: None where the scene is wrong. variables: what the study asks of the scene. model: None where it is
    from an earlier run. error: what the user has to change. warnings: what the user should know of the model.
    """

    facts: SceneFacts | None
    variables: tuple[answers.SmallArray, ...] = ()
    model: Packed | None = None
    error: UserError | None = None
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Scenes:
    """The scenes of a run.

    scenes: which there are. facts: of each. variables: what the study asks of them.
    stored: the model that the result file holds. notes: what the user should know. models: on their way to the ranks.
    """

    scenes: SceneSet
    facts: tuple[SceneFacts, ...]
    variables: tuple[answers.SmallArray, ...]
    stored: answers.StoredScene | None
    notes: tuple[str, ...]
    models: SceneModels


def build_scenes(ranks: Ranks, study: Study, store: Store, say: Progress) -> Scenes:
    """Rank 0: builds the scenes of a study, several of them together with the other ranks.

    store: the file of the run, with what an earlier run has computed. Raises UserError where a scene is wrong, or lacks
    what the study asks for.
    """
    scenes = find_scenes(study)
    building = _Building(scenes, store, say)
    with keys_in_file(study):
        if len(scenes.studies) > 1:
            serve_tasks(ranks, building, build_scene_task)
        else:
            (task,) = building.begin()
            building.take(task, next(build_scene_task(task, say)))
        store.flush()
        built = [building.found[number] for number in range(len(scenes.studies))]
        for each in built:
            if each.error is not None:
                raise each.error
        facts = tuple(each.facts for each in built if each.facts is not None)
        variables, notes = answers.join_scene_variables(scenes, [each.variables for each in built])
        stored = answers.scene_to_store(scenes.studies[0], building.read(0)) if len(built) == 1 else None
        warnings = dict.fromkeys(text for each in built for text in each.warnings)
    models, notes = SceneModels(building.read, store.path), (*notes, *warnings)
    return Scenes(scenes, facts, (*variables, *answers.exact_answers(study)), stored, notes, models)


class _Building(TaskHandler):
    """Rank 0 while the scenes are built. found: those that are, by number."""

    def __init__(self, scenes: SceneSet, store: Store, say: Progress) -> None:
        super().__init__()
        self._keys = [model_key(study) for study in scenes.studies]
        self._studies = scenes.studies
        self._store = store
        self._say = say
        self.found: dict[int, SceneBuilt] = {}

    def begin(self) -> Iterator[SceneTask]:
        for number, (study, key) in enumerate(zip(self._studies, self._keys, strict=True)):
            yield SceneTask(number, study, self._store.read(COMPUTED, key))

    def take(self, task: SceneTask, result: SceneBuilt) -> Sequence[SceneTask]:
        if result.model is not None:
            self._store.put(COMPUTED, self._keys[task.number], result.model)
        # a single model may be too large for the file
        several = len(self._studies) > 1
        self.found[task.number] = replace(result, model=None) if several else result
        if several:
            self._say(f"{len(self.found)} of {len(self._studies)} scenes are built")
        return ()

    def tick(self, running: object) -> None:  # noqa: ARG002
        self._store.tick()

    def read(self, number: int) -> ReducedModel:
        """The model of a scene. Raises RuntimeError where it is no longer there."""
        packed = self.found[number].model
        key, model = self._keys[number], None if packed is None else unpack_model(packed)
        model = model or self._store.read(COMPUTED, key, unpack_model)
        if model is None:
            raise RuntimeError(f"the model of scene {number} has gone")
        return model


def build_scene_task(task: SceneTask, progress: Progress) -> Iterator[SceneBuilt]:
    """Builds one scene, or takes its model from an earlier run, which is equal to the last bit (`solver.packing`)."""
    known, warnings = None, list[str]()

    def say(text: str) -> None:
        warnings.append(text) if text.startswith(WARNING) else progress(text)

    # what is damaged, altered, or of another version, is built again
    with contextlib.suppress(*UNREADABLE, SceneError):
        if task.known is not None:
            model = unpack_model(task.known)
            check_model(model)
            known = model
    try:
        model = build_study_scene(task.study, say, known)
        variables = answers.build_scene_variables(task.study, model, say)
    except UserError as error:
        yield SceneBuilt(None, error=error)
        return
    packed = pack(model) if known is None else None
    yield SceneBuilt(describe_study_scene(task.study, model), variables, packed, warnings=tuple(warnings))

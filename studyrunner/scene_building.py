"""The scenes of a run: built once, and handed to the ranks that compute with them.

A single scene is built by rank 0, which hands the model to all ranks. Several scenes are built by all ranks side by
side, each scene once. Their models are kept in the file of the run and go to the ranks with the tasks (`SceneModels`),
so that a rank holds few models, whatever their number.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from solver.packing import Packed
from studyrunner.checkpoint.store import Store
from studyrunner.kinds.task import Task
from studyrunner.mpi.cost_model import CostKeys, CostModel
from studyrunner.mpi.mapped_file import hand_out
from studyrunner.mpi.ranks import Ranks
from studyrunner.mpi.schedule import Handlers, serve_tasks, work_on_tasks
from studyrunner.scene.computed import InMemory, keep_model, model_key, read_model
from studyrunner.scene.scene import (
    KeptScene,
    SceneFacts,
    build_study_scene,
    describe_scene,
    harmonics_to_build,
    scene_to_keep,
)
from studyrunner.scene.scene_set import SceneSet, at_ratios, find_scenes
from studyrunner.scene.scene_variables import exact_answers, join_scene_variables
from studyrunner.scene.variables import SceneVariable, build_scene_variables
from studyrunner.scene_models import SceneModels
from studyrunner.study.scene_axes import keys_as_given
from studyrunner.study.study import Study
from studyrunner.system.files import new_partial
from studyrunner.user_error import UserError

if TYPE_CHECKING:
    from solver.model import ReducedModel


class SeveralScenes:
    """What a rank gets in place of the model of the only scene: scenes to build first, then tasks with models."""


@dataclass(frozen=True)
class SceneTask:
    """One scene to build. study: of this scene alone. known: what an earlier run has computed for the scene."""

    number: int
    study: Study
    known: Mapping[str, Packed]
    cost: float = 1.0
    n_results: int = 1
    gives_starts: bool = False

    def cost_of(self, *, first: bool) -> float:
        """Estimated time, s; all scenes are alike."""
        del first
        return self.cost

    @property
    def cost_keys(self) -> CostKeys:
        """Groups of similar tasks."""
        return (("scene",),)


@dataclass(frozen=True)
class SceneBuilt:
    """A scene that was built.

    facts: None where the scene is wrong. variables: what the study asks of the scene. computed: what later runs need
        not compute. error: what the user has to change.
    """

    facts: SceneFacts | None
    variables: tuple[SceneVariable, ...] = ()
    computed: Mapping[str, Packed] = field(default_factory=dict)
    error: UserError | None = None


@dataclass(frozen=True)
class Scenes:
    """The scenes of a run.

    scenes: which there are. facts: of each. variables: what the study asks of them.
    kept: the model that the result file keeps. notes: what the user should know.
    model: of the only scene; None where there are several, whose models are in the file of the run.
    seeing: ranks that see files beside the file of the run.
    store: file of the run.
    """

    scenes: SceneSet
    facts: tuple[SceneFacts, ...]
    variables: tuple[SceneVariable, ...]
    kept: KeptScene | None
    notes: tuple[str, ...]
    model: ReducedModel | None
    seeing: frozenset[int]
    store: Store

    @cached_property
    def _models(self) -> SceneModels:
        return SceneModels(self._read_model, self.seeing, self.store.path)

    def with_model(self, rank: int, task: Task) -> Task:
        """The task as a rank gets it: with the model where the rank does not have the model."""
        return task if self.model is not None else self._models.with_model(rank, task)

    def _read_model(self, number: int) -> ReducedModel:
        study = self.scenes.studies[number]
        return read_model(study, harmonics_to_build(study), self.store)


def build_scenes(ranks: Ranks, study: Study, store: Store, say: Callable[[str], None]) -> Scenes:
    """Rank 0: builds the scenes of a study, several of them together with the other ranks.

    The other ranks have the model of the only scene, or know that there are several, when this returns.

    Parameters
    ----------
    ranks
        All ranks.
    study
        The study.
    store
        The file of the run, with what an earlier run has computed.
    say
        Takes a line on the next step, where a step may take long.

    Raises
    ------
    UserError
        Where a scene is wrong, or lacks what the study asks for.
    """
    scenes = find_scenes(study)
    if len(scenes.studies) == 1:
        one = scenes.studies[0] if study.has_missions else study
        with keys_as_given(study.scene_axes):
            model = build_study_scene(one, say, store)
        if "natural_frequency" in study.scene_variables:
            say("finding the natural frequencies of the scene")
        variables = (*build_scene_variables(one, model, store), *exact_answers(study))
        facts = describe_scene(model)
        kept = scene_to_keep(one, model)
        handed, seeing = hand_out(ranks, model, new_partial(store.path))
        return Scenes(at_ratios(scenes, {0: facts}), (facts,), variables, kept, (), handed, seeing, store)
    _, seeing = hand_out(ranks, SeveralScenes(), new_partial(store.path))
    built = _build_all(ranks, scenes, store, say)
    with keys_as_given(study.scene_axes):
        for each in built:
            if each.error is not None:
                raise each.error
    facts_of_all = tuple(each.facts for each in built if each.facts is not None)
    variables, notes = join_scene_variables(study, scenes, [each.variables for each in built])
    scenes = at_ratios(scenes, dict(enumerate(facts_of_all)))
    return Scenes(scenes, facts_of_all, (*variables, *exact_answers(study)), None, notes, None, seeing, store)


def _build_all(ranks: Ranks, scenes: SceneSet, store: Store, say: Callable[[str], None]) -> list[SceneBuilt]:
    """All scenes, in their order."""
    found: dict[int, SceneBuilt] = {}

    def tasks() -> Iterator[SceneTask]:
        for number, study in enumerate(scenes.studies):
            key = model_key(study, harmonics_to_build(study))
            model = store.read_computed(key)
            yield SceneTask(number, study, {} if model is None else {key: model})

    def take(task: SceneTask, built: SceneBuilt) -> Sequence[SceneTask]:
        for key, value in built.computed.items():
            store.keep_computed(key, value)
        found[task.number] = built
        say(f"{len(found)} of {len(scenes.studies)} scenes are built")
        return ()

    handlers: Handlers[SceneTask, SceneBuilt] = Handlers(take, tick=lambda _: store.tick())
    serve_tasks(ranks, tasks(), build_scene_task, handlers, CostModel())
    store.flush()
    return [found[number] for number in range(len(scenes.studies))]


def build_scene_task(task: SceneTask, _: Callable[[object], None]) -> Iterator[SceneBuilt]:
    """Builds one scene."""
    computed = InMemory(task.known)
    try:
        model = build_study_scene(task.study, computed=computed)
        variables = build_scene_variables(task.study, model, computed)
    except UserError as error:
        yield SceneBuilt(None, error=error)
        return
    keep_model(task.study, harmonics_to_build(task.study), model, computed)
    new = {key: value for key, value in computed.items() if key not in task.known}
    yield SceneBuilt(describe_scene(model), variables, new)


def help_to_build(ranks: Ranks) -> None:
    """Any other rank: builds scenes until all are built."""
    work_on_tasks(ranks, build_scene_task)

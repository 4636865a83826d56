"""The scenes of a run: built once, for all ranks.

A single scene is built by rank 0. Several scenes are built by all ranks side by side, each scene once, and are kept in
the file of the run. The models go to the ranks with the tasks (`SceneModels`), so that a rank holds few models.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from solver.packing import Packed
from studyrunner.checkpoint.store import Store
from studyrunner.mpi.cost_model import CostKeys
from studyrunner.mpi.mapped_file import ranks_that_see
from studyrunner.mpi.ranks import Ranks
from studyrunner.mpi.schedule import Office, serve_tasks
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
    kept: the model that the result file keeps. notes: what the user should know. models: on their way to the ranks.
    """

    scenes: SceneSet
    facts: tuple[SceneFacts, ...]
    variables: tuple[SceneVariable, ...]
    kept: KeptScene | None
    notes: tuple[str, ...]
    models: SceneModels


def build_scenes(ranks: Ranks, study: Study, store: Store, say: Callable[[str], None]) -> Scenes:
    """Rank 0: builds the scenes of a study, several of them together with the other ranks.

    store: the file of the run, with what an earlier run has computed. say: takes a line on the next step, where a step
    may take long. Raises UserError where a scene is wrong, or lacks what the study asks for.
    """
    scenes = find_scenes(study)
    seeing = ranks_that_see(ranks, new_partial(store.path))
    kept, notes = None, tuple[str, ...]()
    with keys_as_given(study.scene_axes):
        if len(scenes.studies) > 1:
            building = _Building(scenes, store, say)
            serve_tasks(ranks, building, build_scene_task)
            store.flush()
            built = [building.found[number] for number in range(len(scenes.studies))]
            for each in built:
                if each.error is not None:
                    raise each.error
            facts = tuple(each.facts for each in built if each.facts is not None)
            variables, notes = join_scene_variables(study, scenes, [each.variables for each in built])

            def read(number: int) -> ReducedModel:
                one = scenes.studies[number]
                return read_model(one, harmonics_to_build(one), store)

        else:
            one = scenes.studies[0] if study.mission else study
            model = build_study_scene(one, say, store)
            if "natural_frequency" in study.scene_variables:
                say("finding the natural frequencies of the scene")
            facts, variables = (describe_scene(model),), build_scene_variables(one, model, store)
            kept = scene_to_keep(one, model)

            def read(number: int) -> ReducedModel:  # noqa: ARG001
                return model

    models = SceneModels(read, seeing, store.path)
    return Scenes(at_ratios(scenes, facts), facts, (*variables, *exact_answers(study)), kept, notes, models)


class _Building(Office[SceneTask, SceneBuilt]):
    """Rank 0 while the scenes are built. found: those that are, by number."""

    def __init__(self, scenes: SceneSet, store: Store, say: Callable[[str], None]) -> None:
        self._scenes = scenes
        self._store = store
        self._say = say
        self.found: dict[int, SceneBuilt] = {}

    def begin(self) -> Iterator[SceneTask]:
        for number, study in enumerate(self._scenes.studies):
            key = model_key(study, harmonics_to_build(study))
            model = self._store.read_computed(key)
            yield SceneTask(number, study, {} if model is None else {key: model})

    def take(self, task: SceneTask, result: SceneBuilt) -> Sequence[SceneTask]:
        for key, value in result.computed.items():
            self._store.keep_computed(key, value)
        self.found[task.number] = result
        self._say(f"{len(self.found)} of {len(self._scenes.studies)} scenes are built")
        return ()

    def tick(self, running: object) -> None:  # noqa: ARG002
        self._store.tick()


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

"""Study -> its kind and its tasks: the only place of the runner that asks which kind it is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from studyrunner.kinds import missions, modes, wear_plan
from studyrunner.kinds.task import Task, TaskPlan
from studyrunner.scene.scene_set import SceneSet, find_scenes
from studyrunner.study.study import MISSIONS, MODES, Study


class Kind(Protocol):
    """What a kind of study has of its own. TIME: how well the time of a run is known before, for `--plan`."""

    TIME: str

    def variables(self, study: Study) -> tuple[str, ...]:
        """Variables of a result: those asked for and those that the last lines of a run are made of."""

    def build_tasks(self, study: Study, n_displacements: Sequence[int], contacts: Any, scenes: SceneSet) -> TaskPlan:
        """Tasks of a study."""

    def describe_tasks(self, tasks: Sequence[Task]) -> str:
        """Tasks in words."""

    def slow_time(self, study: Study) -> list[tuple[str, str]]:
        """Labels and texts of the lines of `--plan` on cycles or missions."""


def kind_of(study: Study) -> Kind:
    """The kind of a study."""
    return missions if study.kind is MISSIONS else modes if study.kind is MODES else wear_plan


def build_tasks(
    study: Study,
    n_displacements: int | Sequence[int],
    contacts: Sequence[Any] | None = None,
    scenes: SceneSet | None = None,
) -> TaskPlan:
    """Tasks of a study. Their order and numbers depend on the study alone.

    n_displacements: number of relative displacements of each scene of the study (`find_scenes`), or of all scenes.
    contacts: what is drawn for the pairs of each part (`contact_changes`); None for nothing. scenes: of the study,
    where they are known already.
    """
    scenes = find_scenes(study) if scenes is None else scenes
    drawn: Sequence[Any] = (((),) * len(study.mission),) * len(scenes.parts) if contacts is None else contacts
    sizes = [n_displacements] * len(scenes.studies) if isinstance(n_displacements, int) else n_displacements
    return kind_of(study).build_tasks(study, sizes, drawn, scenes)

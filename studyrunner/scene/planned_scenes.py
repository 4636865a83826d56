"""The scenes of a study as `--plan` knows them: few of them are built."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from studyrunner.scene.scene import SceneFacts, build_study_scene, describe_scene
from studyrunner.scene.scene_set import SceneSet, at_ratios, find_scenes
from studyrunner.study.scene_axes import keys_as_given
from studyrunner.study.study import Study

_MOST_BUILT = 8


@dataclass(frozen=True)
class PlannedScenes:
    """Scenes of a study. facts: of each scene, or of one that is as large. seconds_left: time for building the others,
    s.
    """

    scenes: SceneSet
    facts: tuple[SceneFacts, ...]
    seconds_left: float

    @property
    def largest(self) -> SceneFacts:
        """Facts of the scene with the most pairs."""
        return max(self.facts, key=lambda each: len(each.area))

    def describe(self) -> str:
        """Number of scenes, and of their pairs; empty for one scene."""
        if len(self.facts) == 1:
            return ""
        fewest, most = min(len(each.area) for each in self.facts), len(self.largest.area)
        of_pairs = f"{most}" if fewest == most else f"{fewest} to {most}"
        return f"{len(self.facts)}, built once each, with {of_pairs} contact pair{'' if of_pairs == '1' else 's'}"


def plan_scenes(study: Study, say: Callable[[str], None]) -> PlannedScenes:
    """Builds some scenes of a study: those that may differ in their sizes, at most eight.

    Scenes that differ only in numbers with a fraction are taken to have the same sizes. Raises UserError where a scene
    is wrong.
    """
    scenes, built = find_scenes(study), dict[str, SceneFacts]()
    began, facts = time.monotonic(), []
    for number, each in enumerate(scenes.studies):
        sizes = str([value for _, value in each.scene.parameters if not isinstance(value, float)])
        if sizes not in built and len(built) < _MOST_BUILT:
            say(f"building scene {number + 1} of {len(scenes.studies)}")
            with keys_as_given(study.scene_axes):
                built[sizes] = describe_scene(build_study_scene(each, say))
        facts.append(built.get(sizes) or next(reversed(built.values())))
    each_takes = (time.monotonic() - began) / len(built)
    left = each_takes * (len(facts) - len(built))
    return PlannedScenes(at_ratios(scenes, facts), tuple(facts), left)

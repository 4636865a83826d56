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
    """Scenes of a study.

    scenes: which there are.
    facts: of the scenes that were built, by number.
    nearest: for each scene the built scene that stands for it.
    seconds_left: estimated time for building the others, s.
    """

    scenes: SceneSet
    facts: dict[int, SceneFacts]
    nearest: tuple[int, ...]
    seconds_left: float

    @property
    def largest(self) -> SceneFacts:
        """Facts of the scene with the most pairs."""
        return max(self.facts.values(), key=lambda each: len(each.area))

    @property
    def n_displacements(self) -> tuple[int, ...]:
        """Number of relative displacements of each scene."""
        return tuple(self.facts[number].n_displacements for number in self.nearest)

    def describe(self) -> str:
        """Number of scenes, and of their pairs; empty for one scene."""
        if len(self.nearest) == 1:
            return ""
        pairs = sorted({len(self.facts[number].area) for number in self.nearest})
        of_pairs = f"{pairs[0]}" if len(pairs) == 1 else f"{pairs[0]} to {pairs[-1]}"
        return f"{len(self.nearest)}, built once each, with {of_pairs} contact pair{'' if of_pairs == '1' else 's'}"


def plan_scenes(study: Study, say: Callable[[str], None]) -> PlannedScenes:
    """Builds some scenes of a study: those that may differ in their sizes, at most eight.

    Scenes that differ only in numbers with a fraction are taken to have the same sizes.

    Raises
    ------
    UserError
        Where a scene is wrong.
    """
    scenes = find_scenes(study)
    kinds: dict[str, int] = {}
    nearest = []
    for number, each in enumerate(scenes.studies):
        sizes = str([value for _, value in each.scene.parameters if not isinstance(value, float)])
        if sizes not in kinds and len(kinds) < _MOST_BUILT:
            kinds[sizes] = number
        nearest.append(kinds.get(sizes, max(kinds.values())))
    began = time.monotonic()
    facts = {}
    for number in kinds.values():
        say(f"building scene {number + 1} of {len(scenes.studies)}")
        with keys_as_given(study.scene_axes):
            model = build_study_scene(scenes.studies[number], say)
        facts[number] = describe_scene(model)
    scenes = at_ratios(scenes, {number: facts[near] for number, near in enumerate(nearest)})
    each_takes = (time.monotonic() - began) / len(facts)
    return PlannedScenes(scenes, facts, tuple(nearest), each_takes * (len(scenes.studies) - len(facts)))

"""The scenes of a study: which of its points share one, what a result says of them, and what differs in their pairs."""

import hashlib
import json
import math
import time
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studies.scene import Progress
from studyrunner.points.draw import draw_inputs
from studyrunner.points.table import Column, Points, points_of
from studyrunner.scatter import SECTOR_FREQUENCY
from studyrunner.scene.scene import SceneFacts, build_study_scene, describe_study_scene, harmonics_to_build
from studyrunner.study.study import Study
from studyrunner.study.study_file import keys_in_file
from studyrunner.user_error import UserError, Verbatim
from studyrunner.values import Wrong

_MOST_PLANNED = 8


@dataclass(frozen=True)
class SceneSet:
    """The different scenes of a study.

    studies: for each scene a study without axes of the scene, from which the scene is built. points: of the study.
    of_blocks: for each of their studies the numbers of the scenes of its blocks, or of its only vibration.
    """

    studies: tuple[Study, ...]
    points: Points
    of_blocks: tuple[tuple[int, ...], ...]

    def along_axes(self, values: Sequence[NDArray[Any]]) -> tuple[tuple[str, ...], NDArray[Any]]:
        """Axes along which arrays of the scenes differ, and these arrays along the axes; of missions those of the first
        block. values: of each scene, alike.
        """
        return self.points.along([values[numbers[0]] for numbers in self.of_blocks])


def find_scenes(study: Study) -> SceneSet:
    """The scenes of a study; points that differ only in what no model depends on share one.

    Raises UserError where a result file is to hold the scene, and there are several.
    """
    points, studies, keys = points_of(study), dict[str, Study](), list[list[str]]()
    for own in points.studies:
        keys.append([])
        for each in own.parts:
            files = [str(path) for path in each.scene.source.files]
            keys[-1].append(json.dumps([each.scene.of_model, files, harmonics_to_build(each)], sort_keys=True))
            studies.setdefault(keys[-1][-1], each)
    if study.outputs.scene and len(studies) > 1:
        remedy = f"leave it out: the study has {len(studies)} scenes, and a result keeps one"
        raise UserError(study.source, "outputs.scene", True, remedy)
    number_of = {key: number for number, key in enumerate(studies)}
    return SceneSet(tuple(studies.values()), points, tuple(tuple(number_of[key] for key in each) for each in keys))


def frequencies(study: Study, scenes: SceneSet, facts: Sequence[SceneFacts]) -> Column:
    """Excitation frequencies, Hz, also where the study gives their ratios. facts: of each scene.

    Raises UserError where a scene has no natural frequency with the joint stuck.
    """
    given = scenes.points.axis("frequency")
    if study.axes.frequency_ratio is None:
        return given
    stuck = [facts[numbers[0]].stuck_frequency for numbers in scenes.of_blocks]
    if any(map(math.isnan, stuck)):
        remedy = "give axes.frequency in its place: nothing that has mass moves while all pairs stick"
        raise UserError(study.source, "axes.frequency_ratio", list(study.axes.frequency_ratio), remedy)
    return scenes.points.combined(lambda ratio, own: ratio * own, given, scenes.points.of_studies(stuck))


def plan_scenes(study: Study, say: Progress) -> tuple[SceneSet, tuple[SceneFacts, ...], float]:
    """The scenes of a study, facts of each, or of one that is as large, and the time, s, for building the others.

    Scenes that differ only in numbers with a fraction are taken to have the same sizes. Raises UserError.
    """
    scenes, built = find_scenes(study), dict[str, SceneFacts]()
    began, facts = time.monotonic(), []
    for number, each in enumerate(scenes.studies):
        # parts of one study have the same pairs, or are refused
        is_part = len(study.parts) > 1 and number in scenes.of_blocks[0]
        sizes = str([value for _, value in each.scene.parameters if is_part or not isinstance(value, float)])
        if sizes not in built and len(built) < _MOST_PLANNED:
            say(f"building scene {number + 1} of {len(scenes.studies)}")
            with keys_in_file(study):
                built[sizes] = describe_study_scene(each, build_study_scene(each, say))
        facts.append(built.get(sizes) or next(reversed(built.values())))
    left = (time.monotonic() - began) / len(built) * (len(facts) - len(built))
    return scenes, tuple(facts), left


def merge_facts(facts: Sequence[SceneFacts]) -> SceneFacts:
    """Facts of the scene with the most pairs, with the largest sizes and a digest of all scenes."""
    if len(facts) == 1:
        return facts[0]
    largest = max(facts, key=lambda each: each.contact.n_contact)
    harmonics = [each.largest_harmonics for each in facts if each.largest_harmonics is not None]
    return replace(
        largest,
        n_displacements=max(each.n_displacements for each in facts),
        digest=hashlib.sha256("".join(each.digest for each in facts).encode()).hexdigest(),
        largest_harmonics=min(harmonics, default=None),
        edge=largest.edge if all(each.contact.n_contact == largest.contact.n_contact for each in facts) else None,
    )


# --- contact pairs that are not those of the scene: drawn values, wear before the start ---

ContactChange = tuple[tuple[str, tuple[float, ...]], ...]
"""Names of arrays of the contact interface with their values for all pairs, in place of those of the scene.

Also `energy`, with which the pairs begin; of a ring `SECTOR_FREQUENCY` and, where one is, the only `FORCED_SECTOR`.
"""

FORCED_SECTOR = "forced_sector"

_Values = dict[str, NDArray[np.float64]]


def contact_changes(
    study: Study, scenes: SceneSet, facts: Sequence[SceneFacts]
) -> tuple[tuple[ContactChange, ...], ...]:
    """What differs from the pairs of the scene, for each study of its points by block, or the only vibration.

    facts: of each scene. Raises UserError where a sample draws a value that is none, or blocks differ in their pairs.
    """
    for numbers in scenes.of_blocks:
        for part, number in zip(study.parts, numbers, strict=True):
            if facts[numbers[0]].pairs != facts[number].pairs:
                remedy = f"give parameters with which it has the contact pairs of {study.parts[0].block}, which wear"
                raise UserError(study.source, f"mission.{part.block}", None, remedy)
    of_blocks = []
    for place in range(len(study.parts)):
        changes: list[ContactChange] = []
        of_pairs = drawn_pairs(study, scenes, facts, place)
        for whole, numbers, drawn in zip(scenes.points.studies, scenes.of_blocks, of_pairs, strict=True):
            own, scene = whole.parts[place], facts[numbers[place]]
            drawn = _of_ring(own, scene) | drawn
            _check_ring(own, scene, drawn)
            if begins_worn(own):
                # wear opens a pair as a gap does, Eq. (7)
                drawn = {**drawn, "gap": drawn.get("gap", scene.contact.gap) + worn_depth(own, scene)}
                if own.scene.worn is not None and own.evolving:
                    energy = own.scene.worn.of_pairs(own.scene.worn.energy[0], len(drawn["gap"]))
                    drawn = {**drawn, "energy": np.array(energy)}
            changes.append(tuple((name, tuple(each.tolist())) for name, each in drawn.items()))
        of_blocks.append(changes)
    return tuple(zip(*of_blocks, strict=True))


def _of_ring(study: Study, facts: SceneFacts) -> _Values:
    """What the sectors of a ring have of their own; nothing of another scene."""
    ring, n = study.scene.ring, facts.n_ring
    if ring is None:
        return {}
    found = {SECTOR_FREQUENCY: np.array(ring.frequency or np.zeros(n))}
    if study.scene.forced_sector is not None:
        found[FORCED_SECTOR] = np.array([float(study.scene.forced_sector)])
    if ring.friction:
        found["friction_coefficient"] = np.repeat(ring.friction, facts.contact.n_contact // n)
    return found


def _check_ring(study: Study, facts: SceneFacts, values: _Values) -> None:
    """Raises UserError where a sector is excited that there is none, or the scene does not know the blades."""
    forced = study.scene.forced_sector
    if forced is not None and forced >= facts.n_ring:
        raise UserError(study.source, "scene.forced_sector", forced, f"give 0 to {facts.n_ring - 1}")
    if SECTOR_FREQUENCY in values and values[SECTOR_FREQUENCY].any() and not facts.differ:
        found = Verbatim("the scene file does not say what differs where a frequency of a blade does")
        raise UserError(study.source, "scene.sectors", found, "give the dataset blade in each group nd/<k>")


def drawn_pairs(study: Study, scenes: SceneSet, facts: Sequence[SceneFacts], block: int = 0) -> list[_Values]:
    """For each study of the points drawn values (n_contact,) of the inputs of pairs. facts: of each scene.

    block: place of the block in a mission. Raises UserError as `contact_changes`.
    """
    if study.scatter is None or not study.scatter.of_pairs:
        return [{}] * len(scenes.points.studies)
    of_studies, found = iter(scenes.of_blocks), []
    for whole in study.variants or (study,):
        variant = whole.parts[block]
        # scenes of samples mostly have the same pairs, and then the same draws
        drawn: dict[Hashable, _Values] = {}
        for sample in range(study.scatter.n_rows):
            own = facts[next(of_studies)[block]]
            contact, friction = own.contact, own.contact.friction_coefficient
            key = own.pairs, contact.gap.tobytes(), None if friction is None else friction.tobytes()
            if key not in drawn:
                of_all = np.nan if variant.friction_coefficient is None else variant.friction_coefficient
                friction = np.full(contact.n_contact, of_all) if friction is None else friction
                values = {"gap": contact.gap, "area": contact.area, "friction_coefficient": friction}
                drawn[key] = draw_inputs(variant, contact, values | _of_ring(variant, own), own.n_ring)
            found.append({name: each[sample] for name, each in drawn[key].items()})
    return found


def begins_worn(study: Study) -> bool:
    """Whether the joint of a study is worn before the history begins."""
    return study.scene.worn is not None or bool(study.scene.ring and study.scene.ring.wear_depth)


def worn_depth(study: Study, facts: SceneFacts) -> NDArray[np.float64]:
    """Wear depths (n_contact,), m, with which a study of a worn scene begins: that of the key and that of each sector.

    Raises UserError where pairs differ.
    """
    n, ring, worn = facts.contact.n_contact, study.scene.ring, study.scene.worn
    of_sectors = np.repeat(ring.wear_depth, n // facts.n_ring) if ring and ring.wear_depth else np.zeros(n)
    try:
        return of_sectors if worn is None else of_sectors + np.array(worn.depths(n))
    except Wrong as error:
        raise UserError(study.source, f"scene.worn.{error.key}", error.value, error.remedy) from None

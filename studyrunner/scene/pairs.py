"""Contact pairs that are not those of the scene: gaps, areas and friction that samples draw, wear before the start."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from studyrunner.scatter import ScatteredPairs
from studyrunner.scene.scene import SceneFacts
from studyrunner.scene.scene_set import SceneSet
from studyrunner.study.parts import draw_inputs
from studyrunner.study.study import Study
from studyrunner.user_error import UserError, WrongValueError

ContactChange = tuple[tuple[str, tuple[float, ...]], ...]
"""Names of arrays of the contact interface with their values for all pairs, in place of those of the scene."""

_Values = dict[str, NDArray[np.float64]]


def contact_changes(
    study: Study, scenes: SceneSet, facts: Sequence[SceneFacts]
) -> tuple[tuple[ContactChange, ...], ...]:
    """What differs from the pairs of the scene, for each part of a study (`parts_of`) by block, or the only vibration.

    facts: of each scene. Raises UserError where a sample draws a value that is none, or blocks differ in their pairs.
    """
    for numbers in scenes.of_blocks:
        for block, number in zip(study.mission, numbers, strict=False):
            if facts[numbers[0]].pairs != facts[number].pairs:
                remedy = f"give parameters with which it has the contact pairs of {study.mission[0].name}, which wear"
                raise UserError(study.source, f"mission.{block.name}", None, remedy)
    of_blocks = []
    for place in range(len(study.mission)) if study.mission else (None,):
        changes: list[ContactChange] = []
        for variant, own, of_sample in drawn_pairs(study, scenes, facts, place):
            if variant.scene.worn is not None:
                # wear opens a pair as a gap does, Eq. (7)
                of_sample["gap"] = of_sample.get("gap", own.gap) + worn_depth(variant, own)
            changes.append(tuple((name, tuple(each.tolist())) for name, each in of_sample.items()))
        of_blocks.append(changes)
    return tuple(zip(*of_blocks, strict=True))


def drawn_pairs(
    study: Study, scenes: SceneSet, facts: Sequence[SceneFacts], block: int | None = None
) -> Iterator[tuple[Study, SceneFacts, _Values]]:
    """For each part of a study its variant, its scene, and drawn values (n_contact,) of the inputs of pairs.

    facts: of each scene. block: place of the block in a mission; None for the study as it is. Raises UserError where a
    sample draws a value that is none.
    """
    of_parts = iter(scenes.of_blocks)
    for whole in study.variants or (study,):
        variant = whole if block is None else whole.block_studies[block]
        # scenes of samples mostly have the same pairs, and then the same draws
        drawn: dict[Hashable, _Values] = {}
        for sample in range(1 if study.scatter is None else study.scatter.n_rows):
            own = facts[next(of_parts)[block or 0]]
            values = own.gap, own.friction_coefficient
            key = own.pairs, *(None if each is None else each.tobytes() for each in values)
            if key not in drawn:
                drawn[key] = _pair_values(variant, own) if scatters_pairs(study) else {}
            yield variant, own, {name: each[sample] for name, each in drawn[key].items()}


def scatters_pairs(study: Study) -> bool:
    """Whether samples draw values of contact pairs."""
    return study.scatter is not None and bool(study.scatter.of_pairs)


def worn_depth(study: Study, facts: SceneFacts) -> NDArray[np.float64]:
    """Wear depths (n_contact,), m, with which the history of a study of one scene begins. Raises UserError."""
    if study.scene.worn is None:
        return np.zeros(len(facts.area))
    try:
        return np.array(study.scene.worn.depths(len(facts.area)))
    except WrongValueError as error:
        raise UserError(study.source, "scene.worn.depth", error.value, error.remedy) from None


def _pair_values(study: Study, facts: SceneFacts) -> _Values:
    """Values (n_samples, n_contact) of the inputs that belong to pairs. study: with one scene. Raises UserError."""
    friction, of_all = facts.friction_coefficient, study.friction_coefficient
    if friction is None:
        friction = np.full(len(facts.area), np.nan if of_all is None else of_all)
    own = {"gap": facts.gap, "area": facts.area, "friction_coefficient": friction}
    return draw_inputs(study, ScatteredPairs(facts.surface, facts.position), own)

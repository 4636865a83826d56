"""What the samples of a study draw for each contact pair: gaps, areas, friction coefficients."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from studyrunner.scatter.drawn_values import ScatteredPairs
from studyrunner.scene.scene import SceneFacts
from studyrunner.scene.scene_set import SceneSet
from studyrunner.study.realisation import draw_pairs, is_of_pairs
from studyrunner.study.study import Study

ContactChange = tuple[tuple[str, tuple[float, ...]], ...]
"""Names of arrays of the contact interface with their values for all pairs, in place of those of the scene."""


def contact_changes(study: Study, scenes: SceneSet, facts: Sequence[SceneFacts]) -> tuple[ContactChange, ...]:
    """Drawn values of the pairs for each part of a study (`realise`).

    facts: of each scene. Raises UserError where a sample draws a value that is none.
    """
    section = study.scatter
    if section is None or not any(is_of_pairs(name, each) for name, each in section.inputs.items()):
        return ((),) * len(scenes.numbers)
    n_samples, variants = section.realisations, study.variants or (study,)
    changes: list[ContactChange] = []
    for place, variant in enumerate(variants):
        own = scenes.numbers[place * n_samples : (place + 1) * n_samples]
        values = {number: pair_values(variant, facts[number]) for number in set(own)}
        for sample, number in enumerate(own):
            of_sample = {name: tuple(each[sample].tolist()) for name, each in values[number].items()}
            changes.append(tuple(of_sample.items()))
    return tuple(changes)


def pair_values(study: Study, facts: SceneFacts) -> dict[str, NDArray[np.float64]]:
    """Values (n_samples, n_contact) of the inputs that belong to pairs. study: with one scene. Raises UserError."""
    friction = facts.friction_coefficient
    if friction is None:
        of_all = study.friction_coefficient
        friction = np.full(len(facts.area), np.nan if of_all is None else of_all)
    own = {"gap": facts.gap, "area": facts.area, "friction_coefficient": friction}
    return draw_pairs(study, own, ScatteredPairs(facts.surface, facts.position))

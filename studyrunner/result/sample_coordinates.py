"""What the histories of a study begin with, as coordinates of the result file: drawn inputs, wear depths."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from studyrunner.coordinates import COORDINATES
from studyrunner.result.arrays import SmallArray
from studyrunner.scene.pairs import drawn_pairs, scatters_pairs, worn_depth
from studyrunner.scene.scene import SceneFacts
from studyrunner.scene.scene_set import SceneSet
from studyrunner.study.realisation import block_of_input, draw_inputs
from studyrunner.study.scene_axes import describe_key
from studyrunner.study.study import Study
from studyrunner.variables import Variable

_BY_SCATTER = "By [scatter] of the study."
_OF_CONTACT = {"gap": ("m", "initial gap of the contact pair"), "area": ("m2", "area of the contact pair")}


def sample_coordinates(study: Study, facts: Sequence[SceneFacts], scenes: SceneSet) -> Iterator[SmallArray]:
    """The drawn values of each input, in the unit of the input.

    Along the samples; along an axis as well where the input is drawn around the values of the axis; along the pairs
    where pairs differ. facts: of each scene of `find_scenes`.
    """
    if study.scatter is None:
        return
    variants = study.variants or (study,)
    shape = [len(axis.values) for axis in study.scene_axes]
    drawn = [draw_inputs(variant) for variant in variants]
    for name, first in drawn[0].items():
        units, meaning = _describe(study, name)
        dimensions: tuple[str, ...] = ("sample",)
        values = first
        if first.ndim == 2:
            # around each value of an axis
            dimensions, values = (("sample",), first[0]) if len(first) == 1 else ((name, "sample"), first)
        elif any(axis.name == name for axis in study.scene_axes):
            place = [axis.name for axis in study.scene_axes].index(name)
            every = np.array([each[name] for each in drawn]).reshape(*shape, -1)
            along = tuple(slice(None) if each == place else 0 for each in range(len(shape)))
            dimensions, values = (name, "sample"), every[along]
        yield _coordinate(name, dimensions, values, units, meaning, _comment(study, name))
    if scatters_pairs(study):
        yield from _of_pairs(study, facts, scenes)


def _of_pairs(study: Study, facts: Sequence[SceneFacts], scenes: SceneSet) -> Iterator[SmallArray]:
    """Values of the pairs along the axes on which they depend; NaN where a scene does not have a pair."""
    drawn = [of_part for _, _, of_part in drawn_pairs(study, scenes, facts)]
    n_contact = max(len(each.area) for each in facts)
    for name in drawn[0]:
        values = np.full((len(drawn), n_contact), np.nan)
        for row, of_part in zip(values, drawn, strict=True):
            row[: len(of_part[name])] = of_part[name]
        values = values.reshape(*(len(each) for each in study.axes_of_parts.values()), n_contact)
        dimensions = ["contact"]
        for place, axis in reversed(list(enumerate(study.axes_of_parts))):
            first = values.take([0], axis=place)
            if axis != "sample" and np.array_equal(np.broadcast_to(first, values.shape), values, equal_nan=True):
                values = values.take(0, axis=place)
            else:
                dimensions.insert(0, axis)
        yield _coordinate(name, tuple(dimensions), values, *_describe(study, name))


def worn_coordinate(study: Study, facts: Sequence[SceneFacts]) -> Iterator[SmallArray]:
    """Wear depths with which the histories begin; none where the study has several scenes or no worn one."""
    if study.scene.worn is None or len(facts) > 1:
        return
    axis = next((axis for axis in study.scene_axes if axis.key == ("worn",)), None)
    # the axis of worn states is the last one
    states = (study,) if axis is None else study.variants[: len(axis.values)]
    values = np.array([worn_depth(state, facts[0]) for state in states])
    dimensions = ("contact",) if axis is None else (axis.name, "contact")
    entry = Variable(
        dimensions, "m", "wear depth at the start", comment="Key scene.worn; wear_depth counts from there."
    )
    yield SmallArray("worn_depth", dimensions, values[0] if axis is None else values, entry)


def _comment(study: Study, name: str) -> str:
    block = block_of_input(study, name)
    if block is None:
        return _BY_SCATTER
    return f"{_BY_SCATTER} In the block {block.name}; in another block around the value of that block."


def _coordinate(
    name: str,
    dimensions: tuple[str, ...],
    values: NDArray[np.float64],
    units: str,
    meaning: str,
    comment: str = _BY_SCATTER,
) -> SmallArray:
    entry = Variable(dimensions, units, f"{meaning}, as the sample draws it", comment=comment)
    return SmallArray(f"sample_{name}", dimensions, np.asarray(values, dtype=np.float64), entry)


def _describe(study: Study, name: str) -> tuple[str, str]:
    """Unit and meaning of an input."""
    if name in COORDINATES:
        return COORDINATES[name].units, COORDINATES[name].long_name
    if name in _OF_CONTACT:
        return _OF_CONTACT[name]
    if name in study.wear.numbers:
        # `surfaces_flat` is the factor of the surface "flat"
        return describe_key(type(study.wear), *name.split("_", 1))
    return describe_key(type(study.scene.parameters), name)

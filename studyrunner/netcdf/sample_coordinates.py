"""What the samples of a study have drawn, as coordinates of the result file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studyrunner.scene.drawn_contacts import pair_values, worn_depth
from studyrunner.scene.scene import SceneFacts
from studyrunner.study.realisation import draw_inputs
from studyrunner.study.scene_axes import describe_key
from studyrunner.study.study import Study
from studyrunner.variables import COORDINATES, Variable

_OF_CONTACT = {"gap": ("m", "initial gap of the contact pair"), "area": ("m2", "area of the contact pair")}


@dataclass(frozen=True)
class SampleCoordinate:
    """A coordinate of the result file. values: with the dimensions of the entry."""

    name: str
    entry: Variable
    values: NDArray[np.float64]


def sample_coordinates(study: Study, facts: Sequence[SceneFacts]) -> Iterator[SampleCoordinate]:
    """The drawn values of each input, in the unit of the input.

    Along the samples; along an axis as well where the input is drawn around the values of the axis; along the pairs
    where pairs differ. The values of pairs are left out where the study has several scenes.
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
        elif any(axis.key == (name,) for axis in study.scene_axes):
            place = [axis.key for axis in study.scene_axes].index((name,))
            every = np.array([each[name] for each in drawn]).reshape(*shape, -1)
            along = tuple(slice(None) if each == place else 0 for each in range(len(shape)))
            dimensions, values = (name, "sample"), every[along]
        yield _coordinate(name, dimensions, values, units, meaning)
    if len(facts) == 1:
        for name, values in pair_values(variants[0], facts[0]).items():
            yield _coordinate(name, ("sample", "contact"), values, *_describe(study, name))


def worn_coordinate(study: Study, facts: Sequence[SceneFacts]) -> Iterator[SampleCoordinate]:
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
    yield SampleCoordinate("worn_depth", entry, values[0] if axis is None else values)


def _coordinate(
    name: str, dimensions: tuple[str, ...], values: NDArray[np.float64], units: str, meaning: str
) -> SampleCoordinate:
    entry = Variable(dimensions, units, f"{meaning}, as the sample draws it", comment="By [scatter] of the study.")
    return SampleCoordinate(f"sample_{name}", entry, np.asarray(values, dtype=np.float64))


def _describe(study: Study, name: str) -> tuple[str, str]:
    """Unit and meaning of an input."""
    if name in COORDINATES:
        return COORDINATES[name].units, COORDINATES[name].long_name
    if name in _OF_CONTACT:
        return _OF_CONTACT[name]
    return describe_key(type(study.wear) if name == "threshold" else type(study.scene.parameters), name)

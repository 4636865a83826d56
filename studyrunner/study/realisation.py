"""A study in parts that have one scene and one sample each: along the axes that are keys of [scene] or [wear], and
along the samples of [scatter].
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel

from studyrunner.scatter.drawn_values import Drawn, ScatteredPairs, drawn
from studyrunner.scatter.section import OF_PAIRS, Scattered, ScatterSection
from studyrunner.study.kinds import NUMBERS
from studyrunner.study.mission import MissionBlock
from studyrunner.study.mistakes import nearest_name
from studyrunner.study.room_for_wear import with_room_for_wear, with_room_of_all
from studyrunner.study.study import Study
from studyrunner.user_error import UserError, WrongValueError
from studyrunner.values import Wrong

_NO_PAIRS = ScatteredPairs(("",), np.zeros((1, 3)))
"""Stands for the pairs where inputs are drawn that do not belong to pairs."""


@dataclass(frozen=True)
class Realisation:
    """A part of a study.

    study: without axes that are keys of [scene] or [wear], and with the values that the sample draws.
    place: indices along these axes and along the samples of the whole study, which are its last axes.
    """

    study: Study
    place: tuple[int, ...]


def realise(study: Study) -> tuple[Realisation, ...]:
    """The parts of a study, in the order of their places; the study itself where it has no such axes and samples.

    Values that differ between the pairs of a contact are not in the parts, see `draw_pairs`.

    Raises
    ------
    UserError
        Where a sample draws a value that is none.
    """
    places = itertools.product(*(range(len(axis.values)) for axis in study.scene_axes))
    parts = []
    for variant, place in zip(study.variants or (study,), places, strict=True):
        samples = _samples(variant)
        parts += [Realisation(part, (*place, *sample)) for part, sample in samples]
    return tuple(parts)


def draw_inputs(study: Study) -> dict[str, NDArray[np.float64]]:
    """Values of the inputs that are the same for all pairs, (n_samples,), or (n_values, n_samples) of an axis.

    study: without axes that are keys of [scene] or [wear]. Raises UserError.
    """
    section = study.scatter
    if section is None:
        return {}
    own: dict[str, ArrayLike] = {name: _own_value(study, name) for name in section.inputs}
    found = _draw(study, section, own, _NO_PAIRS)
    return {
        name: np.array([each.apply(value) for value in np.ravel(own[name])]).squeeze(axis=() if name in NUMBERS else 0)
        for name, each in found.items()
        if not is_of_pairs(name, section.inputs[name])
    }


def draw_pairs(
    study: Study, own_values: Mapping[str, NDArray[np.float64]], pairs: ScatteredPairs
) -> dict[str, NDArray[np.float64]]:
    """Values of the inputs that belong to contact pairs, (n_samples, n_pairs).

    study: without axes that are keys of [scene] or [wear]. own_values: of the scene, (n_pairs,). Raises UserError.
    """
    section = study.scatter
    if section is None:
        return {}
    own: dict[str, ArrayLike] = {name: _own_value(study, name) for name in section.inputs}
    own |= {name: own_values[name] for name in own if name in own_values}
    found = _draw(study, section, own, pairs)
    of_pairs = [name for name in found if is_of_pairs(name, section.inputs[name])]
    shape = (section.realisations, len(pairs.surface))
    return {name: np.broadcast_to(found[name].apply(own_values[name]), shape) for name in of_pairs}


def is_of_pairs(name: str, scattered: Scattered) -> bool:
    """Whether an input belongs to contact pairs: gaps, areas, a friction coefficient with draws of its own."""
    return name in OF_PAIRS and (name != "friction_coefficient" or scattered.of != "all pairs")


def wrong_scatter(study: Study) -> Iterator[Wrong]:
    """What is wrong with inputs of [scatter] beside the other tables: unknown ones, and those that cannot scatter."""
    section = study.scatter
    if section is None:
        return
    of_pairs = [name for name, each in section.inputs.items() if is_of_pairs(name, each)]
    if of_pairs and "exact" in study.outputs.variables:
        remedy = f"leave it out: the closed form knows nothing of the {of_pairs[0]} that [scatter] draws for each pair"
        yield Wrong("outputs.variables", "exact", remedy)
    known = [*(NUMBERS if study.kind.counted else ()), *OF_PAIRS, *_numbers_of(study)]
    for name, scattered in section.inputs.items():
        key, drawn, absolute = f"scatter.{name}", scattered.distribution, scattered.distribution.kind == "value"
        if name not in known:
            yield Wrong(key, None, f"unknown input, give {nearest_name(name, known)}")
        if name == "frequency" and study.follow is not None:
            remedy = f'leave it out: with axes.frequency = "{study.follow.of}" each sample finds its own frequency'
            yield Wrong(key, None, remedy)
        several = name in NUMBERS and len(getattr(study.axes, name)) > 1
        if absolute and (several or any(axis.name == name for axis in study.scene_axes)):
            remedy = f"give one value of axes.{name}, or a distribution around the study's own values, as {{std = ...}}"
            yield Wrong(key, drawn.model_dump(), remedy)
        for block in study.mission:
            if name == "frequency" and block.gives(name):
                remedy = f"leave it out: the block {block.name} has a frequency of its own"
                yield Wrong(key, drawn.model_dump(), remedy)
            elif absolute and block.gives(name):
                remedy = f"give a distribution around own values, as {{std = ...}}: the block {block.name} gives one"
                yield Wrong(key, drawn.model_dump(), remedy)


def check_draws(study: Study) -> None:
    """Raises UserError where a sample draws a value that is none. study: without axes of [scene] or [wear]."""
    for name, values in draw_inputs(study).items():
        if name not in (*NUMBERS, *study.wear.numbers):
            # other parameters of the scene may not fit to one that is drawn
            for extreme in (values.min(), values.max()):
                _with_parameters(study, {name: float(extreme)})


def _numbers_of(study: Study) -> list[str]:
    """Inputs of [scene] and [wear] that are numbers with fractions."""
    fields = type(study.scene.parameters).model_fields
    floats = [name for name, field in fields.items() if float in (field.annotation, *get_args(field.annotation))]
    return [*floats, *study.wear.numbers]


def block_of_input(study: Study, name: str) -> MissionBlock | None:
    """The block of a mission for which the values of an input are shown: the first one where each has a value of its
    own; None where the values are around that of the study.
    """
    return study.mission[0] if study.mission and all(block.gives(name) for block in study.mission) else None


def _own_value(study: Study, name: str) -> ArrayLike:
    """The study's own value of an input; 1, for any, where the contact pairs have their own."""
    if block_of_input(study, name) is not None:
        return _own_value(study.block_studies[0], name)
    if name in NUMBERS:
        return np.array(getattr(study.axes, name))[:, None]
    value = {**dict(study.scene.parameters), **study.wear.numbers}.get(name)
    if isinstance(value, float | int):
        return float(value)
    assert study.scatter is not None
    scattered = study.scatter.inputs[name]
    if scattered.distribution.kind != "value" and not is_of_pairs(name, scattered):
        remedy = "give the middle of the distribution as well: the study has no value of its own"
        raise UserError(study.source, f"scatter.{name}", None, remedy)
    return 1.0


def _draw(
    study: Study, section: ScatterSection, own: Mapping[str, ArrayLike], pairs: ScatteredPairs
) -> dict[str, Drawn]:
    try:
        return drawn(section, own, pairs)
    except WrongValueError as error:
        raise UserError(study.source, error.key or "scatter", error.value, error.remedy) from None


def _samples(study: Study) -> Iterator[tuple[Study, tuple[int, ...]]]:
    """The study in each sample, and the index of the sample; the study itself where nothing scatters."""
    if study.scatter is None:
        yield study, ()
        return
    blocks = zip(*(_samples(block) for block in study.block_studies), strict=True)
    for part, of_blocks in zip(
        _drawn_studies(study), blocks if study.block_studies else itertools.repeat(()), strict=False
    ):
        given = tuple(block for block, _ in of_blocks)
        # blocks have equal pairs, with room for the wear of all
        yield (with_room_of_all(part[0].model_copy(update={"block_studies": given})), part[1]) if given else part


def _drawn_studies(study: Study) -> Iterator[tuple[Study, tuple[int, ...]]]:
    """The study with what each sample draws."""
    assert study.scatter is not None
    values = draw_inputs(study)
    axes = [name for name in values if name in NUMBERS]
    of_wear = [name for name in values if name in study.wear.numbers]
    of_scene = [name for name in values if name not in (*NUMBERS, *of_wear)]
    for sample in range(study.scatter.realisations):
        update: dict[str, object] = {"scatter": None}
        if axes:
            drawn_axes = {name: tuple(values[name][:, sample].tolist()) for name in axes}
            update["axes"] = study.axes.model_copy(update=drawn_axes)
        if of_scene:
            parameters = _with_parameters(study, {name: float(values[name][sample]) for name in of_scene})
            update["scene"] = study.scene.model_copy(update={"parameters": parameters})
        if of_wear:
            update["wear"] = study.wear.with_numbers({name: float(values[name][sample]) for name in of_wear})
        part = study.model_copy(update=update)
        yield with_room_for_wear(part) if of_scene and not study.mission else part, (sample,)


def _with_parameters(study: Study, values: Mapping[str, float]) -> BaseModel:
    """Parameters of the scene with drawn values. Raises UserError where one of them is wrong."""
    parameters = study.scene.parameters
    if values.keys() == {"friction_coefficient"}:
        # all that is asked of it was checked when it was drawn
        return parameters.model_copy(update=dict(values))
    try:
        return type(parameters).model_validate({**dict(parameters), **values})
    except ValueError as error:
        name = next((each for each in values if each in str(error)), next(iter(values)))
        remedy = "give less width: a sample draws a value that the scene cannot have"
        raise UserError(study.source, f"scatter.{name}", values[name], remedy) from None

"""A study in parts that have one scene and one sample each, and how wide their scenes have to be for what they wear."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel

from studies.scene import ExpectedWear, as_scene
from studyrunner.scatter import OF_PAIRS, Drawn, Scattered, ScatteredPairs, drawn
from studyrunner.study.mission import MissionBlock
from studyrunner.study.study import NUMBERS, Study
from studyrunner.user_error import UserError, WrongValueError

_NO_PAIRS = ScatteredPairs(("",), np.zeros((1, 3)))
"""Stands for the pairs where inputs are drawn that do not belong to pairs."""

_FAR = 3.1
"""Standard deviations of each input up to which a scene has room for the wear of its samples: 999 of 1000 lie below.

The largest of the samples themselves would give another scene, and other results, to each number of samples."""


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

    Values that differ between the pairs of a contact are not in the parts, see `draw_pairs`. Raises UserError where a
    sample draws a value that is none.
    """
    places = itertools.product(*(range(len(axis.values)) for axis in study.scene_axes))
    return tuple(
        Realisation(part, (*place, *([] if study.scatter is None else [sample])))
        for variant, place in zip(study.variants or (study,), places, strict=True)
        for sample, part in enumerate(_samples(variant))
    )


def draw_inputs(study: Study) -> dict[str, NDArray[np.float64]]:
    """Values of the inputs that are the same for all pairs, (n_samples,), or (n_values, n_samples) of an axis.

    study: without axes that are keys of [scene] or [wear]. Raises UserError.
    """
    own, found = _draw(study, {}, _NO_PAIRS)
    return {
        name: np.array([each.apply(value) for value in np.ravel(own[name])]).squeeze(axis=() if name in NUMBERS else 0)
        for name, (each, scattered) in found.items()
        if not is_of_pairs(name, scattered)
    }


def draw_pairs(
    study: Study, own_values: Mapping[str, NDArray[np.float64]], pairs: ScatteredPairs
) -> dict[str, NDArray[np.float64]]:
    """Values of the inputs that belong to contact pairs, (n_samples, n_pairs).

    study: without axes that are keys of [scene] or [wear]. own_values: of the scene, (n_pairs,). Raises UserError.
    """
    _, found = _draw(study, own_values, pairs)
    n_samples = 1 if study.scatter is None else study.scatter.realisations
    return {
        name: np.broadcast_to(each.apply(own_values[name]), (n_samples, len(pairs.surface)))
        for name, (each, scattered) in found.items()
        if is_of_pairs(name, scattered)
    }


def is_of_pairs(name: str, scattered: Scattered) -> bool:
    """Whether an input belongs to contact pairs: gaps, areas, a friction coefficient with draws of its own."""
    return name in OF_PAIRS and (name != "friction_coefficient" or scattered.of != "all pairs")


def block_of_input(study: Study, name: str) -> MissionBlock | None:
    """The block of a mission for which the values of an input are shown: the first one where each has a value of its
    own; None where the values are around that of the study.
    """
    return study.mission[0] if study.mission and all(block.gives(name) for block in study.mission) else None


def _own_value(study: Study, name: str, scattered: Scattered) -> ArrayLike:
    """The study's own value of an input; 1, for any, where the contact pairs have their own."""
    if block_of_input(study, name) is not None:
        return _own_value(study.block_studies[0], name, scattered)
    if name in NUMBERS:
        return np.array(getattr(study.axes, name))[:, None]
    value = {**dict(study.scene.parameters), **study.wear.numbers}.get(name)
    if isinstance(value, float | int):
        return float(value)
    if not scattered.distribution.is_absolute and not is_of_pairs(name, scattered):
        remedy = "give the middle of the distribution as well: the study has no value of its own"
        raise UserError(study.source, f"scatter.{name}", None, remedy)
    return 1.0


def _draw(
    study: Study, own_values: Mapping[str, NDArray[np.float64]], pairs: ScatteredPairs
) -> tuple[dict[str, ArrayLike], dict[str, tuple[Drawn, Scattered]]]:
    """Own values, and what is drawn, of each input; nothing where nothing scatters."""
    section = study.scatter
    if section is None:
        return {}, {}
    own: dict[str, ArrayLike] = {name: _own_value(study, name, each) for name, each in section.inputs.items()}
    own |= {name: own_values[name] for name in own if name in own_values}
    try:
        return own, {name: (each, section.inputs[name]) for name, each in drawn(section, own, pairs).items()}
    except WrongValueError as error:
        raise UserError(study.source, error.key or "scatter", error.value, error.remedy) from None


def _samples(study: Study) -> Iterator[Study]:
    """The study with what each sample draws; the study itself where nothing scatters."""
    if study.scatter is None:
        yield study
        return
    values = draw_inputs(study)
    of_wear = [name for name in values if name in study.wear.numbers]
    of_scene = [name for name in values if name not in (*NUMBERS, *of_wear)]
    blocks = [_samples(block) for block in study.block_studies]
    for sample in range(study.scatter.realisations):
        of_axes = {name: tuple(values[name][:, sample].tolist()) for name in values if name in NUMBERS}
        update: dict[str, object] = {"scatter": None, "axes": study.axes.model_copy(update=of_axes)}
        if of_scene:
            parameters = _with_parameters(study, {name: float(values[name][sample]) for name in of_scene})
            update["scene"] = study.scene.model_copy(update={"parameters": parameters})
        if of_wear:
            update["wear"] = study.wear.with_numbers({name: float(values[name][sample]) for name in of_wear})
        if blocks:
            update["block_studies"] = tuple(next(block) for block in blocks)
        part = study.model_copy(update=update)
        # a scene of its own has room for what this sample wears, blocks have equal pairs
        yield with_room_for_wear(part) if blocks or of_scene else part


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


def with_room_for_wear(study: Study) -> Study:
    """The study with a scene that has room for what it wears; the same where its scene needs none, or says itself.

    Of a study with samples the scene has room for nearly all of them. Where parameters of the scene scatter, each
    sample has a scene of its own (`realise`); the study is then the same. Blocks of a mission have room for the wear of
    all of them, in equal pairs.
    """
    scene = study.scene
    if study.mission:
        return _with_room_in_blocks(study)
    own_scenes = study.scatter is not None and study.scatter.inputs.keys() & dict(scene.parameters).keys()
    # what a result file holds was built with the parameters that stand beside it
    if own_scenes or not scene.is_bundled or scene.path is not None:
        return study
    return _with_parameters_of_scene(study, as_scene(scene.parameters).with_room_for_wear(expected_wear(study)))


def _with_parameters_of_scene(study: Study, parameters: BaseModel) -> Study:
    return study.model_copy(update={"scene": study.scene.model_copy(update={"parameters": parameters})})


def _with_room_in_blocks(study: Study) -> Study:
    cycles = study.output_counts[-1] * sum(
        block.cycles_at(max(of_block.axes.frequency))
        for block, of_block in zip(study.mission, study.block_studies, strict=True)
    )
    ends = {"cycles": cycles, "until": study.slow_time.until}
    wearing = [
        with_room_for_wear(each.model_copy(update={"slow_time": each.slow_time.model_copy(update=ends)}))
        for each in study.block_studies
    ]
    parameters = [each.scene.parameters for each in wearing]
    widths = [width for each in parameters if isinstance(width := dict(each).get("half_width"), float)]
    if len(set(widths)) > 1:
        parameters = [each.model_copy(update={"half_width": max(widths)}) for each in parameters]
    found = tuple(map(_with_parameters_of_scene, wearing, parameters))
    return study.model_copy(update={"block_studies": found})


def expected_wear(study: Study) -> ExpectedWear:
    """The most that any of its points wears, of samples up to `_FAR`."""

    def largest(name: str, own: float) -> float:
        scattered = None if study.scatter is None else study.scatter.inputs.get(name)
        return own if scattered is None else float(scattered.distribution.at(np.array(own), np.array(_FAR)))

    law, until = study.wear.as_law, study.slow_time.until or {}
    factor = sum(largest(f"surfaces_{label}", value) for label, value in law.surfaces) if law.surfaces else 1.0
    if law.name == "energy":
        factor *= study.friction_coefficient or 0.0
    if law.table is not None:
        factor *= max(max(row) for row in law.table.factor)
    cycles = math.inf if study.to_the_end else study.output_counts[-1]
    wear = largest("wear_coefficient", max(study.axes.wear_coefficient)) * factor
    return ExpectedWear(
        amplitude=largest("excitation_amplitude", max(study.axes.excitation_amplitude)),
        per_slip_work=wear * cycles if wear > 0.0 else 0.0,
        volume=until.get("worn_volume", math.inf),
        depth=until.get("wear_depth", math.inf),
    )

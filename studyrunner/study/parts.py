"""A study in parts that have one scene and one sample each, and how wide their scenes have to be for what they wear."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel

from solver.model import ContactInterface
from studies.scene import ExpectedWear, as_scene
from studyrunner.scatter import Scattered, draw
from studyrunner.study.scene_section import SceneSection
from studyrunner.study.sections import MissionBlock
from studyrunner.study.study import NUMBERS, Study
from studyrunner.user_error import UserError
from studyrunner.values import Wrong

_FAR = 3.1
"""Standard deviations of each input up to which a scene has room for the wear of its samples: 999 of 1000 lie below.

The largest of the samples themselves would give another scene, and other results, to each number of samples."""


@dataclass(frozen=True)
class Part:
    """A part of a study: a variant with the values that one sample draws, where inputs scatter.

    place: indices along the axes that are keys of [scene] or [wear] and along the samples, the last axes of a result.
    """

    study: Study
    place: tuple[int, ...]


def parts_of(study: Study) -> tuple[Part, ...]:
    """The parts of a study, in the order of their places; the study itself where it has no such axes and samples.

    Values that differ between contact pairs are not in them. Raises UserError where a sample draws one that is none.
    """
    studies = (part for variant in study.variants or (study,) for part in _samples(variant))
    places = np.ndindex(*(len(values) for values in study.axes_of_parts.values()))
    return tuple(Part(part, place) for part, place in zip(studies, places, strict=True))


def draw_inputs(
    study: Study, pairs: ContactInterface | None = None, own_values: Mapping[str, NDArray[np.float64]] | None = None
) -> dict[str, NDArray[np.float64]]:
    """Values of the inputs that are the same for all pairs, or with pairs of those that belong to them, as `draw`.

    study: without axes that are keys of [scene] or [wear]. own_values: of the pairs, (n_pairs,). Raises UserError.
    """
    section = study.scatter
    if section is None:
        return {}
    inputs = section.inputs.items()
    own: Mapping[str, ArrayLike] = own_values or {
        name: _own_value(study, name, each) for name, each in inputs if name not in section.of_pairs
    }
    try:
        return draw(section, own, pairs)
    except Wrong as error:
        raise UserError(study.source, error.key or "scatter", error.value, error.remedy) from None


def block_of_input(study: Study, name: str) -> MissionBlock | None:
    """The block of a mission for which the values of an input are shown: the first one where each has a value of its
    own; None where the values are around that of the study.
    """
    return study.mission[0] if study.mission and all(block.gives(name) for block in study.mission) else None


def _own_value(study: Study, name: str, scattered: Scattered) -> ArrayLike:
    """The study's own value of an input; 1, for any, of an absolute distribution."""
    if block_of_input(study, name) is not None:
        return _own_value(study.block_studies[0], name, scattered)
    if name in NUMBERS:
        return np.array(getattr(study.axes, name))[:, None]
    value = {**dict(study.scene.parameters), **study.wear.numbers}.get(name)
    if isinstance(value, float | int):
        return float(value)
    if not scattered.distribution.is_absolute:
        remedy = "give the middle of the distribution as well: the study has no value of its own"
        raise UserError(study.source, f"scatter.{name}", None, remedy)
    return 1.0


def _samples(study: Study) -> Iterator[Study]:
    """The study with what each sample draws; the study itself where nothing scatters."""
    if study.scatter is None:
        yield study
        return
    values = draw_inputs(study)
    of_wear = [name for name in values if name in study.wear.numbers]
    of_scene = [name for name in values if name not in (*NUMBERS, *of_wear)]
    blocks = [_samples(block) for block in study.block_studies]
    for sample in range(study.scatter.n_rows):
        of_axes = {name: tuple(values[name][:, sample].tolist()) for name in values if name in NUMBERS}
        update: dict[str, object] = {"scatter": None, "axes": study.axes.model_copy(update=of_axes)}
        if of_scene:
            update["scene"] = _with_drawn(study, {name: float(values[name][sample]) for name in of_scene})
        if of_wear:
            update["wear"] = study.wear.with_numbers({name: float(values[name][sample]) for name in of_wear})
        if blocks:
            update["block_studies"] = tuple(next(block) for block in blocks)
        part = study.model_copy(update=update)
        # a scene of its own has room for what this sample wears, blocks have equal pairs
        yield with_room_for_wear(part) if blocks or of_scene else part


def _with_drawn(study: Study, values: Mapping[str, float]) -> SceneSection:
    """The scene with drawn values of its parameters. Raises UserError where one of them is wrong."""
    parameters = study.scene.parameters
    try:
        # all that is asked of a friction coefficient was checked when it was drawn
        if values.keys() == {"friction_coefficient"}:
            parameters = parameters.model_copy(update=dict(values))
        else:
            parameters = type(parameters).model_validate({**dict(parameters), **values})
    except ValueError as error:
        name = next((each for each in values if each in str(error)), next(iter(values)))
        remedy = "give less width: a sample draws a value that the scene cannot have"
        raise UserError(study.source, f"scatter.{name}", values[name], remedy) from None
    return study.scene.model_copy(update={"parameters": parameters})


def with_room_for_wear(study: Study) -> Study:
    """The study with a scene that has room for what it wears; the same where its scene needs none, or says itself.

    Of a study with samples the scene has room for nearly all of them; where parameters of the scene scatter, only each
    sample has (`parts_of`). Blocks of a mission have room for the wear of all of them, in equal pairs.
    """
    scene, parameters = study.scene, dict(study.scene.parameters)
    if study.mission:
        return study.model_copy(update={"block_studies": _with_room_in_blocks(study)})
    own_scenes = study.scatter is not None and study.scatter.inputs.keys() & parameters.keys()
    # what a result file holds was built with the parameters that stand beside it
    if own_scenes or not scene.is_bundled or scene.path is not None:
        return study
    return _with_parameters(study, as_scene(scene.parameters).with_room_for_wear(expected_wear(study)))


def _with_parameters(study: Study, parameters: BaseModel) -> Study:
    return study.model_copy(update={"scene": study.scene.model_copy(update={"parameters": parameters})})


def _with_room_in_blocks(study: Study) -> tuple[Study, ...]:
    of_mission = (
        block.cycles_at(max(each.axes.frequency))
        for block, each in zip(study.mission, study.block_studies, strict=True)
    )
    ends = {"cycles": study.output_counts[-1] * sum(of_mission), "until": study.slow_time.until}
    slow_time = study.block_studies[0].slow_time.model_copy(update=ends)
    wearing = [with_room_for_wear(each.model_copy(update={"slow_time": slow_time})) for each in study.block_studies]
    widths = [dict(each.scene.parameters).get("half_width") for each in wearing]
    if len(set(widths)) > 1:
        widest = {"half_width": max(width for width in widths if isinstance(width, float))}
        wearing = [_with_parameters(each, each.scene.parameters.model_copy(update=widest)) for each in wearing]
    return tuple(wearing)


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

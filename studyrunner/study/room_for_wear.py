"""Pairs laid as far as a study will wear them: the width that a scene in gross slip is built with."""

from __future__ import annotations

import math

import numpy as np

from studies.scenes import scene_with_room
from studies.scenes.half_space import ExpectedWear
from studyrunner.study.study import Study

_FAR = 3.1
"""Standard deviations of each input up to which a scene has room for the wear of its samples: 999 of 1000 lie below.

The largest of the samples themselves would give another scene, and other results, to each number of samples."""


def with_room_for_wear(study: Study) -> Study:
    """The study with a scene that has room for what it wears; the same where its scene needs none, or says itself.

    Of a study with samples the scene has room for nearly all of them. Where parameters of the scene scatter, each
    sample has a scene of its own (`realise`), with room for what this sample wears; the study is then the same. Blocks
    of a mission have room for the wear of all of them, in equal pairs.
    """
    if study.mission:
        return _with_room_in_blocks(study)
    scene = study.scene
    own_scenes = study.scatter is not None and study.scatter.inputs.keys() & dict(scene.parameters).keys()
    # what a result file holds was built with the parameters that stand beside it
    if own_scenes or not scene.is_bundled or scene.path is not None:
        return study
    parameters = scene_with_room(scene.model, scene.parameters, expected_wear(study))
    return study.model_copy(update={"scene": scene.model_copy(update={"parameters": parameters})})


def _with_room_in_blocks(study: Study) -> Study:
    cycles = study.missions_kept[-1] * sum(
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
    found = tuple(
        each.model_copy(update={"scene": each.scene.model_copy(update={"parameters": own})})
        for each, own in zip(wearing, parameters, strict=True)
    )
    return study.model_copy(update={"block_studies": found})


def expected_wear(study: Study) -> ExpectedWear:
    """The most that any of its points wears, of samples up to `_FAR`."""

    def largest(name: str, own: float) -> float:
        scattered = None if study.scatter is None else study.scatter.inputs.get(name)
        return own if scattered is None else float(scattered.distribution.at(np.array(own), np.array(_FAR)))

    law, until = study.wear_law, study.slow_time.until or {}
    factor = sum(largest(f"surfaces_{label}", value) for label, value in law.surfaces) if law.surfaces else 1.0
    if law.name == "energy":
        factor *= study.friction_coefficient or 0.0
    if law.table is not None:
        factor *= max(max(row) for row in law.table.factor)
    cycles = math.inf if study.to_the_end else study.cycles_kept[-1]
    wear = largest("wear_coefficient", max(study.axes.wear_coefficient)) * factor
    return ExpectedWear(
        amplitude=largest("excitation_amplitude", max(study.axes.excitation_amplitude)),
        per_slip_work=wear * cycles if wear > 0.0 else 0.0,
        volume=until.get("worn_volume", math.inf),
        depth=until.get("wear_depth", math.inf),
    )

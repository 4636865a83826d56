"""How wide the scenes of a study have to be for what they wear."""

import math

import numpy as np
from pydantic import BaseModel

from solver.contact.wear_law import WearTable
from studies.scene import ExpectedWear
from studyrunner.study.study import Study

_FAR = 3.1
"""Standard deviations of each input up to which a scene has room for the wear of its samples: 999 of 1000 lie below.

The largest of the samples themselves would give another scene, and other results, to each number of samples."""


def with_room_for_wear(study: Study) -> Study:
    """The study with a scene that has room for what it wears; the same where its scene needs none, or says itself.

    Of a study with samples the scene has room for nearly all of them; where parameters of the scene scatter, only each
    sample has (`samples_of`). Blocks of a mission have room for the wear of all of them, in equal pairs.
    """
    scene, parameters = study.scene, dict(study.scene.parameters)
    if study.block_studies:
        return study.model_copy(update={"block_studies": _with_room_in_blocks(study)})
    own_scenes = study.scatter is not None and study.scatter.inputs.keys() & parameters.keys()
    if own_scenes:
        return study
    return _with_parameters(study, scene.source.with_room_for_wear(scene.parameters, expected_wear(study)))


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
    most = {name: max(map(max, tables.values())) for name, tables in study.evolving.items()}
    if law.name in ("energy", "power"):
        factor *= most.get("friction_coefficient", study.friction_coefficient or 0.0)
    factor *= max(most.get("wear_factor", 1.0), 1.0)
    if isinstance(law.table, WearTable):
        factor *= max(max(row) for row in law.table.factor)
    cycles = math.inf if study.to_the_end else study.output_counts[-1]
    wear = largest("wear_coefficient", max(study.axes.wear_coefficient)) * factor
    return ExpectedWear(
        amplitude=largest("excitation_amplitude", max(study.axes.excitation_amplitude)),
        per_slip_work=wear * cycles if wear > 0.0 else 0.0,
        volume=until.get("worn_volume", math.inf),
        depth=until.get("wear_depth", math.inf),
    )

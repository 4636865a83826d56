"""What a study with several scenes asks of them: variables with the axes along which they differ, exact answers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from pydantic import BaseModel

from studies.scene_answers import ExactAnswer, WearQuestion
from studies.scenes import changed_keys, scene_answer
from studyrunner.coordinates import SCENE
from studyrunner.scene.scene_set import SceneSet, axes_of_difference
from studyrunner.scene.variables import SceneVariable
from studyrunner.study.realisation import realise
from studyrunner.study.sections import SOLVER_AXES
from studyrunner.study.study import Study


def join_scene_variables(
    study: Study, scenes: SceneSet, of_scenes: Sequence[Sequence[SceneVariable]]
) -> tuple[tuple[SceneVariable, ...], tuple[str, ...]]:
    """Variables of all scenes, and notes on those that are left out.

    A variable that differs between the scenes gets the axes along which it differs as first dimensions. Variables of
    different sizes, e.g. meshes of different density, are left out.
    """
    joined, left_out = [], []
    for variables in zip(*of_scenes, strict=True):
        first = variables[0]
        if len({each.values.shape for each in variables}) > 1:
            left_out.append(first.name)
            continue
        names, numbers = axes_of_difference(study, scenes, [each.values.tobytes() for each in variables])
        if names:
            values = np.stack([each.values for each in variables])[numbers]
            entry = replace(first.entry, dimensions=(*names, *(first.entry.dimensions or (first.name,))))
            first = replace(first, entry=entry, values=values, coordinate=False)
        joined.append(first)
    notes = [f"{', '.join(left_out)}: left out of the result, as the scenes differ in their sizes"] if left_out else []
    return tuple(joined), tuple(notes)


def exact_answers(study: Study) -> tuple[SceneVariable, ...]:
    """Exact answers at all points, where the study asks for them; steps, schemes and settings change nothing.

    Their axes are those of the study, of length 1 where nothing depends on an axis.
    """
    if "exact" not in study.outputs.variables:
        return ()
    parts = [_answers(part.study) for part in realise(study)]
    shape = [len(values) for values in study.axes_of_parts.values()]
    own = len(study.own_axes)
    variables = []
    for name, entry in SCENE["exact"].items():
        values = np.stack([part[name] for part in parts], axis=own)
        values = values.reshape(*values.shape[:own], *shape, *values.shape[own + 1 :])
        variables.append(SceneVariable(name, entry, values, axes=True))
    return tuple(variables)


_HOW_TO_COMPUTE = {
    "study": ("name", "title"),
    "scene": ("model", "parameters"),
    "axes": ("step", "scheme", "sweep", *SOLVER_AXES),
    "slow_time": ("cycles", "final_share", "outputs", "until", "largest_depth"),
    "solver": (*SOLVER_AXES, "shortcuts", "time_limit"),
    "outputs": ("variables", "loops", "scene"),
}
_WITHOUT_INFLUENCE = frozenset(f"{table}.{key}" for table, keys in _HOW_TO_COMPUTE.items() for key in keys)
"""Keys of a study that say how a point is computed and shown, and not which point. A key that is not among them may
change the truth: only a closed form that knows the key still holds where it differs from its default."""


def _changed(study: Study) -> frozenset[str]:
    """Keys of a part of a study that differ from their defaults and may change the exact answer.

    Without the parameters of the scene, which `scene_answer` looks at.
    """
    found: set[str] = set()
    for name, field in type(study).model_fields.items():
        table = getattr(study, name)
        if not field.exclude and table:
            found |= changed_keys(table, name) if isinstance(table, BaseModel) else {name}
    return frozenset(found - _WITHOUT_INFLUENCE)


def _answers(study: Study) -> dict[str, np.ndarray]:
    axes, changed = study.axes, _changed(study)
    (depth,) = (0.0,) if study.scene.worn is None else study.scene.worn.depths(1)
    counts, given = np.array(study.cycles_kept), np.array(axes.wear_coefficient)

    def answer(frequency: float, amplitude: float) -> ExactAnswer:
        asked = WearQuestion(frequency, amplitude, given, counts, study.wear_law, depth, changed)
        return scene_answer(study.scene.model, study.scene.parameters, asked)

    answers = [[answer(one, other) for other in axes.excitation_amplitude] for one in axes.frequency]
    others = (1,) * (len(study.own_axes) - 3)
    found = {}
    for name in SCENE["exact"]:
        values = np.array([[getattr(each, name.removeprefix("exact_")) for each in row] for row in answers])
        # frequency, wear coefficient and excitation amplitude are the first axes of a result, in this order
        values = np.swapaxes(values, 1, 2)
        found[name] = values.reshape(*values.shape[:3], *others, *values.shape[3:])
    return found

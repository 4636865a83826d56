"""What a study with several scenes asks of them: variables with the axes along which they differ, exact answers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from studies.scenes import scene_answer
from studyrunner.coordinates import SCENE
from studyrunner.scene.scene_set import SceneSet, axes_of_difference
from studyrunner.scene.variables import SceneVariable
from studyrunner.study.realisation import realise
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
        names, numbers = axes_of_difference(
            study,
            scenes,
            lambda a, b, v=variables: _equal(v[a], v[b]),  # type: ignore[misc]
        )
        if not names:
            joined.append(first)
            continue
        values = np.stack([each.values for each in variables])[numbers]
        entry = replace(first.entry, dimensions=(*names, *(first.entry.dimensions or (first.name,))))
        joined.append(replace(first, entry=entry, values=values, coordinate=False))
    notes = [f"{', '.join(left_out)}: left out of the result, as the scenes differ in their sizes"] if left_out else []
    return tuple(joined), tuple(notes)


def _equal(one: SceneVariable, other: SceneVariable) -> bool:
    return np.array_equal(one.values, other.values, equal_nan=one.values.dtype.kind == "f")


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


def _answers(study: Study) -> dict[str, np.ndarray]:
    axes = study.axes
    answers = [
        [
            scene_answer(
                study.scene.model,
                study.scene.parameters,
                frequency,
                amplitude,
                np.array(axes.wear_coefficient),
                np.array(study.cycles_kept),
            )
            for amplitude in axes.excitation_amplitude
        ]
        for frequency in axes.frequency
    ]
    others = (1,) * (len(study.own_axes) - 3)
    found = {}
    for name in SCENE["exact"]:
        values = np.array([[getattr(answer, name.removeprefix("exact_")) for answer in row] for row in answers])
        # frequency, wear coefficient and excitation amplitude are the first axes of a result, in this order
        values = np.swapaxes(values, 1, 2)
        found[name] = values.reshape(*values.shape[:3], *others, *values.shape[3:])
    return found

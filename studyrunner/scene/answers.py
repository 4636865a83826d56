"""What a study asks of its scenes beside their models: mesh, natural frequencies, exact answers, scene files."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from solver.model import ReducedModel
from studies.scene import Progress
from studyrunner.coordinates import COORDINATES, SCENE
from studyrunner.points.table import points_of
from studyrunner.scene.scene import build_study_scene, harmonics_to_build
from studyrunner.scene.scene_set import SceneSet, find_scenes
from studyrunner.study.mistakes import scene_errors
from studyrunner.study.study import Study
from studyrunner.user_error import UserError, Verbatim, show_text
from studyrunner.variables import Variable


@dataclass(frozen=True)
class SmallArray:
    """A coordinate of the result file, or a variable that no task computes.

    over_axes: whether it has the axes of the study, which may be of length 1 in `values`.
    """

    name: str
    dimensions: tuple[str, ...]
    values: NDArray[np.generic]
    entry: Variable
    over_axes: bool = False


def build_scene_variables(study: Study, model: ReducedModel, progress: Progress) -> tuple[SmallArray, ...]:
    """What the study asks of its scene, but exact answers. Raises UserError."""
    found: list[SmallArray] = []
    with scene_errors(study.source, None):
        if "mesh" in study.scene_variables:
            found += _mesh(study)
        if "natural_frequency" in study.scene_variables:
            # of a bundled sector they take some seconds
            progress("finding the natural frequencies of the scene")
            found += _frequencies(study, model)
    return tuple(found)


def _mesh(study: Study) -> Iterator[SmallArray]:
    mesh = study.scene.source.mesh(study.scene.parameters)
    assert mesh is not None, "asked of scenes that offer it"
    values: dict[str, NDArray[np.generic]] = {
        **{f"mesh_{axis}": mesh.nodes[:, column] for column, axis in enumerate("xyz")},
        "mesh_quad": mesh.quads.astype(np.int32),
        "mesh_part": np.array(mesh.parts),
    }
    for name, entry in SCENE["mesh"].items():
        yield SmallArray(name, entry.dimensions, values[name], entry)


def _frequencies(study: Study, model: ReducedModel) -> Iterator[SmallArray]:
    found = study.scene.source.natural_frequencies(study.scene.parameters, model)
    (entry,) = SCENE["natural_frequency"].values()
    values = np.array(list(found.values()))
    labels = {"nodal_diameter": list(found), "mode": range(1, values.shape[1] + 1)}
    yield SmallArray("natural_frequency", entry.dimensions, values, entry)
    for name, numbers in labels.items():
        yield SmallArray(name, (name,), np.array(numbers, dtype=np.int32), COORDINATES[name])


@dataclass(frozen=True)
class StoredScene:
    """A scene in a result file: attributes, and datasets with groups, by the names of scene files."""

    attributes: Mapping[str, int]
    datasets: tuple[tuple[str, NDArray[np.generic]], ...]


def scene_to_store(study: Study, model: ReducedModel) -> StoredScene | None:
    """Contents of a scene file for the result; of a bundled scene only on request, as the parameters give it again."""
    source = study.scene.source
    if source.is_bundled and not study.outputs.scene:
        return None
    from studies.scene_file import scene_attributes, scene_datasets

    with scene_errors(study.source, source.path):
        return StoredScene(scene_attributes(model), tuple(scene_datasets(model, source.mesh(study.scene.parameters))))


def description_of(study: Study) -> dict[str, str]:
    """Attributes of the result on the scene, see `studies.scene_file.DESCRIPTION`."""
    with scene_errors(study.source, study.scene.source.path):
        return study.scene.source.describe(study.scene.parameters)


def write_study_scene(study: Study, path: Path, progress: Progress) -> None:
    """Writes the scene of a study as a scene file, as a whole or not at all.

    Raises UserError where the scene is wrong, or there are several.
    """
    from studies.scene_file import write_scene

    first, *others = find_scenes(study).studies
    if others:
        found = Verbatim(f"{len(others) + 1} scenes")
        raise UserError(study.source, "scene", found, "give each key one value: a scene file holds one scene")
    model = build_study_scene(first, progress)
    source, parameters = first.scene.source, first.scene.parameters
    with scene_errors(study.source, source.path):
        mesh, description = source.mesh(parameters), source.describe(parameters)
    try:
        write_scene(model, path, mesh, description)
    except OSError as error:
        remedy = f"give a file that can be written: {error.strerror or error}"
        raise UserError("command line", "--write-scene", str(path), remedy) from None


def join_scene_variables(
    scenes: SceneSet, of_scenes: Sequence[Sequence[SmallArray]]
) -> tuple[tuple[SmallArray, ...], tuple[str, ...]]:
    """Variables of all scenes, first along the axes along which they differ, and notes on those that are left out.

    Left out are those of different sizes, e.g. meshes of different density.
    """
    joined, left_out = [], []
    for variables in zip(*of_scenes, strict=True):
        first = variables[0]
        if len({each.values.shape for each in variables}) > 1:
            left_out.append(first.name)
            continue
        names, values = scenes.along_axes([each.values for each in variables])
        joined.append(replace(first, dimensions=(*names, *first.dimensions), values=values))
    notes = [f"{', '.join(left_out)}: left out of the result, as the scenes differ in their sizes"] if left_out else []
    return tuple(joined), tuple(notes)


def exact_answers(study: Study) -> tuple[SmallArray, ...]:
    """Exact answers at all points, where the study asks for them; steps, schemes and settings change nothing.

    Their axes are those of the study, of length 1 where nothing depends on an axis.
    """
    if "exact" not in study.outputs.variables:
        return ()
    points = points_of(study)
    axes = [points.axis(name) for name in ("frequency", "excitation_amplitude", "wear_coefficient")]
    names, codes, combinations = points.grouped(points.columns["study"], *axes)
    answers = list[tuple[Any, Any]]()
    for (number, frequency, amplitude), alike in itertools.groupby(combinations, itemgetter(0, 1, 2)):
        own, wear = points.studies[number], np.array([each[3] for each in alike])
        (depth,) = (0.0,) if own.scene.worn is None else own.scene.worn.depths(1)
        rest = wear, np.array(own.output_counts), own.wear.as_law, depth, _changed(own)
        answers += zip(*cast(Any, own.scene.parameters).exact_answer(frequency, amplitude, *rest), strict=True)
    shape, variables = [length if name in names else 1 for name, length in points.dims.items()], []
    for place, (name, entry) in enumerate(SCENE["exact"].items()):
        values = np.array([each[place] for each in answers])[codes]
        values = values.reshape(*shape, *values.shape[len(names) :])
        variables.append(SmallArray(name, (*points.dims, *entry.dimensions), values, entry, over_axes=True))
    return tuple(variables)


_NOT_ASKED = (("scene", ("model", "parameters")), ("axes", ("step", "scheme", "sweep")), ("wear", ()))
"""Tables, and keys in them that the scene knows, or that say how a point is computed, and not which point."""


def _changed(study: Study) -> frozenset[str]:
    """Keys of a part of a study that differ from their defaults and may change the exact answer, as "wear.law".

    What depends on such a key has a closed form that knows the key, or none.
    """
    changed = {name for name in ("scatter", "loading", "tables") if getattr(study, name)}
    for name, without in _NOT_ASKED:
        table = getattr(study, name)
        for key, entry in type(table).model_fields.items():
            default = entry.get_default(call_default_factory=True)
            if not entry.exclude and key not in without and (entry.is_required() or getattr(table, key) != default):
                changed.add(f"{name}.{key}")
    return frozenset(changed)


def check_study_model(study: Study, picture: Path, progress: Progress) -> str:
    """Lines on the finite-element model of a study, for `--check`. picture: of the contact pairs, is written.

    Raises UserError where the study has no such model, the model is wrong, or the picture cannot be written.
    """
    with scene_errors(study.source, None), np.errstate(all="ignore"):
        checked = study.scene.source.check(study.scene.parameters, harmonics_to_build(study), progress)
    if checked is None:
        remedy = f"give a study file of a finite-element model, which {study.scene.model} here is not"
        raise UserError("command line", "--check", study.source, remedy)
    rows, draw_pairs = checked
    try:
        draw_pairs(picture)
    except OSError as error:
        remedy = f"give a folder that can be written to: {error.strerror or error}"
        raise UserError("command line", "--check", str(picture), remedy) from None
    return "\n".join(f"{label:<10} {' '.join(show_text(text).split())}" for label, text in rows)

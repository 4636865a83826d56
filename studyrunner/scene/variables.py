"""What a study asks of its scene beside the model: pairs with loops, mesh, natural frequencies, an exact answer."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from studies.scene_answers import stuck_frequencies
from studies.scene_error import SceneError
from studies.scenes import scene_has, scene_mesh
from studyrunner.coordinates import COORDINATES, SCENE
from studyrunner.scene.computed import Computed, frequencies_once
from studyrunner.study.study import Study
from studyrunner.user_error import UserError, Verbatim
from studyrunner.variables import LOOP_COMPONENTS, LOOP_PHASES, LOOPS, Variable

if TYPE_CHECKING:
    from solver.model import ReducedModel
    from studies.scene_answers import SurfaceMesh


@dataclass(frozen=True)
class SceneVariable:
    """A variable or coordinate of the result file that no task computes.

    values: with the dimensions of the entry; for an exact answer the axes of the study come before them, of length 1
    where it does not depend on an axis. axes: whether they do. coordinate: whether it is one.
    """

    name: str
    entry: Variable
    values: NDArray[np.generic]
    axes: bool = False
    coordinate: bool = False


_LARGEST_HISTORY = 1e9  # bytes: a result is one message between ranks


def check_outputs(study: Study, model: ReducedModel) -> None:
    """Raises UserError where the study asks for loops of pairs or natural frequencies that the scene does not have."""
    loops, n_contact = study.outputs.loops, model.contact.n_contact
    for pair in loops:
        if pair >= n_contact:
            remedy = f"give indices from 0 to {n_contact - 1}, the contact pairs of the scene"
            raise UserError(study.source, "outputs.loops", pair, remedy)
    own = {"contact": n_contact, "response": len(model.response_names), "cycle": len(study.cycles_kept)}
    sizes = {**own, **study.sizes}
    # the variables of the certificate are there whether they are asked for or not
    n_values = sum(math.prod(sizes[name] for name in each.dimensions) for each in study.variables.values())
    if (size := 8.0 * (loop_numbers(study) + n_values)) > _LARGEST_HISTORY:
        remedy = f"give fewer, or fewer slow_time.outputs: one point would take {1e-9 * size:.1f} GB"
        key = "outputs.loops" if loops else "slow_time.outputs"
        raise UserError(study.source, key, list(loops) if loops else len(study.cycles_kept), remedy)
    if "natural_frequency" in study.scene_variables and not _has_frequencies(study):
        with _user_errors(study):
            stuck_frequencies(model)


def loop_numbers(study: Study) -> int:
    """Numbers in the loops of one point."""
    return len(study.outputs.loops) * len(study.cycles_kept) * LOOP_PHASES * len(LOOP_COMPONENTS) * len(LOOPS)


def build_scene_variables(study: Study, model: ReducedModel, computed: Computed) -> tuple[SceneVariable, ...]:
    """What the study asks of its scene, but exact answers. Natural frequencies of a bundled sector take some seconds.

    computed: holds those of an earlier run. Raises UserError where the scene cannot give them.
    """
    found: list[SceneVariable] = []
    with _user_errors(study):
        if "mesh" in study.scene_variables:
            found += _mesh(study)
        if "natural_frequency" in study.scene_variables:
            found += _frequencies(computed, study, model)
    return tuple(found)


@contextmanager
def _user_errors(study: Study) -> Iterator[None]:
    try:
        yield
    except SceneError as error:
        table = "outputs" if error.key == "variables" else "scene"
        raise UserError(study.source, f"{table}.{error.key}", Verbatim(error.value), error.remedy) from None


def _has_frequencies(study: Study) -> bool:
    """Whether the scene knows more natural frequencies than those of its reduced model."""
    rigid = dict(study.scene.parameters)["contact_stiffness"] is None
    return study.scene.is_bundled and rigid and scene_has(study.scene.model, "natural_frequencies")


def build_mesh(study: Study) -> SurfaceMesh | None:
    """Mesh of the study's scene, None where it has none. Raises SceneError."""
    scene = study.scene
    if "mesh" not in scene.offers:
        return None
    if scene.files is not None:
        from studies.fe_models.from_files.scene import describe_model_mesh

        return describe_model_mesh(scene.files, scene.parameters)
    if scene.path is None:
        return scene_mesh(scene.model, scene.parameters)
    # h5py is loaded for scene files only
    from studies.scene_file import read_mesh

    return read_mesh(scene.path, scene.group)


def _mesh(study: Study) -> Iterator[SceneVariable]:
    mesh = build_mesh(study)
    if mesh is None:
        raise SceneError("variables", "mesh", "leave it out: the scene has none")
    values: dict[str, NDArray[np.generic]] = {
        **{f"mesh_{axis}": mesh.nodes[:, column] for column, axis in enumerate("xyz")},
        "mesh_quad": mesh.quads.astype(np.int32),
        "mesh_part": np.array(mesh.parts),
    }
    for name, entry in SCENE["mesh"].items():
        yield SceneVariable(name, entry, values[name])


def _frequencies(computed: Computed, study: Study, model: ReducedModel) -> Iterator[SceneVariable]:
    found = frequencies_once(study, computed) if _has_frequencies(study) else stuck_frequencies(model)
    (entry,) = SCENE["natural_frequency"].values()
    labels = {"nodal_diameter": found.nodal_diameters, "mode": range(1, found.frequencies.shape[1] + 1)}
    yield SceneVariable("natural_frequency", entry, found.frequencies)
    for name, values in labels.items():
        yield SceneVariable(name, COORDINATES[name], np.array(values, dtype=np.int32), coordinate=True)

"""The reduced model of a study's finite-element model, its mesh for pictures, and where it comes from."""

from __future__ import annotations

import json
from importlib import metadata

from pydantic import BaseModel

from solver.model import ReducedModel
from studies.fe_models.from_files.model import LoadedModel, load_mesh, load_model
from studies.fe_models.from_files.parameters import Parameters
from studies.fe_models.meshes import read_mesh_file
from studies.fe_models.model_files import ModelFiles, file_digest
from studies.finite_element.joint_model import ReductionOptions
from studies.finite_element.reduced_joint import FeScene, Progress, build_fe_scene, silent
from studies.finite_element.surfaces import describe_mesh
from studies.scene import SurfaceMesh, build_compliant


def checked(parameters: BaseModel) -> Parameters:
    """Parameters of a finite-element model; TypeError where they belong to another scene."""
    if not isinstance(parameters, Parameters):
        raise TypeError(f"a finite-element model takes {Parameters.__module__}.Parameters, not {type(parameters)}")
    return parameters


def build(files: ModelFiles, parameters: BaseModel, n_harmonics: int, progress: Progress = silent) -> ReducedModel:
    """Reduced model, with all nodal diameters that the harmonics 0..n_harmonics see.

    Raises SceneError where the files or parameters describe no possible joint.
    """
    own = checked(parameters)

    def reduced() -> ReducedModel:
        return reduce_model(load_model(files, own, progress), own, n_harmonics, progress).model

    if own.contact_stiffness is None:
        return reduced()
    what = [describe_origin(files, own), own.model_dump_json(exclude={"contact_stiffness"}), n_harmonics]
    return build_compliant(json.dumps(what), own.contact_stiffness, reduced)


def reduce_model(loaded: LoadedModel, parameters: Parameters, n_harmonics: int, progress: Progress = silent) -> FeScene:
    """Reduced model of a loaded one. Raises SceneError."""
    options = ReductionOptions(parameters.nodal_diameter, parameters.stuck_modes, parameters.loss_factor)
    return build_fe_scene(loaded.model, loaded.joint, options, n_harmonics, progress)


def describe_model_mesh(files: ModelFiles, parameters: BaseModel) -> SurfaceMesh:
    """Outer faces of the mesh. Raises SceneError."""
    return describe_mesh(load_mesh(files, checked(parameters)))


def describe_origin(files: ModelFiles, parameters: BaseModel) -> dict[str, str]:
    """Attributes of a scene or result file: the files with their SHA-256, their units, and what reduced them.

    Raises SceneError or OSError where a file cannot be read.
    """
    folder = files.mesh.parent
    mesh, *others = files.all
    paths = (mesh, *(folder / name for name in read_mesh_file(mesh).included), *others)
    listed = ", ".join(f"{path.name} sha256:{file_digest(path)}" for path in paths)
    return {
        "model_files": listed,
        "model_units": checked(parameters).units,
        "model_reduced_by": f"fretwear {metadata.version('fretwear')}",
    }

"""From files and a study's parameters to a model and its reduction, in SI units."""

import json
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path

import numpy as np
from pydantic import BaseModel

from solver.model import FloatArray, ReducedModel
from studies.fe_models.deck.contents import Deck
from studies.fe_models.files import UNITS, ModelFiles, Units, check_there, file_digest
from studies.fe_models.from_files.constraints import Supported, find_constraints
from studies.fe_models.from_files.imported import check_nodes_have_dofs, import_matrices, read_recovery
from studies.fe_models.from_files.parameters import Parameters, SetDirection
from studies.fe_models.from_files.selections import Selections, find_surfaces, note_free_surfaces
from studies.fe_models.from_files.solid import build_solid_mesh, check_units, find_axes
from studies.fe_models.matrices.read import find_matrix_files
from studies.fe_models.meshes import read_mesh_file
from studies.finite_element.cut_faces import CyclicAxis
from studies.finite_element.pairing import ContactPairs, Contacts, match_nodes
from studies.finite_element.reduced_joint import FeScene, build_fe_scene
from studies.finite_element.reduction import PreparedModel
from studies.finite_element.solid_mesh import Rotation, SolidMesh, rigid_motions
from studies.finite_element.structure import FeModel, JointDefinition, ReductionOptions, Retainer, mean_motion
from studies.finite_element.surfaces import describe_mesh, faces_of_elements, integrate_shapes
from studies.scene import Progress, SurfaceMesh, build_compliant, silent
from studies.scene_error import SceneError


@dataclass(frozen=True)
class LoadedModel:
    """A model as its files and the study describe it. deck: in units of the files. parameters, model, joint: SI.

    motions (3 n_nodes, 6): of all nodes as one body, see `PreparedModel`. omega_squared_held: square of the speed at
    which the matrices were made, rad2/s2; None where they do not tell.
    """

    deck: Deck
    parameters: Parameters
    model: FeModel
    joint: JointDefinition
    motions: FloatArray
    omega_squared_held: float | None


def checked(parameters: BaseModel) -> Parameters:
    """Parameters that are those of a finite-element model."""
    assert isinstance(parameters, Parameters)
    return parameters


def find_files(folder: Path, model: str, parameters: Parameters) -> ModelFiles:
    """The files of a model, whose names are relative to a folder. Raises SceneError where one is missing."""
    mesh, recovery = folder / model, None
    matrices = () if parameters.matrices is None else find_matrix_files(folder / parameters.matrices)
    if parameters.recovery is not None:
        if not matrices:
            raise SceneError("recovery", parameters.recovery, "give it with `matrices`, over their rows")
        recovery = folder / parameters.recovery
    files = ModelFiles(mesh, matrices, recovery)
    keys = ("model", *("matrices" for _ in matrices), "recovery")
    for path, key in zip(files.all, keys, strict=False):
        check_there(path, key)
    return files


def build(files: ModelFiles, parameters: BaseModel, n_harmonics: int, progress: Progress = silent) -> ReducedModel:
    """Reduced model, with all nodal diameters that the harmonics 0..n_harmonics see. Raises SceneError."""
    own = checked(parameters)
    what = [describe_origin(files, own), own.model_dump_json(exclude={"contact_stiffness"}), n_harmonics]
    return build_compliant(
        files.mesh.name,
        json.dumps(what),
        own.contact_stiffness,
        lambda: reduce_model(load_model(files, own, progress), n_harmonics, progress).model,
    )


def reduce_model(
    loaded: LoadedModel, n_harmonics: int, progress: Progress = silent, prepared: PreparedModel | None = None
) -> FeScene:
    """Reduced model of a loaded one, which may be prepared already. Raises SceneError."""
    own = loaded.parameters
    ring = own.sectors is not None
    options = ReductionOptions(own.nodal_diameter, own.stuck_modes, own.loss_factor, all_sectors=ring)
    return build_fe_scene(loaded.model, loaded.joint, options, n_harmonics, progress, prepared)


def describe_model_mesh(files: ModelFiles, parameters: BaseModel) -> SurfaceMesh:
    """Outer faces of the mesh. Raises SceneError."""
    own = checked(parameters)
    return describe_mesh(build_solid_mesh(read_mesh_file(files.mesh), own, UNITS[own.units]))


def describe_origin(files: ModelFiles, parameters: BaseModel) -> dict[str, str]:
    """Attributes of a scene or result file: the files with their SHA-256, their units, and what reduced them."""
    mesh, *others = files.all
    paths = (mesh, *(mesh.parent / name for name in read_mesh_file(mesh).included), *others)
    return {
        "model_files": ", ".join(f"{path.name} sha256:{file_digest(path)}" for path in paths),
        "model_units": checked(parameters).units,
        "model_reduced_by": f"fretwear {metadata.version('fretwear')}",
    }


def load_model(files: ModelFiles, parameters: Parameters, progress: Progress = silent) -> LoadedModel:
    """Reads the files and puts the model together. Raises SceneError."""
    units = UNITS[parameters.units]
    progress(f"reading {files.mesh.name}")
    deck = note_free_surfaces(read_mesh_file(files.mesh), parameters.contact)
    mesh = build_solid_mesh(deck, parameters, units)
    selections = Selections(deck, mesh, parameters, units)
    if not files.matrices:
        _check_assembled(deck, units)
    rotation, axis = find_axes(deck, parameters, units)
    contacts, ties = find_surfaces(selections, axis)
    cut, clamped = selections.cut(axis, contacts), selections.clamped()
    on_cut = np.empty(0, dtype=np.int64) if cut is None else np.concatenate([cut.left, cut.right])
    imported = None
    if files.matrices:
        progress(f"reading {', '.join(path.name for path in files.matrices)}")
        imported = import_matrices(files.matrices[0], selections, (contacts, ties), rotation, mesh.numbers[on_cut])
    nodes = mesh if imported is None else imported.mesh
    supported = find_constraints(selections, nodes.numbers, clamped, on_cut)
    selections = replace(selections, references=supported.references)
    preload, gravity = _preload(selections, supported), None if deck.gravity is None else deck.gravity * units.length
    n_nodes, forms = len(supported.held), None
    asked = (parameters.response or {"load": parameters.load}).items()
    responses = {name: _motion(selections, each, f"response.{name}.set", n_nodes) for name, each in asked}
    if imported is not None:
        if imported.matrices.load is not None:
            preload[imported.place] += imported.matrices.load[:, 0] * units.force
        if deck.contact_nodes is None:
            free = mesh.numbers[~supported.own[: mesh.n_nodes].all(axis=1)]
            check_nodes_have_dofs(imported.matrices, free, "the mesh without its clamps")
        supported.held[: len(imported.missing)] |= imported.missing
        forms = imported.forms
        for form in forms.values():
            form.resize((3 * n_nodes, 3 * n_nodes))
        if files.recovery is not None:
            responses |= read_recovery(files.recovery, imported, units, responses)
    whole = nodes.with_nodes(supported.extra)
    model = FeModel(whole, rotation, parameters.stress_stiffening, preload, gravity, forms, parameters.suspension)
    joint = JointDefinition(
        contacts=contacts,
        held=supported.held,
        load=_motion(selections, parameters.load, "load.set", n_nodes),
        responses=responses,
        cut=cut,
        retainer=_retainer(parameters, None if cut is None else cut.axis.axis, rotation),
        ties=ties,
        constraints=supported.constraints,
        pairs=_pairs_of_table(selections, whole, contacts, axis),
    )
    placed = ~np.isnan(nodes.coordinates[:, :1, None])
    motions = np.vstack([(placed * rigid_motions(np.nan_to_num(nodes.coordinates))).reshape(-1, 6), supported.motions])
    centre = np.nanmean(nodes.coordinates, axis=0) if cut is None else cut.axis.point
    motions[:, 3:] -= motions[:, :3] @ rigid_motions(centre[None])[0, :, 3:]
    held_speed = None if imported is None else imported.omega_squared_held
    return LoadedModel(deck, parameters, model, joint, motions, held_speed)


def _check_assembled(deck: Deck, units: Units) -> None:
    """What stiffness and mass that are assembled here need. Raises SceneError."""
    if deck.contact_nodes is not None:
        raise SceneError("matrices", "missing", f"give the matrices of the nodes of {deck.path}")
    check_units(deck, None, units)
    if deck.unassembled:
        raise SceneError("model", deck.unassembled[0], "use solid elements, of one material in a .cdb, or `matrices`")


def _pairs_of_table(
    selections: Selections, mesh: SolidMesh, contacts: Contacts, axis: CyclicAxis | None
) -> ContactPairs | None:
    """Pairs of a table of nodes; None of a mesh, whose facets make them."""
    table, length = selections.deck.contact_nodes, selections.units.length
    if table is None:
        return None
    given = table * [length**2, 1.0, 1.0, 1.0, length]
    area, *normals, gap = np.pad(given.T, ((0, 0), (0, mesh.n_nodes - len(given))), constant_values=np.nan)
    return match_nodes(mesh, contacts, (area, np.stack(normals, axis=1), gap), axis)


def _preload(selections: Selections, supported: Supported) -> FloatArray:
    """Constant nodal forces (3 n_nodes,), N: those of the study, else forces and pressures of the deck."""
    n_nodes, given, mesh = len(supported.held), selections.parameters.preload, selections.mesh
    if given:
        rows = [each.force * _motion(selections, each, "preload.set", n_nodes) for each in given]
        return np.asarray(np.sum(rows, axis=0))
    forces = np.zeros(3 * n_nodes)
    for each in selections.deck.pressures:
        kept = np.isin(each.elements, np.concatenate([group.numbers for group in mesh.groups]))
        faces = faces_of_elements(mesh, each.place, each.elements[kept], each.faces[kept])
        pressed = integrate_shapes(mesh.coordinates, faces)[1].ravel()
        forces[: 3 * mesh.n_nodes] -= each.value * selections.units.stress * pressed
    return np.asarray(supported.forces + forces)


def _motion(selections: Selections, given: SetDirection, key: str, n_nodes: int) -> FloatArray:
    return mean_motion(selections.nodes(given.set, key), np.array(given.direction), n_nodes)


def _retainer(parameters: Parameters, axis: FloatArray | None, rotation: Rotation | None) -> Retainer | None:
    if parameters.retention_stiffness == 0.0:
        return None
    of_model = axis if axis is not None or rotation is None else rotation.axis
    direction = of_model if parameters.retention_direction is None else parameters.retention_direction
    if direction is None:
        raise SceneError("retention_direction", "missing", "give it: the model has no axis")
    return Retainer(parameters.retention_stiffness, np.array(direction))

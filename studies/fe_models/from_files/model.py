"""From files and a study's parameters to a model and what is done with it, in SI units."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from solver.model import FloatArray
from studies.fe_models.checks import check_nodes_have_dofs, check_units
from studies.fe_models.deck.contents import Deck
from studies.fe_models.from_files.constraints import Supported, find_constraints
from studies.fe_models.from_files.imported import (
    check_table,
    constant_forces,
    import_matrices,
    read_recovery,
)
from studies.fe_models.from_files.parameters import Parameters, SetDirection
from studies.fe_models.from_files.selections import Selections, Surfaces, find_surfaces
from studies.fe_models.from_files.solid import (
    build_solid_mesh,
    find_clamped,
    find_cut,
    find_cyclic_axis,
    find_rotation,
)
from studies.fe_models.matrices.read import find_matrix_files
from studies.fe_models.meshes import read_mesh_file
from studies.fe_models.model_files import ModelFiles, Units, find_units
from studies.finite_element.cut_faces import CyclicAxis
from studies.finite_element.joint_model import FeModel, JointDefinition, Retainer, mean_motion
from studies.finite_element.pairing import ContactPairs, match_nodes
from studies.finite_element.reduced_joint import Progress, silent
from studies.finite_element.solid_mesh import Rotation, SolidMesh
from studies.finite_element.surfaces import loops_of_faces, pressure_forces
from studies.scene_error import SceneError


@dataclass(frozen=True)
class LoadedModel:
    """A model as its files and the study describe it.

    deck: in units of the file. mesh: m. model, joint: SI.
    omega_squared_held: square of the speed at which the matrices were made, rad2/s2; None where they do not tell.
    """

    deck: Deck
    units: Units
    mesh: SolidMesh
    model: FeModel
    joint: JointDefinition
    omega_squared_held: float | None


def find_files(folder: Path, model: str, parameters: Parameters) -> ModelFiles:
    """The files of a model, whose names are relative to a folder.

    Raises SceneError where there are none of these names.
    """
    mesh = folder / model
    _check_there(mesh, "model")
    if parameters.matrices is None:
        if parameters.recovery is not None:
            raise SceneError("recovery", parameters.recovery, "give it with `matrices`, over their rows")
        return ModelFiles(mesh)
    matrices = find_matrix_files(folder / parameters.matrices)
    for path in matrices:
        _check_there(path, "matrices")
    recovery = None if parameters.recovery is None else folder / parameters.recovery
    if recovery is not None:
        _check_there(recovery, "recovery")
    return ModelFiles(mesh, matrices, recovery)


def load_mesh(files: ModelFiles, parameters: Parameters) -> SolidMesh:
    """The mesh alone. Raises SceneError."""
    return build_solid_mesh(read_mesh_file(files.mesh), parameters, find_units(parameters.units))


def load_model(files: ModelFiles, parameters: Parameters, progress: Progress = silent) -> LoadedModel:
    """Reads the files and puts the model together.

    Raises SceneError where a file cannot be read, the study names what is not there, or what was exported is of no use.
    """
    units = find_units(parameters.units)
    progress(f"reading {files.mesh.name}")
    deck = read_mesh_file(files.mesh)
    mesh = build_solid_mesh(deck, parameters, units)
    selections = Selections(deck, mesh)
    if not files.matrices:
        _check_assembled(deck, units)
    rotation = find_rotation(deck, parameters, units)
    axis = find_cyclic_axis(deck, parameters, units)
    surfaces = find_surfaces(selections, parameters, units, axis)
    cut, clamped = find_cut(selections, parameters, axis, surfaces.contacts), find_clamped(selections, parameters)
    on_cut = np.empty(0, dtype=np.int64) if cut is None else np.concatenate([cut.left, cut.right])
    imported = None
    if files.matrices:
        progress(f"reading {', '.join(path.name for path in files.matrices)}")
        imported = import_matrices(files, parameters, deck, mesh, surfaces, units, rotation)
    nodes = mesh if imported is None else imported.nodal.mesh
    numbers = nodes.numbers
    if clamped is not None:
        clamped = np.pad(clamped, ((0, len(numbers) - len(clamped)), (0, 0)))
    supported = find_constraints(deck, numbers, clamped, units, on_cut)
    selections = replace(selections, references=supported.references)
    preload = _preload(selections, parameters, units, supported)
    gravity = None if deck.gravity is None else deck.gravity * units.length
    n_nodes, forms = len(supported.held), None
    responses = {
        name: _motion(selections, each, f"response.{name}.set", n_nodes) for name, each in parameters.responses.items()
    }
    if imported is not None:
        matrices, nodal = imported.matrices, imported.nodal
        if deck.contact_nodes is not None:
            check_table(deck, matrices, parameters, mesh.numbers[on_cut])
            preload = preload + constant_forces(matrices, nodal, units, n_nodes)
        else:
            free = mesh.numbers[~supported.own[: mesh.n_nodes].all(axis=1)]
            check_nodes_have_dofs(matrices, free, "the mesh without its clamps")
        supported.held[: len(nodal.missing)] |= nodal.missing
        forms = nodal.forms
        for form in forms.values():
            form.resize((3 * n_nodes, 3 * n_nodes))
        if files.recovery is not None:
            responses |= read_recovery(files.recovery, matrices, nodal, units, responses)
    model = FeModel(nodes.with_nodes(supported.extra), rotation, parameters.stress_stiffening, preload, gravity, forms)
    joint = JointDefinition(
        contacts=surfaces.contacts,
        held=supported.held,
        load=_motion(selections, parameters.load, "load.set", n_nodes),
        responses=responses,
        cut=cut,
        retainer=_retainer(parameters, None if cut is None else cut.axis.axis, rotation),
        ties=surfaces.ties,
        constraints=supported.constraints,
        pairs=_pairs_of_table(deck, model, surfaces, units, axis),
    )
    return LoadedModel(deck, units, mesh, model, joint, None if imported is None else imported.omega_squared_held)


def _check_assembled(deck: Deck, units: Units) -> None:
    """What stiffness and mass that are assembled here need. Raises SceneError."""
    if deck.contact_nodes is not None:
        raise SceneError("matrices", "missing", f"give the matrices of the nodes of {deck.path}")
    check_units(deck, None, units)
    for found in deck.unassembled:
        remedy = "use solid elements, of one material in a .cdb, or give `matrices` of another program"
        raise SceneError("model", found, remedy)


def _pairs_of_table(
    deck: Deck, model: FeModel, surfaces: Surfaces, units: Units, axis: CyclicAxis | None
) -> ContactPairs | None:
    """Pairs of a table of nodes; None of a mesh, whose facets make them."""
    if deck.contact_nodes is None:
        return None
    others = model.mesh.n_nodes - len(deck.node_numbers)
    scales = (deck.contact_nodes.area * units.length**2, deck.contact_nodes.gap * units.length)
    area, gap = (np.pad(each, (0, others), constant_values=np.nan) for each in scales)
    normals = np.pad(deck.contact_nodes.normals, ((0, others), (0, 0)), constant_values=np.nan)
    return match_nodes(model.mesh.coordinates, model.mesh.numbers, surfaces.contacts, (area, normals, gap), axis)


def _preload(selections: Selections, parameters: Parameters, units: Units, supported: Supported) -> FloatArray:
    """Constant nodal forces (3 n_nodes,), N: those of the study, else of the deck."""
    n_nodes = len(supported.held)
    if not parameters.preload:
        return np.asarray(supported.forces + _pressed(selections.deck, selections.mesh, n_nodes, units))
    rows = [each.force * _motion(selections, each, "preload.set", n_nodes) for each in parameters.preload]
    return np.asarray(np.sum(rows, axis=0))


def _check_there(path: Path, key: str) -> None:
    try:
        exists = path.is_file()
    except (OSError, ValueError):
        exists = False
    if not exists:
        raise SceneError(key, f"there is no file {path.name}", "give a path relative to the study file")


def _motion(selections: Selections, given: SetDirection, key: str, n_nodes: int) -> FloatArray:
    return mean_motion(selections.nodes(given.set, key), np.array(given.direction), n_nodes)


def _pressed(deck: Deck, mesh: SolidMesh, n_nodes: int, units: Units) -> FloatArray:
    """Nodal forces (3 n_nodes,), N, of the pressures of a deck."""
    forces = np.zeros(3 * n_nodes)
    for each in deck.pressures:
        kept = np.isin(each.elements, np.concatenate([group.numbers for group in mesh.groups]))
        loops, _ = loops_of_faces(mesh, each.place, each.elements[kept], each.faces[kept])
        forces[: 3 * mesh.n_nodes] += pressure_forces(mesh.coordinates, loops, each.value * units.stress)
    return forces


def _retainer(parameters: Parameters, axis: FloatArray | None, rotation: Rotation | None) -> Retainer | None:
    if parameters.retention_stiffness == 0.0:
        return None
    direction = parameters.retention_direction
    if direction is not None:
        return Retainer(parameters.retention_stiffness, np.array(direction))
    if axis is None and rotation is not None:
        axis = rotation.axis
    if axis is None:
        raise SceneError("retention_direction", "missing", "give it: the model has no axis")
    return Retainer(parameters.retention_stiffness, axis)

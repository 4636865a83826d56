"""Matrices of another program: of a mesh, or reduced ones with a table of nodes, in the order of the nodes, SI."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import sparse

from solver.model import BoolArray, FloatArray, IntArray
from studies.fe_models.files import ModelFiles, Units, library_errors
from studies.fe_models.from_files.export_mistakes import (
    check_contact_removed,
    check_mass,
    check_mesh_is_of_matrices,
    check_nodes_have_dofs,
    check_speed,
    check_translations,
    mass_of,
)
from studies.fe_models.from_files.selections import Selections
from studies.fe_models.from_files.solid import check_units
from studies.fe_models.matrices.matrices import Matrices
from studies.fe_models.matrices.read import read_matrices
from studies.finite_element.pairing import ContactSurfaces
from studies.finite_element.solid_mesh import Rotation, SolidMesh
from studies.scene_error import SceneError


@dataclass(frozen=True)
class NodalMatrices:
    """Matrices of another program, and forms of them by name with displacements node by node in x, y, z: nodes of the
    mesh, then those of the matrices alone, then rows of no place, as modal coordinates, three by three.

    missing (n_nodes, 3): displacements that the matrices do not have, which must be held. place (n_dof,): of each row
    of the matrices in the displacements of the model. omega_squared_held: square of the speed at which they were made,
    rad2/s2; None where they do not tell.
    """

    matrices: Matrices
    mesh: SolidMesh
    forms: Mapping[str, sparse.csr_matrix]
    missing: BoolArray
    place: IntArray
    omega_squared_held: float | None = None


def order_by_nodes(matrices: Matrices, units: Units, mesh: SolidMesh) -> NodalMatrices:
    """Matrices in the order of the nodes of a mesh."""
    numbers = mesh.numbers
    node, direction = matrices.node.copy(), matrices.direction.copy()
    other = np.flatnonzero((direction < 0) | (direction > 2))
    first = min(0, int(node.min(initial=0)), int(numbers.min(initial=0))) - 1
    node[other], direction[other] = first - np.arange(len(other)) // 3, np.arange(len(other)) % 3
    extra = np.setdiff1d(node, numbers)
    everything = np.concatenate([numbers, extra]).astype(np.int64)
    order = np.argsort(everything)
    place = 3 * order[np.searchsorted(everything, node, sorter=order)] + direction
    n = 3 * len(everything)

    def ordered(matrix: sparse.csr_array) -> sparse.csr_matrix:
        entries = matrix.tocoo()
        return sparse.csr_matrix((entries.data * units.stiffness, (place[entries.row], place[entries.col])), (n, n))

    missing = np.ones(n, dtype=np.bool_)
    missing[place] = False
    forms = {"stiffness": ordered(matrices.stiffness), "mass": ordered(matrices.mass)}
    if matrices.damping is not None:
        # seconds in all systems of units: N s/m from a damping as N/m from a stiffness
        forms["damping"] = ordered(matrices.damping)
    return NodalMatrices(matrices, mesh.with_nodes(extra), forms, missing.reshape(-1, 3), place)


def import_matrices(
    files: ModelFiles,
    selections: Selections,
    surfaces: tuple[tuple[ContactSurfaces, ...], tuple[ContactSurfaces, ...]],
    rotation: Rotation | None,
    on_cut: IntArray,
) -> NodalMatrices:
    """Reads matrices; those of a mesh are whole, and nothing joins surfaces in contact. Raises SceneError.

    surfaces: those in contact, and those that are glued. on_cut: numbers of the nodes on both cut faces.
    """
    deck, mesh, units, parameters = selections.deck, selections.mesh, selections.units, selections.parameters
    if not parameters.stress_stiffening:
        raise SceneError("stress_stiffening", "false", "leave it out: the matrices hold it or not")
    if deck.n_instances > 1:
        found = f"{deck.path} has {deck.n_instances} instances, whose nodes have other numbers in matrices"
        raise SceneError("matrices", found, "write a flat deck, or leave `matrices` out")
    matrices, held_speed = read_matrices(files.matrices[0]), None
    check_mesh_is_of_matrices(deck, matrices)
    if deck.contact_nodes is None:
        check_translations(matrices)
        check_units(deck, mass_of(deck, matrices), units)
        check_mass(deck, matrices, units)
        for each in (*surfaces[0], *surfaces[1]):
            for surface in (each.first, each.second):
                check_nodes_have_dofs(matrices, mesh.numbers[surface.nodes], surface.name)
        for each in surfaces[0]:
            nodes = mesh.numbers[each.first.nodes], mesh.numbers[each.second.nodes]
            check_contact_removed(deck, matrices, nodes, (each.first.name, each.second.name), units)
        if rotation is not None:
            held_speed = check_speed(deck, matrices, rotation, of_study=parameters.rotation_speed is not None)
    else:
        _check_table(matrices, selections, on_cut)
    return replace(order_by_nodes(matrices, units, mesh), omega_squared_held=held_speed)


def _check_table(matrices: Matrices, selections: Selections, on_cut: IntArray) -> None:
    """Raises SceneError where a table of nodes and matrices do not go together, or a key needs elements."""
    deck = selections.deck
    # forces of rotation are among those of the matrices, or in `preload`
    for key in ("material", "rotation_speed"):
        if getattr(selections.parameters, key) is not None:
            remedy = "leave it out: reduced matrices have it in them, and forces stand in their load or in preload"
            raise SceneError(key, "the model is a table of nodes", remedy)
    if matrices.load is not None and matrices.load.shape[1] > 1:
        raise SceneError("matrices", f"{matrices.files[0]}: several load cases", "give one column of forces")
    lost = np.setdiff1d(deck.node_numbers, matrices.node)
    if len(lost):
        found = f"{len(lost)} nodes of {deck.path} have no row in {matrices.files[0]}, as node {lost[0]}"
        raise SceneError("matrices", found, "give the nodes that the matrices keep")
    turning = matrices.node[np.isin(matrices.node, on_cut) & (matrices.direction > 2)]
    if len(turning):
        found = f"node {turning[0]} of a cut face has rotations"
        raise SceneError("cut_faces", found, "reduce the sector to the displacements of its cut faces")


def read_recovery(
    path: Path, imported: NodalMatrices, units: Units, taken: Collection[str]
) -> Mapping[str, FloatArray]:
    """Quantities by name, as sums over the displacements of a model.

    A quantity with a unit in its name, as "root stress [MPa]", has this unit; one without is a displacement, m. taken:
    names of other responses. Raises SceneError where a column is no numbers, a row is none of the matrices, or a name
    is taken.
    """
    with library_errors(path, "pandas", "pandas", "recovery"):
        table = pd.read_csv(path, skipinitialspace=True)
        names = [str(name).strip() for name in table if str(name).strip() not in ("node", "dof")]
        table.columns = [str(name).strip() for name in table]
        values = table[names].fillna(0.0).to_numpy(dtype=np.float64)
        rows = pd.MultiIndex.from_frame(table[["node", "dof"]])
    matrices = imported.matrices
    own = pd.MultiIndex.from_arrays([matrices.node, matrices.direction + 1]).get_indexer(rows)
    if not names or (own < 0).any():
        unknown = "no quantity" if not names else f"node {rows[own < 0][0][0]} with dof {rows[own < 0][0][1]} is no row"
        remedy = f"give a column for each quantity, over the rows of {matrices.files[0]}"
        raise SceneError("recovery", f"{path.name}: {unknown}", remedy)
    twice = [name for name in names if name in taken]
    if twice:
        raise SceneError("recovery", f"{path.name}: a response has the name {twice[0]} as well", "give another name")
    motions = {}
    for name, column in zip(names, values.T, strict=True):
        weights = np.zeros(imported.forms["mass"].shape[0])
        np.add.at(weights, imported.place[own], column / (units.length if name.endswith("]") else 1.0))
        motions[name] = weights
    return motions

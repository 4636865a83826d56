"""Matrices of another program: of a mesh, or reduced ones with a table of nodes, in the order of the nodes, SI.

Each mistake in their export has a function that raises SceneError, with one sentence where the mistake was made.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import sparse

from solver.model import BoolArray, FloatArray, IntArray
from studies.fe_models.deck.contents import Deck
from studies.fe_models.files import Units, library_errors
from studies.fe_models.from_files.selections import Selections
from studies.fe_models.from_files.solid import SPEED_AGREES, check_units
from studies.fe_models.matrices.matrices import Matrices, number_modes
from studies.fe_models.matrices.read import read_matrices
from studies.finite_element.elements import ELEMENT_KINDS
from studies.finite_element.pairing import Contacts
from studies.finite_element.solid_mesh import Rotation, SolidMesh, find_places, volumes_of_points
from studies.scene_error import SceneError

_PAIR, _CONTACT = "add *MODEL CHANGE,TYPE=CONTACT PAIR,REMOVE and the pair", "remove the contact between them"
# of each program: to export free nodes, to take contact out, to keep the prestress
_REMEDIES = {
    "calculix": ("export with *EQUATION,REMOVE ALL", _PAIR, "write *STEP,PERTURBATION"),
    "abaqus": ("remove ties and *BOUNDARY in the step of *MATRIX GENERATE", _PAIR, "write *STEP,NLGEOM before it"),
    "ansys": ("write CEDELE and DDELE before the solution", _CONTACT, "write PSTRES,ON for the static solution"),
    "nastran": ("export without SPC and MPC on them", _CONTACT, "name the static subcase with STATSUB"),
    "table": ("export without ties and boundary conditions", _CONTACT, "export the prestressed stiffness"),
}
_COUPLED = 1e-9  # relative stiffness between two surfaces above which they are coupled
_ROUNDING = 1e-13  # of an entry in a file: 14 digits, and what the code itself rounds
_MASS_AGREES = 0.02  # of two masses that are the same: a coarse mesh of curved bodies, point masses that are small
_LEAST_SHARE = 0.1  # of the mass that matrices without the fixed nodes have at least


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


def order_by_nodes(matrices: Matrices, units: Units, mesh: SolidMesh, held: float | None = None) -> NodalMatrices:
    """Matrices in the order of the nodes of a mesh. held: omega_squared_held."""
    numbers = mesh.numbers
    node, direction = matrices.node.copy(), matrices.direction.copy()
    other = np.flatnonzero((direction < 0) | (direction > 2))
    first = min(0, int(node.min(initial=0)), int(numbers.min(initial=0))) - 1
    node[other], direction[other] = first - np.arange(len(other)) // 3, np.arange(len(other)) % 3
    extra = np.setdiff1d(node, numbers)
    everything = np.concatenate([numbers, extra]).astype(np.int64)
    place = 3 * find_places(node, everything) + direction
    n = 3 * len(everything)
    missing = np.ones(n, dtype=np.bool_)
    missing[place] = False
    forms = {}
    # seconds in all systems of units: N s/m from a damping as N/m from a stiffness
    for name in ("stiffness", "mass", "damping"):
        matrix: sparse.csr_array | None = getattr(matrices, name)
        if matrix is not None:
            entries = matrix.tocoo()
            at = place[entries.row], place[entries.col]
            forms[name] = sparse.csr_matrix((entries.data * units.stiffness, at), (n, n))
    return NodalMatrices(matrices, mesh.with_nodes(extra), forms, missing.reshape(-1, 3), place, held)


def import_matrices(
    path: Path, selections: Selections, surfaces: tuple[Contacts, Contacts], rotation: Rotation | None, on_cut: IntArray
) -> NodalMatrices:
    """Reads matrices; those of a mesh are whole, and nothing joins surfaces in contact. Raises SceneError.

    path: of one of their files. surfaces: those in contact, and those that are glued. on_cut: numbers of the nodes on
    both cut faces.
    """
    deck, mesh, units, parameters = selections.deck, selections.mesh, selections.units, selections.parameters
    if not parameters.stress_stiffening:
        raise SceneError("stress_stiffening", "false", "leave it out: the matrices hold it or not")
    if deck.n_instances > 1:
        found = f"{deck.path} has {deck.n_instances} instances, whose nodes have other numbers in matrices"
        raise SceneError("matrices", found, "write a flat deck, or leave `matrices` out")
    matrices, held_speed = read_matrices(path), None
    if not np.isin(matrices.node, deck.node_numbers).any():
        found = f"{matrices.files[0]} and {deck.path} have no node in common"
        raise SceneError("matrices", found, "give the mesh that the matrices were made of")
    if deck.contact_nodes is not None:
        _check_table(matrices, selections, on_cut)
        return order_by_nodes(matrices, units, mesh)
    if (other := np.flatnonzero((matrices.direction < 0) | (matrices.direction > 2))).size:
        found = f"{matrices.files[0]}: node {matrices.node[other[0]]} has the dof {matrices.direction[other[0]] + 1}"
        raise SceneError("matrices", found, "export dofs 1 to 3; to reduced matrices belongs a table of nodes, .csv")
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
    return order_by_nodes(matrices, units, mesh, held_speed)


def _check_table(matrices: Matrices, selections: Selections, on_cut: IntArray) -> None:
    """A table of nodes and matrices go together, and no key needs elements."""
    deck = selections.deck
    # forces of rotation are among those of the matrices, or in `preload`
    for key in ("material", "rotation_speed"):
        if getattr(selections.parameters, key) is not None:
            remedy = "leave it out: reduced matrices have it in them, and forces stand in their load or in preload"
            raise SceneError(key, "the model is a table of nodes", remedy)
    if matrices.load is not None and matrices.load.shape[1] > 1:
        raise SceneError("matrices", f"{matrices.files[0]}: several load cases", "give one column of forces")
    if len(lost := np.setdiff1d(deck.node_numbers, matrices.node)):
        found = f"{len(lost)} nodes of {deck.path} have no row in {matrices.files[0]}, as node {lost[0]}"
        raise SceneError("matrices", found, "give the nodes that the matrices keep")
    if len(turning := matrices.node[np.isin(matrices.node, on_cut) & (matrices.direction > 2)]):
        raise SceneError("cut_faces", f"node {turning[0]} has rotations", "reduce the sector to displacements there")


def check_nodes_have_dofs(matrices: Matrices, nodes: IntArray, name: str) -> None:
    """Every node (p,) of a surface or set, by its number, has all three dofs in the matrices. name: for the message."""
    wanted = np.unique(nodes)
    found, counts = np.unique(matrices.node, return_counts=True)
    if n_missing := int(np.count_nonzero(~np.isin(wanted, found[counts == 3]))):
        where = matrices.files[-1] if matrices.code == "calculix" else matrices.files[0]
        some = "lack dofs" if np.isin(wanted, found[counts < 3]).any() else "have no dof"
        what = f"{name}: {n_missing} of {wanted.size} nodes {some} in {where} (tied or fixed)"
        raise SceneError("matrices", what, _REMEDIES[matrices.code][0])


def check_contact_removed(
    deck: Deck, matrices: Matrices, nodes: tuple[IntArray, IntArray], names: tuple[str, str], units: Units
) -> None:
    """The stiffness does not couple the two surfaces of a contact, other than through elements that have nodes of both.

    nodes: node numbers (p,) and (q,) of the surfaces. names: of the surfaces, for the message.
    """
    first, second = (np.flatnonzero(np.isin(matrices.node, members)) for members in nodes)
    part = sparse.coo_array(matrices.stiffness[first][:, second])
    large = abs(part.data) > _COUPLED * abs(matrices.stiffness.diagonal()).max(initial=0.0)
    one, other = matrices.node[first[part.row[large]]], matrices.node[second[part.col[large]]]
    apart = ~_share_element(deck, one, other)
    if apart.any():
        largest = abs(part.data[large][apart]).max() * units.stiffness
        found = f"the stiffness couples {names[0]} and {names[1]} ({largest:.1e} N/m)"
        raise SceneError("matrices", found, _REMEDIES[matrices.code][1])


def _share_element(deck: Deck, one: IntArray, other: IntArray) -> BoolArray:
    """Whether the nodes (m,) and (m,) are the same, or nodes of one element."""
    together = np.array(one == other, dtype=bool)
    asked = np.union1d(one, other)
    for block in deck.blocks:
        elements, places = np.nonzero(np.isin(block.nodes, asked))
        rows = np.searchsorted(asked, block.nodes[elements, places])
        belongs = sparse.csr_array((np.ones(rows.size), (rows, elements)), shape=(asked.size, block.numbers.size))
        common = sparse.coo_array(belongs @ belongs.T)
        pairs = np.searchsorted(asked, one) * asked.size + np.searchsorted(asked, other)
        together |= np.isin(pairs, common.row.astype(np.int64) * asked.size + common.col)
    return together


def _translation(deck: Deck, matrices: Matrices, direction: FloatArray) -> FloatArray:
    """A rigid translation (n_dof,) by the vector (3,); rows of nodes inside of elements (C3D8I) take no part."""
    return np.where(np.isin(matrices.node, deck.node_numbers), direction[matrices.direction], 0.0)


def mass_of(deck: Deck, matrices: Matrices) -> float:
    """Mass of the model in units of the file: the mean over the three directions."""
    motions = [_translation(deck, matrices, axis) for axis in np.eye(3)]
    return float(np.mean([motion @ (matrices.mass @ motion) for motion in motions]))


def check_mass(deck: Deck, matrices: Matrices, units: Units) -> None:
    """The matrices have the mass that density and volume of the deck give; less where they lack nodes of the deck."""
    expected, found = 0.0, mass_of(deck, matrices)
    for block in deck.blocks:
        density = np.full(block.numbers.size, np.nan)
        for section in deck.sections:
            density[np.isin(block.numbers, section.elements)] = deck.materials[section.material].density
        places = deck.coordinates[deck.rows_of_nodes(block.nodes)]
        expected += float((density @ volumes_of_points(ELEMENT_KINDS[block.kind], places)).sum())
    whole = np.isin(np.concatenate([block.nodes.ravel() for block in deck.blocks]), matrices.node).all()
    least = 1 - _MASS_AGREES if whole else _LEAST_SHARE
    # of a deck that lacks a density nothing is known
    if not math.isnan(expected) and not least <= found / expected <= 1 + _MASS_AGREES:
        masses = f"{found * units.mass:.3g} kg in the matrices, {expected * units.mass:.3g} kg by density and volume"
        found_both = f"{matrices.files[0]} and {deck.path}: {masses}"
        raise SceneError("matrices", found_both, "give both of one run in the same units, or a deck without *DENSITY")


def omega_squared_of(deck: Deck, matrices: Matrices, axis: FloatArray) -> float | None:
    """Square of the speed, rad2/s2, at which the stiffness was made: only spin softening resists a translation.

    `Omega^2 = - t^T K t / t^T M t` for a rigid translation t along a unit vector (3,) across the axis. None where the
    model is held, so that other stiffness resists as well.
    """
    found: list[float] = []
    for direction in np.linalg.svd(axis[np.newaxis])[2][1:]:
        motion = _translation(deck, matrices, direction)
        mass = float(motion @ (matrices.mass @ motion))
        if not mass > 0:
            return None
        moved = np.flatnonzero(motion)
        rounding = _ROUNDING * float(abs(matrices.stiffness[moved][:, moved]).sum()) / mass
        value = -float(motion @ (matrices.stiffness @ motion)) / mass
        if value < -rounding:
            return None
        found.append(value if value > rounding else 0.0)
    return float(np.mean(found))


def check_speed(deck: Deck, matrices: Matrices, rotation: Rotation, *, of_study: bool = False) -> float | None:
    """Square of the speed, rad2/s2, at which the stiffness was made; None where it cannot be found.

    rotation: SI. Raises SceneError where it has another speed. of_study: whether the study gives it, not the deck.
    """
    held = omega_squared_of(deck, matrices, rotation.axis)
    if held is None or math.isclose(held, rotation.omega_squared, rel_tol=2.0 * SPEED_AGREES):
        return held
    speed, own = math.sqrt(rotation.omega_squared), math.sqrt(held)
    if of_study:
        found = f"{30.0 * speed / math.pi:g} rpm, the stiffness holds {30.0 * own / math.pi:.6g} rpm"
        raise SceneError("rotation_speed", found, "export the matrices at this speed, or leave it out")
    found = f"the deck spins at {speed:.6g} rad/s, the stiffness holds {own:.6g}"
    raise SceneError("matrices", found, _REMEDIES[matrices.code][2] if held == 0 else "give the files of one run")


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
        table.columns = [str(name).strip() for name in table]
        names = [name for name in table if name not in ("node", "dof")]
        values = table[names].fillna(0.0).to_numpy(dtype=np.float64)
        node, dof = table[["node", "dof"]].to_numpy(dtype=np.int64).T
        rows = pd.MultiIndex.from_arrays([number_modes(node, dof), dof])
        n_modes = int(np.count_nonzero((node == 0) & (dof == 0)))
    matrices = imported.matrices
    own = pd.MultiIndex.from_arrays([matrices.node, matrices.direction + 1]).get_indexer(rows)
    if not names or (own < 0).any():
        unknown = "no quantity" if not names else f"node {node[own < 0][0]} with dof {dof[own < 0][0]} is no row"
        remedy = f"give a column for each quantity, over the rows of {matrices.files[0]}"
        raise SceneError("recovery", f"{path.name}: {unknown}", remedy)
    given = int(np.count_nonzero((matrices.node < 0) & (matrices.direction < 0)))
    if 0 < n_modes < given:
        found = f"{path.name}: {n_modes} rows of node 0 and dof 0, {matrices.files[0]} has {given}"
        raise SceneError("recovery", found, "give all of them, in the order of the matrices")
    twice = [name for name in names if name in taken]
    if twice:
        raise SceneError("recovery", f"{path.name}: a response has the name {twice[0]} as well", "give another name")
    motions = {}
    for name, column in zip(names, values.T, strict=True):
        weights = np.zeros(imported.forms["mass"].shape[0])
        np.add.at(weights, imported.place[own], column / (units.length if name.endswith("]") else 1.0))
        motions[name] = weights
    return motions

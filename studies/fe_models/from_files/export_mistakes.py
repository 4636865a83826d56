"""Mistakes in the export of matrices: one function for each, from the deck and the matrices alone.

Each function raises SceneError with one sentence where the mistake was made, and otherwise returns what it has found.
"""

from __future__ import annotations

import math

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from studies.fe_models.deck.contents import Deck
from studies.fe_models.files import FloatArray, IntArray, Units
from studies.fe_models.from_files.solid import SPEED_AGREES
from studies.fe_models.matrices.matrices import Matrices
from studies.finite_element.elements import ELEMENT_KINDS
from studies.finite_element.solid_mesh import Rotation, volumes_of_points
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

_COUPLED = 1e-9
"""Relative stiffness between two surfaces above which they are coupled."""

_ROUNDING = 1e-13
"""Of an entry in a file: 14 digits, and what the code itself rounds."""

_MASS_AGREES = 0.02
"""Relative difference of two masses that are the same: a coarse mesh of curved bodies, point masses that are small."""

_LEAST_SHARE = 0.1
"""Of the mass that matrices without the fixed nodes have at least."""


def check_translations(matrices: Matrices) -> None:
    """All rows are displacements of nodes. Raises SceneError."""
    other = np.flatnonzero((matrices.direction < 0) | (matrices.direction > 2))
    if other.size:
        found = f"{matrices.files[0]}: node {matrices.node[other[0]]} has the dof {matrices.direction[other[0]] + 1}"
        remedy = "export a model of solid elements: dofs 1 to 3; to reduced matrices belongs a table of nodes, .csv"
        raise SceneError("matrices", found, remedy)


def check_nodes_have_dofs(matrices: Matrices, nodes: IntArray, name: str) -> None:
    """Every node (p,) of a surface or set, by its number, has all three dofs in the matrices. name: for the message."""
    wanted = np.unique(nodes)
    found, counts = np.unique(matrices.node, return_counts=True)
    whole = found[counts == 3]
    n_missing = int(np.count_nonzero(~np.isin(wanted, whole)))
    if not n_missing:
        return
    where = matrices.files[-1] if matrices.code == "calculix" else matrices.files[0]
    some = "have no dof" if not np.isin(wanted, found[counts < 3]).any() else "lack dofs"
    found_missing = f"{name}: {n_missing} of {wanted.size} nodes {some} in {where} (tied or fixed)"
    raise SceneError("matrices", found_missing, _REMEDIES[matrices.code][0])


def check_contact_removed(
    deck: Deck, matrices: Matrices, nodes: tuple[IntArray, IntArray], names: tuple[str, str], units: Units
) -> None:
    """The stiffness does not couple the two surfaces of a contact, other than through elements that have nodes of both.

    nodes: node numbers (p,) and (q,) of the surfaces. names: of the surfaces, for the message.
    """
    first, second = (np.flatnonzero(np.isin(matrices.node, members)) for members in nodes)
    part = sp.coo_array(matrices.stiffness[first][:, second])
    large = abs(part.data) > _COUPLED * abs(matrices.stiffness.diagonal()).max(initial=0.0)
    one, other = matrices.node[first[part.row[large]]], matrices.node[second[part.col[large]]]
    apart = ~_share_element(deck, one, other)
    if apart.any():
        largest = abs(part.data[large][apart]).max() * units.stiffness
        found = f"the stiffness couples {names[0]} and {names[1]} ({largest:.1e} N/m)"
        raise SceneError("matrices", found, _REMEDIES[matrices.code][1])


def _share_element(deck: Deck, one: IntArray, other: IntArray) -> NDArray[np.bool_]:
    """Whether the nodes (m,) and (m,) are the same, or nodes of one element."""
    together = np.array(one == other, dtype=bool)
    asked = np.union1d(one, other)
    for block in deck.blocks:
        elements, places = np.nonzero(np.isin(block.nodes, asked))
        rows = np.searchsorted(asked, block.nodes[elements, places])
        belongs = sp.csr_array((np.ones(rows.size), (rows, elements)), shape=(asked.size, block.numbers.size))
        common = sp.coo_array(belongs @ belongs.T)
        pairs = np.searchsorted(asked, one) * asked.size + np.searchsorted(asked, other)
        together |= np.isin(pairs, common.row.astype(np.int64) * asked.size + common.col)
    return together


def translation(deck: Deck, matrices: Matrices, direction: FloatArray) -> FloatArray:
    """A rigid translation (n_dof,) by the vector (3,); rows of nodes inside of elements (C3D8I) take no part."""
    return np.where(np.isin(matrices.node, deck.node_numbers), direction[matrices.direction], 0.0)


def mass_of(deck: Deck, matrices: Matrices) -> float:
    """Mass of the model in units of the file: the mean over the three directions."""
    motions = [translation(deck, matrices, axis) for axis in np.eye(3)]
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
        remedy = "give both of one run and in the same units, or a deck without *DENSITY"
        raise SceneError("matrices", f"{matrices.files[0]} and {deck.path}: {masses}", remedy)


def check_mesh_is_of_matrices(deck: Deck, matrices: Matrices) -> None:
    """Deck and matrices have nodes in common."""
    if not np.isin(matrices.node, deck.node_numbers).any():
        found = f"{matrices.files[0]} and {deck.path} have no node in common"
        raise SceneError("matrices", found, "give the mesh that the matrices were made of")


def omega_squared_of(deck: Deck, matrices: Matrices, axis: FloatArray) -> float | None:
    """Square of the speed, rad2/s2, at which the stiffness was made: only spin softening resists a translation.

    `Omega^2 = - t^T K t / t^T M t` for a rigid translation t along a unit vector (3,) across the axis. None where the
    model is held, so that other stiffness resists as well.
    """
    across = np.linalg.svd(axis[np.newaxis])[2][1:]
    found: list[float] = []
    for direction in across:
        motion = translation(deck, matrices, direction)
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

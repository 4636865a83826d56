"""A model of matrices and of a table of nodes: reduced matrices, as companies share them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from studies.fe_models.deck.mesh import Deck
from studies.fe_models.from_files.parameters import Parameters
from studies.fe_models.libraries.errors import library_errors
from studies.fe_models.matrices.matrices import FloatArray, IntArray, Matrices
from studies.fe_models.nodal_matrices import NodalMatrices
from studies.fe_models.units import Units
from studies.finite_element.joint_model import RowMotion
from studies.scene_error import SceneError

_OF_ELEMENTS = ("material", "rotation_speed")
"""Keys that need elements: the forces of rotation are among those of the matrices, or in `preload`."""


def check_table(deck: Deck, matrices: Matrices, parameters: Parameters, on_cut: IntArray) -> None:
    """Raises SceneError where a table of nodes and matrices do not go together, or a key needs elements.

    on_cut: numbers of the nodes on both cut faces.
    """
    for key in _OF_ELEMENTS:
        if getattr(parameters, key) is not None:
            remedy = "leave it out: reduced matrices have it in them, and forces stand in their load or in preload"
            raise SceneError(key, "the model is a table of nodes", remedy)
    if matrices.load is not None and matrices.load.shape[1] > 1:
        raise SceneError("matrices", f"{matrices.files[0]}: several load cases", "give one column of forces")
    lost = np.setdiff1d(deck.node_numbers, matrices.node)
    if len(lost):
        found = f"{len(lost)} nodes of {deck.path} have no row in {matrices.files[0]}, as node {lost[0]}"
        raise SceneError("matrices", found, "give the nodes that the matrices keep")
    turning = np.unique(matrices.node[np.isin(matrices.node, on_cut) & (matrices.direction > 2)])
    if len(turning):
        found = f"node {turning[0]} of a cut face has rotations"
        raise SceneError("cut_faces", found, "reduce the sector to the displacements of its cut faces")


def constant_forces(matrices: Matrices, nodal: NodalMatrices, units: Units, n_nodes: int) -> FloatArray:
    """Forces (3 n_nodes,), N, that stand beside the matrices."""
    found = np.zeros(3 * n_nodes)
    if matrices.load is not None:
        found[nodal.place] = matrices.load[:, 0] * units.force
    return found


def read_recovery(
    path: Path, matrices: Matrices, nodal: NodalMatrices, units: Units, taken: Collection[str]
) -> Mapping[str, RowMotion]:
    """Quantities by name, as sums over the displacements of a model.

    A quantity with a unit in its name, as "root stress [MPa]", has this unit; one without is a displacement, m. taken:
    names of other responses.

    Raises SceneError about "recovery" where a column is no numbers, a row is none of the matrices, or a name is taken.
    """
    with library_errors(path, "pandas", "pandas", "recovery"):
        table = pd.read_csv(path, skipinitialspace=True)
        names = [str(name).strip() for name in table if str(name).strip() not in ("node", "dof")]
        table.columns = [str(name).strip() for name in table]
        values = table[names].fillna(0.0).to_numpy(dtype=np.float64)
        rows = pd.MultiIndex.from_frame(table[["node", "dof"]])
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
        weights = np.zeros(nodal.missing.size)
        np.add.at(weights, nodal.place[own], column / (units.length if name.endswith("]") else 1.0))
        motions[name] = RowMotion(weights)
    return motions

"""Matrices of another program, row by row, in the order of the nodes of a mesh, in SI units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from solver.model import BoolArray, FloatArray, IntArray
from studies.fe_models.matrices.matrices import Matrices
from studies.fe_models.units import Units
from studies.finite_element.joint_model import MatrixModel


@dataclass(frozen=True)
class NodalMatrices:
    """A model of matrices with displacements node by node in x, y, z.

    model: nodes of the mesh, then those that only the matrices have; rows that are no displacement of a node, as modal
    coordinates, stand three by three behind them, as if of nodes without a place.
    missing (n_nodes, 3): displacements that the matrices do not have; their rows are empty, and they must be held.
    place (n_dof,): place of each row of the matrices in the displacements of the model.
    """

    model: MatrixModel
    missing: BoolArray
    place: IntArray


def order_by_nodes(matrices: Matrices, units: Units, numbers: IntArray, coordinates: FloatArray) -> NodalMatrices:
    """Matrices in the order of the nodes of a mesh. numbers (n_mesh,), coordinates (n_mesh, 3), m: its nodes."""
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
    model = MatrixModel(
        coordinates=np.vstack([coordinates, np.full((len(extra), 3), np.nan)]),
        numbers=everything,
        stiffness=ordered(matrices.stiffness),
        mass=ordered(matrices.mass),
        # seconds in all systems of units: N s/m from a damping as N/m from a stiffness
        damping=None if matrices.damping is None else ordered(matrices.damping),
    )
    return NodalMatrices(model, missing.reshape(-1, 3), place)

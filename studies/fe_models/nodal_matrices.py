"""Matrices of another program, row by row, in the order of the nodes of a mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from solver.model import BoolArray, FloatArray, IntArray
from studies.finite_element.elements.solid_mesh import Rotation
from studies.finite_element.joint_model import MatrixModel
from studies.scene_error import SceneError


@dataclass(frozen=True)
class NodalMatrices:
    """Matrices in the order of the nodes.

    numbers (n_nodes,): nodes of the mesh, then those that only the matrices have. coordinates (n_nodes, 3): m, NaN for
    the latter. stiffness, mass (3 n_nodes, 3 n_nodes): displacements node by node in x, y, z. missing (n_nodes, 3):
    displacements that the matrices do not have; their rows are empty, and they must be held.
    """

    numbers: IntArray
    coordinates: FloatArray
    stiffness: sparse.csr_matrix
    mass: sparse.csr_matrix
    missing: BoolArray

    def model(
        self,
        rotation: Rotation | None = None,
        preload: FloatArray | None = None,
        gravity: FloatArray | None = None,
        extra: IntArray | None = None,
    ) -> MatrixModel:
        """The model of them. extra (m,): numbers of further nodes, without matrices; for the rest see MatrixModel."""
        if extra is None or not len(extra):
            return MatrixModel(self.coordinates, self.numbers, self.stiffness, self.mass, rotation, preload, gravity)
        n = len(self.numbers) + len(extra)
        forms = self.stiffness.copy(), self.mass.copy()
        for form in forms:
            form.resize((3 * n, 3 * n))
        coordinates = np.vstack([self.coordinates, np.full((len(extra), 3), np.nan)])
        return MatrixModel(coordinates, np.concatenate([self.numbers, extra]), *forms, rotation, preload, gravity)


def order_by_nodes(
    stiffness: sparse.csr_matrix,
    mass: sparse.csr_matrix,
    node: IntArray,
    direction: IntArray,
    numbers: IntArray,
    coordinates: FloatArray,
) -> NodalMatrices:
    """Matrices (n_dof, n_dof) in the order of the nodes of a mesh.

    Parameters
    ----------
    stiffness, mass
        Symmetric, both triangles, N/m and kg.
    node, direction
        (n_dof,): number of the node and direction 0 to 2 of every row.
    numbers, coordinates
        (n_mesh,), (n_mesh, 3): nodes of the mesh, m.

    Raises
    ------
    SceneError
        Where a displacement has two rows.
    """
    extra = np.setdiff1d(node, numbers)
    everything = np.concatenate([numbers, extra]).astype(np.int64)
    order = np.argsort(everything)
    place = order[np.searchsorted(everything, node, sorter=order)]
    dof = 3 * place + direction
    unique, count = np.unique(dof, return_counts=True)
    if (count > 1).any():
        twice = unique[count > 1][0]
        raise SceneError(
            "matrices",
            f"displacement {twice % 3 + 1} of node {everything[twice // 3]} has more than one row",
            "export every displacement once",
        )
    n = 3 * len(everything)
    missing = np.ones(n, dtype=np.bool_)
    missing[dof] = False

    def ordered(matrix: sparse.csr_matrix) -> sparse.csr_matrix:
        entries = matrix.tocoo()
        return sparse.csr_matrix((entries.data, (dof[entries.row], dof[entries.col])), shape=(n, n))

    return NodalMatrices(
        numbers=everything,
        coordinates=np.vstack([coordinates, np.full((len(extra), 3), np.nan)]),
        stiffness=ordered(stiffness),
        mass=ordered(mass),
        missing=missing.reshape(-1, 3),
    )

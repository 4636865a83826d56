"""Positions in which layers of a mesh are looked for, for the order of elimination."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from solver.model import FloatArray
from studies.finite_element.joint.cut_faces import CutFaces


def find_layers(coordinates: FloatArray, coupled: sparse.csr_matrix, cut: CutFaces | None) -> FloatArray:
    """Coordinates (n_nodes, n_directions) in which layers of a mesh are looked for, over its extent.

    They are rounded, so that layers of a regular mesh are layers.
    """
    positions = _positions(coordinates, coupled)
    extent = np.ptp(positions, axis=0).max()
    directions = [positions]
    if cut is not None:
        directions.append(cut.axis.cylinder(positions) * [1.0, extent, 1.0])
    return np.asarray(np.round(np.hstack(directions) / extent, 7))


def find_couplings(matrix: sparse.csr_matrix) -> sparse.csr_matrix:
    """Which nodes (n_nodes, n_nodes) a matrix couples."""
    blocks = matrix.tobsr(blocksize=(3, 3))
    ones = np.ones(len(blocks.indices), dtype=np.float32)
    n = matrix.shape[0] // 3
    return sparse.csr_matrix((ones, blocks.indices, blocks.indptr), shape=(n, n))


def _positions(coordinates: FloatArray, coupled: sparse.csr_matrix) -> FloatArray:
    """Coordinates, those of nodes without a place from their neighbours."""
    nowhere = np.asarray(np.isnan(coordinates).any(axis=1))
    if not nowhere.any():
        return coordinates
    known = np.where(nowhere[:, None], 0.0, coordinates)
    count = np.maximum(coupled @ (~nowhere).astype(float), 1.0)
    return np.where(nowhere[:, None], (coupled @ known) / count[:, None], coordinates)

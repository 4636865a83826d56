"""A hexahedral mesh and its sparse matrices, before any boundary condition."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from solver.model import FloatArray, IntArray
from studies.scenes.finite_element.hex_element import HexElements

IN_PLANE = np.diag([1.0, 1.0, 0.0])


@dataclass(frozen=True)
class HexMesh:
    """nodes (n_nodes, 3): m. elements (n_elements, 8): corner nodes in the order of `hex_element.CORNERS`."""

    nodes: FloatArray
    elements: IntArray


@dataclass(frozen=True)
class SectorMatrices:
    """Unconstrained sparse matrices (3 n_nodes, 3 n_nodes), displacements node by node in x, y, z.

    stiffness: elastic, N/m. mass: kg. spin_mass: the part of `mass` that moves across the z axis, kg: `-Omega^2` times
    it is the spin softening. load (3 n_nodes,): centrifugal load at Omega = 1 rad/s, N s2.
    """

    stiffness: sparse.bsr_matrix
    mass: sparse.bsr_matrix
    spin_mass: sparse.bsr_matrix
    load: FloatArray


def assemble(element_matrices: FloatArray, elements: IntArray, n_nodes: int) -> sparse.bsr_matrix:
    """Sum of element matrices: (n_elements, 8, 8) gives (n_nodes, n_nodes), (n_elements, 24, 24) three times that.

    There is one block for each two nodes that share an element.
    """
    per_node = element_matrices.shape[1] // 8
    blocks = element_matrices.reshape(-1, 8, per_node, 8, per_node).transpose(0, 1, 3, 2, 4).reshape(-1, per_node**2)
    key = (elements[:, :, None] * n_nodes + elements[:, None, :]).ravel()
    order = np.argsort(key, kind="stable")
    key = key[order]
    first = np.flatnonzero(np.diff(key, prepend=-1))
    # Adds the blocks that stand at the same place.
    add = sparse.csr_matrix((np.ones(len(key)), order, np.append(first, len(key))), shape=(len(first), len(key)))
    starts = np.searchsorted(key[first], np.arange(n_nodes + 1) * n_nodes)
    data = (add @ blocks).reshape(-1, per_node, per_node)
    return sparse.bsr_matrix((data, key[first] % n_nodes, starts), shape=(per_node * n_nodes,) * 2)


def _in_directions(scalar: sparse.bsr_matrix, weights: FloatArray) -> sparse.bsr_matrix:
    """The matrix (3 n_nodes, 3 n_nodes) with the blocks `weights` (3, 3) times each entry of a scalar one."""
    blocks = scalar.data * weights
    return sparse.bsr_matrix((blocks, scalar.indices, scalar.indptr), shape=(3 * scalar.shape[0],) * 2)


def assemble_sector(mesh: HexMesh, hexes: HexElements) -> SectorMatrices:
    """Elastic stiffness, mass and centrifugal load of the elements `hexes` of the mesh; the rotation is about z."""
    n_nodes = len(mesh.nodes)
    scalar_mass = assemble(hexes.mass(), mesh.elements, n_nodes)
    spin_mass = _in_directions(scalar_mass, IN_PLANE)
    return SectorMatrices(
        stiffness=assemble(hexes.stiffness(), mesh.elements, n_nodes),
        mass=_in_directions(scalar_mass, np.eye(3)),
        spin_mass=spin_mass,
        # Isoparametric elements: the integral of N rho x is exactly the consistent mass times the nodal positions.
        load=spin_mass @ mesh.nodes.ravel(),
    )


def assemble_geometric_stiffness(mesh: HexMesh, hexes: HexElements, displacements: FloatArray) -> sparse.bsr_matrix:
    """Geometric stiffness (3 n_nodes, 3 n_nodes), N/m, of the linear stress under `displacements` (3 n_nodes,) in m."""
    local = displacements.reshape(-1, 3)[mesh.elements].reshape(len(mesh.elements), 24)
    scalar = assemble(hexes.geometric_stiffness(hexes.stress(local)), mesh.elements, len(mesh.nodes))
    return _in_directions(scalar, np.eye(3))

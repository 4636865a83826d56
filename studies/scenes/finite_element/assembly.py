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

    stiffness: sparse.csr_matrix
    mass: sparse.csr_matrix
    spin_mass: sparse.csr_matrix
    load: FloatArray


def assemble(element_matrices: FloatArray, elements: IntArray, n_nodes: int) -> sparse.csr_matrix:
    """Sum of element matrices: (n_elements, 8, 8) gives (n_nodes, n_nodes), (n_elements, 24, 24) three times that."""
    per_node = element_matrices.shape[1] // 8
    dofs = (per_node * elements[:, :, None] + np.arange(per_node)).reshape(len(elements), -1)
    n_local, n_dofs = dofs.shape[1], per_node * n_nodes
    rows = np.repeat(dofs, n_local, axis=1).ravel()
    columns = np.tile(dofs, (1, n_local)).ravel()
    return sparse.csr_matrix((element_matrices.ravel(), (rows, columns)), shape=(n_dofs, n_dofs))


def assemble_sector(mesh: HexMesh, hexes: HexElements) -> SectorMatrices:
    """Elastic stiffness, mass and centrifugal load of the elements `hexes` of the mesh; the rotation is about z."""
    n_nodes = len(mesh.nodes)
    scalar_mass = assemble(hexes.mass(), mesh.elements, n_nodes)
    spin_mass = sparse.kron(scalar_mass, IN_PLANE, format="csr")
    return SectorMatrices(
        stiffness=assemble(hexes.stiffness(), mesh.elements, n_nodes),
        mass=sparse.kron(scalar_mass, np.eye(3), format="csr"),
        spin_mass=spin_mass,
        # Isoparametric elements: the integral of N rho x is exactly the consistent mass times the nodal positions.
        load=spin_mass @ mesh.nodes.ravel(),
    )


def assemble_geometric_stiffness(mesh: HexMesh, hexes: HexElements, displacements: FloatArray) -> sparse.csr_matrix:
    """Geometric stiffness (3 n_nodes, 3 n_nodes), N/m, of the linear stress under `displacements` (3 n_nodes,) in m."""
    local = displacements.reshape(-1, 3)[mesh.elements].reshape(len(mesh.elements), 24)
    scalar = assemble(hexes.geometric_stiffness(hexes.stress(local)), mesh.elements, len(mesh.nodes))
    return sparse.kron(scalar, np.eye(3), format="csr")

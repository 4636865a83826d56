"""Sparse matrices of a mesh: elastic stiffness, mass, and what rotation adds to them.

Matrices are (3 n_nodes, 3 n_nodes), unconstrained, displacements node by node in x, y, z.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from solver.model import FloatArray, IntArray
from studies.finite_element.elements.element_matrices import ElementBatch, smallest_jacobians
from studies.finite_element.elements.kinds import ASSEMBLED_KINDS, ELEMENT_KINDS
from studies.finite_element.elements.solid_mesh import ElementGroup, Rotation, SolidMesh
from studies.scene_error import SceneError

_BATCH_BYTES = 32 * 2**20  # of intermediate arrays at a time
_ENTRIES = 8_000_000  # element entries that wait to be added up

Blocks = Callable[[ElementBatch, IntArray], FloatArray]
"""Element matrices of a batch, (e, n_local, n_local) or three times that, from the batch and its nodes."""


def check_elements(mesh: SolidMesh) -> None:
    """Raise SceneError where an element has no matrices here, or is turned inside out."""
    for group in mesh.groups:
        kind = ELEMENT_KINDS[group.kind]
        if not kind.assembled:
            raise SceneError(
                "model",
                f"element {group.numbers[0]} is a {group.kind}, whose matrices depend on the program",
                f"give matrices, or use one of {', '.join(ASSEMBLED_KINDS)}",
            )
        for chosen in _batches(group):
            wrong = np.flatnonzero(~(smallest_jacobians(kind, mesh.coordinates[group.nodes[chosen]]) > 0.0))
            if len(wrong):
                number = group.numbers[chosen][wrong[0]]
                raise SceneError(
                    "model",
                    f"element {number} ({group.kind}) is turned inside out",
                    "give its nodes in the order of CalculiX and Abaqus, or mend the mesh",
                )


def assemble_stiffness(mesh: SolidMesh) -> sparse.csr_matrix:
    """Elastic stiffness, N/m."""
    return _assemble(mesh, lambda batch, _: batch.stiffness(), per_node=3)


def assemble_mass(mesh: SolidMesh) -> sparse.csr_matrix:
    """Consistent mass, kg; it may be singular (C3D20R, C3D10)."""
    scalar = _assemble(mesh, lambda batch, _: batch.mass(), per_node=1)
    return sparse.kron(scalar, np.eye(3), format="csr")


def assemble_tangent_stiffness(mesh: SolidMesh, displacements: FloatArray) -> sparse.csr_matrix:
    """Stiffness, N/m, about a state of stress under nodal displacements (3 n_nodes,), m: see `tangent_stiffness`."""
    moved = displacements.reshape(-1, 3)
    return _assemble(mesh, lambda batch, nodes: batch.tangent_stiffness(moved[nodes]), per_node=3)


def spin_softening(mass: sparse.csr_matrix, rotation: Rotation) -> sparse.csr_matrix:
    """Spin softening, N/m: `-Omega^2` times the mass that moves across the axis. Coriolis forces are left out."""
    across = sparse.kron(sparse.eye(mass.shape[0] // 3), rotation.across, format="csr")
    return (-rotation.omega_squared) * (across @ mass @ across)


def centrifugal_load(mass: sparse.csr_matrix, coordinates: FloatArray, rotation: Rotation) -> FloatArray:
    """Centrifugal load (3 n_nodes,), N.

    The integral of N rho x is the consistent mass times the nodal positions: elements are isoparametric.
    """
    return np.asarray(rotation.omega_squared * (mass @ rotation.arms(coordinates).ravel()))


def _batches(group: ElementGroup) -> Iterator[slice]:
    """Elements of a group, few at a time."""
    kind = ELEMENT_KINDS[group.kind]
    n_local, n_points = group.nodes.shape[1], len(kind.rule.weights)
    # what an element needs on the way: strains or gradients at all points, and some copies of its matrix
    size = 8 * (4 * (3 * n_local) ** 2 + n_points * (36 * n_local + n_local**2))
    step = max(1, _BATCH_BYTES // size)
    for first in range(0, len(group.nodes), step):
        yield slice(first, first + step)


def _assemble(mesh: SolidMesh, blocks: Blocks, per_node: int) -> sparse.csr_matrix:
    """Sum of element matrices with `per_node` displacements a node, added up some elements at a time."""
    size = per_node * mesh.n_nodes
    total = sparse.csr_matrix((size, size))
    rows: list[NDArray[np.int32]] = []
    columns: list[NDArray[np.int32]] = []
    values: list[FloatArray] = []

    def added() -> sparse.csr_matrix:
        if not values:
            return total
        place = (np.concatenate(rows), np.concatenate(columns))
        part = sparse.csr_matrix((np.concatenate(values), place), shape=(size, size))
        for waiting in (rows, columns, values):
            waiting.clear()
        return total + part

    for group in mesh.groups:
        kind = ELEMENT_KINDS[group.kind]
        for chosen in _batches(group):
            nodes = group.nodes[chosen]
            matrices = blocks(ElementBatch(kind, mesh.coordinates[nodes], group.material), nodes)
            dofs = (per_node * nodes[:, :, None] + np.arange(per_node)).reshape(len(nodes), -1).astype(np.int32)
            rows.append(np.repeat(dofs, dofs.shape[1], axis=1).ravel())
            columns.append(np.tile(dofs, (1, dofs.shape[1])).ravel())
            values.append(matrices.ravel())
            if sum(len(each) for each in values) > _ENTRIES:
                total = added()
    return added()

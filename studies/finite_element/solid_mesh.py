"""An unstructured mesh of solid elements, and its sparse matrices: elastic stiffness, mass, what rotation adds to them.

Matrices are (3 n_nodes, 3 n_nodes), unconstrained, displacements node by node in x, y, z.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from solver.model import FloatArray, IntArray
from studies.finite_element.element_matrices import ElementBatch, Material, smallest_jacobians
from studies.finite_element.elements import ASSEMBLED_KINDS, ELEMENT_KINDS
from studies.scene_error import SceneError

_BATCH_BYTES = 16 * 2**20  # of intermediate arrays at a time
_ENTRIES = 8_000_000  # element entries that wait to be added up


@dataclass(frozen=True)
class ElementGroup:
    """Elements of one kind and one material.

    kind: a key of `ELEMENT_KINDS`. nodes (n_elements, n_local): rows of `SolidMesh.coordinates`. numbers (n_elements,):
    in the file, for messages and surfaces. part: label for pictures.
    """

    kind: str
    nodes: IntArray
    numbers: IntArray
    material: Material
    part: str = ""


@dataclass(frozen=True)
class SolidMesh:
    """coordinates (n_nodes, 3): m. numbers (n_nodes,): of the nodes in the file, for messages. groups: the elements."""

    coordinates: FloatArray
    numbers: IntArray
    groups: tuple[ElementGroup, ...]

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.coordinates)

    @property
    def bodies(self) -> IntArray:
        """Body (n_nodes,) of each node: what elements join is one body, as are nodes without elements."""
        if not self.groups:
            return np.zeros(self.n_nodes, dtype=np.int64)
        first = np.concatenate([np.repeat(group.nodes[:, 0], group.nodes.shape[1]) for group in self.groups])
        second = np.concatenate([group.nodes.ravel() for group in self.groups])
        joints = sparse.coo_matrix((np.ones(len(first), dtype=np.int8), (first, second)), (self.n_nodes, self.n_nodes))
        return np.asarray(connected_components(joints, directed=False)[1], dtype=np.int64)


@dataclass(frozen=True)
class Rotation:
    """Rotation at constant speed. omega_squared: rad2/s2. point (3,): on the axis, m. axis (3,): unit vector."""

    omega_squared: float
    point: FloatArray
    axis: FloatArray

    @property
    def across(self) -> FloatArray:
        """Projection (3, 3) on the plane across the axis."""
        return np.asarray(np.eye(3) - np.outer(self.axis, self.axis))


def check_elements(mesh: SolidMesh) -> None:
    """Raises SceneError where an element has no matrices here, or is turned inside out."""
    for group in mesh.groups:
        kind = ELEMENT_KINDS[group.kind]
        if not kind.assembled:
            found = f"element {group.numbers[0]} is a {group.kind}, whose matrices depend on the program"
            raise SceneError("model", found, f"give matrices, or use one of {', '.join(ASSEMBLED_KINDS)}")
        for chosen in _batches(group):
            wrong = np.flatnonzero(~(smallest_jacobians(kind, mesh.coordinates[group.nodes[chosen]]) > 0.0))
            if len(wrong):
                found = f"element {group.numbers[chosen][wrong[0]]} is turned inside out"
                remedy = "give its nodes in the order of CalculiX and Abaqus, or mend the mesh"
                raise SceneError("model", found, remedy)


def assemble_stiffness(mesh: SolidMesh) -> sparse.csr_matrix:
    """Elastic stiffness, N/m."""
    return _assemble(mesh, lambda batch, _: batch.stiffness(), per_node=3)


def assemble_mass(mesh: SolidMesh) -> sparse.csr_matrix:
    """Consistent mass, kg; it may be singular (C3D20R, C3D10)."""
    scalar = _assemble(mesh, lambda batch, _: batch.mass(), per_node=1)
    return sparse.kron(scalar, np.eye(3), format="csr")


def assemble_tangent_stiffness(mesh: SolidMesh, displacements: FloatArray) -> sparse.csr_matrix:
    """Stiffness, N/m, about nodal displacements (3 n_nodes,), m: see `ElementBatch.tangent_stiffness`."""
    moved = displacements.reshape(-1, 3)
    return _assemble(mesh, lambda batch, nodes: batch.tangent_stiffness(moved[nodes]), per_node=3)


def spin_softening(mass: sparse.csr_matrix, rotation: Rotation) -> sparse.csr_matrix:
    """Spin softening, N/m: `-Omega^2` times the mass that moves across the axis. Coriolis forces are left out."""
    across = sparse.kron(sparse.eye(mass.shape[0] // 3), rotation.across, format="csr")
    return (-rotation.omega_squared) * (across @ mass @ across)


def centrifugal_load(mass: sparse.csr_matrix, coordinates: FloatArray, rotation: Rotation) -> FloatArray:
    """Centrifugal load (3 n_nodes,), N: elements are isoparametric, so that int N rho x is mass times positions.

    What has no place, NaN, has no arm: an amplitude within an element.
    """
    arms = np.nan_to_num(coordinates - rotation.point) @ rotation.across
    return np.asarray(rotation.omega_squared * (mass @ arms.ravel()))


def _batches(group: ElementGroup) -> Iterator[slice]:
    """Elements of a group, few at a time."""
    n_local, n_points = group.nodes.shape[1], len(ELEMENT_KINDS[group.kind].rule.weights)
    # what an element needs on the way: gradients at all points, and some copies of its matrix
    size = 8 * (4 * (3 * n_local) ** 2 + n_points * (36 * n_local + n_local**2))
    step = max(1, _BATCH_BYTES // size)
    for first in range(0, len(group.nodes), step):
        yield slice(first, first + step)


def _assemble(
    mesh: SolidMesh, matrices_of: Callable[[ElementBatch, IntArray], FloatArray], per_node: int
) -> sparse.csr_matrix:
    """Sum of the element matrices of batches and their nodes, `per_node` displacements a node."""
    size = per_node * mesh.n_nodes
    total = sparse.csr_matrix((size, size))
    waiting: list[tuple[NDArray[np.int32], NDArray[np.int32], FloatArray]] = []

    def added() -> sparse.csr_matrix:
        if not waiting:
            return total
        rows, columns, values = (np.concatenate(each) for each in zip(*waiting, strict=True))
        waiting.clear()
        return total + sparse.csr_matrix((values, (rows, columns)), shape=(size, size))

    for group in mesh.groups:
        for chosen in _batches(group):
            nodes = group.nodes[chosen]
            batch = ElementBatch(ELEMENT_KINDS[group.kind], mesh.coordinates[nodes], group.material)
            dofs = (per_node * nodes[:, :, None] + np.arange(per_node)).reshape(len(nodes), -1).astype(np.int32)
            rows, columns = np.repeat(dofs, dofs.shape[1], axis=1), np.tile(dofs, (1, dofs.shape[1]))
            waiting.append((rows.ravel(), columns.ravel(), matrices_of(batch, nodes).ravel()))
            if sum(len(values) for _, _, values in waiting) > _ENTRIES:
                total = added()
    return added()

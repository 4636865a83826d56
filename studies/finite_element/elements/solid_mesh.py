"""An unstructured mesh of solid elements, in arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from solver.model import FloatArray, IntArray


@dataclass(frozen=True)
class Material:
    """Isotropic linear elastic material.

    young_modulus: Pa.
    poisson_ratio: 1.
    density: kg/m3.
    """

    young_modulus: float
    poisson_ratio: float
    density: float


@dataclass(frozen=True)
class ElementGroup:
    """Elements of one kind and one material.

    kind: a key of `kinds.ELEMENT_KINDS`.
    nodes (n_elements, n_local): rows of `SolidMesh.coordinates`, in the order of CalculiX and Abaqus.
    numbers (n_elements,): in the file, for messages and surfaces.
    material: of all elements.
    part: label for pictures.
    """

    kind: str
    nodes: IntArray
    numbers: IntArray
    material: Material
    part: str = ""


@dataclass(frozen=True)
class SolidMesh:
    """A mesh.

    coordinates (n_nodes, 3): m.
    numbers (n_nodes,): of the nodes in the file, for messages.
    groups: the elements.
    """

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
        return joined_bodies(
            self.n_nodes,
            np.concatenate([np.repeat(group.nodes[:, 0], group.nodes.shape[1]) for group in self.groups]),
            np.concatenate([group.nodes.ravel() for group in self.groups]),
        )


def joined_bodies(n_nodes: int, first: IntArray, second: IntArray) -> IntArray:
    """Body (n_nodes,) of each node, where nodes first (n,) are joined to nodes second (n,)."""
    joints = coo_matrix((np.ones(len(first), dtype=np.int8), (first, second)), shape=(n_nodes, n_nodes))
    return np.asarray(connected_components(joints, directed=False)[1], dtype=np.int64)


@dataclass(frozen=True)
class Rotation:
    """Rotation at constant speed.

    omega_squared: square of the angular speed, rad2/s2.
    point (3,): on the axis, m.
    axis (3,): unit vector.
    """

    omega_squared: float
    point: FloatArray
    axis: FloatArray

    @property
    def across(self) -> FloatArray:
        """Projection (3, 3) on the plane across the axis."""
        return np.asarray(np.eye(3) - np.outer(self.axis, self.axis))

    def arms(self, coordinates: FloatArray) -> FloatArray:
        """Vectors (n_nodes, 3) from the axis to the nodes, m."""
        return np.asarray((coordinates - self.point) @ self.across)

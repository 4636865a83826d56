"""An unstructured mesh of solid elements, and its sparse matrices: elastic stiffness, mass, what rotation adds to them.

Matrices are (3 n_nodes, 3 n_nodes), unconstrained, displacements node by node in x, y, z.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from solver.model import FloatArray, IntArray
from studies.finite_element.elements import ASSEMBLED_KINDS, ELEMENT_KINDS, ElementKind
from studies.scene_error import SceneError

_BATCH_BYTES = 16 * 2**20  # of intermediate arrays at a time
_ENTRIES = 8_000_000  # element entries that wait to be added up


@dataclass(frozen=True)
class Material:
    """Isotropic linear elastic material. Units: Pa, 1, kg/m3."""

    young_modulus: float
    poisson_ratio: float
    density: float


@dataclass(frozen=True)
class ElementGroup:
    """Elements of one kind, a key of `ELEMENT_KINDS`, and one material.

    nodes (n_elements, n_local): rows of `SolidMesh.coordinates`. numbers (n_elements,): in the file. part: label for
    pictures.
    """

    kind: str
    nodes: IntArray
    numbers: IntArray
    material: Material
    part: str = ""


@dataclass(frozen=True)
class SolidMesh:
    """coordinates (n_nodes, 3): m, NaN for nodes without a place. numbers (n_nodes,): of the nodes in the file."""

    coordinates: FloatArray
    numbers: IntArray
    groups: tuple[ElementGroup, ...]

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.coordinates)

    def with_nodes(self, numbers: IntArray) -> "SolidMesh":
        """The mesh with further nodes (m,), without elements or a place: others follow them."""
        coordinates = np.vstack([self.coordinates, np.full((len(numbers), 3), np.nan)])
        return SolidMesh(coordinates, np.concatenate([self.numbers, numbers]), self.groups)

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


def find_places(wanted: IntArray, numbers: IntArray) -> IntArray:
    """Places of numbers, of any shape, among others (n,), the first of equal ones; -1 of those that are not there."""
    if not len(numbers):
        return np.full(np.shape(wanted), -1)
    order = np.argsort(numbers, kind="stable")
    places = order[np.minimum(np.searchsorted(numbers, wanted, sorter=order), len(numbers) - 1)]
    return np.where(numbers[places] == wanted, places, -1)


def rigid_motions(points: FloatArray) -> FloatArray:
    """Motions (n, 3, 6) of points (n, 3), m, as one body: three translations, m, and turns about the axes, rad."""
    turns = np.swapaxes(np.cross(np.eye(3), points[:, None]), 1, 2)
    return np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns], axis=2)


def check_elements(mesh: SolidMesh) -> None:
    """Raises SceneError where an element has no matrices here, or is turned inside out."""
    for group in mesh.groups:
        kind = ELEMENT_KINDS[group.kind]
        if not kind.assembled:
            found = f"element {group.numbers[0]} is a {group.kind}, whose matrices depend on the program"
            alike = [each for each in ASSEMBLED_KINDS if ELEMENT_KINDS[each].reference is kind.reference]
            read = f'read_as = {{{group.kind} = "{alike[-1]}"}}, '
            raise SceneError("model", found, f"give {read}matrices, or use one of {', '.join(ASSEMBLED_KINDS)}")
        for chosen in _batches(group):
            wrong = np.flatnonzero(~(volumes_of_points(kind, mesh.coordinates[group.nodes[chosen]]).min(axis=1) > 0.0))
            if len(wrong):
                found = f"element {group.numbers[chosen][wrong[0]]} is turned inside out"
                remedy = "give its nodes in the order of CalculiX and Abaqus, or change the geometry"
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

    What has no place, NaN, an amplitude within an element, has no arm.
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
    mesh: SolidMesh, matrices_of: "Callable[[ElementBatch, IntArray], FloatArray]", per_node: int
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


def volumes_of_points(kind: ElementKind, coordinates: FloatArray) -> FloatArray:
    """Volumes (n_elements, n_points), m3, of integration points, < 0 inside out; coordinates (n_elements, n, 3)."""
    return np.asarray(np.linalg.det(_jacobians(kind, coordinates, kind.rule.points)) * kind.rule.weights)


def _jacobians(kind: ElementKind, coordinates: FloatArray, points: FloatArray) -> FloatArray:
    """dx/dxi (n_elements, n_points, 3 reference directions, 3 directions) at reference points (n_points, 3)."""
    derivatives = np.swapaxes(kind.reference.derivatives(points), 1, 2)
    return np.asarray(np.matmul(derivatives[None], coordinates[:, None]))


@dataclass(frozen=True)
class ElementBatch:
    """Matrices of elements of one kind and material. coordinates (n_elements, n_local, 3): m. Stress is (3, 3), Pa.

    The hexahedron C3D8I has the nine incompatible modes `1 - xi^2, 1 - eta^2, 1 - zeta^2` in three directions, which
    let it bend without locking (Wilson et al. 1973). Their gradients are taken with the Jacobian at the centre, scaled
    by `det J0 / det J`, so that distorted elements pass the patch test (Taylor, Beresford and Wilson 1976). They are
    condensed element by element.
    """

    kind: ElementKind
    coordinates: FloatArray
    material: Material

    @cached_property
    def _lame(self) -> tuple[float, float]:
        """Lame's constants, Pa: lambda and the shear modulus."""
        young, poisson = self.material.young_modulus, self.material.poisson_ratio
        return young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)), young / (2.0 * (1.0 + poisson))

    @cached_property
    def _geometry(self) -> tuple[FloatArray, FloatArray]:
        """Gradients (n_elements, n_points, n_local, 3), 1/m, and volumes (n_elements, n_points), m3, of the points."""
        rule = self.kind.rule
        jacobians = _jacobians(self.kind, self.coordinates, rule.points)
        inverse = np.swapaxes(np.linalg.inv(jacobians), -1, -2)
        gradients = np.matmul(self.kind.reference.derivatives(rule.points)[None], inverse)
        return gradients, np.linalg.det(jacobians) * rule.weights

    @cached_property
    def _functions(self) -> FloatArray:
        """Gradients of the shape functions, those of the three incompatible functions behind them."""
        gradients, volumes = self._geometry
        if not self.kind.incompatible_modes:
            return gradients
        centre = _jacobians(self.kind, self.coordinates, np.zeros((1, 3)))
        scale = np.linalg.det(centre) / volumes  # the weights of the rule are 1
        # derivative -2 xi_a of 1 - xi_a^2 along reference direction a
        inner = -2.0 * self.kind.rule.points[None, :, :, None] * np.swapaxes(np.linalg.inv(centre), -1, -2)
        return np.concatenate([gradients, inner * scale[:, :, None, None]], axis=2)

    @cached_property
    def _whole_stiffness(self) -> FloatArray:
        """Elastic stiffness of shape functions and incompatible functions, three displacements each."""
        return self._elastic(self._functions, None)

    @cached_property
    def _inner_from_nodes(self) -> FloatArray:
        """Amplitudes (n_elements, 9, 24) of the incompatible modes from the nodal displacements."""
        n = 3 * self.coordinates.shape[1]
        whole = self._whole_stiffness
        return np.asarray(-np.linalg.solve(whole[:, n:, n:], whole[:, n:, :n]))

    def stiffness(self) -> FloatArray:
        """Elastic stiffness (n_elements, 3 n_local, 3 n_local), N/m."""
        whole, n = self._whole_stiffness, 3 * self.coordinates.shape[1]
        if not self.kind.incompatible_modes:
            return whole.copy()
        condensed = whole[:, :n, :n] + whole[:, :n, n:] @ self._inner_from_nodes
        return np.asarray(0.5 * (condensed + np.swapaxes(condensed, 1, 2)))

    def mass(self) -> FloatArray:
        """Consistent mass (n_elements, n_local, n_local), kg, the same for the three directions."""
        values = self.kind.reference.values(self.kind.rule.points)
        products = values[:, :, None] * values[:, None, :]
        return np.asarray(self.material.density * np.tensordot(self._geometry[1], products, axes=(1, 0)))

    def stress(self, displacements: FloatArray) -> FloatArray:
        """Linear elastic stress (n_elements, n_points, 3, 3), Pa, under displacements (n_elements, n_local, 3), m."""
        n_elements = len(displacements)
        if self.kind.incompatible_modes:
            inner = self._inner_from_nodes @ displacements.reshape(n_elements, -1, 1)
            displacements = np.concatenate([displacements, inner.reshape(n_elements, 3, 3)], axis=1)
        slopes = np.matmul(np.swapaxes(self._functions, -1, -2), displacements[:, None])
        lame, shear = self._lame
        dilatation = np.trace(slopes, axis1=-2, axis2=-1)[..., None, None]
        return np.asarray(lame * dilatation * np.eye(3) + shear * (slopes + np.swapaxes(slopes, -1, -2)))

    def tangent_stiffness(self, displacements: FloatArray) -> FloatArray:
        """Stiffness (n_elements, 3 n_local, 3 n_local), N/m, about displacements (n_elements, n_local, 3), m.

        Stress stiffening `int grad N_a . stress . grad N_b dV` by the linear elastic stress (Bathe, Finite Element
        Procedures, sec. 6.3), and the elastic stiffness with the variation `sym(F^T grad v)` of Green's strain in place
        of `sym(grad v)`, `F = 1 + grad u`: together what CalculiX takes after a linear static step. Elements with
        incompatible modes have their stress stiffening only.
        """
        gradients, volumes = self._geometry
        if self.kind.incompatible_modes:
            result = self.stiffness()
        else:
            slopes = np.matmul(np.swapaxes(displacements, 1, 2)[:, None], gradients)
            result = self._elastic(gradients, np.eye(3) + slopes)
        weighted = self.stress(displacements) * volumes[:, :, None, None]
        stiffening = (gradients @ weighted @ np.swapaxes(gradients, -1, -2)).sum(axis=1)
        n_elements, n_local = displacements.shape[:2]
        blocks = result.reshape(n_elements, n_local, 3, n_local, 3)
        for direction in range(3):
            blocks[:, :, direction, :, direction] += stiffening
        return result

    def _elastic(self, gradients: FloatArray, deformation: FloatArray | None) -> FloatArray:
        """Elastic stiffness of functions with gradients (n_elements, n_points, n, 3), (n_elements, 3 n, 3 n).

        deformation (n_elements, n_points, 3, 3): F; None for the unit tensor. Entry (a m, b n) is
        `lambda h_am h_bn + mu (h_an h_bm + (F F^T)_mn g_ak g_bk)` with `h_am = F_mi g_ai`.
        """
        volumes, (lame, shear) = self._geometry[1], self._lame
        n_elements, n_points, n, _ = gradients.shape
        moved = gradients if deformation is None else np.matmul(gradients, np.swapaxes(deformation, -1, -2))
        flat = moved.reshape(n_elements, n_points, 3 * n)
        products = np.matmul(np.swapaxes(flat * volumes[:, :, None], 1, 2), flat)
        blocks = products.reshape(n_elements, n, 3, n, 3)
        result = lame * blocks + shear * np.swapaxes(blocks, 2, 4)
        if deformation is None:
            trace = shear * np.einsum("eaibi->eab", blocks)
            for direction in range(3):
                result[:, :, direction, :, direction] += trace
        else:
            stretch = np.matmul(deformation, np.swapaxes(deformation, -1, -2)) * (shear * volumes)[:, :, None, None]
            scalar = np.matmul(gradients, np.swapaxes(gradients, -1, -2)).reshape(n_elements, n_points, -1)
            mixed = np.matmul(np.swapaxes(scalar, 1, 2), stretch.reshape(n_elements, n_points, 9))
            result += np.moveaxis(mixed.reshape(n_elements, n, n, 3, 3), 3, 2)
        return np.asarray(result.reshape(n_elements, 3 * n, 3 * n))

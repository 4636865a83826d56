"""Matrices of a batch of elements of one kind and one material.

Displacements stand node by node in x, y, z. Stress is a full tensor (3, 3), Pa.

The hexahedron C3D8I has the nine incompatible modes `1 - xi^2, 1 - eta^2, 1 - zeta^2` in three directions, which let
it bend without locking (Wilson et al. 1973). Their gradients are taken with the Jacobian at the centre, scaled by
`det J0 / det J`, so that distorted elements pass the patch test (Taylor, Beresford and Wilson 1976). They are condensed
element by element.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from solver.model import FloatArray
from studies.finite_element.elements import ElementKind


@dataclass(frozen=True)
class Material:
    """Isotropic linear elastic material. Units: Pa, 1, kg/m3."""

    young_modulus: float
    poisson_ratio: float
    density: float


def smallest_jacobians(kind: ElementKind, coordinates: FloatArray) -> FloatArray:
    """Smallest Jacobian determinant (n_elements,) at the integration points; coordinates (n_elements, n_local, 3)."""
    return np.asarray(np.linalg.det(_jacobians(kind, coordinates, kind.rule.points)).min(axis=1))


def element_volumes(kind: ElementKind, coordinates: FloatArray) -> FloatArray:
    """Volume (n_elements,) of elements; coordinates (n_elements, n_local, 3)."""
    return np.asarray(np.linalg.det(_jacobians(kind, coordinates, kind.rule.points)) @ kind.rule.weights)


def _jacobians(kind: ElementKind, coordinates: FloatArray, points: FloatArray) -> FloatArray:
    """dx/dxi (n_elements, n_points, 3 reference directions, 3 directions) at reference points (n_points, 3)."""
    derivatives = np.swapaxes(kind.reference.derivatives(points), 1, 2)
    return np.asarray(np.matmul(derivatives[None], coordinates[:, None]))


@dataclass(frozen=True)
class ElementBatch:
    """Elements of one kind and material. coordinates (n_elements, n_local, 3): m."""

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

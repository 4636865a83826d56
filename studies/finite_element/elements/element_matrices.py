"""Element matrices of a batch of elements of one kind and one material.

Displacements stand node by node in x, y, z. Stress is a full tensor (3, 3), Pa. Integration as in `kinds`. Elements
with incompatible modes are those of `studies.finite_element.elements.hex_element`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from solver.model import FloatArray
from studies.finite_element.elements.hex_element import HexElements, elasticity_matrix
from studies.finite_element.elements.kinds import ElementKind
from studies.finite_element.elements.solid_mesh import Material

_TENSOR = [[0, 3, 5], [3, 1, 4], [5, 4, 2]]  # of a stress vector in the order of `hex_element`


def smallest_jacobians(kind: ElementKind, coordinates: FloatArray) -> FloatArray:
    """Smallest Jacobian determinant (n_elements,) at the integration points; coordinates (n_elements, n_local, 3)."""
    return np.asarray(np.linalg.det(_jacobians(kind, coordinates)).min(axis=1))


def element_volumes(kind: ElementKind, coordinates: FloatArray) -> FloatArray:
    """Volume (n_elements,) of elements; coordinates (n_elements, n_local, 3)."""
    return np.asarray(np.linalg.det(_jacobians(kind, coordinates)) @ kind.rule.weights)


def _jacobians(kind: ElementKind, coordinates: FloatArray) -> FloatArray:
    """dx/dxi (n_elements, n_points, 3 reference directions, 3 directions)."""
    derivatives = np.swapaxes(kind.reference.derivatives(kind.rule.points), 1, 2)
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
    def _hexes(self) -> HexElements:
        material = self.material
        elasticity = elasticity_matrix(material.young_modulus, material.poisson_ratio)
        return HexElements(self.coordinates, elasticity)

    @cached_property
    def _geometry(self) -> tuple[FloatArray, FloatArray]:
        """Gradients (n_elements, n_points, n_local, 3), 1/m, and volumes (n_elements, n_points), m3, of the points."""
        rule = self.kind.rule
        jacobians = _jacobians(self.kind, self.coordinates)
        inverse = np.swapaxes(np.linalg.inv(jacobians), -1, -2)
        gradients = np.matmul(self.kind.reference.derivatives(rule.points)[None], inverse)
        return gradients, np.linalg.det(jacobians) * rule.weights

    def stiffness(self) -> FloatArray:
        """Elastic stiffness (n_elements, 3 n_local, 3 n_local), N/m."""
        if self.kind.incompatible_modes:
            return self._hexes.stiffness()
        gradients, volumes = self._geometry
        n_elements, n_points, n_local, _ = gradients.shape
        flat = gradients.reshape(n_elements, n_points, 3 * n_local)
        products = np.matmul(np.swapaxes(flat * volumes[:, :, None], 1, 2), flat)
        # Entry (a i, b j): lambda g_ai g_bj + mu (g_aj g_bi + delta_ij g_ak g_bk).
        blocks = products.reshape(n_elements, n_local, 3, n_local, 3)
        lame, shear = self._lame
        result = lame * blocks + shear * np.swapaxes(blocks, 2, 4)
        trace = shear * np.einsum("eaibi->eab", blocks)
        for direction in range(3):
            result[:, :, direction, :, direction] += trace
        return np.asarray(result.reshape(n_elements, 3 * n_local, 3 * n_local))

    def mass(self) -> FloatArray:
        """Consistent mass (n_elements, n_local, n_local), kg, the same for the three directions."""
        values = self.kind.reference.values(self.kind.rule.points)
        products = values[:, :, None] * values[:, None, :]
        return np.asarray(self.material.density * np.tensordot(self._geometry[1], products, axes=(1, 0)))

    def stress(self, displacements: FloatArray) -> FloatArray:
        """Linear elastic stress (n_elements, n_points, 3, 3), Pa, under displacements (n_elements, n_local, 3), m."""
        if self.kind.incompatible_modes:
            vectors = self._hexes.stress(displacements.reshape(len(displacements), -1))
            return np.asarray(vectors[:, :, _TENSOR])
        gradients, _ = self._geometry
        slopes = np.matmul(np.swapaxes(gradients, -1, -2), displacements[:, None])
        lame, shear = self._lame
        dilatation = np.trace(slopes, axis1=-2, axis2=-1)[..., None, None]
        return np.asarray(lame * dilatation * np.eye(3) + shear * (slopes + np.swapaxes(slopes, -1, -2)))

    def stress_stiffening(self, displacements: FloatArray) -> FloatArray:
        """Stress stiffening (n_elements, n_local, n_local), N/m, the same for the three directions.

        `int grad N_a . stress . grad N_b dV` with the stress under displacements (n_elements, n_local, 3), m (Bathe,
        Finite Element Procedures, sec. 6.3).
        """
        gradients, volumes = self._geometry
        weighted = self.stress(displacements) * volumes[:, :, None, None]
        return np.asarray((gradients @ weighted @ np.swapaxes(gradients, -1, -2)).sum(axis=1))

    def tangent_stiffness(self, displacements: FloatArray) -> FloatArray:
        """Stiffness (n_elements, 3 n_local, 3 n_local), N/m, about displacements (n_elements, n_local, 3), m.

        Stress stiffening by the linear elastic stress, and the elastic stiffness with the variation `sym(F^T grad v)`
        of Green's strain in place of `sym(grad v)`, where `F = 1 + grad u`: together what CalculiX takes after a linear
        static step. Elements with incompatible modes have their stress stiffening only.
        """
        result = self.stiffness() if self.kind.incompatible_modes else self._elastic_about(displacements)
        n_elements, n_local = displacements.shape[:2]
        blocks = result.reshape(n_elements, n_local, 3, n_local, 3)
        stiffening = self.stress_stiffening(displacements)
        for direction in range(3):
            blocks[:, :, direction, :, direction] += stiffening
        return result

    def _elastic_about(self, displacements: FloatArray) -> FloatArray:
        gradients, volumes = self._geometry
        n_elements, n_points, n_local, _ = gradients.shape
        deformation = np.eye(3) + np.matmul(np.swapaxes(displacements, 1, 2)[:, None], gradients)
        # Entry (a m, b n), with h_am = F_mi g_ai: lambda h_am h_bn + mu (h_an h_bm + (F F^T)_mn g_ak g_bk).
        moved = np.matmul(gradients, np.swapaxes(deformation, -1, -2)).reshape(n_elements, n_points, 3 * n_local)
        products = np.matmul(np.swapaxes(moved * volumes[:, :, None], 1, 2), moved)
        blocks = products.reshape(n_elements, n_local, 3, n_local, 3)
        lame, shear = self._lame
        result = lame * blocks + shear * np.swapaxes(blocks, 2, 4)
        stretch = np.matmul(deformation, np.swapaxes(deformation, -1, -2)) * (shear * volumes)[:, :, None, None]
        scalar = np.matmul(gradients, np.swapaxes(gradients, -1, -2)).reshape(n_elements, n_points, -1)
        mixed = np.matmul(np.swapaxes(scalar, 1, 2), stretch.reshape(n_elements, n_points, 9))
        mixed = mixed.reshape(n_elements, n_local, n_local, 3, 3)
        result += np.moveaxis(mixed, 3, 2)
        return np.asarray(result.reshape(n_elements, 3 * n_local, 3 * n_local))

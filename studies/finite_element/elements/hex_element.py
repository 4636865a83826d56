"""Trilinear hexahedron with incompatible modes, all elements of a mesh at once.

The nine incompatible modes `1 - xi^2, 1 - eta^2, 1 - zeta^2` in three directions let the element bend without locking
(Wilson et al. 1973). Their gradients are taken with the Jacobian at the centre, scaled by `det J0 / det J`, so that
distorted elements pass the patch test (Taylor, Beresford and Wilson 1976). They are condensed element by element.
Integration is 2 x 2 x 2 Gauss points throughout.

Stress and strain are in the order xx, yy, zz, xy, yz, zx with engineering shear strains. The nodes of an element are
in the order of `CORNERS`: counterclockwise at zeta = -1, then the same at zeta = +1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from solver.model import FloatArray

CORNERS: FloatArray = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], dtype=float
)
GAUSS_POINTS: FloatArray = CORNERS / np.sqrt(3.0)
# Elements computed at a time, so that what is kept of them on the way stays in the cache.
_BATCH = 128
# Row of the strain vector, direction of the displacement, direction of the derivative.
_STRAIN_TERMS = ((0, 0, 0), (1, 1, 1), (2, 2, 2), (3, 0, 1), (3, 1, 0), (4, 1, 2), (4, 2, 1), (5, 0, 2), (5, 2, 0))


def shape_derivatives(points: FloatArray) -> FloatArray:
    """Derivatives (n_points, 8, 3) of the shape functions by the reference coordinates at points (n_points, 3)."""
    factors = 1.0 + points[:, None, :] * CORNERS[None]
    derivatives = np.empty(factors.shape)
    for axis in range(3):
        first, second = (other for other in range(3) if other != axis)
        derivatives[:, :, axis] = CORNERS[:, axis] * factors[:, :, first] * factors[:, :, second] / 8.0
    return derivatives


def elasticity_matrix(young_modulus: float, poisson_ratio: float) -> FloatArray:
    """Isotropic elasticity (6, 6), Pa, from Young's modulus in Pa and Poisson's ratio."""
    shear = young_modulus / (2.0 * (1.0 + poisson_ratio))
    lame = young_modulus * poisson_ratio / ((1.0 + poisson_ratio) * (1.0 - 2.0 * poisson_ratio))
    matrix = np.diag([2.0 * shear] * 3 + [shear] * 3)
    matrix[:3, :3] += lame
    return matrix


def _strain_rows(gradients: FloatArray) -> FloatArray:
    """Strain-displacement matrices (..., 6, 3 n) from the gradients (..., n, 3) of n scalar functions."""
    n_functions = gradients.shape[-2]
    rows = np.zeros((*gradients.shape[:-2], 6, 3 * n_functions))
    for strain, direction, derivative in _STRAIN_TERMS:
        rows[..., strain, direction::3] = gradients[..., derivative]
    return rows


@dataclass(frozen=True)
class HexElements:
    """Hexahedra of one material.

    coordinates (n_elements, 8, 3): m, corner nodes in the order of `CORNERS`; the Jacobian determinant is positive at
    all integration points. elasticity (6, 6): Pa.
    """

    coordinates: FloatArray
    elasticity: FloatArray

    @cached_property
    def _jacobians(self) -> FloatArray:
        """dx/dxi (n_elements, 8 points, 3 reference directions, 3 directions), m."""
        return np.asarray(np.einsum("pna,enj->epaj", shape_derivatives(GAUSS_POINTS), self.coordinates, optimize=True))

    @cached_property
    def volumes(self) -> FloatArray:
        """Volume (n_elements, 8) that belongs to each integration point, m3."""
        return np.asarray(np.linalg.det(self._jacobians))

    @cached_property
    def gradients(self) -> FloatArray:
        """Gradients (n_elements, 8 points, 8 nodes, 3) of the shape functions, 1/m."""
        inverse = np.linalg.inv(self._jacobians)
        return np.asarray(np.matmul(shape_derivatives(GAUSS_POINTS)[None], np.swapaxes(inverse, -1, -2)))

    @cached_property
    def _strains(self) -> FloatArray:
        """Strains (n_elements, 48, 24), six for each of the eight points, from the nodal displacements."""
        return _strain_rows(self.gradients).reshape(len(self.coordinates), 48, 24)

    @cached_property
    def _incompatible_strains(self) -> FloatArray:
        """Strains (n_elements, 48, 9) from the incompatible modes, Taylor-corrected."""
        centre = np.einsum("na,enj->eaj", shape_derivatives(np.zeros((1, 3)))[0], self.coordinates)
        inverse = np.linalg.inv(centre)
        scale = np.linalg.det(centre)[:, None] / self.volumes
        # Row a: derivative -2 xi_a of the mode 1 - xi_a^2 along reference direction a.
        gradients = -2.0 * GAUSS_POINTS[None, :, :, None] * np.swapaxes(inverse, -1, -2)[:, None]
        return _strain_rows(gradients * scale[:, :, None, None]).reshape(len(self.coordinates), 48, 9)

    def _stresses(self, strains: FloatArray) -> FloatArray:
        """Stresses of the same shape (n_elements, 48, n) as the strains."""
        n_elements, _, n_columns = strains.shape
        stresses = np.matmul(self.elasticity, strains.reshape(n_elements, 8, 6, n_columns))
        return np.asarray(stresses.reshape(strains.shape))

    @cached_property
    def _incompatible_from_nodes(self) -> FloatArray:
        """Amplitudes (n_elements, 9, 24) of the incompatible modes from the nodal displacements."""
        weights = np.repeat(self.volumes, 6, axis=1)[:, None, :]
        weighted = np.swapaxes(self._stresses(self._incompatible_strains), 1, 2) * weights
        own, coupling = weighted @ self._incompatible_strains, weighted @ self._strains
        return np.asarray(-np.linalg.solve(own, coupling))

    @cached_property
    def _effective_strains(self) -> FloatArray:
        """Strains (n_elements, 48, 24) from the nodal displacements, incompatible modes condensed."""
        return self._strains + self._incompatible_strains @ self._incompatible_from_nodes

    def _batches(self) -> Iterator[HexElements]:
        for first in range(0, len(self.coordinates), _BATCH):
            yield replace(self, coordinates=self.coordinates[first : first + _BATCH])

    def stiffness(self) -> FloatArray:
        """Stiffness matrices (n_elements, 24, 24), N/m, displacements node by node in x, y, z."""
        return np.concatenate([batch._stiffness() for batch in self._batches()])

    def _stiffness(self) -> FloatArray:
        weights = np.repeat(self.volumes, 6, axis=1)[:, :, None]
        strains = self._effective_strains
        matrices = np.swapaxes(strains, 1, 2) @ (self._stresses(strains) * weights)
        return np.asarray(0.5 * (matrices + np.swapaxes(matrices, 1, 2)))

    def stress(self, displacements: FloatArray) -> FloatArray:
        """Stress (n_elements, 8 points, 6), Pa, under nodal displacements (n_elements, 24) in m."""
        parts = []
        for number, batch in enumerate(self._batches()):
            moved = displacements[number * _BATCH : (number + 1) * _BATCH, :, None]
            parts.append(batch._stresses(batch._effective_strains @ moved).reshape(-1, 8, 6))
        return np.concatenate(parts)

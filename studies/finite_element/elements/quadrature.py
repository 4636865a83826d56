"""Integration rules on the reference elements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.model import FloatArray
from studies.finite_element.elements.hex_element import GAUSS_POINTS


@dataclass(frozen=True)
class Quadrature:
    """points (n_points, 3): reference coordinates. weights (n_points,): their sum is the volume of the element."""

    points: FloatArray
    weights: FloatArray


def _line(n_points: int) -> tuple[FloatArray, FloatArray]:
    points, weights = np.polynomial.legendre.leggauss(n_points)
    return points, weights


def _hexahedron(n_points: int) -> Quadrature:
    """Gauss points (n_points in each direction)."""
    points, weights = _line(n_points)
    grid = np.stack(np.meshgrid(points, points, points, indexing="ij"), axis=-1).reshape(-1, 3)
    return Quadrature(grid, np.einsum("i,j,k->ijk", weights, weights, weights).ravel())


def _wedge(triangle: FloatArray, area_weights: FloatArray, n_points: int) -> Quadrature:
    """A rule on the triangle, points (n, 2), times Gauss points along zeta."""
    points, weights = _line(n_points)
    grid = [(*place, z) for z in points for place in triangle]
    return Quadrature(np.array(grid), np.outer(weights, area_weights).ravel())


_ONE_POINT = np.array([[1.0, 1.0]]) / 3.0
_THREE_POINTS = np.array([[1.0, 1.0], [4.0, 1.0], [1.0, 4.0]]) / 6.0
_INNER = (5.0 - np.sqrt(5.0)) / 20.0

# in the order of the elements with incompatible modes, whose stresses are theirs
HEX_8_POINTS = Quadrature(GAUSS_POINTS, np.ones(8))
HEX_27_POINTS = _hexahedron(3)
WEDGE_2_POINTS = _wedge(_ONE_POINT, np.array([0.5]), 2)
WEDGE_9_POINTS = _wedge(_THREE_POINTS, np.full(3, 1.0 / 6.0), 3)
TET_1_POINT = Quadrature(np.full((1, 3), 0.25), np.array([1.0 / 6.0]))
TET_4_POINTS = Quadrature(_INNER + (1.0 - 4.0 * _INNER) * np.eye(4)[:, 1:], np.full(4, 1.0 / 24.0))

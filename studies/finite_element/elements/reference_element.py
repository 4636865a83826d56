"""Reference elements: nodes in the order of CalculiX and Abaqus, shape functions and their derivatives.

Tetrahedra and wedges live on the triangle `xi, eta >= 0, xi + eta <= 1`, wedges with `zeta` from -1 to 1; hexahedra on
the cube from -1 to 1. Shape functions are the polynomials of a given space that are 1 at one node and 0 at the others.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from solver.model import FloatArray, IntArray
from studies.finite_element.elements.hex_element import CORNERS

Edges = tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class ReferenceElement:
    """A reference element.

    corners (n_corners, 3): reference coordinates. edges: corners between which the mid-side nodes lie, in their order;
    empty for a linear element. exponents (n_nodes, 3): of the monomials that span the shape functions.
    """

    corners: FloatArray
    edges: Edges
    exponents: IntArray

    @cached_property
    def nodes(self) -> FloatArray:
        """Reference coordinates (n_nodes, 3) of all nodes, corners first."""
        middles = [0.5 * (self.corners[a] + self.corners[b]) for a, b in self.edges]
        return np.array([*self.corners, *middles])

    @cached_property
    def _coefficients(self) -> FloatArray:
        """Coefficients (n_monomials, n_nodes) of the shape functions: multiples of 1/8, without round-off."""
        exact = np.linalg.inv(self._monomials(self.nodes))
        return np.asarray(np.round(8.0 * exact) / 8.0)

    def _monomials(self, points: FloatArray) -> FloatArray:
        return np.asarray(np.prod(points[:, None, :] ** self.exponents, axis=2))

    def values(self, points: FloatArray) -> FloatArray:
        """Shape functions (n_points, n_nodes) at the reference points (n_points, 3)."""
        return self._monomials(points) @ self._coefficients

    def derivatives(self, points: FloatArray) -> FloatArray:
        """Derivatives (n_points, n_nodes, 3) of the shape functions by the reference coordinates."""
        result = np.empty((len(points), len(self.nodes), 3))
        for axis in range(3):
            powers = self.exponents.copy()
            powers[:, axis] = np.maximum(powers[:, axis] - 1, 0)
            monomials = np.prod(points[:, None, :] ** powers, axis=2) * self.exponents[:, axis]
            result[:, :, axis] = monomials @ self._coefficients
        return result


def _exponents(allowed: Iterable[tuple[int, ...]]) -> IntArray:
    return np.array(sorted(allowed, key=lambda powers: (sum(powers), powers)), dtype=np.int64)


def _complete(degree: int) -> IntArray:
    """All monomials up to a total degree."""
    return _exponents(powers for powers in product(range(degree + 1), repeat=3) if sum(powers) <= degree)


_TET_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
_WEDGE_CORNERS = np.array([[0, 0, -1], [1, 0, -1], [0, 1, -1], [0, 0, 1], [1, 0, 1], [0, 1, 1]], dtype=float)
_TET_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
_WEDGE_EDGES = ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5))
_HEX_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))

# The wedge with 15 nodes: quadratic in the triangle times linear along zeta, and zeta squared times linear.
_WEDGE_15 = [(a, b, c) for a, b, c in product(range(3), repeat=3) if a + b <= 2 and (c < 2 or a + b <= 1)]
# The serendipity hexahedron: of what is more than linear in one direction, no more than the square.
_HEX_20 = [powers for powers in product(range(3), repeat=3) if sum(power for power in powers if power > 1) <= 2]

TET_4 = ReferenceElement(_TET_CORNERS, (), _complete(1))
TET_10 = ReferenceElement(_TET_CORNERS, _TET_EDGES, _complete(2))
WEDGE_6 = ReferenceElement(
    _WEDGE_CORNERS, (), _exponents((a, b, c) for a, b, c in product(range(2), repeat=3) if a + b <= 1)
)
WEDGE_15 = ReferenceElement(_WEDGE_CORNERS, _WEDGE_EDGES, _exponents(_WEDGE_15))
HEX_8 = ReferenceElement(CORNERS, (), _exponents(product(range(2), repeat=3)))
HEX_20 = ReferenceElement(CORNERS, _HEX_EDGES, _exponents(_HEX_20))

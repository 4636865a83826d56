"""Solid elements as CalculiX and Abaqus have them: nodes and faces, shape functions, integration rules.

Tetrahedra and wedges live on the triangle `xi, eta >= 0, xi + eta <= 1`, wedges with `zeta` from -1 to 1; hexahedra on
the cube from -1 to 1. Shape functions are the polynomials of a given space that are 1 at one node and 0 at the others.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from solver.model import FloatArray, IntArray

Loop = tuple[int, ...]

CORNERS: FloatArray = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], dtype=float
)
"""Corners of a hexahedron: anticlockwise at zeta = -1, then the same at zeta = 1."""


@dataclass(frozen=True)
class ReferenceElement:
    """Nodes and shape functions.

    corners (n_corners, 3): reference coordinates. edges: corners between which the mid-side nodes lie, in their order;
    empty for a linear element. exponents (n_nodes, 3): of the monomials that span the shape functions.
    """

    corners: FloatArray
    edges: tuple[tuple[int, int], ...]
    exponents: IntArray

    @cached_property
    def nodes(self) -> FloatArray:
        """Reference coordinates (n_nodes, 3), corners first."""
        return np.array([*self.corners, *(0.5 * (self.corners[a] + self.corners[b]) for a, b in self.edges)])

    @cached_property
    def _coefficients(self) -> FloatArray:
        """Coefficients (n_monomials, n_nodes) of the shape functions: multiples of 1/8, without round-off."""
        return np.asarray(np.round(8.0 * np.linalg.inv(self._monomials(self.nodes))) / 8.0)

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


def _powers(allowed: Callable[..., bool]) -> IntArray:
    """Exponents of the monomials that are allowed, each of a coordinate at most 2."""
    chosen = [each for each in product(range(3), repeat=3) if allowed(*each)]
    return np.array(sorted(chosen, key=lambda each: (sum(each), each)), dtype=np.int64)


_TET_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
_WEDGE_CORNERS = np.array([[0, 0, -1], [1, 0, -1], [0, 1, -1], [0, 0, 1], [1, 0, 1], [0, 1, 1]], dtype=float)
_TET_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
_WEDGE_EDGES = ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5))
_HEX_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))

TET_4 = ReferenceElement(_TET_CORNERS, (), _powers(lambda *each: sum(each) <= 1))
TET_10 = ReferenceElement(_TET_CORNERS, _TET_EDGES, _powers(lambda *each: sum(each) <= 2))
WEDGE_6 = ReferenceElement(_WEDGE_CORNERS, (), _powers(lambda a, b, c: a + b <= 1 and c <= 1))
# quadratic in the triangle times linear along zeta, and zeta squared times linear
_WEDGE_15 = _powers(lambda a, b, c: a + b <= 2 and (c < 2 or a + b <= 1))
WEDGE_15 = ReferenceElement(_WEDGE_CORNERS, _WEDGE_EDGES, _WEDGE_15)
HEX_8 = ReferenceElement(CORNERS, (), _powers(lambda *each: max(each) <= 1))
# serendipity: of what is more than linear in one direction, no more than the square
HEX_20 = ReferenceElement(CORNERS, _HEX_EDGES, _powers(lambda *each: sum(n for n in each if n > 1) <= 2))


@dataclass(frozen=True)
class Quadrature:
    """points (n_points, 3): reference coordinates. weights (n_points,): their sum is the volume of the element."""

    points: FloatArray
    weights: FloatArray


def _wedge_rule(triangle: FloatArray, area_weight: float, n_points: int) -> Quadrature:
    """A rule on the triangle, points (n, 2) of equal weight, times Gauss points along zeta."""
    points, weights = np.polynomial.legendre.leggauss(n_points)
    grid = [(*place, z) for z in points for place in triangle]
    return Quadrature(np.array(grid), np.repeat(area_weight * weights, len(triangle)))


_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(3)
_INNER = (5.0 - np.sqrt(5.0)) / 20.0
_HEX_8_POINTS = Quadrature(CORNERS / np.sqrt(3.0), np.ones(8))
_HEX_27_POINTS = Quadrature(np.array([*product(_GAUSS, repeat=3)]), np.einsum("i,j,k->ijk", *[_WEIGHTS] * 3).ravel())
_WEDGE_2_POINTS = _wedge_rule(np.array([[1.0, 1.0]]) / 3.0, 0.5, 2)
_WEDGE_9_POINTS = _wedge_rule(np.array([[1.0, 1.0], [4.0, 1.0], [1.0, 4.0]]) / 6.0, 1.0 / 6.0, 3)
_TET_1_POINT = Quadrature(np.full((1, 3), 0.25), np.array([1.0 / 6.0]))
_TET_4_POINTS = Quadrature(_INNER + (1.0 - 4.0 * _INNER) * np.eye(4)[:, 1:], np.full(4, 1.0 / 24.0))

_TET_FACES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))
_WEDGE_FACES = ((0, 1, 2), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))
_HEX_FACES = ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))


@dataclass(frozen=True)
class ElementKind:
    """A kind of element.

    rule: integration of stiffness and mass, as in CalculiX; with fewer points than nodes the mass of an element is
    singular. corner_faces: corners of the faces S1, S2, ... of CalculiX and Abaqus, in either sense.
    incompatible_modes: see `ElementBatch`. assembled: whether matrices can be assembled here.
    """

    reference: ReferenceElement
    rule: Quadrature
    corner_faces: tuple[Loop, ...]
    incompatible_modes: bool = False
    assembled: bool = True

    @cached_property
    def faces(self) -> tuple[Loop, ...]:
        """Local nodes of the faces S1, S2, ...: corners anticlockwise from outside, then mid-side nodes behind each."""
        return tuple(self._face(loop) for loop in self.corner_faces)

    def _face(self, loop: Loop) -> Loop:
        corners = self.reference.corners
        a, b, c = corners[list(loop[:3])]
        outward = corners[list(loop)].mean(axis=0) - corners.mean(axis=0)
        if np.dot(np.cross(b - a, c - b), outward) < 0.0:
            loop = (loop[0], *loop[:0:-1])
        if not self.reference.edges:
            return loop
        middle = {frozenset(edge): len(corners) + place for place, edge in enumerate(self.reference.edges)}
        return (*loop, *(middle[frozenset((loop[i], loop[(i + 1) % len(loop)]))] for i in range(len(loop))))


ELEMENT_KINDS: dict[str, ElementKind] = {
    "C3D4": ElementKind(TET_4, _TET_1_POINT, _TET_FACES),
    "C3D6": ElementKind(WEDGE_6, _WEDGE_2_POINTS, _WEDGE_FACES),
    "C3D8": ElementKind(HEX_8, _HEX_8_POINTS, _HEX_FACES),
    "C3D8I": ElementKind(HEX_8, _HEX_8_POINTS, _HEX_FACES, incompatible_modes=True),
    # hourglass control, pressures as unknowns and modified shape functions are each code's own
    "C3D8R": ElementKind(HEX_8, _HEX_8_POINTS, _HEX_FACES, assembled=False),
    "C3D8H": ElementKind(HEX_8, _HEX_8_POINTS, _HEX_FACES, assembled=False),
    "C3D10": ElementKind(TET_10, _TET_4_POINTS, _TET_FACES),
    "C3D10M": ElementKind(TET_10, _TET_4_POINTS, _TET_FACES, assembled=False),
    "C3D15": ElementKind(WEDGE_15, _WEDGE_9_POINTS, _WEDGE_FACES),
    "C3D20": ElementKind(HEX_20, _HEX_27_POINTS, _HEX_FACES),
    "C3D20R": ElementKind(HEX_20, _HEX_8_POINTS, _HEX_FACES),
}
"""Solid elements by their names in CalculiX and Abaqus, nodes in the order of these programs."""

ASSEMBLED_KINDS = tuple(name for name, kind in ELEMENT_KINDS.items() if kind.assembled)
"""Those with matrices."""

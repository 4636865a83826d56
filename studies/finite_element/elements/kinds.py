"""Kinds of elements: reference element, integration rules and faces, as CalculiX has them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from studies.finite_element.elements.quadrature import (
    HEX_8_POINTS,
    HEX_27_POINTS,
    TET_1_POINT,
    TET_4_POINTS,
    WEDGE_2_POINTS,
    WEDGE_9_POINTS,
    Quadrature,
)
from studies.finite_element.elements.reference_element import (
    HEX_8,
    HEX_20,
    TET_4,
    TET_10,
    WEDGE_6,
    WEDGE_15,
    ReferenceElement,
)

Loop = tuple[int, ...]

_TET_FACES: tuple[Loop, ...] = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))
_WEDGE_FACES: tuple[Loop, ...] = ((0, 1, 2), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))
_HEX_FACES: tuple[Loop, ...] = (
    (0, 1, 2, 3),
    (4, 5, 6, 7),
    (0, 1, 5, 4),
    (1, 2, 6, 5),
    (2, 3, 7, 6),
    (3, 0, 4, 7),
)


@dataclass(frozen=True)
class ElementKind:
    """A kind of element.

    reference: nodes and shape functions.
    rule: integration of stiffness and mass, as in CalculiX. The mass of an element is singular where there are fewer
        points than nodes, and the mass of a mesh may be.
    corner_faces: corners of the faces S1, S2, ... of CalculiX and Abaqus, in either sense.
    incompatible_modes: whether the element has the incompatible modes of `hex_element`.
    assembled: whether matrices can be assembled here.
    """

    reference: ReferenceElement
    rule: Quadrature
    corner_faces: tuple[Loop, ...]
    incompatible_modes: bool = False
    assembled: bool = True

    @cached_property
    def faces(self) -> tuple[Loop, ...]:
        """Local nodes of the faces S1, S2, ...: corners anticlockwise from outside, then the mid-side nodes.

        The first mid-side node lies between the first two corners.
        """
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
    "C3D4": ElementKind(TET_4, TET_1_POINT, _TET_FACES),
    "C3D6": ElementKind(WEDGE_6, WEDGE_2_POINTS, _WEDGE_FACES),
    "C3D8": ElementKind(HEX_8, HEX_8_POINTS, _HEX_FACES),
    "C3D8I": ElementKind(HEX_8, HEX_8_POINTS, _HEX_FACES, incompatible_modes=True),
    # hourglass control, pressures as unknowns and modified shape functions are each code's own
    "C3D8R": ElementKind(HEX_8, HEX_8_POINTS, _HEX_FACES, assembled=False),
    "C3D8H": ElementKind(HEX_8, HEX_8_POINTS, _HEX_FACES, assembled=False),
    "C3D10": ElementKind(TET_10, TET_4_POINTS, _TET_FACES),
    "C3D10M": ElementKind(TET_10, TET_4_POINTS, _TET_FACES, assembled=False),
    "C3D15": ElementKind(WEDGE_15, WEDGE_9_POINTS, _WEDGE_FACES),
    "C3D20": ElementKind(HEX_20, HEX_27_POINTS, _HEX_FACES),
    "C3D20R": ElementKind(HEX_20, HEX_8_POINTS, _HEX_FACES),
}
"""Solid elements by their names in CalculiX and Abaqus."""

ASSEMBLED_KINDS = tuple(name for name, kind in ELEMENT_KINDS.items() if kind.assembled)
"""Those with matrices."""

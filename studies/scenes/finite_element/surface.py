"""Outer faces of a hexahedral mesh."""

from __future__ import annotations

import numpy as np

from solver.model import IntArray

FACES = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])
"""Corners of the faces of a hexahedron in the order of `hex_element.CORNERS`, anticlockwise from outside."""


def outer_faces(elements: IntArray) -> tuple[IntArray, IntArray]:
    """Faces (n_faces, 4) that belong to a single one of the elements (n_elements, 8), and that element (n_faces,)."""
    faces = elements[:, FACES].reshape(-1, 4)
    _, place, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    outer = np.sort(place[count == 1])
    return faces[outer], outer // len(FACES)

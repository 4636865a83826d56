"""A mesh with fewer faces, for the page: nodes that are near each other become one, but for those in contact.

By hand: libraries that simplify a mesh cannot keep chosen nodes, as those in contact.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from studyrunner.report.root.contact_faces import face_normals
from studyrunner.report.root.surface import RootSurface

_TRIES = 24


def simplify(surface: RootSurface, most_faces: int) -> RootSurface:
    """The surface with at most so many faces, those in contact not counted, as they are all kept.

    Nodes of one body in one cell of a cubic grid become one at their mean, if they look the same way: both sides of a
    thin blade stay apart. Faces without area are left out. The size of the cells is found by bisection.
    """
    n_contact = int(np.count_nonzero(surface.contact.flank >= 0))
    if len(surface.faces) <= most_faces + n_contact:
        return surface
    large = float(np.ptp(surface.nodes, axis=0).max()) or 1.0
    found, small = _merge(surface, large), 0.0
    for _ in range(_TRIES):
        size = 0.5 * (small + large)
        tried = _merge(surface, size)
        if len(tried.faces) > most_faces + n_contact:
            small = size
        else:
            large, found = size, tried
        if large - small < 0.05 * large:
            break
    return found


def _merge(surface: RootSurface, size: float) -> RootSurface:
    """The surface with the nodes in each cell of this size, m, as one."""
    body_of_node = np.zeros(len(surface.nodes), dtype=np.int64)
    body_of_node[surface.faces] = surface.body[:, None]
    cells = np.floor((surface.nodes - surface.nodes.min(axis=0)) / size).astype(np.int64)
    own = np.full(len(cells), -1)
    own[surface.contact.nodes] = surface.contact.nodes
    keys = np.column_stack([cells, body_of_node, own, _looks(surface)])
    _, merged = np.unique(keys, axis=0, return_inverse=True)
    merged = merged.ravel()
    count = np.bincount(merged)
    nodes = np.stack([np.bincount(merged, weights=column) / count for column in surface.nodes.T], axis=1)
    faces, kept = _distinct(merged[surface.faces])
    used, places = np.unique(faces, return_inverse=True)
    contact = replace(
        surface.contact,
        flank=surface.contact.flank[kept],
        nodes=np.searchsorted(used, merged[surface.contact.nodes]),
    )
    return replace(
        surface, nodes=nodes[used], faces=places.reshape(faces.shape), body=surface.body[kept], contact=contact
    )


def _looks(surface: RootSurface) -> NDArray[np.int64]:
    """Which of the six directions along an axis the surface looks to at each node (n_nodes,), nearly."""
    normals = np.zeros_like(surface.nodes)
    np.add.at(normals, surface.faces, face_normals(surface.nodes, surface.faces)[:, None, :])
    axis = np.argmax(np.abs(normals), axis=1)
    return np.asarray(2 * axis + (np.take_along_axis(normals, axis[:, None], axis=1)[:, 0] > 0.0))


def _distinct(faces: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Faces (n, 4) of three nodes or more, no two of the same nodes, and their places; triangles repeat the last."""
    same = faces == np.roll(faces, 1, axis=1)
    # what remains of a quadrilateral whose edge is lost is a triangle: its nodes are moved to the front
    order = np.argsort(same, axis=1, kind="stable")
    packed = np.take_along_axis(faces, order, axis=1)
    number = 4 - same.sum(axis=1)
    packed[number == 3, 3] = packed[number == 3, 2]
    ranked = np.sort(packed, axis=1)
    distinct = 1 + np.count_nonzero(np.diff(ranked, axis=1), axis=1)
    good = np.flatnonzero((number >= 3) & (distinct == np.minimum(number, 4)))
    _, first = np.unique(ranked[good], axis=0, return_index=True)
    kept = good[np.sort(first)]
    return packed[kept], kept

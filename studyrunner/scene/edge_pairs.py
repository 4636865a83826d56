"""Which contact pairs lie at the edge of their surface, from where they are.

A pair is inside where its neighbours surround it. Neighbours are those of a Delaunay triangulation in the plane of the
surface, which a structured mesh of any side ratio and an unstructured one have alike.

By hand: libraries of alpha shapes ask for a length, which cells that are long and thin do not have.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from solver.model import ContactInterface

_FLAT = 0.1
"""Of its smaller extent in the plane: a surface that is less flat, as one that closes on itself, is not looked at."""
_SAME_PLACE = 1e-6
"""Of the extent of the surface: what is less is round-off."""
_WIDEST_GAP = 0.75 * np.pi
"""Angle between one neighbour and the next, from which on a pair is at the edge. Measured inside: pi / 2 on meshes of
rows and columns with side ratios of 0.05 to 20, at most 2.13 on random points that keep a distance; rows 20 times as
dense as their shift, or such cells moved at random by a tenth, are taken for edge. At a straight edge it is pi."""
_LONGEST = 2.5
"""Over the median distance to its neighbours: what is farther is across a hole or a notch."""


def edge_pairs(contact: ContactInterface) -> NDArray[np.bool_]:
    """Pairs (n_contact,) at the edge of their surface: those that the scene names, else by their positions.

    None of a surface that has nothing but edge, whose positions are not known, or which is not flat.
    """
    if contact.edge is not None:
        return np.array(contact.edge)
    found, labels = np.zeros(contact.n_contact, np.bool_), np.array(contact.surface)
    for surface in np.unique(labels):
        own = np.flatnonzero(labels == surface)
        edge = _edge(np.asarray(contact.position)[own])
        found[own] = False if edge is None or edge.all() else edge
    return found


def _edge(position: NDArray[np.float64]) -> NDArray[np.bool_] | None:
    """Of one surface, positions (n, 3), m; None where it cannot be found."""
    if len(position) < 3 or not np.isfinite(position).all():
        return None
    centred = position - position.mean(axis=0)
    along = centred @ np.linalg.svd(centred, full_matrices=False)[2].T
    extent = np.ptp(along, axis=0)
    if extent[0] == 0.0 or extent[2] > max(_FLAT * extent[1], _SAME_PLACE * extent[0]):
        return None
    if extent[1] <= _SAME_PLACE * extent[0]:
        ends = np.abs(along[:, 0, None] - [along[:, 0].min(), along[:, 0].max()])
        return np.asarray((ends <= _SAME_PLACE * extent[0]).any(axis=1))
    from scipy.spatial import Delaunay, QhullError  # where it is used: it takes a while to load

    plane = along[:, :2]
    try:
        mesh = Delaunay(plane)
    except QhullError:
        return None
    first, neighbours = mesh.vertex_neighbor_vertices
    found = np.array([_is_edge(plane[neighbours[first[i] : first[i + 1]]] - plane[i]) for i in range(len(plane))])
    # of several pairs at one place a single one is a corner of the triangulation
    found[mesh.coplanar[:, 0]] = found[mesh.coplanar[:, 2]]
    return found


def _is_edge(away: NDArray[np.float64]) -> bool:
    """Whether neighbours, (n, 2) from the pair, leave a side open."""
    distance = np.linalg.norm(away, axis=1)
    near = away[distance <= _LONGEST * np.median(distance)] if len(away) else away
    angles = np.sort(np.arctan2(near[:, 1], near[:, 0]))
    if angles.size < 3:
        return True
    return bool(np.diff(angles, append=angles[0] + 2.0 * np.pi).max() > _WIDEST_GAP)

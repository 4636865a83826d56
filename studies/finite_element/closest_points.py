"""Closest points of surfaces: which element face a node lies on, and its interpolation weights there."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from solver.model import FloatArray, IntArray
from studies.finite_element.surfaces import FACE_SHAPES, Surface, quad_derivatives, quad_values

_CHUNK = 2_000_000  # distances from nodes to facets looked at together
_NEWTON_STEPS = 8
_DESCENT_STEPS = 24
_FACE_STEPS = 6


def closest_points(
    points: FloatArray, surface: Surface, coordinates: FloatArray
) -> tuple[sparse.csr_matrix, FloatArray]:
    """Closest points on a surface to some points (n_points, 3), m.

    Their interpolation weights (n_points, n_nodes), the shape functions of element faces, and the distances (n_points,)
    to the linear facets, m.
    """
    corners = coordinates[surface.facets]
    centre = corners.mean(axis=1)
    radius = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
    triangle = surface.facets[:, 2] == surface.facets[:, 3]
    step = max(1, _CHUNK // len(corners))
    facet_of, within = np.zeros(len(points), dtype=np.int64), np.zeros((len(points), 4))
    distance = np.full(len(points), np.inf)
    for first in range(0, len(points), step):
        own = points[first : first + step]
        apart = np.linalg.norm(own[:, None] - centre, axis=2)
        # no facet is closer than its sphere, and none that is farther than a whole sphere can be the closest
        reach = (apart + radius).min(axis=1, keepdims=True)
        point, facet = np.nonzero(apart - radius <= reach * (1.0 + 1e-12))
        found = np.empty((len(point), 4))
        flat = triangle[facet]
        found[flat] = _on_triangles(own[point[flat]], corners[facet[flat], :3])
        found[~flat] = _on_quads(own[point[~flat]], corners[facet[~flat]])
        away = np.linalg.norm(own[point] - np.einsum("pn,pnj->pj", found, corners[facet]), axis=1)
        # the closest of each point, the first of those that are equally close
        order = np.lexsort((np.round(away / radius.max(), 12), point))
        chosen = order[np.unique(point[order], return_index=True)[1]]
        rows = first + point[chosen]
        facet_of[rows], within[rows], distance[rows] = facet[chosen], found[chosen], away[chosen]
    nodes = surface.faces[facet_of]
    places = np.einsum("pn,pna->pa", within, surface.places[facet_of])
    weights = _face_weights(points, nodes, places, coordinates)
    point, corner = np.nonzero(weights)
    entries = (weights[point, corner], (point, nodes[point, corner]))
    return sparse.csr_matrix(entries, shape=(len(points), len(coordinates))), distance


def _face_weights(points: FloatArray, nodes: IntArray, places: FloatArray, coordinates: FloatArray) -> FloatArray:
    """Shape functions (n, 8) of element faces (n, 8) at the points closest to some points, near places (n, 2)."""
    weights = np.zeros(nodes.shape)
    counts = (nodes >= 0).sum(axis=1)
    for count in np.unique(counts):
        own = np.flatnonzero(counts == count)
        shape, place = FACE_SHAPES[count], places[own]
        corners = coordinates[nodes[own, :count]]
        # On straight faces of even sides the facets have found the place; elsewhere they are close to it.
        for _ in range(_FACE_STEPS if count > 4 else 0):
            tangents = np.einsum("pna,pnj->paj", shape.derivatives(place), corners)
            rest = points[own] - np.einsum("pn,pnj->pj", shape.values(place), corners)
            metric = np.matmul(tangents, np.swapaxes(tangents, 1, 2))
            change = np.linalg.solve(metric, np.einsum("paj,pj->pa", tangents, rest)[..., None])[..., 0]
            place = _inside(place + np.clip(change, -0.25, 0.25), triangle=bool(count == 6))
        weights[own, :count] = shape.values(place)
    weights[np.abs(weights) < 1e-10] = 0.0
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def _inside(places: FloatArray, *, triangle: bool) -> FloatArray:
    """Places (n, 2) moved back onto the face where they are outside."""
    if not triangle:
        return np.clip(places, -1.0, 1.0)
    beyond = np.maximum(places.sum(axis=1, keepdims=True) - 1.0, 0.0)
    places = np.clip(places - 0.5 * beyond, 0.0, 1.0)
    return np.asarray(places / np.maximum(places.sum(axis=1, keepdims=True), 1.0))


def _on_triangles(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Weights (n, 4) of the closest points of triangles (n, 3, 3), one for each point (n, 3)."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    offset = points - corners[:, 0]
    a, b, c = (np.einsum("ij,ij->i", u, v) for u, v in ((first, first), (first, second), (second, second)))
    d, e = (np.einsum("ij,ij->i", u, offset) for u in (first, second))
    determinant = np.maximum(a * c - b * b, 1e-30 * (a * c))
    eta = (a * e - b * d) / determinant
    xi = (c * d - b * e) / determinant
    weights = np.stack([1.0 - xi - eta, xi, eta], axis=1)
    best = np.where((weights >= 0.0).all(axis=1), 0.0, np.inf)
    for start, end in ((0, 1), (1, 2), (2, 0)):
        along = corners[:, end] - corners[:, start]
        share = np.einsum("ij,ij->i", points - corners[:, start], along) / np.einsum("ij,ij->i", along, along)
        share = np.clip(share, 0.0, 1.0)
        away = np.linalg.norm(points - corners[:, start] - share[:, None] * along, axis=1)
        closer = away < best
        best[closer] = away[closer]
        weights[closer] = 0.0
        weights[closer, start], weights[closer, end] = 1.0 - share[closer], share[closer]
    return np.hstack([weights, np.zeros((len(points), 1))])


def _on_quads(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Weights (n, 4) of the closest points of bilinear facets (n, 4, 3), one for each point (n, 3)."""
    place = np.zeros((len(points), 2))
    for _ in range(_NEWTON_STEPS):  # Gauss-Newton
        tangents = np.einsum("pna,pnj->paj", quad_derivatives(place), corners)
        rest = points - np.einsum("pn,pnj->pj", quad_values(place), corners)
        metric = np.matmul(tangents, np.swapaxes(tangents, 1, 2))
        metric += 1e-14 * np.trace(metric, axis1=1, axis2=2)[:, None, None] * np.eye(2)
        change = np.linalg.solve(metric, np.einsum("paj,pj->pa", tangents, rest)[..., None])[..., 0]
        place = np.clip(place + np.clip(change, -2.0, 2.0), -3.0, 3.0)
    outside = (np.abs(place) > 1.0).any(axis=1)
    place = np.clip(place, -1.0, 1.0)
    edge, rim, chosen = corners[outside], place[outside], points[outside]
    for turn in range(_DESCENT_STEPS if outside.any() else 0):  # along one direction after the other, to the edge
        axis = turn % 2
        tangent = np.einsum("pn,pnj->pj", quad_derivatives(rim)[..., axis], edge)
        rest = chosen - np.einsum("pn,pnj->pj", quad_values(rim), edge)
        change = np.einsum("pj,pj->p", tangent, rest) / np.einsum("pj,pj->p", tangent, tangent)
        rim[:, axis] = np.clip(rim[:, axis] + change, -1.0, 1.0)
    place[outside] = rim
    return quad_values(place)

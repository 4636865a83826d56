"""Surfaces of a mesh in linear facets, with areas and normals of their nodes, and the points on them that are closest.

Faces of quadratic elements are split at their mid-side nodes: the consistent areas of a quadratic face are negative or
zero at its corners, those of its facets are positive at all nodes.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import sparse

from solver.model import BoolArray, FloatArray, IntArray
from studies.finite_element.elements import CORNERS, ELEMENT_KINDS, HEX_8, HEX_20, TET_4, TET_10, ReferenceElement
from studies.finite_element.solid_mesh import SolidMesh, find_places
from studies.scene import SurfaceMesh
from studies.scene_error import SceneError

_CHUNK = 2_000_000  # distances from nodes to facets looked at together
_NEWTON_STEPS, _DESCENT_STEPS = 8, 24  # to a point of a facet
_FACE_STEPS = 6  # from there to the point of a quadratic face


@dataclass(frozen=True)
class FaceShape:
    """Shape functions of an element on a face, at the reference coordinate zeta = height.

    nodes: of the element on the face, corners first. facets: linear ones by these, of a triangle the last one twice.
    """

    element: ReferenceElement
    nodes: tuple[int, ...]
    height: float
    facets: tuple[tuple[int, ...], ...]

    def values(self, places: FloatArray) -> FloatArray:
        """Shape functions (n, n_nodes) at places (n, 2) of the face."""
        return self.element.values(np.column_stack([places, np.full(len(places), self.height)]))[:, list(self.nodes)]

    def derivatives(self, places: FloatArray) -> FloatArray:
        """Their derivatives (n, n_nodes, 2)."""
        points = np.column_stack([places, np.full(len(places), self.height)])
        return self.element.derivatives(points)[:, list(self.nodes), :2]


_TRIANGLE = ((0, 1, 2, 2),)
_TRIANGLES = ((0, 3, 5, 5), (1, 4, 3, 3), (2, 5, 4, 4), (3, 4, 5, 5))
_QUADS = ((0, 4, 7, 7), (1, 5, 4, 4), (2, 6, 5, 5), (3, 7, 6, 6), (4, 5, 6, 7))
FACE_SHAPES = {
    3: FaceShape(TET_4, (0, 1, 2), 0.0, _TRIANGLE),
    4: FaceShape(HEX_8, (0, 1, 2, 3), -1.0, ((0, 1, 2, 3),)),
    6: FaceShape(TET_10, (0, 1, 2, 4, 5, 6), 0.0, _TRIANGLES),
    8: FaceShape(HEX_20, (0, 1, 2, 3, 8, 9, 10, 11), -1.0, _QUADS),
}
"""Element faces by their number of nodes."""
_QUAD_POINTS = CORNERS[:4, :2] / np.sqrt(3.0)
_GAUSS = np.polynomial.legendre.leggauss(3)
_QUAD_RULE = np.stack(np.meshgrid(_GAUSS[0], _GAUSS[0]), axis=-1).reshape(-1, 2), np.outer(_GAUSS[1], _GAUSS[1]).ravel()
# of the square, its side eta = 1 drawn together to a corner: exact to the fourth degree
_XI, _ETA = _QUAD_RULE[0].T
_TRIANGLE_POINTS = np.stack([(1.0 + _XI) * (1.0 - _ETA) / 4.0, (1.0 + _ETA) / 2.0], axis=1)
_TRIANGLE_RULE = _TRIANGLE_POINTS, _QUAD_RULE[1] * (1.0 - _ETA) / 8.0


def quad_values(points: FloatArray) -> FloatArray:
    """Bilinear shape functions (..., 4) at points (..., 2) of the square from -1 to 1, corners anticlockwise."""
    return np.asarray(np.prod(1.0 + points[..., None, :] * CORNERS[:4, :2], axis=-1) / 4.0)


def quad_derivatives(points: FloatArray) -> FloatArray:
    """Their derivatives (..., 4, 2)."""
    factors = 1.0 + points[..., None, :] * CORNERS[:4, :2]
    return np.asarray(CORNERS[:4, :2] * factors[..., ::-1] / 4.0)


@dataclass(frozen=True)
class Surface:
    """A surface of one body.

    facets (n_facets, 4): rows of `SolidMesh.coordinates`, anticlockwise from outside, of a triangle the last one twice.
    faces (n_facets, 8): nodes of the element face of each, -1 after the last. places (n_facets, 4, 2): reference
    coordinates of its corners there. depth (n_nodes,): least depth of the elements below each of `nodes`, m.
    """

    name: str
    facets: IntArray
    faces: IntArray
    places: FloatArray
    depth: FloatArray

    @cached_property
    def nodes(self) -> IntArray:
        """Its nodes, ascending."""
        return np.unique(self.facets)

    def areas_and_normals(self, coordinates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Area (n_nodes,), m2, and unit outward normal (n_nodes, 3) of each of `nodes`.

        Integrals of the shape function of the node on the facets, and of this times their normals.
        """
        area, normal = np.zeros(len(coordinates)), np.zeros((len(coordinates), 3))
        tangents = np.einsum("pna,fnj->fapj", quad_derivatives(_QUAD_POINTS), coordinates[self.facets])
        vectors = np.cross(tangents[:, 0], tangents[:, 1])
        values = quad_values(_QUAD_POINTS)
        np.add.at(normal, self.facets, np.einsum("pn,fpj->fnj", values, vectors))
        np.add.at(area, self.facets, np.linalg.norm(vectors, axis=2) @ values)
        sizes = np.linalg.norm(normal[self.nodes], axis=1)
        if not (sizes > 1e-6 * area[self.nodes]).all():
            found = f"surface {self.name} folds back on itself"
            raise SceneError("contact", found, "give a smooth surface of one body")
        return area[self.nodes], normal[self.nodes] / sizes[:, None]


class Face(NamedTuple):
    """Face of an element.

    nodes: corners anticlockwise from outside, then mid-side nodes. element: all nodes of the element. part: its label.
    """

    nodes: IntArray
    element: IntArray
    part: str


def faces_of_elements(mesh: SolidMesh, name: str, elements: IntArray, faces: IntArray) -> list[Face]:
    """Faces by numbers of elements (n_faces,) and of their faces S1 to S6 (n_faces,), as CalculiX and Abaqus have them.

    name: for messages. Raises SceneError where there is no such element or face.
    """
    found: list[Face] = []
    left = np.ones(len(elements), dtype=np.bool_)
    for group in mesh.groups:
        table = ELEMENT_KINDS[group.kind].faces
        place = find_places(elements, group.numbers)
        left &= place < 0
        for chosen in np.flatnonzero(place >= 0):
            if not 1 <= faces[chosen] <= len(table):
                wrong = f"surface {name} names face S{faces[chosen]} of element {elements[chosen]} ({group.kind})"
                raise SceneError("contact", wrong, f"give faces S1 to S{len(table)}")
            element = group.nodes[place[chosen]]
            found.append(Face(element[list(table[faces[chosen] - 1])], element, group.part))
    if left.any():
        raise SceneError("contact", f"surface {name} names element {elements[left][0]}", "there is no such element")
    return found


def surface_of_faces(mesh: SolidMesh, name: str, elements: IntArray, faces: IntArray) -> Surface:
    """Surface of faces, as `faces_of_elements` has them. Raises SceneError where there is none."""
    return _surface(mesh, name, faces_of_elements(mesh, name, elements, faces))


def integrate_shapes(coordinates: FloatArray, faces: list[Face]) -> tuple[FloatArray, FloatArray]:
    """Integrals of shape functions over faces, (n_nodes,), m2, and of these times the outward normals, (n_nodes, 3)."""
    areas, vectors = np.zeros(len(coordinates)), np.zeros(coordinates.shape)
    for size, shape in FACE_SHAPES.items():
        own = np.array([face.nodes for face in faces if len(face.nodes) == size], dtype=np.int64).reshape(-1, size)
        points, weights = _TRIANGLE_RULE if size in (3, 6) else _QUAD_RULE
        tangents = np.einsum("pna,fnj->fapj", shape.derivatives(points), coordinates[own])
        outward = np.cross(tangents[:, 0], tangents[:, 1])
        values = weights[:, None] * shape.values(points)
        np.add.at(areas, own, np.linalg.norm(outward, axis=2) @ values)
        np.add.at(vectors, own, np.einsum("pn,fpj->fnj", values, outward))
    return areas, vectors


def surface_of_nodes(mesh: SolidMesh, name: str, nodes: IntArray) -> Surface:
    """Surface of the outer faces whose nodes are all among these (n,). Raises SceneError where one is on no face."""
    inside = np.zeros(mesh.n_nodes, dtype=np.bool_)
    inside[nodes] = True
    surface = _surface(mesh, name, [face for face in outer_faces(mesh, inside) if inside[face.nodes].all()])
    if len(lonely := np.setdiff1d(nodes, surface.nodes)):
        found = f"{len(lonely)} of {len(nodes)} nodes of {name} belong to no face with all nodes in the set, as node"
        remedy = "give a surface of element faces, or a set of the nodes of whole faces"
        raise SceneError("contact", f"{found} {mesh.numbers[lonely[0]]}", remedy)
    return surface


def surface_of_points(name: str, nodes: IntArray) -> Surface:
    """Surface of nodes (n,) of a model without elements: facets of no extent."""
    n = len(nodes)
    return Surface(name, np.tile(nodes[:, None], 4), np.full((n, 8), -1), np.zeros((n, 4, 2)), np.zeros(n))


def outer_faces(mesh: SolidMesh, among: BoolArray) -> list[Face]:
    """Faces of one element only, their corners among these nodes (n_nodes,)."""
    faces: list[Face] = []
    keys: list[IntArray] = []
    for group in mesh.groups:
        for face in ELEMENT_KINDS[group.kind].faces:
            n_corners = 3 if len(face) in (3, 6) else 4
            corners = group.nodes[:, list(face[:n_corners])]
            chosen = group.nodes[among[corners].all(axis=1)]
            faces += [Face(element[list(face)], element, group.part) for element in chosen]
            key = np.full((len(chosen), 4), -1)
            key[:, :n_corners] = chosen[:, list(face[:n_corners])]
            keys.append(np.sort(key, axis=1))
    _, first, count = np.unique(np.concatenate(keys), axis=0, return_index=True, return_counts=True)
    return [faces[place] for place in np.sort(first[count == 1])]


def describe_mesh(mesh: SolidMesh) -> SurfaceMesh:
    """Outer faces of a mesh by their corners, for pictures; triangles repeat their last corner."""
    outer = outer_faces(mesh, np.ones(mesh.n_nodes, dtype=np.bool_))
    corners = np.array([face.nodes[[0, 1, 2, 2 if len(face.nodes) in (3, 6) else 3]] for face in outer])
    used, quads = np.unique(corners, return_inverse=True)
    return SurfaceMesh(mesh.coordinates[used], quads.reshape(corners.shape), tuple(face.part for face in outer))


def _surface(mesh: SolidMesh, name: str, chosen: list[Face]) -> Surface:
    if not chosen:
        raise SceneError("contact", f"surface {name} has no face", "give at least one face of an element")
    depth = np.full(mesh.n_nodes, np.inf)
    facets, faces, places = [], [], []
    for loop, element, _ in chosen:
        first, second, third = mesh.coordinates[loop[:3]]
        normal = np.cross(second - first, third - first)
        below = (first - mesh.coordinates[element]) @ (normal / np.linalg.norm(normal))
        depth[loop] = np.minimum(depth[loop], below.max())
        shape = FACE_SHAPES[len(loop)]
        facets.append(loop[np.array(shape.facets)])
        faces += [np.append(loop, np.full(8 - len(loop), -1))] * len(shape.facets)
        places.append(shape.element.nodes[list(shape.nodes), :2][np.array(shape.facets)])
    return Surface(name, np.concatenate(facets), np.array(faces), np.concatenate(places), depth[np.isfinite(depth)])


def closest_points(
    points: FloatArray, surface: Surface, coordinates: FloatArray
) -> tuple[sparse.csr_matrix, FloatArray]:
    """Weights (n_points, n_nodes), by the shape functions of element faces, of the points of a surface that are closest
    to points (n_points, 3), m, and the distances (n_points,) to the linear facets, m. All nodes of a face have an
    entry, which may be 0.
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
    point, corner = np.nonzero(nodes >= 0)
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

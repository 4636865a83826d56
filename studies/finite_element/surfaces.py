"""Surfaces of a mesh in linear facets, with areas and normals of their nodes.

Faces of quadratic elements are split at their mid-side nodes: the consistent areas of a quadratic face are negative or
zero at its corners, those of its facets are positive at all nodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from solver.model import FloatArray, IntArray
from studies.finite_element.elements import CORNERS, ELEMENT_KINDS, HEX_8, HEX_20, TET_4, TET_10, ReferenceElement
from studies.finite_element.solid_mesh import SolidMesh
from studies.scene import SurfaceMesh
from studies.scene_error import SceneError


@dataclass(frozen=True)
class FaceShape:
    """Shape functions of the face of an element at a reference coordinate zeta, the height.

    nodes: of the element on the face, corners first. facets: linear ones by these, of a triangle the last one twice.
    """

    element: ReferenceElement
    nodes: tuple[int, ...]
    height: float
    facets: tuple[tuple[int, ...], ...]

    @property
    def places(self) -> FloatArray:
        """Reference coordinates (n_nodes, 2) of its nodes."""
        return self.element.nodes[list(self.nodes), :2]

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
_TRIANGLE_RULE = (
    np.stack([(1.0 + _XI) * (1.0 - _ETA) / 4.0, (1.0 + _ETA) / 2.0], axis=1),
    _QUAD_RULE[1] * (1.0 - _ETA) / 8.0,
)


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

    facets (n_facets, 4): rows of `SolidMesh.coordinates`, anticlockwise as seen from outside, of a triangle the last
    one twice. faces (n_facets, 8): nodes of the element face that each is of, -1 after the last. places (n_facets, 4,
    2): reference coordinates of its corners there. depth (n_nodes,): how deep the elements are below each of `nodes`,
    the least one, m.
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

        The area of a node is the integral of its shape function on the facets; the normal is the mean of those of the
        facets, weighted alike.
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

    def facet_size(self, coordinates: FloatArray) -> float:
        """Typical size of a facet, m: root of the mean area."""
        return float(np.sqrt(self.areas_and_normals(coordinates)[0].sum() / len(self.facets)))


class Face(NamedTuple):
    """Face of an element.

    nodes: corners anticlockwise from outside, then mid-side nodes. element: all nodes of the element. part: its label.
    """

    nodes: IntArray
    element: IntArray
    part: str


def faces_of_elements(mesh: SolidMesh, name: str, elements: IntArray, faces: IntArray) -> list[Face]:
    """Faces by element numbers (n_faces,) and faces (n_faces,), 1 to 6 for S1 to S6 of CalculiX and Abaqus.

    name: for messages. Raises SceneError where there is no such element or face.
    """
    found: list[Face] = []
    left = np.ones(len(elements), dtype=np.bool_)
    for group in mesh.groups:
        table = ELEMENT_KINDS[group.kind].faces
        order = np.argsort(group.numbers)
        place = np.minimum(np.searchsorted(group.numbers, elements, sorter=order), len(order) - 1)
        own = group.numbers[order[place]] == elements
        left &= ~own
        for chosen in np.flatnonzero(own):
            if not 1 <= faces[chosen] <= len(table):
                wrong = f"surface {name} names face S{faces[chosen]} of element {elements[chosen]} ({group.kind})"
                raise SceneError("contact", wrong, f"give faces S1 to S{len(table)}")
            element = group.nodes[order[place[chosen]]]
            found.append(Face(element[list(table[faces[chosen] - 1])], element, group.part))
    if left.any():
        raise SceneError("contact", f"surface {name} names element {elements[left][0]}", "there is no such element")
    return found


def surface_of_faces(mesh: SolidMesh, name: str, elements: IntArray, faces: IntArray) -> Surface:
    """Surface of faces, as `faces_of_elements` has them. Raises SceneError where there is none."""
    return _surface(mesh, name, faces_of_elements(mesh, name, elements, faces))


def pressure_forces(coordinates: FloatArray, faces: list[Face], pressure: float) -> FloatArray:
    """Consistent nodal forces (3 n_nodes,), N, of a pressure, Pa, into the body."""
    forces = np.zeros(coordinates.shape)
    for size, shape in FACE_SHAPES.items():
        own = np.array([face.nodes for face in faces if len(face.nodes) == size], dtype=np.int64).reshape(-1, size)
        points, weights = _TRIANGLE_RULE if size in (3, 6) else _QUAD_RULE
        tangents = np.einsum("pna,fnj->fapj", shape.derivatives(points), coordinates[own])
        outward = np.cross(tangents[:, 0], tangents[:, 1])
        np.add.at(forces, own, -pressure * np.einsum("p,pn,fpj->fnj", weights, shape.values(points), outward))
    return forces.ravel()


def surface_of_nodes(mesh: SolidMesh, name: str, nodes: IntArray) -> Surface:
    """Surface of the outer faces all of whose nodes are among some nodes (n,), rows of the coordinates.

    Raises SceneError where nodes belong to no such face.
    """
    inside = np.zeros(mesh.n_nodes, dtype=np.bool_)
    inside[nodes] = True
    surface = _surface(mesh, name, [face for face in outer_faces(mesh) if inside[face.nodes].all()])
    lonely = np.setdiff1d(nodes, surface.nodes)
    if len(lonely):
        found = (
            f"{len(lonely)} of {len(nodes)} nodes of {name} belong to no face whose nodes are all in the set, as node"
        )
        remedy = "give a surface of element faces, or a set of the nodes of whole faces"
        raise SceneError("contact", f"{found} {mesh.numbers[lonely[0]]}", remedy)
    return surface


def surface_of_points(name: str, nodes: IntArray) -> Surface:
    """Surface of nodes (n,) of a model without elements: facets of no extent."""
    n = len(nodes)
    return Surface(name, np.tile(nodes[:, None], 4), np.full((n, 8), -1), np.zeros((n, 4, 2)), np.zeros(n))


def outer_faces(mesh: SolidMesh) -> list[Face]:
    """Faces of one element only."""
    faces: list[Face] = []
    keys: list[IntArray] = []
    for group in mesh.groups:
        for face in ELEMENT_KINDS[group.kind].faces:
            nodes = group.nodes[:, list(face)]
            n_corners = 3 if len(face) in (3, 6) else 4
            key = np.full((len(nodes), 4), -1)
            key[:, :n_corners] = nodes[:, :n_corners]
            faces += [Face(loop, element, group.part) for loop, element in zip(nodes, group.nodes, strict=True)]
            keys.append(np.sort(key, axis=1))
    _, first, count = np.unique(np.concatenate(keys), axis=0, return_index=True, return_counts=True)
    return [faces[place] for place in np.sort(first[count == 1])]


def describe_mesh(mesh: SolidMesh) -> SurfaceMesh:
    """Outer faces of a mesh by their corners, for pictures; triangles repeat their last corner."""
    outer = outer_faces(mesh)
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
        places.append(shape.places[np.array(shape.facets)])
    return Surface(name, np.concatenate(facets), np.array(faces), np.concatenate(places), depth[np.isfinite(depth)])

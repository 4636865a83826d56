"""Faces that are drawn in three dimensions: those of the scene's mesh, or a patch a contact pair where it has none."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from studyrunner.report.root.contact_faces import ContactFaces, face_normals, find_contact_faces
from studyrunner.result.view import Result

MESH = ("mesh_x", "mesh_y", "mesh_z", "mesh_quad")

_DEEPEST = 0.04  # worn depth as it is drawn, over the size of the contact surfaces
_STRAIGHT = 1e-6
_CORNERS = 4


@dataclass(frozen=True)
class RootSurface:
    """Outer faces of the bodies of a joint, and what its contact pairs are on them.

    nodes (n_nodes, 3): m. faces (n_faces, 4): nodes anticlockwise from outside; triangles repeat their last one.
    body (n_faces,): index into `bodies`, whose faces hang together by their nodes. contact: the faces in contact.
    flanks: labels of the contact surfaces. is_mesh: else the faces are patches, one a pair.
    """

    nodes: NDArray[np.float64]
    faces: NDArray[np.int64]
    body: NDArray[np.int64]
    bodies: tuple[str, ...]
    contact: ContactFaces
    flanks: tuple[str, ...]
    is_mesh: bool

    def worn(self, depth: NDArray[np.float64], factor: float) -> NDArray[np.float64]:
        """Nodes (n_nodes, 3), m, with the wear depth (n_contact,), m, of the pairs times a factor taken off.

        The depth of a pair is that of both its surfaces together: it is drawn into each of them. NaN counts as no wear.
        """
        worn = self.nodes.copy()
        own = np.nan_to_num(self.contact.values(depth))
        worn[self.contact.nodes] -= factor * own[:, None] * self.contact.normals
        return worn

    def near_contact(self, most_faces: int) -> RootSurface:
        """The surface with at most so many faces: those in contact, and those nearest to them."""
        if len(self.faces) <= most_faces:
            return self
        centres = self.nodes[self.faces].mean(axis=1)
        distance, _ = cKDTree(self.nodes[self.contact.nodes]).query(centres)
        of_contact = self.contact.flank >= 0
        order = np.argsort(np.where(of_contact, -1.0, distance), kind="stable")
        kept = np.sort(order[: max(most_faces, int(of_contact.sum()))])
        used, places = np.unique(self.faces[kept], return_inverse=True)
        nodes = np.searchsorted(used, self.contact.nodes)
        contact = replace(self.contact, flank=self.contact.flank[kept], nodes=nodes)
        faces = places.reshape(-1, _CORNERS)
        return replace(self, nodes=self.nodes[used], faces=faces, body=self.body[kept], contact=contact)

    @property
    def well_seen(self) -> float:
        """Depth, m, that is well seen beside the size of the contact surfaces."""
        return _DEEPEST * float(np.linalg.norm(np.ptp(self.nodes[self.contact.nodes], axis=0)))

    def exaggeration(self, deepest: float) -> float:
        """Factor 1, 2 or 5 times a power of ten with which a depth, m, is well seen; 1 where nothing is worn."""
        if not deepest > 0.0 or not math.isfinite(deepest) or not self.well_seen > 0.0:
            return 1.0
        wanted = self.well_seen / deepest
        power = 10.0 ** math.floor(math.log10(wanted))
        return max(factor * power for factor in (1.0, 2.0, 5.0) if factor * power <= wanted * (1.0 + 1e-9))


def read_root(result: Result) -> RootSurface | None:
    """The faces of a file; None where it has no positions of pairs to draw them at."""
    coordinates = result.dataset.coords
    n_pairs = result.dataset.sizes["contact"]
    if not all(f"contact_{axis}" in coordinates for axis in "xyz"):
        return None
    positions = np.stack([coordinates[f"contact_{axis}"].values for axis in "xyz"], axis=1).astype(float)
    if not np.isfinite(positions).all():
        return None
    labels = np.full(n_pairs, "contact")
    if "contact_surface" in coordinates:
        labels = coordinates["contact_surface"].values.astype(str)
    flanks = tuple(dict.fromkeys(labels.tolist()))
    flank = np.array([flanks.index(label) for label in labels.tolist()])
    if result.has(*MESH) and len(result.dataset["mesh_quad"]) and result.dataset["mesh_quad"].shape[1] == _CORNERS:
        surface = _of_mesh(result, positions, flank, flanks)
        if len(surface.contact.nodes):
            return surface
    area = np.asarray(coordinates["contact_area"].values if "contact_area" in coordinates else np.nan, dtype=float)
    # what is no area has no sides: NaN is none
    return _of_patches(positions, area, flank, flanks) if (area > 0.0).all() else None


def _of_mesh(
    result: Result, positions: NDArray[np.float64], flank: NDArray[np.int64], flanks: tuple[str, ...]
) -> RootSurface:
    nodes = np.stack([result.read(f"mesh_{axis}").values for axis in "xyz"], axis=1).astype(float)
    faces = result.read("mesh_quad").values.astype(np.int64)
    parts = result.read("mesh_part").values.astype(str) if result.has("mesh_part") else np.full(len(faces), "")
    body = _bodies(faces, len(nodes))
    contact = find_contact_faces(nodes, faces, body, positions, flank)
    return RootSurface(nodes, faces, body, _name_bodies(body, parts), contact, flanks, is_mesh=True)


def _bodies(faces: NDArray[np.int64], n_nodes: int) -> NDArray[np.int64]:
    """Body (n_faces,) of each face, counted from 0 in the order of the faces."""
    rows, columns = faces[:, [0, 0, 0]].ravel(), faces[:, 1:].ravel()
    joined = sparse.coo_matrix((np.ones(rows.size), (rows, columns)), shape=(n_nodes, n_nodes))
    _, component = connected_components(joined, directed=False)
    _, first, body = np.unique(component[faces[:, 0]], return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[body].astype(np.int64)


def _name_bodies(body: NDArray[np.int64], parts: NDArray[np.str_]) -> tuple[str, ...]:
    """The part most of its faces belong to; with a number where bodies share it."""
    names = [Counter(parts[body == number].tolist()).most_common(1)[0][0] for number in range(int(body.max()) + 1)]
    count = Counter(names)
    return tuple(
        name if name and count[name] == 1 else f"{name or 'body'} {names[: place + 1].count(name)}"
        for place, name in enumerate(names)
    )


def _of_patches(
    positions: NDArray[np.float64], area: NDArray[np.float64], flank: NDArray[np.int64], flanks: tuple[str, ...]
) -> RootSurface:
    """A rectangle at each pair, in the plane that fits the pairs of its surface best."""
    nodes = np.empty((len(positions), 4, 3))
    normals = np.empty((len(positions), 3))
    for number in range(len(flanks)):
        own = np.flatnonzero(flank == number)
        first, second, lengths = _plane(positions[own], area[own])
        for corner, (a, b) in enumerate(((-1, -1), (1, -1), (1, 1), (-1, 1))):
            nodes[own, corner] = positions[own] + 0.5 * (a * lengths[:, :1] * first + b * lengths[:, 1:] * second)
        normals[own] = np.cross(first, second)
    faces = np.arange(4 * len(positions)).reshape(-1, 4)
    pairs = np.repeat(np.arange(len(positions)), 4)
    contact = ContactFaces(
        flank=flank,
        nodes=faces.ravel(),
        pairs=pairs[:, None],
        weights=np.ones((pairs.size, 1)),
        normals=np.repeat(normals, 4, axis=0),
    )
    body = np.zeros(len(faces), dtype=np.int64)
    return RootSurface(nodes.reshape(-1, 3), faces, body, ("contact pairs",), contact, flanks, is_mesh=False)


def _plane(
    positions: NDArray[np.float64], area: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors (3,) along the sides of the patches of a surface, and lengths (n, 2), m, of these sides.

    The first points to the nearest neighbour of the pair in the middle: patches of a grid lie side by side. They are
    squares of the area, but no larger than to the neighbour: where a symmetric half is modelled, areas count double.
    Pairs on a line become strips whose plane stands straightest on an axis, a quarter as long as the line: of a plane
    strain model the third direction has no length.
    """
    centred = positions - positions.mean(axis=0)
    _, sizes, directions = np.linalg.svd(np.vstack([centred, np.zeros((3, 3))]), full_matrices=False)
    spacing, first = float(np.sqrt(area.mean())), directions[0]
    if len(positions) > 1 and sizes[0] > 0.0:
        middle = int(np.argmin(np.linalg.norm(centred, axis=1)))
        apart, near = cKDTree(positions).query(positions, k=2)
        spacing = float(np.median(apart[:, 1])) or spacing
        way = positions[near[middle, 1]] - positions[middle]
        first = way / np.linalg.norm(way) if apart[middle, 1] > 0.0 else first
    if sizes[1] > _STRAIGHT * sizes[0]:
        normal = directions[2] * np.sign(directions[2][np.argmax(np.round(np.abs(directions[2]), 6))])
        side = np.minimum(np.sqrt(area), spacing)
        lengths = np.stack([side, side], axis=1)
    else:
        normal = np.eye(3)[2 - np.argmin(np.round(np.abs(first[::-1]), 6))]
        length = 0.25 * float(np.ptp(positions @ first)) or spacing
        lengths = np.tile([spacing, length], (len(positions), 1))
    first = first - (first @ normal) * normal
    first /= np.linalg.norm(first)
    return first, np.cross(normal, first), lengths


def mean_normal(surface: RootSurface, chosen: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Unit vector (3,): mean outward normal of some faces (n_faces,), weighted by their areas."""
    total = face_normals(surface.nodes, surface.faces[chosen]).sum(axis=0)
    return np.asarray(total / max(float(np.linalg.norm(total)), 1e-300))

"""The mesh of a scene as it is drawn in three dimensions: outer faces of the bodies, and the contact pairs on them.

A result file holds outer faces and positions of pairs, but not which face belongs to which pair: faces all of whose
corners are nodes at which pairs stand are in contact. Where the meshes of two bodies do not match, those are the faces
of one of them.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from studyrunner.result.pairs import contact_pairs
from studyrunner.result.view import Result

MESH = ("mesh_x", "mesh_y", "mesh_z", "mesh_quad")

Floats = NDArray[np.float64]
Places = NDArray[np.int64]

_DEEPEST = 0.04  # worn depth as it is drawn, over the size of the contact surfaces
_CORNERS = 4
_SAME = 1e-6  # distance of a node and its pair, over the size of the mesh


@dataclass(frozen=True)
class ContactFaces:
    """Faces in contact and the pairs at their nodes.

    flank (n_faces,): number of the contact surface that a face belongs to, -1 for those not in contact. nodes
    (n_own,): of the faces in contact, ascending. pairs (n_own,): contact pair at each of these nodes. normals
    (n_own, 3): unit vectors out of the body.
    """

    flank: Places
    nodes: Places
    pairs: Places
    normals: Floats


@dataclass(frozen=True)
class RootSurface:
    """Outer faces of the bodies of a joint, and what its contact pairs are on them.

    nodes (n_nodes, 3): m. faces (n_faces, 4): nodes anticlockwise from outside; triangles repeat their last one.
    body (n_faces,): index into `bodies`, whose faces hang together by their nodes. contact: the faces in contact.
    flanks: labels of the contact surfaces.
    """

    nodes: Floats
    faces: Places
    body: Places
    bodies: tuple[str, ...]
    contact: ContactFaces
    flanks: tuple[str, ...]

    def worn(self, depth: Floats, factor: float) -> Floats:
        """Nodes (n_nodes, 3), m, with the wear depth (n_contact,), m, of the pairs times a factor taken off.

        The depth of a pair is that of both its surfaces together: it is drawn into each of them. NaN counts as no wear.
        """
        worn = self.nodes.copy()
        worn[self.contact.nodes] -= factor * np.nan_to_num(depth[self.contact.pairs])[:, None] * self.contact.normals
        return worn

    def near_contact(self, most_faces: int) -> RootSurface:
        """The surface with at most so many faces: those in contact, and those nearest to them."""
        if len(self.faces) <= most_faces:
            return self
        distance, _ = cKDTree(self.nodes[self.contact.nodes]).query(self.nodes[self.faces].mean(axis=1))
        of_contact = self.contact.flank >= 0
        order = np.argsort(np.where(of_contact, -1.0, distance), kind="stable")
        kept = np.sort(order[: max(most_faces, int(of_contact.sum()))])
        used, places = np.unique(self.faces[kept], return_inverse=True)
        nodes, faces = np.searchsorted(used, self.contact.nodes), places.reshape(-1, _CORNERS)
        contact = replace(self.contact, flank=self.contact.flank[kept], nodes=nodes)
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
    """The faces of a file; None where it has no mesh, no positions of pairs, or no pairs on its mesh."""
    pairs = contact_pairs(result, result.shown_point())
    if not np.isfinite(pairs.position).all() or not result.has(*MESH):
        return None
    nodes, faces, parts = read_mesh(result)
    if not len(faces) or faces.shape[1] != _CORNERS:
        return None
    flanks = tuple(dict.fromkeys(pairs.surface.tolist()))
    flank = np.array([flanks.index(label) for label in pairs.surface.tolist()])
    # bodies are counted in the order of their faces
    rows, columns = faces[:, [0, 0, 0]].ravel(), faces[:, 1:].ravel()
    joined = sparse.coo_matrix((np.ones(rows.size), (rows, columns)), shape=(len(nodes), len(nodes)))
    _, component = connected_components(joined, directed=False)
    _, first, body = np.unique(component[faces[:, 0]], return_index=True, return_inverse=True)
    body = np.argsort(np.argsort(first))[body].astype(np.int64)
    contact = find_contact_faces(nodes, faces, pairs.position, flank)
    return RootSurface(nodes, faces, body, _name_bodies(body, parts), contact, flanks) if len(contact.nodes) else None


def read_mesh(result: Result) -> tuple[Floats, Places, NDArray[np.str_]]:
    """Nodes (n, 3), m, faces (n_faces, 4) and their parts (n_faces,), "" where the file names none."""
    nodes = np.stack([result.dataset[f"mesh_{axis}"].values for axis in "xyz"], axis=1).astype(float)
    faces = result.dataset["mesh_quad"].values.astype(np.int64)
    parts = result.dataset["mesh_part"].values.astype(np.str_) if result.has("mesh_part") else np.full(len(faces), "")
    return nodes, faces, parts


def _name_bodies(body: Places, parts: NDArray[np.str_]) -> tuple[str, ...]:
    """The part most of its faces belong to; with a number where bodies share it."""
    names = [Counter(parts[body == number].tolist()).most_common(1)[0][0] for number in range(int(body.max()) + 1)]
    count = Counter(names)
    return tuple(
        name if name and count[name] == 1 else f"{name or 'body'} {names[: place + 1].count(name)}"
        for place, name in enumerate(names)
    )


# --- which faces are in contact ---


def face_normals(nodes: Floats, faces: Places) -> Floats:
    """Outward normals (n_faces, 3) of the length of the area of the faces (n_faces, 4), m2."""
    corners = nodes[faces]
    return np.asarray(0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]))


def find_contact_faces(nodes: Floats, faces: Places, positions: Floats, flank: Places) -> ContactFaces:
    """Faces in contact of a mesh.

    nodes (n_nodes, 3), m. faces (n_faces, 4): nodes anticlockwise from outside; triangles repeat their last one.
    positions (n_contact, 3) of the pairs, m. flank (n_contact,): number of the contact surface of each pair.
    """
    distance, nearest = cKDTree(positions).query(nodes)
    stands = distance <= _SAME * np.linalg.norm(np.ptp(nodes, axis=0))
    found = np.where(stands[faces].all(axis=1), flank[nearest[faces[:, 0]]], -1)
    found[(flank[nearest[faces]] != found[:, None]).any(axis=1)] = -1
    own, normals = faces[found >= 0], np.zeros_like(nodes)
    np.add.at(normals, own, face_normals(nodes, own)[:, None, :])
    used = np.unique(own)
    normals = normals[used] / np.maximum(np.linalg.norm(normals[used], axis=1, keepdims=True), 1e-300)
    return ContactFaces(found, used, nearest[used], normals)

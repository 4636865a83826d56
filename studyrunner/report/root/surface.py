"""The mesh of a scene as it is drawn in three dimensions: outer faces of the bodies, and the contact pairs on them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from studyrunner.report.root.contact_faces import ContactFaces, face_normals, find_contact_faces
from studyrunner.result.scene_pairs import contact_pairs
from studyrunner.result.view import Result

MESH = ("mesh_x", "mesh_y", "mesh_z", "mesh_quad")

_DEEPEST = 0.04  # worn depth as it is drawn, over the size of the contact surfaces
_CORNERS = 4


@dataclass(frozen=True)
class RootSurface:
    """Outer faces of the bodies of a joint, and what its contact pairs are on them.

    nodes (n_nodes, 3): m. faces (n_faces, 4): nodes anticlockwise from outside; triangles repeat their last one.
    body (n_faces,): index into `bodies`, whose faces hang together by their nodes. contact: the faces in contact.
    flanks: labels of the contact surfaces.
    """

    nodes: NDArray[np.float64]
    faces: NDArray[np.int64]
    body: NDArray[np.int64]
    bodies: tuple[str, ...]
    contact: ContactFaces
    flanks: tuple[str, ...]

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

    def mean_normal(self, chosen: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Unit vector (3,): mean outward normal of some faces (n_faces,), weighted by their areas."""
        total = face_normals(self.nodes, self.faces[chosen]).sum(axis=0)
        return np.asarray(total / max(float(np.linalg.norm(total)), 1e-300))


def read_root(result: Result) -> RootSurface | None:
    """The faces of a file; None where it has no mesh, no positions of pairs, or no pairs on its mesh."""
    pairs = contact_pairs(result, result.shown_point())
    if not np.isfinite(pairs.position).all() or not result.has(*MESH):
        return None
    faces = result.read("mesh_quad").values.astype(np.int64)
    if not len(faces) or faces.shape[1] != _CORNERS:
        return None
    nodes = np.stack([result.read(f"mesh_{axis}").values for axis in "xyz"], axis=1).astype(float)
    parts = result.read("mesh_part").values.astype(str) if result.has("mesh_part") else np.full(len(faces), "")
    flanks = tuple(dict.fromkeys(pairs.surface.tolist()))
    flank = np.array([flanks.index(label) for label in pairs.surface.tolist()])
    body = _bodies(faces, len(nodes))
    contact = find_contact_faces(nodes, faces, body, pairs.position, flank)
    return RootSurface(nodes, faces, body, _name_bodies(body, parts), contact, flanks) if len(contact.nodes) else None


def known_counts(fields: Mapping[str, NDArray[np.float64]]) -> NDArray[np.intp]:
    """Places of the cycle counts at which all of these fields (n_cycles, n_contact) have values."""
    return np.flatnonzero(np.all([np.isfinite(values).all(axis=1) for values in fields.values()], axis=0))


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

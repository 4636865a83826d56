"""Which outer faces of a mesh are in contact, and which contact pairs tell the values at their nodes.

A result file holds outer faces and positions of pairs, but not which face belongs to which pair. Pairs stand at nodes
of one body: faces all of whose corners are such nodes are in contact. The body opposite has nodes at the same places,
or others: then its faces are taken that lie on those of the first one and look at them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

_SAME = 1e-6  # distance of a node and its pair, over the size of the mesh
_AWAY, _ASIDE = 0.35, 1.0  # of a node opposite: distance off and along the surface, over the spacing of the pairs
_OPPOSITE = -0.7  # cosine between the normals of two faces that look at each other
_NEAREST = 4


@dataclass(frozen=True)
class ContactFaces:
    """Faces in contact and the pairs at their nodes.

    flank (n_faces,): number of the contact surface that a face belongs to, -1 for those not in contact. nodes
    (n_own,): of the faces in contact, ascending. pairs, weights (n_own, n): contact pairs of each of these nodes and
    their weights, which sum to 1. normals (n_own, 3): unit vectors out of the body.
    """

    flank: NDArray[np.int64]
    nodes: NDArray[np.int64]
    pairs: NDArray[np.int64]
    weights: NDArray[np.float64]
    normals: NDArray[np.float64]

    def values(self, of_pairs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values (n_own,) at `nodes` from those of the pairs (n_contact,)."""
        return np.asarray((of_pairs[self.pairs] * self.weights).sum(axis=1))


def face_normals(nodes: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Outward normals (n_faces, 3) of the length of the area of the faces (n_faces, 4), m2."""
    corners = nodes[faces]
    return np.asarray(0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]))


def find_contact_faces(
    nodes: NDArray[np.float64],
    faces: NDArray[np.int64],
    body: NDArray[np.int64],
    positions: NDArray[np.float64],
    flank: NDArray[np.int64],
) -> ContactFaces:
    """Faces in contact of a mesh.

    Parameters
    ----------
    nodes
        (n_nodes, 3), m.
    faces
        (n_faces, 4): nodes anticlockwise from outside; triangles repeat their last one.
    body
        (n_faces,): which body each belongs to; bodies share no node.
    positions
        (n_contact, 3) of the pairs, m.
    flank
        (n_contact,): number of the contact surface of each pair.
    """
    normals = face_normals(nodes, faces)
    distance, nearest = cKDTree(positions).query(nodes)
    stands = distance <= _SAME * np.linalg.norm(np.ptp(nodes, axis=0))
    found = np.where(stands[faces].all(axis=1), flank[nearest[faces[:, 0]]], -1)
    found[(flank[nearest[faces]] != found[:, None]).any(axis=1)] = -1
    pairs = np.repeat(nearest[:, None], _NEAREST, axis=1)
    weights = np.zeros((len(nodes), _NEAREST))
    weights[:, 0] = 1.0
    for number in np.unique(found[found >= 0]).tolist():
        own = found == number
        if len(np.unique(body[own])) > 1:
            # nodes of both bodies stand where the pairs are
            continue
        outward = _at_pairs(faces[own], normals[own], nearest, len(positions))
        known = np.flatnonzero(np.linalg.norm(outward, axis=1) > 0.5)
        others = np.flatnonzero((found < 0) & (body != body[own][0]))
        opposite, used, of_used, shares = _opposite(
            nodes, faces[others], normals[others], positions[known], outward[known]
        )
        found[others[opposite]] = number
        pairs[used, : of_used.shape[1]] = known[of_used]
        weights[used] = 0.0
        weights[used, : of_used.shape[1]] = shares
    used = np.unique(faces[found >= 0])
    summed = np.zeros_like(nodes)
    np.add.at(summed, faces[found >= 0], normals[found >= 0][:, None, :])
    outward = summed[used] / np.maximum(np.linalg.norm(summed[used], axis=1, keepdims=True), 1e-300)
    columns = max(1, int((weights[used] > 0.0).any(axis=0).sum()))
    return ContactFaces(found, used, pairs[used, :columns], weights[used, :columns], outward)


def _at_pairs(
    faces: NDArray[np.int64],
    normals: NDArray[np.float64],
    pair_of_node: NDArray[np.int64],
    n_pairs: int,
) -> NDArray[np.float64]:
    """Unit normals (n_pairs, 3) at the pairs that stand at nodes of these faces; zero at all others."""
    summed = np.zeros((n_pairs, 3))
    np.add.at(summed, pair_of_node[faces], normals[:, None, :])
    return np.asarray(summed / np.maximum(np.linalg.norm(summed, axis=1, keepdims=True), 1e-300))


def _opposite(
    nodes: NDArray[np.float64],
    faces: NDArray[np.int64],
    normals: NDArray[np.float64],
    positions: NDArray[np.float64],
    outward: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Which of some faces lie opposite to a surface, their nodes (n,), and pairs and weights (n, k) of these.

    positions, outward (n_pairs, 3): of the pairs of the surface and its normals there.
    """
    nothing = np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64), np.empty((0, 1), dtype=np.int64)
    if len(positions) < 3 or not len(faces):
        return *nothing, np.empty((0, 1))
    tree = cKDTree(positions)
    spacing = float(np.median(tree.query(positions, k=2)[0][:, 1]))
    used, corners = np.unique(faces, return_inverse=True)
    _, nearest = tree.query(nodes[used])
    way = nodes[used] - positions[nearest]
    off = np.einsum("ij,ij->i", way, outward[nearest])
    aside = np.sqrt(np.maximum(np.einsum("ij,ij->i", way, way) - off**2, 0.0))
    near = (np.abs(off) <= _AWAY * spacing) & (aside <= _ASIDE * spacing)
    corners = corners.reshape(faces.shape)
    sizes = np.maximum(np.linalg.norm(normals, axis=1), 1e-300)
    cosine = np.einsum("ij,ij->i", normals, outward[nearest[corners[:, 0]]]) / sizes
    chosen = np.flatnonzero(near[corners].all(axis=1) & (cosine <= _OPPOSITE))
    if not len(chosen):
        return *nothing, np.empty((0, 1))
    wanted = np.unique(faces[chosen])
    distance, pairs = tree.query(nodes[wanted], k=min(_NEAREST, len(positions)))
    weights = 1.0 / np.maximum(distance, 1e-6 * spacing) ** 2
    return chosen, wanted, pairs, weights / weights.sum(axis=1, keepdims=True)

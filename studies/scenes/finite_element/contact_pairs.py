"""Coincident node pairs on the flanks: areas and local frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.model import FloatArray, IntArray
from studies.scenes.finite_element.hex_element import CORNERS

_FACE_POINTS = CORNERS[:4, :2] / np.sqrt(3.0)
_FACE_VALUES = np.prod(1.0 + _FACE_POINTS[:, None, :] * CORNERS[None, :4, :2], axis=2) / 4.0
_FACE_DERIVATIVES = np.stack(
    [
        CORNERS[None, :4, 0] * (1.0 + _FACE_POINTS[:, 1, None] * CORNERS[None, :4, 1]) / 4.0,
        CORNERS[None, :4, 1] * (1.0 + _FACE_POINTS[:, 0, None] * CORNERS[None, :4, 0]) / 4.0,
    ]
)


@dataclass(frozen=True)
class ContactPairs:
    """Pairs of coincident nodes, `n_contact` of them.

    moving, fixed (n_contact,): node numbers; the relative displacement is that of `moving` minus that of `fixed`.
    frames (n_contact, 3, 3): rows are the unit vectors normal (out of the moving body, so that motion along it closes
    the pair), first tangent, second tangent. area (n_contact,): m2. position (n_contact, 3): m.
    """

    moving: IntArray
    fixed: IntArray
    frames: FloatArray
    area: FloatArray
    position: FloatArray


def build_contact_pairs(nodes: FloatArray, moving: IntArray, fixed: IntArray, inside: FloatArray) -> ContactPairs:
    """Pairs of one flank.

    nodes (n_nodes, 3), m. moving, fixed (n_rows, n_columns): coincident nodes of the two bodies on a structured grid,
    columns running along the second tangent. inside (3,): a point on the moving body's side of the flank.

    The area of a pair is the integral of its bilinear shape function over the flank. The normal is the mean of those
    of the neighbouring faces, weighted by area; the first tangent runs along the rows, the second along the columns.
    Pairs are in the order of the grid, columns fastest.

    Raises ValueError where the nodes of a pair do not coincide.
    """
    if not np.allclose(nodes[moving], nodes[fixed], rtol=0.0, atol=1e-9):
        raise ValueError("the two nodes of a contact pair do not coincide")
    grid = nodes[moving]
    faces = np.stack([moving[:-1, :-1], moving[1:, :-1], moving[1:, 1:], moving[:-1, 1:]], axis=-1).reshape(-1, 4)
    tangents = np.einsum("apn,fnj->fapj", _FACE_DERIVATIVES, nodes[faces])
    normals = np.cross(tangents[:, 0], tangents[:, 1])
    weighted = np.einsum("pn,fpj->fnj", _FACE_VALUES, normals)
    areas = np.einsum("pn,fp->fn", _FACE_VALUES, np.linalg.norm(normals, axis=2))
    nodal_normal, nodal_area = np.zeros_like(nodes), np.zeros(len(nodes))
    np.add.at(nodal_normal, faces, weighted)
    np.add.at(nodal_area, faces, areas)

    normal = nodal_normal[moving]
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    outward = np.sign(np.sum(normal * (grid - inside), axis=-1, keepdims=True))
    normal = normal * outward
    along_rows = np.gradient(grid, axis=0)
    first = along_rows - np.sum(along_rows * normal, axis=-1, keepdims=True) * normal
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    second = np.cross(normal, first)
    # Along the columns on both flanks, so that the frames of two mirrored flanks mirror each other, too.
    second *= np.sign(np.sum(second * np.gradient(grid, axis=1), axis=-1, keepdims=True))
    return ContactPairs(
        moving=moving.ravel(),
        fixed=fixed.ravel(),
        frames=np.stack([normal, first, second], axis=-2).reshape(-1, 3, 3),
        area=nodal_area[moving].ravel(),
        position=grid.reshape(-1, 3),
    )


def join_pairs(parts: tuple[ContactPairs, ...]) -> ContactPairs:
    """Pairs of several flanks, one flank after the other."""
    return ContactPairs(
        moving=np.concatenate([part.moving for part in parts]),
        fixed=np.concatenate([part.fixed for part in parts]),
        frames=np.concatenate([part.frames for part in parts]),
        area=np.concatenate([part.area for part in parts]),
        position=np.concatenate([part.position for part in parts]),
    )

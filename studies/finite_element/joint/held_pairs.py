"""Contact pairs whose moving nodes are held along a tangent, as in a plane of symmetry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.model import BoolArray, FloatArray, IntArray
from studies.finite_element.joint.constraints import Constraints
from studies.finite_element.joint.pairing import ContactPairs
from studies.scene_error import SceneError

_SLANTED = 0.1  # sine of the angle between the normal of a pair and a plane of symmetry that round-off or facets make


def hold_pairs(
    pairs: ContactPairs, numbers: IntArray, held: BoolArray, constraints: Constraints | None, rotation: FloatArray
) -> ContactPairs:
    """Pairs whose frames have a tangent along each direction that is held; the pairs do not have this tangent.

    numbers (n_nodes,): of the nodes in the file. held (n_nodes, 3): displacements that are 0. constraints: with nodes
    that are held along other directions. rotation (3, 3): by one sector.

    Raises SceneError where a moving node is held along its normal, or the opposite point is not held as well.
    """

    def along(node: int) -> FloatArray:
        """Projection (3, 3) on the directions along which a node is held."""
        if constraints is not None and constraints.oblique[node]:
            return constraints.held_along(node)
        return np.diag(held[node].astype(float))

    frames, present = pairs.frames.copy(), pairs.present.copy()
    slanted = np.zeros(len(held), dtype=np.bool_) if constraints is None else constraints.oblique
    for place in np.flatnonzero((held.any(axis=1) | slanted)[pairs.moving]):
        node, name = int(pairs.moving[place]), pairs.moving_name[pairs.surface[place]]
        by = " (*TRANSFORM)" if slanted[node] else ""
        values, vectors = np.linalg.eigh(along(node))
        axes = vectors.T[values > 0.5] if slanted[node] else np.eye(3)[held[node]]
        normal = frames[place, 0]
        if np.linalg.norm(axes @ normal) > _SLANTED:
            raise SceneError(
                "contact",
                f"{_count_clamped(pairs, held, int(place))} nodes of {name} are clamped, as node {numbers[node]}{by}",
                "take them out of the surface or of the clamped set",
            )
        normal = normal - (axes @ normal) @ axes
        normal /= np.linalg.norm(normal)
        second = axes[-1]
        frames[place] = [normal, np.cross(second, normal), second]
        present[place, 3 - len(axes) :] = False
        start, end = pairs.opposite.indptr[place : place + 2]
        turn = np.linalg.matrix_power(rotation, int(pairs.sector[place]))
        loose = [
            np.abs(turn @ along(int(other)) @ turn.T - along(node)).max() > _SLANTED
            for other in pairs.opposite.indices[start:end]
        ]
        if np.abs(pairs.opposite.data[start:end][loose]).sum() > _SLANTED:
            found = f"node {numbers[node]} of {name} is held in a direction in which the other surface moves{by}"
            raise SceneError("contact", found, "hold both surfaces there, or none")
    return replace(pairs, frames=frames, present=present)


def _count_clamped(pairs: ContactPairs, held: BoolArray, place: int) -> int:
    """Number of moving nodes of the same surface that are held along their normals."""
    own = pairs.surface == pairs.surface[place]
    along_normal = np.linalg.norm(held[pairs.moving] * pairs.frames[:, 0], axis=1) > _SLANTED
    return max(int(np.count_nonzero(along_normal & own)), 1)

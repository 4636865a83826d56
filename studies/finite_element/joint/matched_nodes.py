"""Contact pairs of nodes that meet, with areas and normals as given: of reduced matrices, which have no facets."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from solver.model import FloatArray, IntArray
from studies.finite_element.joint.cut_faces import CyclicAxis
from studies.finite_element.joint.pairing import ContactPairs, ContactSurfaces, initial_gaps, join_pairs, local_frames
from studies.scene_error import SceneError

_TOLERANCE = 0.05  # largest distance of the nodes of a pair over the root of its area, where none is given


def match_nodes(
    coordinates: FloatArray,
    numbers: IntArray,
    contacts: Sequence[ContactSurfaces],
    given: tuple[FloatArray, FloatArray, FloatArray],
    axis: CyclicAxis | None,
) -> ContactPairs:
    """Pairs of the nodes of the first surface of each contact and the nearest ones of the second.

    coordinates (n_nodes, 3): m. numbers (n_nodes,): of the nodes in the file, for messages. contacts: at least one; the
    second surface stands where its sector has it. given: areas (n_nodes,), m2, normals (n_nodes, 3), unit vectors out
    of the body, and initial gaps (n_nodes,), m; NaN where there is none; those of the first surface count. axis: of the
    cyclic structure; the first tangents are as near to it as possible, else to z.

    Raises SceneError where a node has no area or normal, or finds no node that it meets.
    """
    along = np.array([0.0, 0.0, 1.0]) if axis is None else axis.axis
    area, normals, gap = given
    parts = []
    for place, contact in enumerate(contacts):
        nodes, others = contact.first.nodes, contact.second.nodes
        known = (area[nodes] > 0.0) & np.isfinite(normals[nodes]).all(axis=1)
        if not known.all():
            found = f"{np.count_nonzero(~known)} nodes of {contact.first.name} have no area or normal"
            raise SceneError(
                "contact", f"{found}, as node {numbers[nodes[~known][0]]}", "give both in the table of nodes"
            )
        there = coordinates if axis is None or not contact.sector else axis.turned(coordinates, contact.sector)
        apart, nearest = cKDTree(there[others]).query(coordinates[nodes])
        tolerance = contact.tolerance or _TOLERANCE * float(np.sqrt(area[nodes].min()))
        far = np.flatnonzero(apart > tolerance)
        if len(far):
            turned = " after a turn by one sector" if contact.sector else ""
            found = (
                f"{len(far)} of {len(nodes)} nodes of {contact.first.name} are farther than {tolerance:.3g} m from"
                f" those of {contact.second.name}{turned}, as node {numbers[nodes[far[0]]]}"
            )
            raise SceneError("contact", found, "give nodes that meet, node by node, or a larger tolerance")
        n, opposite = len(nodes), others[nearest]
        distance = np.einsum("ij,ij->i", there[opposite] - coordinates[nodes], normals[nodes])
        parts.append(
            ContactPairs(
                moving=nodes,
                opposite=sparse.csr_matrix((np.ones(n), (np.arange(n), opposite)), shape=(n, len(coordinates))),
                sector=np.full(n, contact.sector),
                frames=local_frames(normals[nodes], along),
                present=np.ones((n, 3), dtype=np.bool_),
                area=area[nodes],
                position=coordinates[nodes],
                distance=distance,
                gap=np.where(np.isnan(gap[nodes]), initial_gaps(contact, distance), gap[nodes]),
                surface=np.full(n, place),
                moving_name=(contact.first.name,),
                opposite_name=(contact.second.name,),
            )
        )
    return join_pairs(parts, numbers)

"""Contact pairs of two surfaces: nodes of one surface, and points of the other; the meshes need not match."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from solver.model import BoolArray, FloatArray, IntArray
from studies.finite_element.joint.closest_point import closest_points
from studies.finite_element.joint.cut_faces import CyclicAxis
from studies.finite_element.joint.surfaces import Surface
from studies.scene_error import SceneError

_TOLERANCE = 0.05  # largest distance of the nodes of a pair over the size of a facet, where none is given

_OVERLAP = 0.5
"""Largest overlap of two bodies over the depth of their elements. Interference takes thousandths of it, flat facets on
curved surfaces hundredths; between both faces of one body it is 1 or more."""

_STRAIGHT = 0.7  # part of the way to the closest point that is along the normal, where the way goes through material


@dataclass(frozen=True)
class ContactSurfaces:
    """Two surfaces in contact.

    first, second: the nodes of the finer surface move, those of the first one where both are alike. Where one surface
        alone is covered by the other, its nodes move.
    tolerance: largest distance of a node that is paired, m; None for a share of the size of a facet.
    friction_coefficient: of these surfaces; None where all pairs have the same.
    with_gaps: whether distances in the mesh are gaps of the joint. Otherwise they are errors of flat facets on curved
        surfaces, and the pairs touch.
    clearance: gap of all pairs in place of the distances, m, negative for an interference; None for the distances.
    label: of the pairs; the names of both surfaces if empty.
    sector: of the second surface, counted from that of the first one: 1 where it belongs to the next sector in the
        sense of the axis, -1 to the one before, 0 to the same.
    """

    first: Surface
    second: Surface
    tolerance: float | None = None
    friction_coefficient: float | None = None
    with_gaps: bool = False
    clearance: float | None = None
    label: str = ""
    sector: int = 0

    @property
    def name(self) -> str:
        """Label of the pairs."""
        return self.label or f"{self.first.name}-{self.second.name}"

    @property
    def turned_round(self) -> ContactSurfaces:
        """The same contact with the surfaces in the other order."""
        return replace(self, first=self.second, second=self.first, sector=-self.sector, label=self.name)


@dataclass(frozen=True)
class ContactPairs:
    """Contact pairs, `n_contact` of them.

    moving (n_contact,): nodes. The relative displacement is that of the node minus that of the opposite point.
    opposite (n_contact, n_nodes): interpolation weights of the opposite points; rows sum to 1.
    sector (n_contact,): of the opposite point, counted from that of the moving node: 0, 1 or -1. The weights are of the
        nodes of this sector that the point is the image of.
    frames (n_contact, 3, 3): rows are unit vectors: normal (out of the moving body, so that motion along it closes the
        pair), first tangent, second tangent.
    present (n_contact, 3): whether a relative displacement exists; the others are held.
    area (n_contact,): m2.
    position (n_contact, 3): of the moving node, m.
    distance (n_contact,): along the normal, positive where the pair is open, m.
    gap (n_contact,): initial gap, m.
    surface (n_contact,): number of the pair of surfaces.
    moving_name, opposite_name: names of the surfaces, for each pair of surfaces.
    """

    moving: IntArray
    opposite: sparse.csr_matrix
    sector: IntArray
    frames: FloatArray
    present: BoolArray
    area: FloatArray
    position: FloatArray
    distance: FloatArray
    gap: FloatArray
    surface: IntArray
    moving_name: tuple[str, ...]
    opposite_name: tuple[str, ...]

    @property
    def n_contact(self) -> int:
        """Number of pairs."""
        return len(self.moving)

    def chosen(self, which: IntArray | BoolArray) -> ContactPairs:
        """Some of the pairs."""
        parts = ("moving", "opposite", "sector", "frames", "present", "area", "position", "distance", "gap", "surface")
        return replace(self, **{name: getattr(self, name)[which] for name in parts})


def build_contact_pairs(
    coordinates: FloatArray,
    numbers: IntArray,
    contacts: Sequence[ContactSurfaces],
    along: FloatArray,
    axis: CyclicAxis | None = None,
) -> ContactPairs:
    """Pairs of all surfaces, those of the first ones first, each by its moving nodes in ascending order.

    coordinates (n_nodes, 3): m. numbers (n_nodes,): of the nodes in the file, for messages. contacts: at least one.
    along (3,): the first tangents are the projections of this direction where it does not stand on the surface; else
    of the axis of coordinates that lies flattest on it. axis: of the cyclic structure, for contacts between sectors.

    Raises SceneError where nodes find no point of the other surface, do not face it, or find it behind their own body,
    and where nodes belong to two pairs.
    """
    parts = [_pair(coordinates, numbers, contact, place, along, axis) for place, contact in enumerate(contacts)]
    return join_pairs(parts, numbers)


def join_pairs(parts: Sequence[ContactPairs], numbers: IntArray) -> ContactPairs:
    """Pairs of several surfaces, one after the other. Raises SceneError where a node moves in two of them."""
    joined = ContactPairs(
        moving=np.concatenate([part.moving for part in parts]),
        opposite=sparse.vstack([part.opposite for part in parts], format="csr"),
        sector=np.concatenate([part.sector for part in parts]),
        frames=np.concatenate([part.frames for part in parts]),
        present=np.concatenate([part.present for part in parts]),
        area=np.concatenate([part.area for part in parts]),
        position=np.concatenate([part.position for part in parts]),
        distance=np.concatenate([part.distance for part in parts]),
        gap=np.concatenate([part.gap for part in parts]),
        surface=np.concatenate([part.surface for part in parts]),
        moving_name=tuple(name for part in parts for name in part.moving_name),
        opposite_name=tuple(name for part in parts for name in part.opposite_name),
    )
    unique, count = np.unique(joined.moving, return_counts=True)
    if (count > 1).any():
        twice = unique[count > 1]
        both = joined.surface[joined.moving == twice[0]]
        names = " and ".join(joined.moving_name[place] for place in both)
        raise SceneError(
            "contact",
            f"{len(twice)} nodes move in two pairs, in {names}, as node {numbers[twice[0]]}",
            "take them out of one of the surfaces",
        )
    return joined


def local_frames(normals: FloatArray, along: FloatArray) -> FloatArray:
    """Frames (n, 3, 3) of unit normals (n, 3): rows normal, first tangent near `along`, second tangent."""
    candidates = [along / np.linalg.norm(along), *np.eye(3)]
    steepest = [np.abs(normals @ each).max(initial=0.0) for each in candidates]
    # one direction for the whole surface, so that neighbouring frames are alike
    direction = candidates[0] if steepest[0] < 0.9 else candidates[1 + int(np.argmin(steepest[1:]))]
    first = direction - (normals @ direction)[:, None] * normals
    flat = np.linalg.norm(first, axis=1) < 0.1
    for place in np.flatnonzero(flat):  # on a closed surface no direction lies on it everywhere
        axis = np.eye(3)[np.argmin(np.abs(normals[place]))]
        first[place] = axis - (normals[place] @ axis) * normals[place]
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([normals, first, np.cross(normals, first)], axis=1)


@dataclass(frozen=True)
class _Match:
    """Nodes of one surface, and the closest points of the other.

    weights (n, n_nodes): of the points. area, normals (n,), (n, 3): of the nodes. apart (n,): to the facets, m.
    distance (n,): along the normals, m. facing (n,): cosine between the normals of node and point. depth (n,): of the
    elements below node or point, the smaller one, m.
    """

    moving: Surface
    opposite: Surface
    weights: sparse.csr_matrix
    area: FloatArray
    normals: FloatArray
    apart: FloatArray
    distance: FloatArray
    facing: FloatArray
    depth: FloatArray


def _match(coordinates: FloatArray, moving: Surface, opposite: Surface, there: FloatArray) -> _Match:
    """Closest points. there (n_nodes, 3): coordinates in the sector of the opposite surface, m."""
    found = closest_points(coordinates[moving.nodes], opposite, there)
    area, normals = moving.areas_and_normals(coordinates)
    point, corner = np.nonzero(found.weights)
    entries = (found.weights[point, corner], (point, found.nodes[point, corner]))
    weights = sparse.csr_matrix(entries, shape=(len(moving.nodes), len(coordinates)))
    facing, depth = np.zeros_like(coordinates), np.zeros(len(coordinates))
    facing[opposite.nodes] = opposite.areas_and_normals(there)[1]
    depth[opposite.nodes] = opposite.depth
    offset = weights @ there - coordinates[moving.nodes]
    return _Match(
        moving=moving,
        opposite=opposite,
        weights=weights,
        area=area,
        normals=normals,
        apart=found.distance,
        distance=np.einsum("ij,ij->i", offset, normals),
        facing=np.einsum("ij,ij->i", weights @ facing, normals),
        depth=np.minimum(moving.depth, weights @ depth),
    )


def _check_match(match: _Match, numbers: IntArray, facet: float, sector: int) -> None:
    """Raises SceneError where no tolerance makes pairs of these nodes. facet: size of the larger facets, m."""
    turned = " after a turn by one sector" if sector else ""
    names, n = (match.moving.name, match.opposite.name), len(match.apart)
    if (match.facing > 0.0).all():
        raise SceneError("contact", f"{names[0]} and {names[1]} face the same way", "give faces that touch")
    inside = (match.distance < -_OVERLAP * match.depth) & (match.distance < -_STRAIGHT * match.apart)
    if inside.any():
        deepest = np.argmin(match.distance)
        raise SceneError(
            "contact",
            f"between {names[0]} and {names[1]} there is material: at {inside.sum()} of {n} nodes {names[1]} is up to"
            f" {-match.distance[deepest]:.3g} m below {names[0]}, whose elements are {match.depth[deepest]:.3g} m deep",
            "give two surfaces that face each other in the same sector, or name them in next_sector",
        )
    away = match.apart > facet
    if away.any():
        raise SceneError(
            "contact",
            f"{away.sum()} of {n} nodes of {names[0]} are farther from {names[1]} than a facet ({facet:.3g} m);"
            f" the farthest is at {match.apart.max():.3g} m{turned}",
            f"give surfaces that touch{turned}, one of which covers the other: a larger tolerance is no remedy",
        )
    aside = np.flatnonzero(match.facing > 0.0)
    if len(aside):
        node = numbers[match.moving.nodes[aside[0]]]
        found = f"{len(aside)} of {n} nodes of {names[0]} do not face {names[1]}, as node {node}"
        raise SceneError("contact", found, "leave them out of the surface")


def initial_gaps(contact: ContactSurfaces, distance: FloatArray) -> FloatArray:
    """Initial gaps (n,), m: the clearance that the model states, the distances of the mesh (n,), or none."""
    if contact.clearance is not None:
        return np.full_like(distance, contact.clearance)
    return distance if contact.with_gaps else np.zeros_like(distance)


def _matched(coordinates: FloatArray, contact: ContactSurfaces, axis: CyclicAxis | None) -> _Match:
    """The first surface of a contact, which moves, and the second one where its sector has it."""
    if contact.sector == 0:
        return _match(coordinates, contact.first, contact.second, coordinates)
    if axis is None:
        raise ValueError("a contact between sectors needs the axis of the cyclic structure")
    return _match(coordinates, contact.first, contact.second, axis.turned(coordinates, contact.sector))


def _pair(
    coordinates: FloatArray,
    numbers: IntArray,
    contact: ContactSurfaces,
    place: int,
    along: FloatArray,
    axis: CyclicAxis | None,
) -> ContactPairs:
    first, second = contact.first, contact.second
    shared = np.intersect1d(first.nodes, second.nodes)
    if len(shared):
        raise SceneError(
            "contact",
            f"{first.name} and {second.name} share {len(shared)} nodes",
            "give the two bodies nodes of their own where they touch",
        )
    sizes = first.facet_size(coordinates), second.facet_size(coordinates)
    if sizes[1] < (1.0 - 1e-6) * sizes[0]:
        contact = contact.turned_round
    tolerance = _TOLERANCE * max(sizes) if contact.tolerance is None else contact.tolerance
    match = _matched(coordinates, contact, axis)
    far = match.apart > tolerance
    if far.any():
        # a coarse surface may lie inside a finer one that goes on
        other = _matched(coordinates, contact.turned_round, axis)
        if (other.apart > tolerance).any():
            _check_match(match, numbers, max(sizes), contact.sector)
            raise SceneError(
                "contact",
                f"{np.count_nonzero(far)} of {len(far)} nodes of {match.moving.name} are farther than {tolerance:g} m"
                f" from {match.opposite.name}",
                f"give a larger tolerance (the farthest is at {match.apart.max():.3g} m), or surfaces of which one"
                " covers the other",
            )
        match, contact = other, contact.turned_round
    _check_match(match, numbers, max(sizes), contact.sector)
    nodes, n = match.moving.nodes, len(match.area)
    return ContactPairs(
        moving=nodes,
        opposite=match.weights,
        sector=np.full(n, contact.sector),
        frames=local_frames(match.normals, along),
        present=np.ones((n, 3), dtype=np.bool_),
        area=match.area,
        position=coordinates[nodes],
        distance=match.distance,
        gap=initial_gaps(contact, match.distance),
        surface=np.full(n, place),
        moving_name=(match.moving.name,),
        opposite_name=(match.opposite.name,),
    )

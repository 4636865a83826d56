"""Contact pairs of two surfaces: nodes of one surface, and points of the other; the meshes need not match."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy  # whose parts are loaded at their first use
from scipy import sparse

from solver.model import BoolArray, FloatArray, IntArray
from studies.finite_element.cut_faces import CyclicAxis
from studies.finite_element.solid_mesh import SolidMesh
from studies.finite_element.surfaces import Surface, closest_points
from studies.scene_error import SceneError

_TOLERANCE = 0.05  # largest distance of the nodes of a pair over the size of a facet, or the root of an area
_OVERLAP = 0.5
"""Largest overlap of two bodies over the depth of their elements. Interference takes thousandths of it, flat facets on
curved surfaces hundredths; between both faces of one body it is 1 or more."""
_TOUCHES = 1e-9  # of the extent of a face: a distance that is round-off
_FLAT = 1e-10  # moment of inertia of a face over its largest, about an axis about which it has no rotation
_NEIGHBOURS = 30  # of a node of no face, with which a surface turns there: of several lines of nodes
_STRAIGHT = 0.7  # part of the way to the closest point that is along the normal, where the way goes through material


@dataclass(frozen=True)
class ContactSurfaces:
    """Two surfaces in contact.

    The nodes of the finer surface move, those of the first one where both are alike; where one surface alone is covered
    by the other, its nodes move. tolerance: largest distance of a pair, m; None for a share of a facet.
    friction_coefficient: None where all pairs have the same. with_gaps: whether distances in the mesh are gaps, and no
    errors of flat facets on curved surfaces. clearance: gap of all pairs in place of the distances, m, negative for an
    interference. label: of the pairs; the names of both surfaces if empty. sector: of the second surface: 1 for the
    next sector in the sense of the axis, -1 for the one before.
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

    def beside(self, coordinates: FloatArray, axis: CyclicAxis | None) -> FloatArray:
        """Coordinates (n_nodes, 3), m, where the second surface is; axis: of the cyclic structure."""
        if not self.sector:
            return coordinates
        assert axis is not None, "of a sector"
        return axis.turned(coordinates, self.sector)

    @property
    def turned_round(self) -> "ContactSurfaces":
        """The same with the surfaces in the other order."""
        return replace(self, first=self.second, second=self.first, sector=-self.sector, label=self.name)


Contacts = tuple[ContactSurfaces, ...]
"""Several pairs of surfaces."""


@dataclass(frozen=True)
class ContactPairs:
    """Contact pairs; the relative displacement is that of the moving node minus that of the opposite point.

    moving (n_contact,): nodes. opposite (n_contact, n_nodes): interpolation weights of the opposite points, of the
    nodes of this sector whose images they are, with an entry for all nodes of the face; sector (n_contact,): where the
    point is, 0, 1 or -1. frames (n_contact, 3, 3): rows are normal (out of the moving body: motion along it closes the
    pair), first and second tangent. present (n_contact, 3): whether a relative displacement exists; the others are
    held. area (n_contact,): m2. position (n_contact, 3): of the moving node, m. distance (n_contact,): along the
    normal, positive where the pair is open, m. gap (n_contact,): m. surface (n_contact,): number of the pair of
    surfaces, with moving_name and opposite_name.
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

    def carried(self, coordinates: FloatArray, axis: CyclicAxis | None) -> sparse.csr_matrix:
        """Matrix (3 n_contact, 3 n_nodes) from displacements of this sector to those of the opposite points, which move
        with their faces to where the moving nodes are: a motion as one body causes no relative displacement.

        `u = sum w_i u_i + theta x arm`, with the arm from the opposite point to the moving node and the mean rotation
        of the face, `theta = J^-1 sum r_i x u_i`, J its moment of inertia. coordinates (n_nodes, 3), m.
        """
        weights, place, node = self.opposite, self.position.copy(), self.opposite.indices
        for k in (1, -1):  # back to this sector
            if axis is not None and (self.sector == k).any():
                place[self.sector == k] = axis.turned(place[self.sector == k], -k)
        count = np.diff(weights.indptr)
        of, first = np.repeat(np.arange(self.n_contact), count), weights.indptr[:-1]
        r = coordinates[node]
        arm = place - np.add.reduceat(weights.data[:, None] * r, first)
        r = r - (np.add.reduceat(r, first) / count[:, None])[of]
        square = (r**2).sum(axis=1)
        inertia = np.add.reduceat(square[:, None, None] * np.eye(3) - r[:, :, None] * r[:, None, :], first)
        extent = np.sqrt(np.add.reduceat(square, first))
        arm[np.linalg.norm(arm, axis=1) <= _TOUCHES * extent] = 0.0
        turn = _cross(arm) @ np.linalg.pinv(inertia, rcond=_FLAT, hermitian=True)
        blocks = weights.data[:, None, None] * np.eye(3) - turn[of] @ _cross(r)
        shape = 3 * weights.shape[0], 3 * weights.shape[1]
        carried = sparse.bsr_matrix((blocks, node, weights.indptr), shape).tocsr()
        carried.eliminate_zeros()
        return carried

    def chosen(self, which: IntArray | BoolArray) -> "ContactPairs":
        """Some of the pairs."""
        return replace(self, **{name: getattr(self, name)[which] for name in ("opposite", *_ARRAYS)})


def _cross(vectors: FloatArray) -> FloatArray:
    """Matrices (n, 3, 3) of the vector products with vectors (n, 3) on the left."""
    return np.cross(np.eye(3), vectors[:, None])


_ARRAYS = ("moving", "sector", "frames", "present", "area", "position", "distance", "gap", "surface")


def build_contact_pairs(
    mesh: SolidMesh, contacts: Sequence[ContactSurfaces], along: FloatArray, axis: CyclicAxis | None = None
) -> ContactPairs:
    """Pairs of all surfaces, those of the first ones first, each by its moving nodes in ascending order.

    contacts: at least one. along (3,): see `local_frames`. axis: of the cyclic structure, for contacts between sectors.
    Raises SceneError where nodes find no point of the other surface, do not face it, find it behind their own body, or
    move in two pairs.
    """
    parts = []
    for place, contact in enumerate(contacts):
        match, limit = _best_match(mesh, contact, place, along, axis)
        _check_match(match, mesh, limit)
        parts.append(match.pairs)
    return _joined(parts, mesh)


def build_ties(
    mesh: SolidMesh, ties: Sequence[ContactSurfaces], along: FloatArray
) -> tuple[ContactPairs, tuple[str, ...]]:
    """As `build_contact_pairs`, of surfaces that are glued; a sentence on each whose nodes are tied in part.

    Where neither surface is covered, nodes of the first one that are too far stay free, as in Abaqus. Raises SceneError
    where no node is near.
    """
    parts, notes = [], []
    for place, tie in enumerate(ties):
        match, limit = _best_match(mesh, tie, place, along, None)
        if (match.apart > limit).any():
            match = _match(mesh.coordinates, tie, place, along, None)
        near = match.apart <= limit
        if near.any() and not near.all():
            found = f"{np.count_nonzero(~near)} of {len(near)} nodes of {tie.first.name} are farther than {limit:.3g} m"
            remedy = "give a larger POSITION TOLERANCE if they are to be"
            notes.append(f"{found} from {tie.second.name} and are not tied, as in Abaqus: {remedy}")
            pairs, cosines = match.pairs.chosen(near), match.facing[near]
            match = replace(match, pairs=pairs, apart=match.apart[near], facing=cosines, depth=match.depth[near])
        _check_match(match, mesh, limit)
        parts.append(match.pairs)
    return _joined(parts, mesh), tuple(notes)


def _best_match(
    mesh: SolidMesh, contact: ContactSurfaces, place: int, along: FloatArray, axis: CyclicAxis | None
) -> tuple["_Match", float]:
    """Pairs of the nodes of the finer surface, or of those of the other one where they alone are all near; largest
    distance, m. Raises SceneError where the surfaces share nodes.
    """
    if len(shared := np.intersect1d(contact.first.nodes, contact.second.nodes)):
        found = f"{contact.first.name} and {contact.second.name} share {len(shared)} nodes"
        raise SceneError("contact", found, "give the two bodies nodes of their own where they touch")
    both, coordinates = (contact.first, contact.second), mesh.coordinates
    # roots of the mean areas of their facets
    sizes = [float(np.sqrt(each.areas_and_normals(coordinates)[0].sum() / len(each.facets))) for each in both]
    finer = contact.turned_round if sizes[1] < (1.0 - 1e-6) * sizes[0] else contact
    facet = max(sizes)
    limit = min(facet, _TOLERANCE * facet if contact.tolerance is None else contact.tolerance)
    match = _match(coordinates, finer, place, along, axis)
    if (match.apart > limit).any():
        # a coarse surface may lie inside a finer one that goes on
        other = _match(coordinates, finer.turned_round, place, along, axis)
        match = match if (other.apart > limit).any() else other
    return match, limit


def match_nodes(
    mesh: SolidMesh, contacts: Contacts, given: tuple[FloatArray, FloatArray, FloatArray], axis: CyclicAxis | None
) -> ContactPairs:
    """As `build_contact_pairs`, of nodes of the first surface that meet nodes of the second, as reduced matrices have.

    given, of the first surface: areas (n_nodes,), m2, normals (n_nodes, 3), unit vectors out of the body, initial gaps
    (n_nodes,), m; NaN where there is none. The first tangents are as near to the axis as possible, else to z. Raises
    SceneError where a node has no area or normal, or meets no node.
    """
    along = np.array([0.0, 0.0, 1.0]) if axis is None else axis.axis
    (area, normals, gap), coordinates = given, mesh.coordinates
    parts = []
    for place, contact in enumerate(contacts):
        nodes, others = contact.first.nodes, contact.second.nodes
        if len(unknown := nodes[~((area[nodes] > 0.0) & np.isfinite(normals[nodes]).all(axis=1))]):
            found = f"{len(unknown)} nodes of {contact.first.name} have no area or normal, as node"
            raise SceneError("contact", f"{found} {mesh.numbers[unknown[0]]}", "give both in the table of nodes")
        there = contact.beside(coordinates, axis)
        near = np.arange(1, 1 + min(_NEIGHBOURS, len(others)))
        distances, nearest = scipy.spatial.cKDTree(there[others]).query(coordinates[nodes], near)
        apart = distances[:, 0]
        limit = contact.tolerance or _TOLERANCE * float(np.sqrt(area[nodes].min()))
        _check_near(contact, apart, limit, mesh, "give nodes that meet, node by node, or a larger tolerance")
        entries = np.zeros(nearest.shape)
        entries[:, 0] = 1.0
        stored = entries.ravel(), others[nearest].ravel(), len(near) * np.arange(len(nodes) + 1)
        weights = sparse.csr_matrix(stored, shape=(len(nodes), len(coordinates)))
        pairs = _pairs_of(coordinates, there, contact, place, weights, (area[nodes], normals[nodes]), along)
        parts.append(replace(pairs, gap=np.where(np.isnan(gap[nodes]), pairs.gap, gap[nodes])))
    return _joined(parts, mesh)


def _pairs_of(
    coordinates: FloatArray,
    there: FloatArray,
    contact: ContactSurfaces,
    place: int,
    weights: sparse.csr_matrix,
    surface: tuple[FloatArray, FloatArray],
    along: FloatArray,
) -> ContactPairs:
    """Pairs of the nodes of the first surface. surface: their areas and normals. place: of the contact among all.

    there (n_nodes, 3): coordinates where the sector of the second surface is.
    """
    nodes, (area, normals) = contact.first.nodes, surface
    n = len(nodes)
    distance = np.einsum("ij,ij->i", weights @ there - coordinates[nodes], normals)
    gap = distance if contact.with_gaps else np.zeros(n)
    return ContactPairs(
        moving=nodes,
        opposite=weights,
        sector=np.full(n, contact.sector),
        frames=local_frames(normals, along),
        present=np.ones((n, 3), dtype=np.bool_),
        area=area,
        position=coordinates[nodes],
        distance=distance,
        gap=gap if contact.clearance is None else np.full(n, contact.clearance),
        surface=np.full(n, place),
        moving_name=(contact.first.name,),
        opposite_name=(contact.second.name,),
    )


def _joined(parts: Sequence[ContactPairs], mesh: SolidMesh) -> ContactPairs:
    """Pairs of several surfaces, one after the other. Raises SceneError where a node moves in two of them."""
    joined = ContactPairs(
        opposite=sparse.vstack([part.opposite for part in parts], format="csr"),
        moving_name=tuple(name for part in parts for name in part.moving_name),
        opposite_name=tuple(name for part in parts for name in part.opposite_name),
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in _ARRAYS},
    )
    unique, count = np.unique(joined.moving, return_counts=True)
    if len(twice := unique[count > 1]):
        names = " and ".join(joined.moving_name[place] for place in joined.surface[joined.moving == twice[0]])
        found = f"{len(twice)} nodes move in two pairs, in {names}, as node {mesh.numbers[twice[0]]}"
        raise SceneError("contact", found, "take them out of one of the surfaces")
    return joined


def local_frames(normals: FloatArray, along: FloatArray) -> FloatArray:
    """Frames (n, 3, 3) of unit normals (n, 3): rows normal, first tangent, second tangent.

    The first tangents are projections of the direction along (3,) where it does not stand on the surface, else of the
    axis of coordinates that lies flattest on it.
    """
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
    """Pairs of a contact, whose first surface moves, and how they fit.

    apart (n,): from the nodes to the facets, m. facing (n,): cosine between the normals of node and point. depth (n,):
    of the elements below node or point, the smaller one, m.
    """

    contact: ContactSurfaces
    pairs: ContactPairs
    apart: FloatArray
    facing: FloatArray
    depth: FloatArray


def _match(
    coordinates: FloatArray, contact: ContactSurfaces, place: int, along: FloatArray, axis: CyclicAxis | None
) -> _Match:
    """Nodes of the first surface and the closest points of the second one where its sector has it."""
    moving, opposite, there = contact.first, contact.second, contact.beside(coordinates, axis)
    weights, apart = closest_points(coordinates[moving.nodes], opposite, there)
    area, normals = moving.areas_and_normals(coordinates)
    facing, depth = np.zeros_like(coordinates), np.zeros(len(coordinates))
    facing[opposite.nodes] = opposite.areas_and_normals(there)[1]
    depth[opposite.nodes] = opposite.depth
    return _Match(
        contact=contact,
        pairs=_pairs_of(coordinates, there, contact, place, weights, (area, normals), along),
        apart=apart,
        facing=np.einsum("ij,ij->i", weights @ facing, normals),
        depth=np.minimum(moving.depth, weights @ depth),
    )


def _check_match(match: _Match, mesh: SolidMesh, limit: float) -> None:
    """Raises SceneError where nodes are no pairs. limit: largest distance from the facets, m."""
    contact, distance, n = match.contact, match.pairs.distance, match.pairs.n_contact
    moving, opposite = contact.first.name, contact.second.name
    if (match.facing > 0.0).all():
        raise SceneError("contact", f"{moving} and {opposite} face the same way", "give faces that touch")
    inside = (distance < -_OVERLAP * match.depth) & (distance < -_STRAIGHT * match.apart)
    if inside.any():
        deepest = np.argmin(distance)
        found = (
            f"between {moving} and {opposite} there is material: at {inside.sum()} of {n} nodes {opposite} is up to"
            f" {-distance[deepest]:.3g} m below {moving}, whose elements are {match.depth[deepest]:.3g} m deep"
        )
        remedy = "give two surfaces that face each other in the same sector, or name them in next_sector"
        raise SceneError("contact", found, remedy)
    remedy = "give surfaces that touch, of which one covers the other, or a larger tolerance, at most a facet"
    _check_near(contact, match.apart, limit, mesh, remedy)
    if len(aside := np.flatnonzero(match.facing > 0.0)):
        found = f"{len(aside)} of {n} nodes of {moving} do not face {opposite}, as node"
        remedy = "leave them out of the surface"
        raise SceneError("contact", f"{found} {mesh.numbers[match.pairs.moving[aside[0]]]}", remedy)


def _check_near(contact: ContactSurfaces, apart: FloatArray, limit: float, mesh: SolidMesh, remedy: str) -> None:
    """Raises SceneError where nodes of the first surface are farther from the second than the limit; apart (n,), m."""
    if far := int(np.count_nonzero(apart > limit)):
        worst, turned = int(np.argmax(apart)), " after a turn by one sector" if contact.sector else ""
        found = (
            f"{far} of {len(apart)} nodes of {contact.first.name} are farther than {limit:.3g} m from"
            f" {contact.second.name}{turned}; the farthest, node {mesh.numbers[contact.first.nodes[worst]]}, is at"
            f" {apart[worst]:.3g} m"
        )
        raise SceneError("contact", found, remedy)

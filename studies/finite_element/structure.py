"""A finite-element model of a joint, SI; which displacements are free, held, or follow others.

Nodes of the right cut face follow those of the left one, the moving node of a contact pair or of a tie follows the
opposite point, plus the relative displacement of the pair; constraints do the same to other displacements.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from solver.model import BoolArray, FloatArray, IntArray
from studies.finite_element.constraints import Constraints, eliminate, resolve
from studies.finite_element.cut_faces import CutFaces
from studies.finite_element.pairing import ContactPairs, Contacts, build_contact_pairs, build_ties
from studies.finite_element.solid_mesh import Rotation, SolidMesh
from studies.scene_error import SceneError

_SLANTED = 0.1  # sine of the angle between the normal of a pair and a plane of symmetry that round-off or facets make
_ROUND_OFF = 1e-6  # of a direction, which decks give with few digits


@dataclass(frozen=True)
class FeModel:
    """A model, whose nodes are those of a mesh.

    prestress: whether the stiffness that is assembled contains the stress and the displacements of the glued structure
    under the centrifugal load, and spin softening. preload (3 n_nodes,): constant forces, N, and gravity (3,):
    acceleration of all mass, m/s2; no part of the prestress, as forces on gaps act otherwise on a glued structure.
    forms: "stiffness", N/m, "mass", kg, and where there is one "damping", N s/m, of another program, with their
    prestress and spin softening, (3 n_nodes, 3 n_nodes), symmetric and unconstrained; None: they are assembled here.
    suspension: frequency, Hz, of the rigid motions of a free structure, on springs in proportion to its mass.
    """

    mesh: SolidMesh
    rotation: Rotation | None = None
    prestress: bool = True
    preload: FloatArray | None = None
    gravity: FloatArray | None = None
    forms: Mapping[str, sparse.csr_matrix] | None = None
    suspension: float = 0.0


def mean_motion(nodes: IntArray, direction: FloatArray, n_nodes: int) -> FloatArray:
    """Row (3 n_nodes,) of the mean displacement of nodes (n,) along a direction (3,); as a load 1 N, shared evenly."""
    row = np.zeros((n_nodes, 3))
    np.add.at(row, nodes, direction / (np.linalg.norm(direction) * len(nodes)))
    return row.ravel()


@dataclass(frozen=True)
class Retainer:
    """A spring, N/m, on the mean relative displacement of all pairs, weighted by area, along a direction (3,).

    It keeps a joint from walking that friction alone holds; without it there may be no periodic state.
    """

    stiffness: float
    direction: FloatArray


@dataclass(frozen=True)
class JointDefinition:
    """What is done with a model.

    held (n_nodes, 3): displacements that are 0, or follow others by the constraints. load (3 n_nodes,): harmonic load,
    N per unit of excitation amplitude. responses: rows (3 n_nodes,) by name. cut: None where the structure is no cyclic
    sector. ties: surfaces that are always glued. pairs: in place of those that `build_contact_pairs` makes.
    """

    contacts: Contacts
    held: BoolArray
    load: FloatArray
    responses: Mapping[str, FloatArray]
    cut: CutFaces | None = None
    retainer: Retainer | None = None
    ties: Contacts = ()
    constraints: Constraints | None = None
    pairs: ContactPairs | None = None


@dataclass(frozen=True)
class ReductionOptions:
    """nodal_diameter: of the travelling wave that excites. n_modes: stuck modes. loss_factor: see `build_fe_scene`.
    all_sectors: whether for a ring of sectors (`solver.structure.ring`): all nodal diameters, and the blade's modes.
    """

    nodal_diameter: int = 0
    n_modes: int = 20
    loss_factor: float = 1e-3
    all_sectors: bool = False


@dataclass(frozen=True)
class Coordinates:
    """`u = glued @ y + relative @ u_rel`: all displacements (3 n_nodes,) from the free ones and those of the pairs.

    Both are complex where a wave has a phase. relative: pair by pair normal, first, second tangent, without those that
    do not exist. node (n_free,): of each y, ascending.
    """

    glued: sparse.csr_matrix
    relative: sparse.csr_matrix
    node: IntArray


@dataclass(frozen=True)
class Structure:
    """A structure with contact pairs.

    held (n_nodes, 3): displacements that are 0, or depend on others by the constraints. cut: cut faces; None where the
    structure is no cyclic sector. followers (m,): nodes that follow others, those of the pairs first. points (3 m,
    3 n_nodes): what they follow in this sector; sectors (m,): in which it is; labels (m,): what joins them. notes: on
    nodes that a tie does not join.
    """

    held: BoolArray
    cut: CutFaces | None
    constraints: Constraints
    pairs: ContactPairs
    followers: IntArray
    points: sparse.csr_matrix
    sectors: IntArray
    labels: tuple[str, ...]
    notes: tuple[str, ...] = ()

    def _follow(self, nodal_diameter: int) -> tuple[IntArray, sparse.csr_matrix, sparse.csr_matrix, sparse.csr_matrix]:
        """Displacements (3 m,) of the followers; those of all nodes that they are, but for what is held; what they
        follow in a wave; and all displacements from those that follow none.
        """
        dofs = (3 * self.followers[:, None] + np.arange(3)).ravel()
        loose = sparse.diags((~self.held.ravel()).astype(float), format="csr") - self.constraints.across
        follow, points = loose[:, dofs], self.points
        if self.cut is not None:
            # a point of the next sector moves as its image in this one, turned and with the phase of the wave
            points = (self.cut.across(self.sectors, nodal_diameter) @ points).tocsr()
        if (total := resolve(follow @ points + self.constraints.steps)) is None:
            raise SceneError("contact", "surfaces follow each other in a circle", "give every pair of surfaces once")
        return dofs, follow, points, total

    def deviation(self, motion: NDArray[Any], nodal_diameter: int) -> tuple[NDArray[Any], sparse.csr_matrix]:
        """Displacements (3 n_nodes,) that others cause in a motion, less the motion; all that move with these.

        What is held does not count. Raises SceneError as `coordinates`.
        """
        dofs, follow, points, total = self._follow(nodal_diameter)
        steps = self.constraints.steps
        depends = np.diff(steps.indptr) > 0
        return follow @ (points @ motion - motion[dofs]) + steps @ motion - depends * motion, total

    def coordinates(self, nodal_diameter: int) -> Coordinates:
        """Those of a wave. Raises SceneError where nodes follow each other in a circle, or none is free."""
        pairs, constraints, held = self.pairs, self.constraints, self.held.ravel()
        dofs, follow, _, total = self._follow(nodal_diameter)
        own = ~(held | constraints.idle)
        own[dofs] = False
        if not own.any():
            remedy = "refine the mesh, or keep modes in reduced matrices"
            raise SceneError("contact", "all nodes that move are in contact pairs", remedy)
        free = np.flatnonzero(own)
        frames = sparse.block_diag(list(np.swapaxes(pairs.frames, 1, 2)), format="csr")[:, pairs.present.ravel()]
        driven = follow[:, : 3 * pairs.n_contact] @ frames
        return Coordinates((total @ constraints.axes[:, free]).tocsr(), (total @ driven).tocsr(), free // 3)


def build_structure(model: FeModel, joint: JointDefinition) -> Structure:
    """The structure of a joint, with its pairs. Raises SceneError where the model describes no possible joint."""
    numbers, cut = model.mesh.numbers, joint.cut
    constraints = joint.constraints or eliminate((), joint.held, {}, numbers, len(numbers))[0]
    axis = None if cut is None else cut.axis
    # first tangents lie along the axis
    along = axis.axis if axis is not None else model.rotation.axis if model.rotation is not None else np.eye(3)[2]
    pairs = joint.pairs
    if pairs is None:
        follow = np.asarray(constraints.dependent.any(axis=1))
        # of surfaces that are alike the first one moves: one that does not follow others if the second does not
        contacts = [
            each.turned_round if follow[each.first.nodes].any() and not follow[each.second.nodes].any() else each
            for each in joint.contacts
        ]
        pairs = build_contact_pairs(model.mesh, contacts, along, axis)
    ties, notes = build_ties(model.mesh, joint.ties, along) if joint.ties else (None, ())
    _check_followers(constraints, numbers, cut, pairs, ties)
    held = _hold_cut_faces(joint.held, cut, numbers)
    pairs = _merge_cut_pairs(_hold_pairs(pairs, numbers, held, constraints, cut), cut, numbers)
    if ties is not None:
        # held nodes and those that follow their image are bound already
        bound: BoolArray = np.asarray(held.all(axis=1))
        if cut is not None:
            bound[cut.right] = True
        ties = ties.chosen(~bound[ties.moving])
        pairs = _merge_tied_pairs(pairs, ties)
        if (moving := np.isin(ties.moving, pairs.moving)).any():
            found = f"{np.count_nonzero(moving)} nodes that are tied, as node {numbers[ties.moving[moving][0]]}"
            remedy = "let the surface in contact go on beyond the tie"
            notes += (f"{found}, move in contact pairs: they are not tied; {remedy}",)
            ties = ties.chosen(~moving)
    followers = []
    for each, surfaces in ((pairs, joint.contacts), (ties, joint.ties)):
        if each is not None:
            labels = [surfaces[place].name for place in each.surface]
            followers.append((each.moving, each.carried(model.mesh.coordinates, axis), each.sector, labels))
    if cut is not None:
        images = sparse.eye(held.size, format="csr")[(3 * cut.left[:, None] + np.arange(3)).ravel()]
        n = len(cut.right)
        followers.append((cut.right, images, np.ones(n, dtype=np.int64), ["the cut faces"] * n))
    nodes, points, sectors, names = zip(*followers, strict=True)
    joined = np.concatenate(nodes), sparse.vstack(points, format="csr"), np.concatenate(sectors)
    joins = tuple(label for each in names for label in each)
    return Structure(held, cut, constraints, pairs, *joined, joins, notes)


def _check_followers(
    constraints: Constraints, numbers: IntArray, cut: CutFaces | None, pairs: ContactPairs, ties: ContactPairs | None
) -> None:
    """Raises SceneError where a node follows others in two ways, or images are held in other directions."""
    remedy = "take it out of one of them, or refine the other surface"
    ways = [(pairs.moving, "moves in a contact pair", remedy)]
    if ties is not None:
        ways.append((ties.moving, "is tied", remedy))
    if cut is not None:
        ways.append((np.concatenate([cut.left, cut.right]), "is on a cut face", "let other nodes depend on this one"))
    for nodes, what, remedy in ways:
        if len(wrong := nodes[constraints.dependent[nodes].any(axis=1)]):
            found = f"{constraints.origin[int(wrong[0])]}: node {numbers[wrong[0]]} depends on others and {what}"
            raise SceneError("model", found, remedy)
    if cut is None:
        return
    turn, none, oblique = cut.axis.pitch(), np.zeros((3, 3)), constraints.oblique
    slanted = np.isin(cut.left, list(oblique)) | np.isin(cut.right, list(oblique))
    for one, other in zip(cut.left[slanted].tolist(), cut.right[slanted].tolist(), strict=True):
        along, image = (oblique.get(node, none) for node in (one, other))
        if np.abs(turn @ along @ turn.T - image).max() > _ROUND_OFF:
            found = f"nodes {numbers[one]} and {numbers[other]} of the cut faces are held in other directions"
            raise SceneError("clamp", found, "give both *TRANSFORM, TYPE=C about the axis, and the same dofs")


def _hold_cut_faces(held: BoolArray, cut: CutFaces | None, numbers: IntArray) -> BoolArray:
    """Held displacements (n_nodes, 3), alike on both cut faces. Raises SceneError where directions are not."""
    if cut is None:
        return held
    either, turn = held[cut.left] | held[cut.right], cut.axis.pitch()
    for place in np.flatnonzero(either.any(axis=1) & ~either.all(axis=1)):
        projection = np.diag(either[place].astype(float))
        if np.abs(turn @ projection - projection @ turn).max() > 1e-9:
            found = f"node {numbers[cut.left[place]]} of a cut face is held in some directions"
            raise SceneError("clamp", found, "hold nodes of cut faces in all directions, or along the axis")
    held = held.copy()
    held[cut.left] = held[cut.right] = either
    return held


def _merge_cut_pairs(pairs: ContactPairs, cut: CutFaces | None, numbers: IntArray) -> ContactPairs:
    """Pairs without those on the right cut face, which are the same as their images: these get their areas.

    Raises SceneError where a pair on the right cut face has no image.
    """
    if cut is None:
        return pairs
    image, place = np.full((2, len(numbers)), -1)
    image[cut.right] = cut.left
    place[pairs.moving] = np.arange(pairs.n_contact)
    right = np.flatnonzero(image[pairs.moving] >= 0)
    left = place[image[pairs.moving[right]]]
    if (left < 0).any():
        wrong = pairs.moving[right[left < 0]]
        name = pairs.moving_name[pairs.surface[right[0]]]
        found = f"{len(wrong)} nodes of {name} lie on one cut face and their images are in no pair, as node"
        raise SceneError("contact", f"{found} {numbers[wrong[0]]}", "let the surface end alike on both cut faces")
    area = pairs.area.copy()
    area[left] += area[right]
    return replace(pairs, area=area).chosen(np.setdiff1d(np.arange(pairs.n_contact), right))


def _merge_tied_pairs(pairs: ContactPairs, ties: ContactPairs) -> ContactPairs:
    """Pairs without those of tied nodes where all nodes that these follow move in pairs of the same surfaces, as where
    a surface in contact goes on from one part to the next: their areas go to these.
    """
    tied = np.isin(pairs.moving, ties.moving)
    places = np.flatnonzero(tied)
    order = np.argsort(ties.moving)
    rows = order[np.searchsorted(ties.moving, pairs.moving[places], sorter=order)]
    alike = pairs.surface[places][:, None] == pairs.surface
    share = ties.opposite[rows][:, pairs.moving].toarray() * (alike & ~tied)
    covered = share.sum(axis=1) > 1.0 - _ROUND_OFF
    area = pairs.area + pairs.area[places[covered]] @ share[covered]
    return replace(pairs, area=area).chosen(np.setdiff1d(np.arange(pairs.n_contact), places[covered]))


def _hold_pairs(
    pairs: ContactPairs, numbers: IntArray, held: BoolArray, constraints: Constraints, cut: CutFaces | None
) -> ContactPairs:
    """Pairs whose frames have a tangent along each direction that is held; the pairs do not have this tangent.

    Raises SceneError where a moving node is held along its normal, or the opposite point is not held as well.
    """
    oblique = constraints.oblique

    def along(node: int) -> FloatArray:
        """Projection (3, 3) on the directions along which a node is held."""
        return oblique[node] if node in oblique else np.diag(held[node].astype(float))

    frames, present = pairs.frames.copy(), pairs.present.copy()
    for place in np.flatnonzero(held[pairs.moving].any(axis=1) | np.isin(pairs.moving, list(oblique))):
        node, name = int(pairs.moving[place]), pairs.moving_name[pairs.surface[place]]
        by = " (*TRANSFORM)" if node in oblique else ""
        values, vectors = np.linalg.eigh(along(node))
        axes = vectors.T[values > 0.5] if node in oblique else np.eye(3)[held[node]]
        normal = frames[place, 0]
        if np.linalg.norm(axes @ normal) > _SLANTED:
            clamped = np.linalg.norm(held[pairs.moving] * pairs.frames[:, 0], axis=1) > _SLANTED
            count = max(int(np.count_nonzero(clamped & (pairs.surface == pairs.surface[place]))), 1)
            found = f"{count} nodes of {name} are clamped, as node {numbers[node]}{by}"
            raise SceneError("contact", found, "take them out of the surface or of the clamped set")
        normal = normal - (axes @ normal) @ axes
        normal /= np.linalg.norm(normal)
        second = axes[-1]
        frames[place] = [normal, np.cross(second, normal), second]
        present[place, 3 - len(axes) :] = False
        turn = np.eye(3) if cut is None else cut.axis.pitch(int(pairs.sector[place]))
        face = pairs.opposite[[place]]
        loose = [np.abs(turn @ along(int(other)) @ turn.T - along(node)).max() > _SLANTED for other in face.indices]
        if np.abs(face.data[loose]).sum() > _SLANTED:
            found = f"node {numbers[node]} of {name} is held in a direction in which the other surface moves{by}"
            raise SceneError("contact", found, "hold both surfaces there, or none")
    return replace(pairs, frames=frames, present=present)

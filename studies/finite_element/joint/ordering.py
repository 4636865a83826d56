"""Which nodes move freely, which nodes follow others, and the order of elimination.

Nodes of the right cut face follow those of the left one. Nodes of the contact pairs, on both sides, are never
eliminated. A moving node follows the opposite point of its pair, plus the relative displacement.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from solver.model import BoolArray, FloatArray, IntArray
from studies.finite_element.condensation.dissection import Dissection, dissect
from studies.finite_element.condensation.ordered_form import OrderedForm, order_form
from studies.finite_element.joint.constraints import Constraints
from studies.finite_element.joint.cut_faces import CutFaces
from studies.finite_element.joint.held_pairs import hold_pairs
from studies.finite_element.joint.pairing import ContactPairs
from studies.scene_error import SceneError

_LONGEST_CHAIN = 8  # surfaces on surfaces: nodes that follow nodes that follow
_LARGEST_KEPT_CUT = 900  # nodes of a cut face; the dense matrix of those that are kept grows with their square
# Nodal diameters from which on it pays to keep the cut faces. Bundled dovetail, kept over eliminated, CPU time: one
# nodal diameter 1.4 (mesh 2) and 2.0 (mesh 3), two 1.4 (mesh 4), six 0.8 (mesh 2).
_FEWEST_REUSES = 4


@dataclass(frozen=True)
class Supports:
    """Held and tied displacements.

    numbers (n_nodes,): of the nodes in the file, for messages.
    held (n_nodes, 3): displacements that are 0.
    cut: cut faces; None where the structure is no cyclic sector.
    n_reductions: number of nodal diameters at which the structure will be reduced. More are possible and take longer.
    constraints: displacements that follow others, which are held as well; None where there are none.
    """

    numbers: IntArray
    held: BoolArray
    cut: CutFaces | None
    n_reductions: int = 1
    constraints: Constraints | None = None

    @property
    def keeps_cut(self) -> bool:
        """Whether nodes of the cut faces are eliminated last: then elimination is real and the same for all nodal
        diameters.
        """
        if self.cut is None or self.n_reductions < _FEWEST_REUSES:
            return False
        return len(self.cut.left) <= _LARGEST_KEPT_CUT

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.numbers)

    @property
    def wholly_held(self) -> BoolArray:
        """Nodes (n_nodes,) that do not move at all."""
        return np.asarray(self.held.all(axis=1))

    @property
    def turned(self) -> BoolArray:
        """Nodes (n_nodes,) that are eliminated as `phase * rotation` times their images.

        These are the nodes of the right cut face, or none.
        """
        turned = np.zeros(self.n_nodes, dtype=np.bool_)
        if self.cut is not None and not self.keeps_cut:
            turned[self.cut.right] = True
        return turned

    @property
    def rotation(self) -> FloatArray:
        """Rotation (3, 3) by one sector."""
        return np.eye(3) if self.cut is None else self.cut.rotation

    @property
    def master(self) -> IntArray:
        """Node (n_nodes,) that each node is eliminated with: its image or itself; -1 for held nodes."""
        master = np.arange(self.n_nodes)
        if self.cut is not None and not self.keeps_cut:
            master[self.cut.right] = self.cut.left
        held = self.wholly_held
        master[held[master] | held] = -1
        return master

    def opposite(self, pairs: ContactPairs, nodal_diameter: int) -> sparse.csr_matrix:
        """Displacements (3 n_contact, 3 n_nodes) of the opposite points from those that depend on no other.

        An opposite point of the next sector moves as its image in this one, turned and with the phase of the wave.
        """
        points = sparse.kron(pairs.opposite, np.eye(3), format="csr")
        if self.cut is not None and pairs.sector.any():
            each = np.arange(pairs.n_contact + 1)
            steps = self.cut.across(pairs.sector, nodal_diameter), each[:-1], each
            points = (sparse.bsr_matrix(steps) @ points).tocsr()
        return points if self.constraints is None else (points @ self.constraints.transformation).tocsr()

    def phase(self, nodal_diameter: int) -> complex | float:
        """Phase in the elimination: `exp(i phi)` of a nodal diameter, or 1.0."""
        return 1.0 if self.cut is None or self.keeps_cut else self.cut.phase(nodal_diameter)


def consistent_supports(supports: Supports) -> Supports:
    """Supports whose nodes on one cut face are held as their images are.

    Raises SceneError where a node of a cut face is held in directions that its image does not have.
    """
    cut = supports.cut
    if cut is None:
        return supports
    held = supports.held.copy()
    either = held[cut.left] | held[cut.right]
    for place in np.flatnonzero(either.any(axis=1) & ~either.all(axis=1)):
        projection = np.diag(either[place].astype(float))
        if np.abs(cut.rotation @ projection - projection @ cut.rotation).max() > 1e-9:
            raise SceneError(
                "clamp",
                f"node {supports.numbers[cut.left[place]]} of a cut face is held in some directions",
                "hold nodes of cut faces in all directions, or along the axis",
            )
    held[cut.left] = held[cut.right] = either
    return replace(supports, held=held)


def pairs_of_sector(pairs: ContactPairs, supports: Supports) -> ContactPairs:
    """Pairs without those on the right cut face, which are the same as their images: these get their areas.

    Where moving nodes are held along a tangent the pairs do not have it.

    Raises SceneError where a moving node is held along its normal, or a pair on the right cut face has no image.
    """
    pairs = hold_pairs(pairs, supports.numbers, supports.held, supports.constraints, supports.rotation)
    if supports.cut is None:
        return pairs
    image = np.full(supports.n_nodes, -1)
    image[supports.cut.right] = supports.cut.left
    place = np.full(supports.n_nodes, -1)
    place[pairs.moving] = np.arange(pairs.n_contact)
    right = np.flatnonzero(image[pairs.moving] >= 0)
    if len(right) == 0:
        return pairs
    left = place[image[pairs.moving[right]]]
    if (left < 0).any():
        wrong = pairs.moving[right[left < 0]]
        raise SceneError(
            "contact",
            f"{len(wrong)} nodes of {pairs.moving_name[pairs.surface[right[0]]]} lie on one cut face and their images"
            f" are in no pair, as node {supports.numbers[wrong[0]]}",
            "let the surface end alike on both cut faces",
        )
    area = pairs.area.copy()
    area[left] += area[right]
    kept = np.setdiff1d(np.arange(pairs.n_contact), right)
    return replace(pairs, area=area).chosen(kept)


def ties_of_structure(ties: ContactPairs, supports: Supports, pairs: ContactPairs) -> ContactPairs:
    """Ties without those of nodes that are held, follow their image on a cut face, or move in a contact pair."""
    bound = supports.wholly_held
    bound[pairs.moving] = True
    if supports.cut is not None:
        bound[supports.cut.right] = True
    return ties.chosen(~bound[ties.moving])


@dataclass(frozen=True)
class KeptCoordinates:
    """Displacements (3 n_kept,) of the nodes that are not eliminated: glued @ y + relative @ u_rel.

    glued (3 n_kept, n_glued): with the pairs glued; complex where an opposite point lies on the right cut face.
    relative (3 n_kept, n_relative): pair by pair; normal, first, second tangent, without the held ones.
    """

    glued: sparse.csr_matrix
    relative: sparse.csr_matrix


@dataclass(frozen=True)
class OrderedStructure:
    """A structure with its nodes in an order of elimination, for any nodal diameter.

    supports, pairs, ties: as in `order_structure`.
    dissection: of the nodes that are not held.
    place (n_nodes,): place of each node, or of its master, in the order; -1 for held nodes.
    free (n_free,): nodes in the order of elimination.
    """

    supports: Supports
    pairs: ContactPairs
    ties: ContactPairs | None
    dissection: Dissection
    place: IntArray
    free: IntArray

    @property
    def leading(self) -> IntArray:
        """Nodes (n_leading,), ascending, that follow no other: not held, not moving in a pair, not on the right cut."""
        follows = self.supports.wholly_held
        follows[self.pairs.moving] = True
        if self.supports.cut is not None:
            follows[self.supports.cut.right] = True
        return np.flatnonzero(~follows)

    def order(self, matrix: sparse.csr_matrix, *, stiffness: bool) -> OrderedForm:
        """A form (3 n_nodes, 3 n_nodes) of all nodes in the order of elimination.

        What is held in some directions only has no coupling; in a stiffness it stands on springs of its own.
        """
        held = (self.supports.held & ~self.supports.wholly_held[:, None]).ravel()
        if held.any():
            loose = sparse.diags((~held).astype(float))
            spring = float(np.abs(matrix.diagonal()).mean()) if stiffness else 0.0
            matrix = loose @ matrix @ loose + spring * sparse.diags(held.astype(float))
        blocks = matrix.tocsr().tobsr(blocksize=(3, 3))
        return order_form(blocks, self.dissection, self.place, self.supports.turned, self.supports.rotation)

    def followers(self, nodal_diameter: int) -> sparse.csr_matrix:
        """Displacements (3 n_nodes, 3 n_free) of all nodes from those in the order of elimination."""
        supports = self.supports
        phase = supports.phase(nodal_diameter)
        blocks = np.tile(np.eye(3, dtype=type(phase)), (supports.n_nodes, 1, 1))
        blocks[supports.turned] = phase * supports.rotation
        blocks = blocks * ~supports.held[:, :, None]
        moving = self.place >= 0
        starts = np.concatenate([[0], np.cumsum(moving)])
        shape = (3 * supports.n_nodes, 3 * len(self.free))
        return sparse.bsr_matrix((blocks[moving], self.place[moving], starts), shape=shape).tocsr()

    def kept(self, nodal_diameter: int) -> KeptCoordinates:
        """Coordinates of the nodes of the pairs.

        Raises SceneError where moving nodes follow each other in a circle.
        """
        pairs, supports, first = self.pairs, self.supports, self.dissection.n_eliminated
        n_kept, n_contact = len(self.free) - first, pairs.n_contact
        all_nodes = self.followers(nodal_diameter)[:, 3 * first :]
        moving, follow = [pairs.moving], [supports.opposite(pairs, nodal_diameter)]
        if self.ties is not None:
            moving.append(self.ties.moving)
            follow.append(supports.opposite(self.ties, nodal_diameter))
        if supports.cut is not None and supports.keeps_cut:
            loose_cut = self.place[supports.cut.right] >= 0
            moving.append(supports.cut.right[loose_cut])
            follow.append(supports.cut.images(nodal_diameter, supports.n_nodes)[np.repeat(loose_cut, 3)])
        followers = np.concatenate(moving)
        # What they follow, in all three directions, from the displacements of the nodes that are kept.
        opposite = (sparse.vstack(follow, format="csr") @ all_nodes).tocsr()
        if supports.constraints is not None:
            rows = (3 * followers[:, None] + np.arange(3)).ravel()
            opposite = (opposite - supports.constraints.across[rows][:, rows] @ opposite).tocsr()
        dofs = (3 * (self.place[followers] - first)[:, None] + np.arange(3)).ravel()
        loose = (~supports.held[followers]).ravel().astype(float)
        scatter = sparse.csr_matrix((loose, (dofs, np.arange(len(dofs)))), shape=(3 * n_kept, len(dofs)))
        frames = sparse.block_diag(list(np.swapaxes(pairs.frames, 1, 2)), format="csr")[:, pairs.present.ravel()]
        follows, driven = scatter @ opposite, scatter[:, : 3 * n_contact] @ frames
        total = sparse.eye(3 * n_kept, format="csr")
        power = follows
        for _ in range(_LONGEST_CHAIN):
            if power.nnz == 0:
                break
            total = total + power
            power = follows @ power
            power.eliminate_zeros()
        else:
            raise SceneError("contact", "surfaces follow each other in a circle", "give every pair of surfaces once")
        own = ~supports.held[self.free[first:]].ravel()
        own[dofs] = False
        return KeptCoordinates(glued=total[:, np.flatnonzero(own)].tocsr(), relative=(total @ driven).tocsr())


def order_structure(
    supports: Supports,
    pairs: ContactPairs,
    ties: ContactPairs | None,
    coupled: sparse.csr_matrix,
    positions: FloatArray | IntArray,
) -> OrderedStructure:
    """Order of elimination.

    supports, pairs, ties: as `consistent_supports`, `pairs_of_sector` and `ties_of_structure` give them; ties are glued
    for good. coupled (n_nodes, n_nodes): which nodes are coupled; the values do not matter. positions
    (n_nodes, n_directions): coordinates, or places in a structured grid; cuts run across these directions.

    Raises SceneError where nothing but the nodes of the pairs moves.
    """
    master = supports.master
    free = np.flatnonzero(master == np.arange(supports.n_nodes))
    number = np.full(supports.n_nodes + 1, -1)
    number[free] = np.arange(len(free))
    node = number[master]
    entries = coupled.tocoo()
    rows, columns = node[entries.row], node[entries.col]
    both = (rows >= 0) & (columns >= 0)
    ones = np.ones(np.count_nonzero(both), dtype=np.int8)
    couplings = sparse.csr_matrix((ones, (rows[both], columns[both])), shape=(len(free), len(free)))
    bound = [pairs] if ties is None else [pairs, ties]
    nodes = [part for each in bound for part in (each.moving, supports.opposite(each, 0).indices // 3)]
    if supports.cut is not None and supports.keeps_cut:
        nodes += [supports.cut.left, supports.cut.right]
    involved = master[np.concatenate(nodes)]
    kept = np.isin(free, involved)
    if kept.all():
        raise SceneError(
            "contact", "all nodes that move are in contact pairs", "refine the mesh, or keep modes in reduced matrices"
        )
    dissection = dissect(couplings, positions[free], kept)
    place = np.empty(len(free) + 1, dtype=np.int64)
    place[dissection.order] = np.arange(len(free))
    place[-1] = -1
    return OrderedStructure(supports, pairs, ties, dissection, place[node], free[dissection.order])

"""Which displacements of a structure are free, which follow others, and which are held.

Nodes of the right cut face follow those of the left one, the moving node of a contact pair or of a tie follows the
opposite point, plus the relative displacement of the pair.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from solver.model import BoolArray, FloatArray, IntArray
from studies.finite_element.constraints import Constraints
from studies.finite_element.cut_faces import CutFaces
from studies.finite_element.pairing import ContactPairs
from studies.scene_error import SceneError

_LONGEST_CHAIN = 8  # surfaces on surfaces: nodes that follow nodes that follow
_SLANTED = 0.1  # sine of the angle between the normal of a pair and a plane of symmetry that round-off or facets make


@dataclass(frozen=True)
class Coordinates:
    """`u = glued @ y + relative @ u_rel`: all displacements (3 n_nodes,) from the free ones and those of the pairs.

    relative (3 n_nodes, n_relative): pair by pair; normal, first, second tangent, without those that do not exist. Both
    are complex where a wave has a phase. node (n_free,): of each y, ascending.
    """

    glued: sparse.csr_matrix
    relative: sparse.csr_matrix
    node: IntArray


@dataclass(frozen=True)
class Structure:
    """A structure with contact pairs.

    held (n_nodes, 3): displacements that are 0, or depend on others by the constraints. cut: cut faces; None where the
    structure is no cyclic sector. constraints: None where no displacement depends on others; forms and forces are
    those on the displacements q of `Constraints`. ties: pairs that are glued for good; None of none.
    """

    held: BoolArray
    cut: CutFaces | None
    constraints: Constraints | None
    pairs: ContactPairs
    ties: ContactPairs | None

    def coordinates(self, nodal_diameter: int) -> Coordinates:
        """Those of a wave. Raises SceneError where nodes follow each other in a circle, or none is free."""
        pairs, size = self.pairs, self.held.size
        nodes, follow = [pairs.moving], [self._opposite(pairs, nodal_diameter)]
        if self.ties is not None:
            nodes.append(self.ties.moving)
            follow.append(self._opposite(self.ties, nodal_diameter))
        if self.cut is not None:
            nodes.append(self.cut.right)
            follow.append(self.cut.images(nodal_diameter, len(self.held)))
        followers, what = np.concatenate(nodes), sparse.vstack(follow, format="csr")
        dofs = (3 * followers[:, None] + np.arange(3)).ravel()
        if self.constraints is not None:
            what = (what - self.constraints.across[dofs][:, dofs] @ what).tocsr()
        loose = (~self.held[followers]).ravel().astype(float)
        scatter = sparse.csr_matrix((loose, (dofs, np.arange(len(dofs)))), shape=(size, len(dofs)))
        frames = sparse.block_diag(list(np.swapaxes(pairs.frames, 1, 2)), format="csr")[:, pairs.present.ravel()]
        driven = scatter[:, : 3 * pairs.n_contact] @ frames
        total, step = sparse.eye(size, format="csr"), scatter @ what
        power = step
        for _ in range(_LONGEST_CHAIN):
            if power.nnz == 0:
                break
            total = total + power
            power = step @ power
            power.eliminate_zeros()
        else:
            raise SceneError("contact", "surfaces follow each other in a circle", "give every pair of surfaces once")
        own = ~self.held.ravel()
        own[dofs] = False
        if not own.any():
            remedy = "refine the mesh, or keep modes in reduced matrices"
            raise SceneError("contact", "all nodes that move are in contact pairs", remedy)
        free = np.flatnonzero(own)
        return Coordinates(total[:, free].tocsr(), (total @ driven).tocsr(), free // 3)

    def _opposite(self, pairs: ContactPairs, nodal_diameter: int) -> sparse.csr_matrix:
        """Displacements (3 n_contact, 3 n_nodes) of the opposite points.

        A point of the next sector moves as its image in this one, turned and with the phase of the wave.
        """
        points = sparse.kron(pairs.opposite, np.eye(3), format="csr")
        if self.cut is not None and pairs.sector.any():
            each = np.arange(pairs.n_contact + 1)
            steps = self.cut.across(pairs.sector, nodal_diameter), each[:-1], each
            points = (sparse.bsr_matrix(steps) @ points).tocsr()
        return points if self.constraints is None else (points @ self.constraints.transformation).tocsr()


def hold_cut_faces(held: BoolArray, cut: CutFaces | None, numbers: IntArray) -> BoolArray:
    """Held displacements (n_nodes, 3), those of nodes on one cut face as those of their images.

    numbers (n_nodes,): of the nodes in the file. Raises SceneError where an image does not have the directions in which
    a node is held.
    """
    if cut is None:
        return held
    either = held[cut.left] | held[cut.right]
    for place in np.flatnonzero(either.any(axis=1) & ~either.all(axis=1)):
        projection = np.diag(either[place].astype(float))
        if np.abs(cut.rotation @ projection - projection @ cut.rotation).max() > 1e-9:
            found = f"node {numbers[cut.left[place]]} of a cut face is held in some directions"
            raise SceneError("clamp", found, "hold nodes of cut faces in all directions, or along the axis")
    held = held.copy()
    held[cut.left] = held[cut.right] = either
    return held


def merge_cut_pairs(pairs: ContactPairs, cut: CutFaces | None, numbers: IntArray) -> ContactPairs:
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
        found = (
            f"{len(wrong)} nodes of {pairs.moving_name[pairs.surface[right[0]]]} lie on one cut face and their images"
            f" are in no pair, as node {numbers[wrong[0]]}"
        )
        raise SceneError("contact", found, "let the surface end alike on both cut faces")
    area = pairs.area.copy()
    area[left] += area[right]
    return replace(pairs, area=area).chosen(np.setdiff1d(np.arange(pairs.n_contact), right))


def loose_ties(ties: ContactPairs, held: BoolArray, cut: CutFaces | None, pairs: ContactPairs) -> ContactPairs:
    """Ties without those of nodes that are held, follow their image on a cut face, or move in a contact pair."""
    bound: BoolArray = np.asarray(held.all(axis=1))
    bound[pairs.moving] = True
    if cut is not None:
        bound[cut.right] = True
    return ties.chosen(~bound[ties.moving])


def hold_pairs(
    pairs: ContactPairs, numbers: IntArray, held: BoolArray, constraints: Constraints | None, cut: CutFaces | None
) -> ContactPairs:
    """Pairs whose frames have a tangent along each direction that is held; the pairs do not have this tangent.

    Raises SceneError where a moving node is held along its normal, or the opposite point is not held as well.
    """
    slanted = np.zeros(len(held), dtype=np.bool_) if constraints is None else constraints.oblique

    def along(node: int) -> FloatArray:
        """Projection (3, 3) on the directions along which a node is held."""
        if constraints is not None and slanted[node]:
            return constraints.held_along(node)
        return np.diag(held[node].astype(float))

    frames, present = pairs.frames.copy(), pairs.present.copy()
    for place in np.flatnonzero((held.any(axis=1) | slanted)[pairs.moving]):
        node, name = int(pairs.moving[place]), pairs.moving_name[pairs.surface[place]]
        by = " (*TRANSFORM)" if slanted[node] else ""
        values, vectors = np.linalg.eigh(along(node))
        axes = vectors.T[values > 0.5] if slanted[node] else np.eye(3)[held[node]]
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
        start, end = pairs.opposite.indptr[place : place + 2]
        turn = np.eye(3) if cut is None else cut.axis.pitch(int(pairs.sector[place]))
        loose = [
            np.abs(turn @ along(int(other)) @ turn.T - along(node)).max() > _SLANTED
            for other in pairs.opposite.indices[start:end]
        ]
        if np.abs(pairs.opposite.data[start:end][loose]).sum() > _SLANTED:
            found = f"node {numbers[node]} of {name} is held in a direction in which the other surface moves{by}"
            raise SceneError("contact", found, "hold both surfaces there, or none")
    return replace(pairs, frames=frames, present=present)

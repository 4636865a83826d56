"""Linear constraints: displacements that depend on others, and are eliminated before anything is reduced."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from solver.model import BoolArray, FloatArray, IntArray
from studies.finite_element.cut_faces import CutFaces
from studies.finite_element.pairing import ContactPairs, ContactSurfaces
from studies.scene_error import SceneError

_LONGEST_CHAIN = 100  # displacements that depend on others that depend on others
_ROUND_OFF = 1e-6  # of a direction, which decks give with few digits
_NOTHING = 1e-12  # square of a motion that moves no node, over that of one that does


@dataclass(frozen=True)
class Dependence:
    """Displacements (d,) that are sums of others, by their places in (3 n_nodes,).

    row, column, value (t,): coefficients; rows count the dependent ones. place: where it stands, for messages.
    """

    dependent: IntArray
    row: IntArray
    column: IntArray
    value: FloatArray
    place: str


@dataclass(frozen=True)
class Constraints:
    """`u = transformation @ q`: q are the displacements that depend on no other and are not held, the rest of q is 0.

    dependent (n_nodes, 3): which displacements move with others. origin (n_nodes,): what makes a node depend on others,
    a place in `origins`; -1 for none. oblique (n_nodes,): nodes that are held along other directions than x, y, z:
    there q has all three displacements, of which u lacks these directions. across: projection on them. Matrices are (3
    n_nodes, 3 n_nodes).
    """

    transformation: sparse.csr_matrix
    dependent: BoolArray
    origin: IntArray
    origins: Sequence[str]
    oblique: BoolArray
    across: sparse.csr_matrix

    def apply(self, form: sparse.csr_matrix, *, stiffness: bool) -> sparse.csr_matrix:
        """A form of q: `T^T K T`. What moves nothing stands on springs of its own in a stiffness."""
        spring = float(np.abs(form.diagonal()).mean()) if stiffness else 0.0
        return (self.transformation.T @ form @ self.transformation + spring * self.across).tocsr()

    def forces(self, vectors: FloatArray) -> FloatArray:
        """Forces (3 n_nodes, ...) on q."""
        return np.asarray(self.transformation.T @ vectors)

    def turned(self, left: int, right: int, rotation: FloatArray) -> bool:
        """Whether a node is held as its image is under a rotation (3, 3)."""
        return bool(np.abs(rotation @ self.held_along(left) @ rotation.T - self.held_along(right)).max() < _ROUND_OFF)

    def held_along(self, node: int) -> FloatArray:
        """Projection (3, 3) on the directions along which an oblique node is held."""
        return np.asarray(self.across[3 * node : 3 * node + 3, 3 * node : 3 * node + 3].toarray())


def free_ones_first(constraints: Constraints, contacts: Sequence[ContactSurfaces]) -> tuple[ContactSurfaces, ...]:
    """Contacts whose first surface, which moves where both are alike, does not follow others if the second does not."""
    follow = np.asarray(constraints.dependent.any(axis=1))
    return tuple(
        each.turned_round if follow[each.first.nodes].any() and not follow[each.second.nodes].any() else each
        for each in contacts
    )


def check_followers(
    constraints: Constraints, numbers: IntArray, cut: CutFaces | None, pairs: ContactPairs, ties: ContactPairs | None
) -> None:
    """Raises SceneError where a node follows others by a constraint and in another way as well."""
    moving = [(pairs, "moves in a contact pair")] + ([] if ties is None else [(ties, "is tied")])
    for each, what in moving:
        _check_free(constraints, each.moving, numbers, what, "take it out of one of them, or refine the other surface")
    if cut is None:
        return
    both = np.concatenate([cut.left, cut.right])
    _check_free(constraints, both, numbers, "is on a cut face", "let other nodes depend on this one")
    slanted = constraints.oblique[cut.left] | constraints.oblique[cut.right]
    for one, other in zip(cut.left[slanted], cut.right[slanted], strict=True):
        if not constraints.turned(one, other, cut.rotation):
            found = f"nodes {numbers[one]} and {numbers[other]} of the cut faces are held in other directions"
            raise SceneError("clamp", found, "give both *TRANSFORM, TYPE=C about the axis, and the same dofs")


def _check_free(constraints: Constraints, nodes: IntArray, numbers: IntArray, what: str, remedy: str) -> None:
    """Raises SceneError where one of the nodes depends on others. what: the nodes are, for the message."""
    wrong = nodes[constraints.dependent[nodes].any(axis=1)]
    if len(wrong):
        origin = constraints.origins[constraints.origin[wrong[0]]]
        raise SceneError("model", f"{origin}: node {numbers[wrong[0]]} depends on others and {what}", remedy)


def eliminate(
    entries: Sequence[Dependence],
    held: BoolArray,
    oblique: Mapping[int, FloatArray],
    numbers: IntArray,
    n_with_elements: int,
) -> tuple[Constraints, BoolArray]:
    """Constraints, and which displacements (n_nodes, 3) are 0 or follow others.

    held (n_nodes, 3): displacements that are 0. oblique: projections (3, 3) of nodes on other directions in which they
    are held. numbers (n_nodes,): of the nodes in the file. n_with_elements: number of nodes with elements; motions of
    the others that move none of these are held. Raises SceneError where a displacement depends twice, on itself, or is
    held as well.
    """
    size, places = held.size, [each.place for each in entries]
    none = np.empty(0, dtype=np.int64)
    dependent = np.concatenate([none, *(each.dependent for each in entries)])
    origin_of = np.repeat(np.arange(len(entries)), [len(each.dependent) for each in entries])
    slanted = np.zeros(len(held), dtype=np.bool_)
    slanted[list(oblique)] = True
    _check_once(dependent, [places[each] for each in origin_of], held | slanted[:, None], numbers)
    shape = (size, size)
    rows = np.concatenate([none, *(each.dependent[each.row] for each in entries)])
    columns = np.concatenate([none, *(each.column for each in entries)])
    values = np.concatenate([np.empty(0), *(each.value for each in entries)])
    steps = sparse.csr_matrix((values, (rows, columns)), shape=shape)
    own = np.ones(size)
    own[dependent] = 0.0
    total = sparse.diags(own, format="csr")
    power = steps
    for _ in range(_LONGEST_CHAIN):
        total = total + power @ sparse.diags(own)
        power = power @ steps
        power.eliminate_zeros()
        if power.nnz == 0:
            break
    else:
        found = f"{places[0]}: displacements depend on each other in a circle"
        raise SceneError("model", found, "let each depend on others that do not depend on it")
    fixed = held.ravel().copy()
    across = sparse.lil_matrix(shape)
    for node, projection in oblique.items():
        across[3 * node : 3 * node + 3, 3 * node : 3 * node + 3] = projection
    across = across.tocsr()
    total = (total @ (sparse.eye(size) - across)) @ sparse.diags((~fixed).astype(float))
    total, idle = _without_idle(total.tocsr(), 3 * n_with_elements, fixed)
    fixed[idle] = True
    total.eliminate_zeros()
    moves = np.zeros(size, dtype=np.bool_)
    moves[dependent] = np.diff(total.indptr)[dependent] > 0
    fixed[dependent] = True
    origin = np.full(len(held), -1)
    origin[dependent // 3] = origin_of
    constraints = Constraints(total, moves.reshape(-1, 3), origin, places, slanted, across)
    return constraints, fixed.reshape(-1, 3)


def _check_once(dependent: IntArray, origins: Sequence[str], held: BoolArray, numbers: IntArray) -> None:
    """Each displacement depends once, and is not held."""

    def found(place: int) -> str:
        at = dependent[place]
        return f"{origins[place]}: displacement {at % 3 + 1} of node {numbers[at // 3]} depends on others"

    order = np.argsort(dependent, kind="stable")
    twice = np.flatnonzero(dependent[order][1:] == dependent[order][:-1])
    if len(twice):
        first, second = order[twice[0]], order[twice[0] + 1]
        remedy = "let each displacement depend once: take it out of one of them"
        raise SceneError("model", f"{found(second)} by {origins[first]}", remedy)
    wrong = np.flatnonzero(held.ravel()[dependent])
    if len(wrong):
        raise SceneError("model", f"{found(wrong[0])} and is held", "take the node out of one of them")


def _without_idle(total: sparse.csr_matrix, first: int, fixed: BoolArray) -> tuple[sparse.csr_matrix, IntArray]:
    """The transformation with motions of nodes without elements of which some move nothing, and these.

    A turn about a line on which all nodes are moves nothing. Displacements from `first` on have no elements.
    """
    change = sparse.eye(len(fixed), format="lil")
    extra = first + np.flatnonzero(~fixed[first:])
    columns = total[:first][:, extra]
    gram = (columns.T @ columns).tocsr()
    scale = np.sqrt(gram.diagonal())
    idle: list[int] = extra[scale == 0.0].tolist()
    _, groups = connected_components(gram, directed=False)
    order = np.argsort(groups, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(groups[order])) + 1) if len(order) else []:
        rows = rows[scale[rows] > 0.0]
        if len(rows) < 2:
            continue
        values, vectors = np.linalg.eigh(gram[rows][:, rows].toarray() / np.outer(scale[rows], scale[rows]))
        nothing = values < _NOTHING * values[-1]
        if nothing.any():
            change[np.ix_(extra[rows], extra[rows])] = vectors / scale[rows][:, None]
            idle += extra[rows][nothing].tolist()
    keep = np.ones(len(fixed))
    keep[idle] = 0.0
    return (total @ change.tocsr() @ sparse.diags(keep)).tocsr(), np.array(idle, dtype=np.int64)

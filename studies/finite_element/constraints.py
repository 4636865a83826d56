"""Linear constraints: displacements that depend on others."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from solver.model import BoolArray, FloatArray, IntArray
from studies.scene_error import SceneError

_LONGEST_CHAIN = 100  # displacements that depend on others that depend on others
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
    """`u = steps @ u + axes @ y`; y are motions of displacements that are not held and depend on no other.

    steps (3 n_nodes, 3 n_nodes): the displacements that depend on others, from these. axes (3 n_nodes, 3 n_nodes): its
    columns are the directions of the motions, those of x, y, z but at nodes that are held along other directions, and
    at nodes without elements. idle (3 n_nodes,): motions that are 0, beside held displacements. oblique: projection
    (3, 3) of nodes on other directions in which they are held; across (3 n_nodes, 3 n_nodes): all of them. dependent
    (n_nodes, 3): which displacements move with others. origin: what makes a node depend on others.
    """

    steps: sparse.csr_matrix
    axes: sparse.csr_matrix
    idle: BoolArray
    oblique: Mapping[int, FloatArray]
    across: sparse.csr_matrix
    dependent: BoolArray
    origin: Mapping[int, str]


def resolve(steps: sparse.csr_matrix) -> sparse.csr_matrix | None:
    """`(1 - steps)^-1`: displacements from those that depend on no other; None where they depend in a circle."""
    total, power = sparse.eye(steps.shape[0], format="csr"), steps
    for _ in range(_LONGEST_CHAIN):
        if power.nnz == 0:
            return total
        total = total + power
        power = steps @ power
        power.eliminate_zeros()
    return None


def eliminate(
    entries: Sequence[Dependence], held: BoolArray, oblique: Mapping[int, FloatArray], numbers: IntArray, n_in_mesh: int
) -> tuple[Constraints, BoolArray]:
    """Constraints, and which displacements (n_nodes, 3) are 0 or follow others.

    held (n_nodes, 3): displacements that are 0. oblique: as in `Constraints`. numbers (n_nodes,): of the nodes in the
    file. n_in_mesh: number of nodes with elements; motions of the others that move none of these are 0. Raises
    SceneError where a displacement depends twice, on itself, or is held as well.
    """
    size, none = held.size, np.empty(0, dtype=np.int64)
    dependent = np.concatenate([none, *(each.dependent for each in entries)])
    places = [each.place for each in entries for _ in each.dependent]
    taken = held.copy()
    taken[list(oblique)] = True
    _check_once(dependent, places, taken, numbers)
    rows = np.concatenate([none, *(each.dependent[each.row] for each in entries)])
    columns = np.concatenate([none, *(each.column for each in entries)])
    values = np.concatenate([np.empty(0), *(each.value for each in entries)])
    steps = sparse.csr_matrix((values, (rows, columns)), shape=(size, size))
    if (total := resolve(steps)) is None:
        found = f"{places[0]}: displacements depend on each other in a circle"
        raise SceneError("model", found, "let each depend on others that do not depend on it")
    turns = []
    idle, fixed = np.zeros(size, dtype=np.bool_), held.ravel().copy()
    fixed[dependent] = True
    for node, projection in oblique.items():
        own = 3 * node + np.arange(3)
        sizes, directions = np.linalg.eigh(projection)
        idle[own] = sizes > 0.5
        turns.append((own, directions - np.eye(3)))
    axes = sparse.eye(size, format="csr") + _blocks(size, turns)
    axes = axes @ _sorted_out(total @ axes, fixed, 3 * n_in_mesh, idle)
    moved = total @ axes @ sparse.diags((~(fixed | idle)).astype(float), format="csr")
    moved.eliminate_zeros()
    moves = np.zeros(size, dtype=np.bool_)
    moves[dependent] = np.diff(moved.indptr)[dependent] > 0
    across = _blocks(size, [(3 * node + np.arange(3), projection) for node, projection in oblique.items()])
    origin = dict(zip((dependent // 3).tolist(), places, strict=True))
    return Constraints(steps, axes, idle, oblique, across, moves.reshape(-1, 3), origin), fixed.reshape(-1, 3)


def _check_once(dependent: IntArray, origins: Sequence[str], held: BoolArray, numbers: IntArray) -> None:
    """Each displacement depends once, and is not held."""

    def found(place: int) -> str:
        at = dependent[place]
        return f"{origins[place]}: displacement {at % 3 + 1} of node {numbers[at // 3]} depends on others"

    order = np.argsort(dependent, kind="stable")
    if len(twice := np.flatnonzero(dependent[order][1:] == dependent[order][:-1])):
        first, second = order[twice[0]], order[twice[0] + 1]
        remedy = "let each displacement depend once: take it out of one of them"
        raise SceneError("model", f"{found(second)} by {origins[first]}", remedy)
    if len(wrong := np.flatnonzero(held.ravel()[dependent])):
        raise SceneError("model", f"{found(wrong[0])} and is held", "take the node out of one of them")


def _sorted_out(total: sparse.csr_matrix, fixed: BoolArray, first: int, idle: BoolArray) -> sparse.csr_matrix:
    """Motions of nodes without elements so that each of them moves others or nothing: the latter are marked as idle.

    A turn about a line on which all nodes are moves nothing. total: all displacements from those that depend on none;
    those from `first` on have no elements. The matrix has the new motions in terms of the given ones.
    """
    changes, extra = [], first + np.flatnonzero(~(fixed | idle)[first:])
    columns = total[:first][:, extra]
    gram = (columns.T @ columns).tocsr()
    scale = np.sqrt(gram.diagonal())
    idle[extra[scale == 0.0]] = True
    _, groups = connected_components(gram, directed=False)
    order = np.argsort(groups, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(groups[order])) + 1) if len(order) else []:
        rows = rows[scale[rows] > 0.0]
        if len(rows) < 2:
            continue
        values, vectors = np.linalg.eigh(gram[rows][:, rows].toarray() / np.outer(scale[rows], scale[rows]))
        nothing = values < _NOTHING * values[-1]
        if nothing.any():
            changes.append((extra[rows], vectors / scale[rows][:, None] - np.eye(len(rows))))
            idle[extra[rows[nothing]]] = True
    return sparse.eye(len(fixed), format="csr") + _blocks(len(fixed), changes)


def _blocks(size: int, blocks: Sequence[tuple[IntArray, FloatArray]]) -> sparse.csr_matrix:
    """Matrix (size, size) of square blocks at some rows and the same columns."""
    none = np.empty(0, dtype=np.int64)
    rows = np.concatenate([none, *(np.repeat(places, len(places)) for places, _ in blocks)])
    columns = np.concatenate([none, *(np.tile(places, len(places)) for places, _ in blocks)])
    values = np.concatenate([np.empty(0), *(values.ravel() for _, values in blocks)])
    return sparse.csr_matrix((values, (rows, columns)), shape=(size, size))

"""A quadratic form of the nodal displacements (stiffness, mass), in the order in which nodes are eliminated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from solver.model import BoolArray, FloatArray, IntArray
from studies.finite_element.condensation.dissection import Dissection, Front


@dataclass(frozen=True)
class BlockRows:
    """Blocks (3, 3) row by row: starts (n_places + 1,), places (n_blocks,) of the columns, values (n_blocks, 3, 3)."""

    starts: IntArray
    places: IntArray
    values: FloatArray


@dataclass(frozen=True)
class OrderedForm:
    """`plain + phase * ahead + conj(phase) * behind`, of which only what a front needs is kept.

    A row has the columns from the first node of its front on; a node that is never eliminated has those of its kind.
    """

    plain: BlockRows
    ahead: BlockRows
    behind: BlockRows

    def rows_of(self, front: Front, phase: complex | float, out: NDArray[Any]) -> NDArray[Any]:
        """Complex conjugate of the rows of a front into `out` (n, n + n_boundary), which holds zeros; n counts dofs.

        The conjugate, since seen as a matrix in Fortran's order that is the lower triangle and what stands below.
        """
        return self._fill(front.first, front.stop, front.boundary, phase, out)

    def kept(self, dissection: Dissection, phase: complex | float) -> NDArray[Any]:
        """The part (n, n) among nodes that are never eliminated."""
        first, stop = dissection.n_eliminated, len(dissection.order)
        out = np.zeros((3 * (stop - first),) * 2, dtype=type(phase))
        return self._fill(first, stop, np.zeros(0, dtype=np.int64), phase, out).conj()

    def phased(self) -> BoolArray:
        """Places (n_places,) whose row depends on the phase."""
        return (np.diff(self.ahead.starts) > 0) | (np.diff(self.behind.starts) > 0)

    def _fill(
        self, first: int, stop: int, boundary: IntArray, phase: complex | float, out: NDArray[Any]
    ) -> NDArray[Any]:
        n = stop - first
        blocks = out.reshape(n, 3, n + len(boundary), 3)
        for part, factor in ((self.plain, 1.0), (self.ahead, np.conj(phase)), (self.behind, phase)):
            start, end = part.starts[first], part.starts[stop]
            if start == end:
                continue
            rows = np.repeat(np.arange(n), np.diff(part.starts[first : stop + 1]))
            places = part.places[start:end]
            columns = np.where(places < stop, places - first, n + np.searchsorted(boundary, places))
            blocks[rows, :, columns] += factor * part.values[start:end]
        return out


def order_form(
    matrix: sparse.bsr_matrix, dissection: Dissection, place: IntArray, turned: BoolArray, rotation: FloatArray
) -> OrderedForm:
    """Form of the nodes that take part from that of all nodes.

    matrix (3 n_nodes, 3 n_nodes): symmetric, in blocks of 3. dissection: of the nodes that take part. place
    (n_nodes,): place, in the order of elimination, of the node that each node moves with; -1 where it is held. turned
    (n_nodes,): the node moves as `phase * rotation` times its master. rotation (3, 3): by one sector.
    """
    n_places = len(dissection.order)
    # From which place on a row is kept.
    begin = np.full(n_places, dissection.n_eliminated)
    for front in dissection.fronts:
        begin[front.first : front.stop] = front.first

    row = np.repeat(np.arange(len(place)), np.diff(matrix.indptr))
    column = matrix.indices
    rows, columns = place[row], place[column]
    used = np.flatnonzero((rows >= 0) & (columns >= 0))
    used = used[columns[used] >= begin[rows[used]]]
    row, column, rows, columns = row[used], column[used], rows[used], columns[used]
    shift = turned[column].astype(np.int8) - turned[row]
    values = matrix.data[used]
    here, there = turned[row], turned[column]
    values[here] = rotation.T @ values[here]
    values[there] = values[there] @ rotation
    parts = [_block_rows(rows, columns, values, shift == sign, n_places) for sign in (0, 1, -1)]
    return OrderedForm(*parts)


def _block_rows(rows: IntArray, columns: IntArray, values: FloatArray, chosen: BoolArray, n: int) -> BlockRows:
    """Blocks of the chosen entries; those at the same place are added up."""
    entries = np.flatnonzero(chosen)
    key = rows[entries] * n + columns[entries]
    order = np.argsort(key, kind="stable")
    key, entries = key[order], entries[order]
    first = np.flatnonzero(np.diff(key, prepend=-1))
    summed = np.add.reduceat(values[entries], first, axis=0) if len(first) else values[:0]
    starts = np.searchsorted(key[first], np.arange(n + 1) * n)
    return BlockRows(starts=starts, places=key[first] % n, values=summed)

"""What a front leaves on its boundary, added to the front that follows (the extend-add of the multifrontal method)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from solver.model import IntArray


def add_lower(
    own: NDArray[Any], below: NDArray[Any], update: NDArray[Any], part: NDArray[Any], places: IntArray
) -> None:
    """Adds the lower triangle of a child's part to those of its parent's front; all but the places in Fortran's order.

    own (e, e), below (f, e), update (f, f): the front, what is below it, and what it leaves. Only lower triangles
    are added to. part (g, g): what the child leaves. places (g / 3,): place of each node of the child's boundary
    among those of the front and its boundary, ascending.
    """
    _add(own, below, update, part, places)


@njit(cache=True)
def _add(own, below, update, part, places):  # type: ignore[no-untyped-def]
    e, n_nodes = own.shape[0], len(places)
    n_own = np.searchsorted(3 * places, e)
    for node in range(n_nodes):
        for direction in range(3):
            column = 3 * node + direction
            source = part[:, column]
            target = 3 * places[node] + direction
            if node < n_own:
                inside, outside = own[:, target], below[:, target]
            else:
                inside, outside = own[:0, 0], update[:, target - e]
            # of its own node the part on and below the diagonal
            first = inside if node < n_own else outside
            shift = 0 if node < n_own else e
            for k in range(direction, 3):
                first[3 * places[node] + k - shift] += source[3 * node + k]
            for row in range(node + 1, n_own):
                place = 3 * places[row]
                inside[place] += source[3 * row]
                inside[place + 1] += source[3 * row + 1]
                inside[place + 2] += source[3 * row + 2]
            for row in range(max(node + 1, n_own), n_nodes):
                place = 3 * places[row] - e
                outside[place] += source[3 * row]
                outside[place + 1] += source[3 * row + 1]
                outside[place + 2] += source[3 * row + 2]

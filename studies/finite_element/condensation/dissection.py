"""Nested dissection: the order of elimination of the nodes, and the blocks of this order.

A layer of nodes cuts a region of the mesh into two halves. The layer is eliminated after both halves; the halves are
cut in the same way (George 1973). Small regions are eliminated as a whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from solver.model import BoolArray, FloatArray, IntArray

_SMALLEST = 40  # nodes of a region that is not cut any more
_SMALLER_HALF = 0.2  # of a region: the least that a cut leaves on one side
_UNEVEN = 4.0  # how much a cut away from the middle is penalised, against the size of its layer


def dofs_of(places: IntArray) -> IntArray:
    """Degrees of freedom (3 n,) of nodes (n,)."""
    return (3 * places[:, None] + np.arange(3)).ravel()


@dataclass(frozen=True)
class Front:
    """Nodes that are eliminated together, by their places in the order of elimination.

    first, stop: the nodes are at the places first..stop - 1.
    boundary (n,): places of the later nodes that are coupled to these nodes when they are eliminated, ascending.
    children: numbers of the fronts whose boundary is first touched here.
    """

    first: int
    stop: int
    boundary: IntArray
    children: tuple[int, ...]

    @cached_property
    def boundary_dofs(self) -> IntArray:
        """Degrees of freedom (3 n,) of the boundary, as `dofs_of`."""
        return dofs_of(self.boundary)


@dataclass(frozen=True)
class Dissection:
    """Order of elimination.

    order (n,): node numbers; nodes that are never eliminated come last.
    n_eliminated: number of eliminated nodes.
    fronts: each after its children.
    roots: fronts that are no front's children.
    """

    order: IntArray
    n_eliminated: int
    fronts: tuple[Front, ...]
    roots: tuple[int, ...]


def dissect(couplings: sparse.csr_matrix, positions: FloatArray | IntArray, kept: BoolArray) -> Dissection:
    """Order and fronts of a mesh.

    couplings (n, n): which nodes are coupled; symmetric pattern, the values do not matter. positions
    (n, n_directions): along each direction layers of nodes are looked for. Places in a structured grid, or coordinates.
    kept (n,): nodes that are never eliminated.
    """
    cutter = _Cutter(couplings, positions)
    inner = np.flatnonzero(~kept)
    _, part = connected_components(couplings[inner][:, inner], directed=False)
    for number in range(part.max(initial=-1) + 1):
        cutter.cut(inner[part == number])
    order = np.concatenate([*cutter.layers, np.flatnonzero(kept)])
    return _symbolic(couplings, order, cutter.layers, cutter.children)


class _Cutter:
    """Cuts regions; `layers` and `children` are the fronts' nodes and children in the order of elimination."""

    def __init__(self, couplings: sparse.csr_matrix, positions: FloatArray | IntArray) -> None:
        self._starts, self._neighbours = couplings.indptr.astype(np.int64), couplings.indices
        self._positions = [np.unique(values, return_inverse=True)[1] for values in positions.T]
        self._inside = np.zeros(len(positions), dtype=np.bool_)
        self.layers: list[IntArray] = []
        self.children: list[tuple[int, ...]] = []

    def cut(self, region: IntArray) -> tuple[int, ...]:
        """Numbers of the fronts that the region ends in: one, or those of its parts where nothing lies between."""
        if len(region) <= _SMALLEST:
            return self._append(region, ())
        layer, lower, upper = self._halves(region)
        children = (*self.cut(lower), *self.cut(upper)) if len(lower) and len(upper) else ()
        if not children:
            return self._append(region, ())
        return self._append(layer, children) if len(layer) else children

    def _append(self, nodes: IntArray, children: tuple[int, ...]) -> tuple[int, ...]:
        self.layers.append(nodes)
        self.children.append(children)
        return (len(self.layers) - 1,)

    def _halves(self, region: IntArray) -> tuple[IntArray, IntArray, IntArray]:
        """The layer that cuts a region and the parts below and above it."""
        rows, neighbours = self._edges(region)
        best = np.inf
        for positions in self._positions:
            own = positions[region]
            farthest = np.maximum.reduceat(positions[neighbours], rows)
            # A cut above position c has the nodes up to c with a neighbour beyond as its layer.
            low = own.min()
            n = own.max() - low + 1
            change = np.bincount(own - low, minlength=n) - np.bincount(farthest - low, minlength=n)
            size = np.cumsum(change)[:-1]
            share = np.cumsum(np.bincount(own - low, minlength=n))[:-1] / len(region)
            if n < 2:
                continue
            uneven = np.abs(share - 0.5)
            # where layers are few even the best is uneven
            allowed = uneven <= max(0.5 - _SMALLER_HALF, uneven.min())
            price = np.where(allowed, size * (1.0 + _UNEVEN * uneven**2) + 1e-6 * uneven, np.inf)
            cut = int(np.argmin(price))
            if price[cut] < best:
                best = price[cut]
                below = own <= low + cut
                in_layer = below & (farthest > low + cut)
        if best == np.inf:
            return region, region[:0], region[:0]
        return region[in_layer], region[below & ~in_layer], region[~below]

    def _edges(self, region: IntArray) -> tuple[IntArray, IntArray]:
        """Where the neighbours of each node of the region begin, and its neighbours within the region, itself too."""
        self._inside[region] = True
        counts = self._starts[region + 1] - self._starts[region] + 1
        ends = np.cumsum(counts)
        places = np.arange(ends[-1]) - np.repeat(ends - counts - self._starts[region], counts)
        last = ends - 1
        places[last] = 0
        neighbours = self._neighbours[places]
        neighbours[last] = region
        # outside ones are replaced by the node itself
        outside = ~self._inside[neighbours]
        neighbours[outside] = np.repeat(region, counts)[outside]
        self._inside[region] = False
        return ends - counts, neighbours


def _symbolic(
    couplings: sparse.csr_matrix, order: IntArray, layers: list[IntArray], children: list[tuple[int, ...]]
) -> Dissection:
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    fronts: list[Front] = []
    first = 0
    for nodes, below in zip(layers, children, strict=True):
        stop = first + len(nodes)
        parts = [couplings.indices[couplings.indptr[node] : couplings.indptr[node + 1]] for node in nodes]
        touched = np.unique(np.concatenate([place[np.concatenate(parts)], *(fronts[k].boundary for k in below)]))
        fronts.append(Front(first, stop, touched[np.searchsorted(touched, stop) :], below))
        first = stop
    owned = {child for front in fronts for child in front.children}
    roots = tuple(k for k in range(len(fronts)) if k not in owned)
    return Dissection(order=order, n_eliminated=first, fronts=tuple(fronts), roots=roots)

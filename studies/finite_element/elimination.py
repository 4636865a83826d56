"""Cholesky factorisation of a sparse Hermitian matrix, front by front in dense blocks.

The order is nested dissection (George 1973): a layer of nodes cuts a region into two halves and is eliminated after
both, which are cut in the same way. A front `e` with boundary `f` is factorised, `A_ee = L L^H`, `W = A_fe L^-H`, and
what it leaves on its boundary, `A_ff - W W^H`, is added to the front that follows (multifrontal method, Duff and Reid
1983).

Why not a library: with SuperLU the bundled dovetail of mesh 3 (18 900 displacements, 288 shapes) takes 7.9 CPU s,
that of mesh 4 46 CPU s and 2.1 GB; with this elimination 2.5 CPU s, and 10 CPU s and 1.1 GB. PARDISO of MKL is as
fast, and knows no Hermitian matrices; CHOLMOD has no wheels.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import blas, eigvalsh, lapack
from scipy.sparse.csgraph import connected_components

from solver.model import FloatArray, IntArray

Dense = NDArray[Any]
"""A dense matrix, real or complex."""

_SMALLEST = 40  # nodes of a region that is not cut any more
_SMALLER_HALF = 0.2  # of a region: the least that a cut leaves on one side
_UNEVEN = 4.0  # how much a cut away from the middle is penalised, against the size of its layer
_SINGULAR = 1e-12  # a pivot that small against its diagonal entry is round-off
_BY_HAND = 200  # entries: numbers of fewer may be exact however few digits they have
_FEWEST_DIGITS, _MOST_DIGITS = 4, 14  # that are looked for; double precision has 16
_SAFETY = 10.0  # of two lapping plates that are free along x, with 10 and 14 digits, the largest was 3.6 times the sum
_LOOKED_AT = 10_000  # entries, at most
_NEGATIVE = 1e-10  # of the largest eigenvalue of a front: one that is more negative is no round-off


class NotPositiveDefiniteError(ValueError):
    """A matrix that is singular, or has a negative eigenvalue. `unstable` says which."""

    def __init__(self, *, unstable: bool) -> None:
        super().__init__("not positive definite")
        self.unstable = unstable


@dataclass(frozen=True)
class Front:
    """Rows that are eliminated together, by their places first..stop - 1 in the order of elimination.

    boundary (f,): places of the later rows that are coupled to these when they are eliminated, ascending. children:
    numbers of the fronts whose boundary is first touched here.
    """

    first: int
    stop: int
    boundary: IntArray
    children: tuple[int, ...]


@dataclass(frozen=True)
class Dissection:
    """order (n,): rows of a matrix in the order of elimination. fronts: each after its children."""

    order: IntArray
    fronts: tuple[Front, ...]


@dataclass(frozen=True)
class Factor:
    """blocks: L (e, e) and W (f, e) of each front."""

    dissection: Dissection
    blocks: tuple[tuple[Dense, Dense], ...]

    def solve(self, forces: Dense) -> Dense:
        """Solutions (n, n_vectors) for right-hand sides of this shape."""
        order, steps = self.dissection.order, list(zip(self.dissection.fronts, self.blocks, strict=True))
        result = np.array(forces[order], dtype=self.blocks[0][0].dtype)
        for front, (lower, below) in steps:
            own = slice(front.first, front.stop)
            if result[own].any():  # forces at a joint reach few fronts
                result[own] = _solve_lower(lower, result[own], adjoint=False)
                result[front.boundary] -= below @ result[own]
        for front, (lower, below) in reversed(steps):
            own = slice(front.first, front.stop)
            result[own] = _solve_lower(lower, result[own] - below.conj().T @ result[front.boundary], adjoint=True)
        solved = np.empty_like(result)
        solved[order] = result
        return solved


def dissect(matrix: sparse.csr_matrix, node: IntArray, positions: FloatArray) -> Dissection:
    """Order of elimination of matrices whose nodes are coupled as those of a matrix (n, n), its values do not matter.

    node (n,): node of each row, ascending. positions (n_nodes, n_directions): layers of nodes are looked for along each
    direction, as along coordinates.
    """
    used, node = np.unique(node, return_inverse=True)
    owner = sparse.csr_matrix((np.ones(len(node), dtype=np.float32), (node, np.arange(len(node)))))
    pattern = sparse.csr_matrix((np.ones(matrix.nnz, dtype=np.float32), matrix.indices, matrix.indptr), matrix.shape)
    couplings = (owner @ pattern @ owner.T).tocsr()
    cutter = _Cutter(couplings, positions[used])
    starts = np.searchsorted(node, np.arange(len(used) + 1))
    rows = [np.concatenate([np.arange(starts[n], starts[n + 1]) for n in nodes]) for nodes in cutter.layers]
    order = np.concatenate(rows)
    whole = (owner.T @ couplings @ owner).tocsr()  # all directions of nodes that are coupled
    fronts = _fronts(whole[order][:, order].tocsc(), [len(each) for each in rows], cutter.children)
    return Dissection(order, tuple(fronts))


def rounding_of(matrix: sparse.csr_matrix) -> float:
    """What the digits of a text leave of the stiffness against a motion of all nodes, over an entry of the diagonal.

    0 of full precision, and of few entries, which may be exact. Errors of entries add up at random.
    """
    values = np.abs(matrix.data[matrix.data != 0.0])
    if len(values) < _BY_HAND:
        return 0.0
    chosen = values[:: len(values) // _LOOKED_AT + 1]
    mantissa = chosen / 10.0 ** np.floor(np.log10(chosen))
    for digits in range(_FEWEST_DIGITS, _MOST_DIGITS + 1):
        whole = mantissa * 10.0 ** (digits - 1)
        if (np.abs(whole - np.round(whole)) < 0.1).all():
            return float(_SAFETY * 0.5 * 10.0 ** (1 - digits) * np.sqrt(len(values)))
    return 0.0


def factorise(matrix: sparse.csr_matrix, dissection: Dissection, rounding: float = 0.0) -> Factor:
    """Factors of a Hermitian matrix (n, n). Raises NotPositiveDefiniteError where it is not positive definite.

    rounding: part of a diagonal entry that is none, as in `rounding_of`.
    """
    ordered = matrix[dissection.order][:, dissection.order].tocsc()
    waiting: dict[int, Dense] = {}
    blocks: list[tuple[Dense, Dense]] = []
    for number, front in enumerate(dissection.fronts):
        whole = _gathered(ordered, front)
        for child in front.children:
            places = _places(front, dissection.fronts[child].boundary)
            # transposed, as it is in memory; what is above the diagonal counts for nothing
            whole.T[np.ix_(places, places)] += waiting.pop(child).T
        lower, below, waiting[number] = _eliminate(whole, front.stop - front.first, rounding)
        blocks.append((lower, below))
    return Factor(dissection, tuple(blocks))


class _Cutter:
    """Cuts a mesh; `layers` and `children` are the fronts' nodes and children in the order of elimination."""

    def __init__(self, couplings: sparse.csr_matrix, positions: FloatArray) -> None:
        self._starts, self._neighbours = couplings.indptr.astype(np.int64), couplings.indices
        self._positions = [np.unique(values, return_inverse=True)[1] for values in positions.T]
        self._inside = np.zeros(len(positions), dtype=np.bool_)
        self.layers: list[IntArray] = []
        self.children: list[tuple[int, ...]] = []
        _, part = connected_components(couplings, directed=False)
        for number in range(part.max(initial=-1) + 1):
            self._cut(np.flatnonzero(part == number))

    def _cut(self, region: IntArray) -> tuple[int, ...]:
        """Numbers of the fronts that the region ends in: one, or those of its parts where nothing lies between."""
        if len(region) <= _SMALLEST:
            return self._append(region, ())
        layer, lower, upper = self._halves(region)
        children = (*self._cut(lower), *self._cut(upper)) if len(lower) and len(upper) else ()
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
            low = own.min()
            n = own.max() - low + 1
            if n < 2:
                continue
            # A cut above position c has the nodes up to c with a neighbour beyond as its layer.
            farthest = np.maximum.reduceat(positions[neighbours], rows)
            counts = np.bincount(own - low, minlength=n)
            size = np.cumsum(counts - np.bincount(farthest - low, minlength=n))[:-1]
            uneven = np.abs(np.cumsum(counts)[:-1] / len(region) - 0.5)
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
        counts = self._starts[region + 1] - self._starts[region]
        ends = np.cumsum(counts)
        neighbours = self._neighbours[np.arange(ends[-1]) - np.repeat(ends - counts - self._starts[region], counts)]
        # outside ones are replaced by the node itself
        neighbours = np.where(self._inside[neighbours], neighbours, np.repeat(region, counts))
        self._inside[region] = False
        return ends - counts, neighbours


def _fronts(ordered: sparse.csc_matrix, sizes: list[int], children: list[tuple[int, ...]]) -> Iterator[Front]:
    """Fronts of a matrix in the order of elimination. sizes: numbers of their rows."""
    boundaries: list[IntArray] = []
    first = 0
    for size, below in zip(sizes, children, strict=True):
        stop = first + size
        touched = [ordered.indices[ordered.indptr[first] : ordered.indptr[stop]], *(boundaries[k] for k in below)]
        everything = np.unique(np.concatenate(touched))
        boundaries.append(everything[np.searchsorted(everything, stop) :].astype(np.int64))
        yield Front(first, stop, boundaries[-1], below)
        first = stop


def _places(front: Front, rows: IntArray) -> IntArray:
    """Places of rows among those of a front, then those of its boundary."""
    behind = front.stop - front.first + np.searchsorted(front.boundary, rows)
    return np.where(rows < front.stop, rows - front.first, behind)


def _gathered(ordered: sparse.csc_matrix, front: Front) -> Dense:
    """Entries of the matrix in the columns of a front, on and below its diagonal, with room for its boundary."""
    part = slice(ordered.indptr[front.first], ordered.indptr[front.stop])
    columns = np.repeat(np.arange(front.stop - front.first), np.diff(ordered.indptr[front.first : front.stop + 1]))
    rows = ordered.indices[part]
    inside = rows >= front.first
    size = front.stop - front.first + len(front.boundary)
    whole = np.zeros((size, size), dtype=ordered.dtype, order="F")
    whole[_places(front, rows[inside]), columns[inside]] = ordered.data[part][inside]
    return whole


def _eliminate(whole: Dense, e: int, rounding: float) -> tuple[Dense, Dense, Dense]:
    """L, W and what is left of a front from its lower triangle; the upper one of what is left is no part of it."""
    kind = "z" if np.iscomplexobj(whole) else "d"
    own, below, left = (np.asfortranarray(each) for each in (whole[:e, :e], whole[e:, :e], whole[e:, e:]))
    lower, info = getattr(lapack, f"{kind}potrf")(own, lower=1, clean=1)
    if info != 0:
        values = eigvalsh(own, lower=True)
        raise NotPositiveDefiniteError(unstable=bool(values[0] < -max(_NEGATIVE, rounding) * np.abs(values).max()))
    if (np.diag(lower).real ** 2 <= max(_SINGULAR, rounding) * np.diag(own).real).any():
        raise NotPositiveDefiniteError(unstable=False)
    if len(below) == 0:
        return lower, below, left
    below = getattr(blas, f"{kind}trsm")(1.0, lower, below, side=1, lower=1, trans_a=2, overwrite_b=1)
    product = blas.zherk if kind == "z" else blas.dsyrk
    return lower, below, product(-1.0, below, beta=1.0, c=left, lower=1, overwrite_c=1)


def _solve_lower(lower: Dense, vectors: Dense, *, adjoint: bool) -> Dense:
    """`L^-1 vectors`, or `L^-H vectors`; vectors (e, n_vectors)."""
    trsm = blas.ztrsm if np.iscomplexobj(lower) else blas.dtrsm
    return np.asarray(trsm(1.0, lower, vectors, lower=1, trans_a=2 * adjoint))

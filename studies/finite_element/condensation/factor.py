"""Elimination of nodes front by front: a Cholesky factorisation in dense blocks.

A front `e` with boundary `f` is factorised, `A_ee = L L^H`, `W = A_fe L^-H`, and what it leaves on its boundary,
`A_ff - W W^H`, is added to the fronts that follow (multifrontal method, Duff and Reid 1983).

Why not a library: for 144 000 displacements (bundled dovetail, 336 pairs, one core) PARDISO of MKL takes 6.0 CPU s to
order and factorise and 0.31 s to solve for 8 right-hand sides; this elimination takes 6.0 and 0.40 s, and leaves fronts
from which forms are condensed (`projection`). CHOLMOD has no wheels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import blas, eigvalsh, lapack

from solver.model import BoolArray, IntArray
from studies.finite_element.condensation.dissection import Dissection, dofs_of
from studies.finite_element.condensation.extend_add import add_lower
from studies.finite_element.condensation.ordered_form import OrderedForm

Dense = NDArray[Any]
"""A dense matrix, real or complex."""

_SINGULAR = 1e-13  # a pivot that small against its diagonal entry is round-off


class NotPositiveDefiniteError(ValueError):
    """A stiffness that is singular, or has a negative eigenvalue. `unstable` says which."""

    def __init__(self, *, unstable: bool) -> None:
        super().__init__("not positive definite")
        self.unstable = unstable


@dataclass(frozen=True)
class FrontFactor:
    """lower (e, e): L, in Fortran's order, not to be read above the diagonal. below (f, e): W. Real or complex."""

    lower: Dense
    below: Dense


@dataclass(frozen=True)
class Factor:
    """Factors of all fronts, and what is left (n, n) of the nodes that are never eliminated."""

    dissection: Dissection
    fronts: tuple[FrontFactor, ...]
    left: Dense

    def condense(self, vectors: Dense) -> Dense:
        """Forward elimination of forces (3 n_places, n_vectors); gives `L^-1 b` in the order of elimination.

        In the rows of nodes that are never eliminated stands the force that is statically equivalent.
        """
        result = np.array(vectors, dtype=np.result_type(vectors, self.left), order="C")
        for front, factor in zip(self.dissection.fronts, self.fronts, strict=True):
            own = slice(3 * front.first, 3 * front.stop)
            result[own] = solve_lower(factor.lower, result[own], transposed=False)
            result[front.boundary_dofs] -= times(factor.below, result[own])
        return result

    def expand(self, vectors: Dense) -> Dense:
        """Backward substitution (3 n_places, n_vectors), complex conjugate of the argument and of the result."""
        result = np.array(vectors, dtype=np.result_type(vectors, self.left), order="C")
        for front, factor in zip(reversed(self.dissection.fronts), reversed(self.fronts), strict=True):
            own = slice(3 * front.first, 3 * front.stop)
            rest = result[own] - times(factor.below.T, result[front.boundary_dofs])
            result[own] = solve_lower(factor.lower, rest, transposed=True)
        return result


def factorise(
    form: OrderedForm,
    dissection: Dissection,
    phase: complex | float,
    unphased: dict[int, tuple[FrontFactor, Dense | None]] | None = None,
) -> Factor:
    """Factors of a Hermitian form at a phase.

    form, dissection: the form in the order of the dissection. phase: complex, or 1.0 or -1.0. unphased: factors of
    fronts that do not depend on the phase and what they leave, from an earlier call; filled by this one.

    Raises NotPositiveDefiniteError where the form is not positive definite on the eliminated nodes.
    """
    phased = phased_fronts(form, dissection)
    done = {} if unphased is None else unphased
    waiting: dict[int, Dense] = {}
    factors: list[FrontFactor] = []
    for number, front in enumerate(dissection.fronts):
        if number in done:
            factor, waits = done[number]
        else:
            e, f = 3 * (front.stop - front.first), 3 * len(front.boundary)
            kind = type(phase) if phased[number] else float
            rows = form.rows_of(front, phase, np.zeros((e, e + f), dtype=kind))
            own, below = np.asfortranarray(rows[:, :e].T), np.asfortranarray(rows[:, e:].T)
            waits = np.zeros((f, f), dtype=kind, order="F")
            for child in front.children:
                add_lower(own, below, waits, waiting.pop(child), places_in_parent(dissection, child, number))
            factor = eliminate(own, below, waits)
        factors.append(factor)
        if waits is not None:
            waiting[number] = waits
        if unphased is not None and not phased[number]:
            unphased[number] = factor, waits
            # What the children left is part of this front for good.
            unphased.update({child: (unphased[child][0], None) for child in front.children})
    left = np.asfortranarray(form.kept(dissection, phase))
    for number in dissection.roots:
        places = dofs_of(dissection.fronts[number].boundary - dissection.n_eliminated)
        left[np.ix_(places, places)] += waiting.pop(number)
    return Factor(dissection, tuple(factors), mirrored(left))


def phased_fronts(form: OrderedForm, dissection: Dissection) -> BoolArray:
    """Fronts (n_fronts,) that depend on the phase, themselves or through their children."""
    places = form.phased()
    phased = np.zeros(len(dissection.fronts), dtype=np.bool_)
    for number, front in enumerate(dissection.fronts):
        phased[number] = places[front.first : front.stop].any() or phased[list(front.children)].any()
    return phased


def mirrored(lower: Dense) -> Dense:
    """Hermitian matrix from its lower triangle."""
    below = np.tril(lower, -1)
    return np.asarray(below + below.conj().T + np.diag(np.diag(lower).real))


def places_in_parent(dissection: Dissection, child: int, parent: int) -> IntArray:
    """Places of the nodes of a child's boundary among the nodes of its parent's front, then those of its boundary."""
    front, boundary = dissection.fronts[parent], dissection.fronts[child].boundary
    n = int(np.searchsorted(boundary, front.stop))
    behind = front.stop - front.first + np.searchsorted(front.boundary, boundary[n:])
    return np.concatenate([boundary[:n] - front.first, behind])


def eliminate(own: Dense, below: Dense, update: Dense) -> FrontFactor:
    """Factorises a front; `update` becomes what it leaves (its lower triangle)."""
    if own.size == 0:
        return FrontFactor(own, below)
    kind = "z" if np.iscomplexobj(own) else "d"
    diagonal = np.diag(own).real.copy()
    lower, info = getattr(lapack, f"{kind}potrf")(own, lower=1, clean=0)
    if info != 0:
        raise NotPositiveDefiniteError(unstable=_is_unstable(own))
    if (np.diag(lower).real ** 2 <= _SINGULAR * diagonal).any():
        raise NotPositiveDefiniteError(unstable=False)
    if len(below) == 0:
        return FrontFactor(lower, below)
    below = getattr(blas, f"{kind}trsm")(1.0, lower, below, side=1, lower=1, trans_a=2, overwrite_b=1)
    product = blas.zherk if kind == "z" else blas.dsyrk
    product(-1.0, below, beta=1.0, c=update, lower=1, overwrite_c=1)
    return FrontFactor(lower, below)


def _is_unstable(own: Dense) -> bool:
    """Whether a matrix (its lower triangle) has an eigenvalue that is negative by more than round-off."""
    values = eigvalsh(own, lower=True)
    return bool(values[0] < -1e-10 * np.abs(values).max())


def times(matrix: Dense, vectors: Dense) -> Dense:
    """`matrix @ vectors`, that of a real matrix and complex vectors in real arithmetic; vectors (n, n_vectors)."""
    if matrix.dtype.kind == "f" and vectors.dtype.kind == "c":
        return np.asarray((matrix @ np.ascontiguousarray(vectors).view(np.float64)).view(np.complex128))
    return np.asarray(matrix @ vectors)


def solve_lower(lower: Dense, vectors: Dense, *, transposed: bool) -> Dense:
    """`L^-1 vectors`, or `L^-T vectors` (not conjugated); vectors (n, n_vectors)."""
    if lower.dtype.kind == "f" and vectors.dtype.kind == "c":
        real = np.ascontiguousarray(vectors).view(np.float64)
        return np.ascontiguousarray(solve_lower(lower, real, transposed=transposed)).view(np.complex128)
    if lower.size == 0 or vectors.size == 0:
        return np.zeros(vectors.shape, dtype=lower.dtype)
    trsm = blas.ztrsm if lower.dtype.kind == "c" else blas.dtrsm
    columns = np.array(vectors, dtype=lower.dtype, order="C")
    # Seen from Fortran the array is the transpose, and L stands on its right.
    return np.asarray(trsm(1.0, lower, columns.T, side=1, lower=1, trans_a=int(not transposed), overwrite_b=1).T)

"""Krylov methods for operators that are only known by their products: GMRES, and Arnoldi's method for eigenvalues.

The operator may be singular, as for a joint that slips as a whole. One pass of Gram-Schmidt then leaves a basis that is
not orthogonal, so each vector is orthogonalised twice. A right-hand side may lie outside the range of a singular
operator: `solve_gmres` then stops at stagnation, with the least-squares solution without a part in the null space.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numba import njit

from solver.model import ComplexArray, FloatArray
from solver.settings import NEGLIGIBLE

MOST_PRODUCTS = 80
"""Most products of a GMRES cycle, and of Arnoldi's method for a determinant or for Floquet multipliers. GMRES finds
resonances one by one. At 160 pairs, eigenvalues at 0.01 converge with 32."""

SIGN_PRODUCTS = 16
"""Products of Arnoldi's method between two computations of the eigenvalues. With four, 23 cases (12 random scenes,
sliders, small joints) take equal iterations."""

STAGNATION_PRODUCTS = 20
"""A GMRES cycle ends unless its residual is halved over so many products. Without this end the same cases are equal.
The end saves products where a joint slides as a whole."""

NO_DIRECTION = 1e-11
"""Fraction of a vector: less is no new direction. Double precision has 2e-16."""

Product = Callable[[FloatArray], FloatArray]
"""An operator applied to a vector (n,)."""


def solve_gmres(
    product: Product, exact: Product, right: FloatArray, rtol: float, restart: int, cycles: float
) -> tuple[FloatArray, bool]:
    """Solve `exact(x) = right` (n,) by restarted GMRES from zero; returns x and whether it has converged.

    product, exact: the operator, with small errors allowed in `product`; `exact` is applied once in a cycle.
    rtol: wanted relative residual. restart: most products of one cycle.
    cycles: most cycles before stagnation. A cycle that converges with inexact products only does not count.
    """
    solution, residual = np.zeros_like(right), right
    norms = [float(np.linalg.norm(right))]
    wanted = rtol * norms[0]
    while cycles > 0 and np.isfinite(norms[-1]) and norms[-1] > wanted:
        first, null = norms[-1], np.ones(min(restart, right.size) + 1)

        def enough(hessenberg: FloatArray, first: float = first, null: FloatArray = null) -> bool:
            # the residual is the part of `first` along the left null vector of the Hessenberg matrix
            k = hessenberg.shape[1]
            along, below = float(null[:k] @ hessenberg[:k, -1]), float(hessenberg[k, -1])
            null[k] = -along / below if below else along * math.inf
            norms.append(first / math.sqrt(null[: k + 1] @ null[: k + 1]))
            return norms[-1] <= wanted or _stagnates(norms)

        basis, hessenberg = _arnoldi(product, residual, restart, enough)
        if not hessenberg.size:
            break
        found = norms[-1] <= wanted
        # without convergence, directions of the null space would only make the solution large
        least = 0.0 if found else NEGLIGIBLE
        along = first * np.eye(len(hessenberg))[0]
        solution = solution + np.linalg.lstsq(hessenberg, along, rcond=least)[0] @ basis
        cycles -= not found
        residual = right - exact(solution)
        norms[-1] = float(np.linalg.norm(residual))
        if _stagnates(norms):
            break
    return solution, norms[-1] <= wanted


def _stagnates(norms: list[float]) -> bool:
    """Whether the residual norm has not been halved over the last products."""
    return len(norms) > STAGNATION_PRODUCTS and norms[-1] > 0.5 * norms[-1 - STAGNATION_PRODUCTS]


def ritz_values(
    product: Product, start: FloatArray, most: int, enough: Callable[[ComplexArray, FloatArray], bool] | None = None
) -> tuple[ComplexArray, FloatArray]:
    """Ritz values of a real operator by Arnoldi's method; outliers of the spectrum appear first.

    start (n,): first vector. most: most products. enough: whether values and residuals suffice, called every
    `SIGN_PRODUCTS` products; by default there are `most` products.

    Returns the values (k,), with k the number of products (less where the Krylov space ended before, NaN where the
    first product is not finite), and the norms (k,) of `A x - value x` for the Ritz vectors x of norm 1.
    """

    def settled(hessenberg: FloatArray) -> bool:
        often = hessenberg.shape[1] % SIGN_PRODUCTS == 0
        return often and enough is not None and enough(*_eigenvalues(hessenberg))

    return _eigenvalues(_arnoldi(product, start, most, settled)[1])


def _eigenvalues(hessenberg: FloatArray) -> tuple[ComplexArray, FloatArray]:
    if not hessenberg.size:
        return np.full(1, np.nan, complex), np.full(1, np.nan)
    values, vectors = np.linalg.eig(hessenberg[:-1])
    return values.astype(complex), hessenberg[-1, -1] * np.abs(vectors[-1])


def _arnoldi(
    product: Product, start: FloatArray, most: int, enough: Callable[[FloatArray], bool]
) -> tuple[FloatArray, FloatArray]:
    """Orthonormal basis (k, n) of the Krylov space of `start`, and the Hessenberg matrix (k + 1, k) of the operator.

    Ends after `most` products, where the space is invariant, before an image that is not finite, or where `enough` is
    true of the Hessenberg matrix.
    """
    size, k = min(most, start.size), 0
    basis, hessenberg = np.empty((size + 1, start.size)), np.zeros((size + 1, size))
    basis[0] = start / np.linalg.norm(start)
    while k < size:
        column = _extend(basis, k, np.ascontiguousarray(product(basis[k])))
        if not np.isfinite(column).all():
            break
        k += 1
        hessenberg[: k + 1, k - 1] = column
        if enough(hessenberg[: k + 1, :k]) or column[k] == 0.0:
            break
    return basis[:k], hessenberg[: k + 1, :k]


@njit(cache=True)
def _extend(basis: FloatArray, k: int, image: FloatArray) -> FloatArray:
    """Next vector k + 1 of an orthonormal basis (most + 1, n) from the image (n,) of vector k, in place.

    Returns the components (k + 2,) of the image on the new basis, the last one 0 where the new part is round-off.
    """
    column = np.zeros(k + 2)
    length = np.linalg.norm(image)
    there = basis[: k + 1]
    left = image
    for _ in range(2):
        components = np.dot(there, left)
        column[: k + 1] += components
        left = left - np.dot(components, there)
    rest = np.linalg.norm(left)
    # the negation also ends at what is not a number
    if not rest <= NO_DIRECTION * length:
        column[k + 1] = rest
        basis[k + 1] = left / rest
    return column

"""Krylov methods for operators that are only known by their products: GMRES, and Arnoldi's method for eigenvalues.

The operator may be singular, as for a joint that slips as a whole. One pass of Gram-Schmidt then leaves a basis that is
not orthogonal, so each basis is orthogonalised twice. A right-hand side may lie outside the range of a singular
operator: `solve_gmres` then stops at stagnation, with the least-squares solution without a part in the null space.
"""

from __future__ import annotations

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
"""Fraction of a vector, or of a slipping pair: less is no new direction. Double precision has 2e-16."""

Product = Callable[[FloatArray], FloatArray]
"""An operator applied to a vector (n,)."""


def solve_gmres(
    product: Product, exact: Product, right: FloatArray, rtol: float, restart: int, cycles: float
) -> tuple[FloatArray, bool]:
    """Solve `exact(x) = right` (n,) by restarted GMRES from zero; returns x and whether it has converged.

    Parameters
    ----------
    product, exact : callable
        The operator, with small errors allowed in `product`; `exact` is applied once in a cycle.
    right : array (n,)
        Right-hand side.
    rtol : float
        Wanted relative residual.
    restart : int
        Most products of one cycle.
    cycles : float
        Most cycles before stagnation. A cycle that converges with inexact products only does not count.
    """
    solution, residual = np.zeros_like(right), right
    size = float(np.linalg.norm(right))
    norms = [size]
    while cycles > 0 and np.isfinite(norms[-1]) and norms[-1] > rtol * size:
        basis, triangle, projected = _cycle(product, residual, norms, rtol * size, min(restart, right.size))
        if not len(triangle):
            break
        # without convergence, directions of the null space would only make the solution large
        least = 0.0 if norms[-1] <= rtol * size else NEGLIGIBLE
        solution = solution + np.linalg.lstsq(triangle, projected, rcond=least)[0] @ basis
        cycles -= norms[-1] > rtol * size
        residual = right - exact(solution)
        norms[-1] = float(np.linalg.norm(residual))
        if _stagnates(norms):
            break
    return solution, norms[-1] <= rtol * size


def _cycle(
    product: Product, residual: FloatArray, norms: list[float], wanted: float, most: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Products, k of them and at most `most`, until the norm of the residual is `wanted`.

    The norms are appended to `norms`. Returns an orthonormal basis (k, n), the triangular factor (k, k) of the
    Hessenberg matrix, and the first residual (k,) on the basis after the Givens rotations to this factor.
    """
    basis = np.empty((most + 1, residual.size))
    triangle, rotations, projected = np.zeros((most, most)), np.zeros((most, 2)), np.zeros(most + 1)
    basis[0] = residual / norms[-1]
    projected[0] = norms[-1]
    k, lost = 0, False
    while k < most and not lost:
        column, lost = extend_basis(basis, k, np.ascontiguousarray(product(basis[k])), NO_DIRECTION)
        if not np.all(np.isfinite(column)) or not rotate_column(column, rotations, k):
            break
        triangle[: k + 1, k] = column[: k + 1]
        cosine, sine = rotations[k]
        projected[k : k + 2] = cosine * projected[k], -sine * projected[k]
        k += 1
        norms.append(abs(float(projected[k])))
        if norms[-1] <= wanted or _stagnates(norms):
            break
    return basis[:k], triangle[:k, :k], projected[:k]


def _stagnates(norms: list[float]) -> bool:
    """Whether the residual norm has not been halved over the last products."""
    return len(norms) > STAGNATION_PRODUCTS and norms[-1] > 0.5 * norms[-1 - STAGNATION_PRODUCTS]


def ritz_values(
    product: Product, start: FloatArray, most: int, enough: Callable[[ComplexArray, FloatArray], bool] | None = None
) -> tuple[ComplexArray, FloatArray]:
    """Ritz values of a real operator by Arnoldi's method; outliers of the spectrum appear first.

    Parameters
    ----------
    product : callable
        The operator.
    start : array (n,)
        First vector.
    most : int
        Most products.
    enough : callable, optional
        Whether values and residuals suffice, called every few products. By default there are `most` products.

    Returns
    -------
    values : array (k,)
        k is the number of products; less where the Krylov space ended before. NaN where the operator overflows.
    residuals : array (k,)
        Norms of `A x - value x` for the Ritz vectors x of norm 1.
    """
    size = min(most, start.size)
    basis = np.zeros((size + 1, start.size))
    projected = np.zeros((size + 1, size))
    basis[0] = start / np.linalg.norm(start)
    values, residuals = np.empty(0, complex), np.empty(0)
    for k in range(1, size + 1):
        image = np.ascontiguousarray(product(basis[k - 1]))
        projected[: k + 1, k - 1], lost = extend_basis(basis, k - 1, image, NO_DIRECTION)
        if not np.all(np.isfinite(projected)):
            return np.full(k, np.nan, complex), np.full(k, np.nan)
        if not (lost or k == size or (enough is not None and k % SIGN_PRODUCTS == 0)):
            continue
        found, vectors = np.linalg.eig(projected[:k, :k])
        values, residuals = found.astype(complex), (0.0 if lost else projected[k, k - 1]) * np.abs(vectors[-1])
        if lost or (enough is not None and enough(values, residuals)):
            break
    return values, residuals


@njit(cache=True)
def extend_basis(basis: FloatArray, k: int, image: FloatArray, round_off: float) -> tuple[FloatArray, bool]:
    """Next vector k + 1 of an orthonormal basis (most + 1, n) from the image (n,) of vector k, in place.

    Returns the components (k + 2,) of the image on the new basis, and whether the new part of the image is round-off:
    less than `round_off` of its length.
    """
    column = np.zeros(k + 2)
    length = np.linalg.norm(image)
    there = basis[: k + 1]
    left = image
    for _ in range(2):
        components = np.dot(there, left)
        column[: k + 1] += components
        left = left - np.dot(components, there)
    column[k + 1] = np.linalg.norm(left)
    if not column[k + 1] > round_off * length:
        return column, True
    basis[k + 1] = left / column[k + 1]
    return column, False


@njit(cache=True)
def rotate_column(column: FloatArray, rotations: FloatArray, k: int) -> bool:
    """Turn column k (k + 2,) of a Hessenberg matrix into one of a triangle, in place, by Givens rotations (most, 2).

    Rotation k is computed here. Returns False where the column is zero.
    """
    for place in range(k):
        above, below = column[place], column[place + 1]
        cosine, sine = rotations[place]
        column[place], column[place + 1] = cosine * above + sine * below, cosine * below - sine * above
    length = np.hypot(column[k], column[k + 1])
    if length == 0.0:
        return False
    rotations[k, 0], rotations[k, 1] = column[k] / length, column[k + 1] / length
    column[k], column[k + 1] = length, 0.0
    return True

"""Krylov methods for operators that are only known by their products: GMRES, and eigenvalues by Arnoldi's method.

Bases are orthogonalised twice: the operator may be singular, as that of a joint that slips as a whole, and one pass
of Gram-Schmidt then leaves a basis that is not orthogonal. A right-hand side may also lie outside the range of such an
operator: `solve_gmres` ends where it stagnates, with the least-squares solution that has no part along the null space.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit

from solver.model import ComplexArray, FloatArray
from solver.newton.options import NEWTON

Product = Callable[[FloatArray], FloatArray]


def solve_gmres(
    product: Product, right: FloatArray, rtol: float, restart: int, cycles: int, exact: Product | None = None
) -> tuple[FloatArray, bool]:
    """Solve `exact(x) = right` by restarted GMRES from zero.

    Parameters
    ----------
    product : callable
        The operator applied to a vector (n,); it may be a little wrong.
    right : array (n,)
        Right-hand side.
    rtol : float
        Relative residual that is wanted.
    restart, cycles : int
        Products of one cycle, and the number of cycles. One that converges, but by wrong products, does not count.
    exact : callable, optional
        The operator itself, `product` by default; applied once a cycle.

    Returns
    -------
    solution : array (n,)
    converged : bool
        Whether the relative residual is below rtol.
    """
    solution, residual = np.zeros_like(right), right
    size = float(np.linalg.norm(right))
    norms = [size]
    restart = min(restart, right.size)
    basis = np.empty((restart + 1, right.size))
    refinements = 0
    while cycles > 0 and refinements <= NEWTON.refinements:
        if not (np.isfinite(norms[-1]) and norms[-1] > rtol * size):
            break
        basis[0] = residual / norms[-1]
        triangle, rotations = np.zeros((restart, restart)), np.zeros((restart, 2))
        projected = np.zeros(restart + 1)
        projected[0] = norms[-1]
        n_columns, lost = 0, False
        while n_columns < restart and not lost:
            column, lost = extend_basis(basis, n_columns, product(basis[n_columns]), NEWTON.round_off)
            if not np.all(np.isfinite(column)) or not rotate_column(column, rotations, n_columns):
                break
            triangle[: n_columns + 1, n_columns] = column[: n_columns + 1]
            cosine, sine = rotations[n_columns]
            projected[n_columns : n_columns + 2] = cosine * projected[n_columns], -sine * projected[n_columns]
            n_columns += 1
            norms.append(abs(float(projected[n_columns])))
            if norms[-1] <= rtol * size or _stagnates(norms):
                break
        if n_columns == 0:
            break
        # where the residual is not met, a direction of the null space would only make the solution large
        least = 0.0 if norms[-1] <= rtol * size else NEWTON.null_space
        weights = np.linalg.lstsq(triangle[:n_columns, :n_columns], projected[:n_columns], rcond=least)[0]
        solution = solution + weights @ basis[:n_columns]
        refined = norms[-1] <= rtol * size
        refinements, cycles = refinements + refined, cycles - (not refined)
        residual = right - (exact or product)(solution)
        norms[-1] = float(np.linalg.norm(residual))
        if _stagnates(norms):
            break
    return solution, norms[-1] <= rtol * size


def ritz_values(
    product: Product, start: FloatArray, most: int, enough: Callable[[ComplexArray, FloatArray], bool] | None = None
) -> tuple[ComplexArray, FloatArray]:
    """Ritz values of a real operator by Arnoldi's method; outliers of the spectrum are found first.

    Parameters
    ----------
    product : callable
        The operator applied to a vector (n,).
    start : array (n,)
        Vector to begin with.
    most : int
        Products.
    enough : callable, optional
        Whether values and residuals will do; asked every few products. By default the end is after `most`.

    Returns
    -------
    values : array (k,)
        k is the number of products, or less where the space ended before; NaN where the operator overflows.
    residuals : array (k,)
        Norms of `A x - value x` for their vectors of norm 1.
    """
    size = min(most, start.size)
    basis = np.zeros((size + 1, start.size))
    projected = np.zeros((size + 1, size))
    basis[0] = start / np.linalg.norm(start)
    values, residuals = np.empty(0, complex), np.empty(0)
    for k in range(1, size + 1):
        projected[: k + 1, k - 1], lost = extend_basis(basis, k - 1, product(basis[k - 1]), NEWTON.round_off)
        if not np.all(np.isfinite(projected)):
            return np.full(k, np.nan, complex), np.full(k, np.nan)
        look = enough is not None and k >= NEWTON.sign_products and k % NEWTON.sign_check == 0
        if not (lost or look or k == size):
            continue
        found, vectors = np.linalg.eig(projected[:k, :k])
        values, residuals = found.astype(complex), (0.0 if lost else projected[k, k - 1]) * np.abs(vectors[-1])
        if lost or (enough is not None and enough(values, residuals)):
            break
    return values, residuals


@njit(cache=True)
def extend_basis(basis: FloatArray, k: int, image: FloatArray, round_off: float) -> tuple[FloatArray, bool]:
    """Next vector k + 1 of an orthonormal basis (most + 1, n) from the image (n,) of vector k, in place.

    Returns the components (k + 2,) of the image on the new basis, and whether nothing new was in it: less than
    `round_off` of its length.
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
    """Column k (k + 2,) of a Hessenberg matrix to that of a triangle, in place, by Givens rotations (most, 2).

    The last of them is made here. False where the column is zero.
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


def _stagnates(norms: list[float]) -> bool:
    """Whether the residual norm has hardly decreased over the last products."""
    products = NEWTON.stagnation_products
    return len(norms) > products and norms[-1] > NEWTON.stagnation_ratio * norms[-1 - products]

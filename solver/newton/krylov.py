"""Krylov methods for large systems: GMRES, Ritz values, and a preconditioner corrected by what GMRES has found.

The operator may be singular, as the Jacobian of a joint that slips as a whole. So each vector is orthogonalised twice,
and GMRES stops at stagnation, with the least-squares solution without a part in the null space.
"""

import math
from collections.abc import Callable

import numpy as np
import scipy.linalg
from scipy.linalg.blas import dgemv, dnrm2

from solver.model import ComplexArray, FloatArray
from solver.settings import NEGLIGIBLE, ROUND_OFF

SIGN_PRODUCTS = 16
"""Products of Arnoldi's method between two computations of the eigenvalues. With four, 23 cases are equal."""

STAGNATION_PRODUCTS = 40
"""GMRES ends unless its residual is halved over so many products: saves time where a joint slides. With 20 a wave of
the dovetail with 39 harmonics, all of whose pairs slip, needs 27 steps where 10 suffice, and is lost; with 80 it takes
as many iterations."""

Product = Callable[[FloatArray], FloatArray]
"""An operator applied to a vector (n,)."""


def solve_gmres(
    product: Product, right: FloatArray, residual: float, most: int
) -> tuple[FloatArray, bool, FloatArray, FloatArray]:
    """Solve `A x = right` (n,) by GMRES from zero, with at most `most` products, to a relative residual.

    Returns x, whether it has converged, and basis and Hessenberg matrix (`_arnoldi`).
    """
    norms, null = [float(np.linalg.norm(right))], np.ones(min(most, right.size) + 1)
    wanted = residual * norms[0]
    if not 0.0 < norms[0] < math.inf:
        return np.zeros_like(right), norms[0] == 0.0, right[None], np.zeros((1, 0))

    def enough(hessenberg: FloatArray) -> bool:
        # the residual is the part of the right-hand side along the left null vector of the Hessenberg matrix
        k = hessenberg.shape[1]
        along, below = float(null[:k] @ hessenberg[:k, -1]), float(hessenberg[k, -1])
        null[k] = -along / below if below else along * math.inf
        norms.append(norms[0] / math.sqrt(null[: k + 1] @ null[: k + 1]))
        stagnates = k >= STAGNATION_PRODUCTS and norms[-1] > 0.5 * norms[-1 - STAGNATION_PRODUCTS]
        return norms[-1] <= wanted or stagnates

    basis, hessenberg = _arnoldi(product, right, most, enough)
    if not hessenberg.size:
        return np.zeros_like(right), False, basis, hessenberg
    found, along = norms[-1] <= wanted, norms[0] * np.eye(len(hessenberg))[0]
    # without convergence, directions of the null space would only make the solution large
    solution = np.linalg.lstsq(hessenberg, along, rcond=0.0 if found else NEGLIGIBLE)[0]
    # of a singular operator the null vector is round-off at last
    found = found and float(np.linalg.norm(hessenberg @ solution - along)) <= 2.0 * wanted
    return solution @ basis[:-1], found, basis, hessenberg


def build_correction(basis: FloatArray, hessenberg: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """A correction `1 + (U - Y) Y^T` of vectors; returns the rows of Y and of U - Y (k, n).

    Of the operator it is the exact inverse on the space where GMRES has been, and the identity at right angles to this
    space. Arnoldi's method gives `A V = W H`, with W (k + 1, n) and H (k + 1, k). With H = Q R, the orthonormal columns
    of Y = W Q are the images of `U = V R^-1` (Parks et al., Recycling Krylov Subspaces, SIAM J. Sci. Comput. 28, 2006).
    None where the operator is nearly singular.
    """
    left, right = np.linalg.qr(hessenberg)
    sizes = np.abs(np.diag(right))
    if not sizes.min() > NEGLIGIBLE * sizes.max():
        return None
    images = left.T @ basis
    return images, scipy.linalg.solve_triangular(right, basis[:-1], trans="T") - images


def ritz_values(
    product: Product, start: FloatArray, most: int, enough: Callable[[ComplexArray, FloatArray], bool] | None = None
) -> tuple[ComplexArray, FloatArray, ComplexArray]:
    """Ritz values (k,) of a real operator A by Arnoldi's method; outliers of the spectrum appear first.

    start (n,): first vector. most: products. enough: whether values and residuals suffice, asked every `SIGN_PRODUCTS`.
    Also returns the norms (k,) of `A x - value x` for the Ritz vectors x of norm 1, and that of the largest value (n,).
    NaN where no product is finite.
    """

    def values_of(hessenberg: FloatArray) -> tuple[ComplexArray, FloatArray, ComplexArray]:
        if not hessenberg.size:
            return np.full(1, np.nan, complex), np.full(1, np.nan), np.zeros(0, complex)
        values, vectors = np.linalg.eig(hessenberg[:-1])
        largest = vectors[:, np.argmax(np.abs(values))]
        return values.astype(complex), hessenberg[-1, -1] * np.abs(vectors[-1]), largest.astype(complex)

    def settled(hessenberg: FloatArray) -> bool:
        often = hessenberg.shape[1] % SIGN_PRODUCTS == 0
        return often and enough is not None and enough(*values_of(hessenberg)[:2])

    basis, hessenberg = _arnoldi(product, start, most, settled)
    values, residuals, largest = values_of(hessenberg)
    return values, residuals, largest @ basis[: largest.size]


def _arnoldi(
    product: Product, start: FloatArray, most: int, enough: Callable[[FloatArray], bool]
) -> tuple[FloatArray, FloatArray]:
    """Orthonormal basis W (k + 1, n) of the Krylov space, and the Hessenberg matrix H (k + 1, k): `A V = W H` for the
    first k vectors V. Ends after `most` products, where the space is invariant or an image not finite, or by `enough`.
    """
    size, k = min(most, start.size), 0
    basis, hessenberg = np.zeros((size + 1, start.size)), np.zeros((size + 1, size))
    basis[0] = start / np.linalg.norm(start)
    while k < size:
        column = _extend(basis, k, product(basis[k]))
        if not np.isfinite(column).all():
            break
        k += 1
        hessenberg[: k + 1, k - 1] = column
        if enough(hessenberg[: k + 1, :k]) or column[k] == 0.0:
            break
    return basis[: k + 1], hessenberg[: k + 1, :k]


@np.errstate(over="ignore", invalid="ignore")
def _extend(basis: FloatArray, k: int, image: FloatArray) -> FloatArray:
    """Vector k + 1 of an orthonormal basis, in place; returns the components (k + 2,) of the image (n,), the last one 0
    where the new part is round-off.
    """
    column, there, left = np.zeros(k + 2), basis[: k + 1].T, image
    for _ in range(2):
        components = dgemv(1.0, there, left, trans=1)
        column[: k + 1] += components
        left = left - dgemv(1.0, there, components)
    rest = dnrm2(left)
    # the negation also ends at what is not a number
    if not rest <= ROUND_OFF * dnrm2(image):
        column[k + 1] = rest
        basis[k + 1] = left / rest
    return column

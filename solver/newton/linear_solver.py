"""Newton directions: solves with the exact Jacobian, Eqs. (16) and (17), and the sign of its determinant.

A small Jacobian is factorised. A large one is solved by GMRES, with a factorisation kept from solve to solve as the
preconditioner. The Jacobian may be singular, as for a joint that slips as a whole. So each Krylov vector is
orthogonalised twice, and GMRES stops at stagnation, with the least-squares solution without a part in the null space.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numba import njit

from solver.harmonic_balance.dlft import Linearisation
from solver.model import ComplexArray, FloatArray, IntArray
from solver.newton.period_preconditioner import PeriodFactor, build_period_factor
from solver.settings import NEGLIGIBLE

FORCING = 1e-3
"""Relative residual of a Newton direction (dovetail with half and twice this value: equal to 1e-6)."""

KEPT_PRODUCTS = 25
"""Most products of a solve with a kept factorisation, before a new one is built, which takes as long as 20 products
with 48 pairs. Histories of 16 and 48 pairs take equal times, within 10 %, with 12 to 80."""

MOST_PRODUCTS = 80
"""Most products of a GMRES cycle, and of Arnoldi's method: at 160 pairs, eigenvalues at 0.01 converge with 32."""

SIGN_PRODUCTS = 16
"""Products of Arnoldi's method between two computations of the eigenvalues. With four, 23 cases are equal."""

STAGNATION_PRODUCTS = 20
"""A GMRES cycle ends unless its residual is halved over so many products: saves time where a joint slides."""

NO_DIRECTION = 1e-11
"""Fraction of a vector: less is no new direction. Double precision has 2e-16."""

SETTLED = 0.1
"""Residual over modulus of an eigenvalue below which its sign is known, and real part above which an eigenvalue is
certainly positive (all are 1 for an exact factorisation). With 0.15 for the real part the same cases are equal."""

DENSE_UNKNOWNS = 200
"""Unknowns up to which a Jacobian is factorised at each solve. With 100 and 400, 16 and 48 pairs take equal times."""

LARGEST_DENSE = 3000
"""Largest number of unknowns of a factorisation: 72 MB and 0.6 s. Above, the highest harmonics are left out."""

EXPENSIVE_UNKNOWNS = 1000
"""Unknowns of an expensive dense solve: above, no odd harmonics above 79, no 3 N + 2 samples to compare, and
no eigenvalues of Hill's matrix (255 unknowns take 0.15 s, 800 take 3 s)."""

SMALL_JOINT = 40
"""Relative displacements up to which a joint is small and its Jacobian is factorised: impacts couple most harmonics,
and products with any other factorisation are in vain (three pairs with 115 harmonics in the tests)."""

# Shift of the eigenvalues, which are 1 for a pair that sticks. The position of a joint that slips as a whole is
# arbitrary along its slip: round-off in a zero eigenvalue would give the determinant any sign.
_NEUTRAL_SHIFT = 1e-8

Product = Callable[[FloatArray], FloatArray]
"""An operator applied to a vector (n,)."""


@dataclass(frozen=True)
class DenseFactor:
    """LU factors and pivots of a Jacobian in some rows (n,) and their first harmonics; the identity elsewhere.

    exact: whether these are all rows of active pairs and all harmonics.
    """

    rows: IntArray
    factor: tuple[FloatArray, IntArray]
    exact: bool

    @property
    def sign(self) -> float:
        """Sign of the determinant, 0 where it is singular."""
        triangle, pivots = self.factor
        swaps = np.count_nonzero(pivots != np.arange(pivots.size))
        return float(np.prod(np.sign(np.diag(triangle))) * (-1.0) ** swaps)

    def solve(self, right: FloatArray) -> FloatArray:
        """Solution (n_rel, m), approximate unless `exact`, for a right-hand side (n_rel, m)."""
        found = right.copy()
        if self.rows.size:
            kept = len(self.factor[1]) // self.rows.size
            inside = right[self.rows, :kept].ravel()
            found[self.rows, :kept] = scipy.linalg.lu_solve(self.factor, inside, check_finite=False).reshape(-1, kept)
        return found


Factor = DenseFactor | PeriodFactor
"""A factorisation of a Jacobian or of a matrix near the Jacobian, with the sign of its determinant."""


def build_dense_factor(tangent: Linearisation) -> DenseFactor:
    """Factorisation of a Jacobian. Singular ones give infinities: Newton's method judges by the residual."""
    rows, m = tangent.active_rows, tangent.joint.basis.synthesis.shape[0]
    kept = min(m, 2 * (LARGEST_DENSE // max(rows.size, 1) // 2) + 1)
    matrix = tangent.dense(tangent.active, kept)
    matrix[np.diag_indices_from(matrix)] += _NEUTRAL_SHIFT
    factor = matrix, np.zeros(0, np.int64)
    if rows.size:
        factor = scipy.linalg.lapack.dgetrf(matrix, overwrite_a=True)[:2]
    return DenseFactor(rows, factor, kept == m)


def build_factor(tangent: Linearisation) -> Factor:
    """A march through the period, or dense factors for small joints, masses, and where a sample is singular."""
    small = tangent.joint.component_index.size <= SMALL_JOINT
    return (None if small else build_period_factor(tangent)) or build_dense_factor(tangent)


@dataclass
class JacobianSolver:
    """Solver of systems with a `Linearisation` that keeps one factorisation between its calls."""

    _factor: Factor | None = None

    def solve(
        self, tangent: Linearisation, rights: Sequence[FloatArray] | FloatArray, rtol: float = FORCING
    ) -> FloatArray:
        """Steps (k, n_rel, m) with Jacobian times step = right (n_rel, m), N, to the relative residual `rtol`.

        A small system is factorised once for all k right-hand sides.
        """
        rows, rest = tangent.active_rows, tangent.passive_rows
        steps = np.zeros((len(rights), *rights[0].shape))
        if 0 < rows.size * steps.shape[2] <= DENSE_UNKNOWNS:
            matrix, wanted = tangent.dense(tangent.active), np.stack([right[rows].ravel() for right in rights], axis=1)
            try:
                found = np.linalg.solve(matrix, wanted)
            except np.linalg.LinAlgError:
                found = np.linalg.lstsq(matrix, wanted)[0]
            steps[:, rows] = found.T.reshape(len(rights), rows.size, -1)
        elif rows.size:
            for step, right in zip(steps, rights, strict=True):
                step[rows] = self._solve_kept(tangent, right, rtol)[rows]
        for step, right in zip(steps, rights, strict=True) if rest.size else ():
            # the columns of all other unknowns are those of the identity
            step[rest] = (right - tangent.apply_roughly(step))[rest]
        return steps

    def _solve_kept(self, tangent: Linearisation, right: FloatArray, rtol: float) -> FloatArray:
        """Solution in the rows of the active pairs, with the kept factorisation while products are few."""

        def cleared(values: FloatArray) -> FloatArray:
            # the steps of these rows do not act on the rows of the active pairs
            values[tangent.passive_rows] = 0.0
            return values

        def iterate(factor: Factor, products: int, cycles: float) -> tuple[FloatArray, bool]:
            # preconditioned from the right: the residual of GMRES is the true one
            def product(apply: Product) -> Product:
                return lambda vector: cleared(apply(factor.solve(vector.reshape(right.shape)))).ravel()

            operators = product(tangent.apply_roughly), product(tangent.apply)
            solution, found = solve_gmres(*operators, cleared(right.copy()).ravel(), rtol, products, cycles)
            return factor.solve(solution.reshape(right.shape)), found

        if self._factor is not None:
            solution, found = iterate(self._factor, KEPT_PRODUCTS, 1)
            if found:
                return solution
        self._factor = build_factor(tangent)
        # convergence is not required: Newton's method judges by the true residual
        return iterate(self._factor, MOST_PRODUCTS, np.inf)[0]

    def determinant_sign(self, tangent: Linearisation) -> float:
        """Sign of the determinant of the Jacobian: 1, -1, or 0 where it is singular.

        For a large joint, that of the kept factorisation P times (-1)^k, with k real negative eigenvalues of J P^-1.
        Where these outliers do not converge, this Jacobian is factorised instead of the kept one, and then densely.
        """
        if self._factor is not None and not self._factor.exact:
            sign, settled = _judge(self._factor, tangent)
            if settled:
                return sign
        self._factor = factor = build_factor(tangent)
        sign, settled = (factor.sign, True) if factor.exact else _judge(factor, tangent)
        if settled:
            return sign
        whole = build_dense_factor(tangent)
        return whole.sign if whole.exact else sign


def _judge(factor: Factor, tangent: Linearisation) -> tuple[float, bool]:
    """Sign of the determinant from outlying eigenvalues of J P^-1, and whether these eigenvalues have converged."""
    shape = tangent.joint.component_index.size, tangent.joint.basis.synthesis.shape[0]

    def product(vector: FloatArray) -> FloatArray:
        return tangent.apply_roughly(factor.solve(vector.reshape(shape))).ravel()

    def settled(values: ComplexArray, residuals: FloatArray) -> bool:
        doubtful = ~(values.real >= SETTLED)
        return bool(np.all((residuals < SETTLED * np.abs(values))[doubtful]))

    # a fixed start: the result must not depend on earlier computations
    start = np.random.default_rng(0).normal(size=shape[0] * shape[1])
    values, residuals = ritz_values(product, start, MOST_PRODUCTS, settled)
    # complex eigenvalues come in conjugate pairs and do not change the sign
    negative = np.count_nonzero((values.real < 0.0) & (values.imag == 0.0))
    return factor.sign * float((-1) ** negative), settled(values, residuals)


def solve_gmres(
    product: Product, exact: Product, right: FloatArray, rtol: float, restart: int, cycles: float
) -> tuple[FloatArray, bool]:
    """Solve `exact(x) = right` (n,) by restarted GMRES from zero; returns x and whether it has converged.

    product: the operator with small errors allowed; `exact` is applied once in a cycle of at most `restart` products.
    rtol: relative residual. cycles: most cycles, but for those that converge with inexact products only.
    """
    solution, residual = np.zeros_like(right), right
    norms = [float(np.linalg.norm(right))]
    wanted = rtol * norms[0]

    def stagnates() -> bool:
        return len(norms) > STAGNATION_PRODUCTS and norms[-1] > 0.5 * norms[-1 - STAGNATION_PRODUCTS]

    while cycles > 0 and np.isfinite(norms[-1]) and norms[-1] > wanted:
        first, null = norms[-1], np.ones(min(restart, right.size) + 1)

        def enough(hessenberg: FloatArray, first: float = first, null: FloatArray = null) -> bool:
            # the residual is the part of `first` along the left null vector of the Hessenberg matrix
            k = hessenberg.shape[1]
            along, below = float(null[:k] @ hessenberg[:k, -1]), float(hessenberg[k, -1])
            null[k] = -along / below if below else along * math.inf
            norms.append(first / math.sqrt(null[: k + 1] @ null[: k + 1]))
            return norms[-1] <= wanted or stagnates()

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
        if stagnates():
            break
    return solution, norms[-1] <= wanted


def ritz_values(
    product: Product, start: FloatArray, most: int, enough: Callable[[ComplexArray, FloatArray], bool] | None = None
) -> tuple[ComplexArray, FloatArray]:
    """Ritz values (k,) of a real operator A by Arnoldi's method; outliers of the spectrum appear first.

    start (n,): first vector. most: products. enough: whether values and residuals suffice, asked every `SIGN_PRODUCTS`.
    Also returns the norms (k,) of `A x - value x` for the Ritz vectors x of norm 1. NaN where no product is finite.
    """

    def values_of(hessenberg: FloatArray) -> tuple[ComplexArray, FloatArray]:
        if not hessenberg.size:
            return np.full(1, np.nan, complex), np.full(1, np.nan)
        values, vectors = np.linalg.eig(hessenberg[:-1])
        return values.astype(complex), hessenberg[-1, -1] * np.abs(vectors[-1])

    def settled(hessenberg: FloatArray) -> bool:
        often = hessenberg.shape[1] % SIGN_PRODUCTS == 0
        return often and enough is not None and enough(*values_of(hessenberg))

    return values_of(_arnoldi(product, start, most, settled)[1])


def _arnoldi(
    product: Product, start: FloatArray, most: int, enough: Callable[[FloatArray], bool]
) -> tuple[FloatArray, FloatArray]:
    """Orthonormal basis (k, n) of the Krylov space of `start`, and the Hessenberg matrix (k + 1, k) of the operator.

    Ends after `most` products, where the space is invariant, before an image that is not finite, or by `enough`.
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
    """Vector k + 1 of an orthonormal basis (most + 1, n), in place; returns the components (k + 2,) of the image (n,).

    The last component is 0 where the new part is round-off.
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

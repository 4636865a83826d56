"""Newton directions: solves with the exact Jacobian, Eqs. (16) and (17).

A small Jacobian is factorised. A large one is solved by GMRES, with a factorisation kept from solve to solve as the
preconditioner.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from solver.harmonic_balance.dlft import Linearisation
from solver.model import ComplexArray, FloatArray, IntArray
from solver.newton.krylov import MOST_PRODUCTS, ritz_values, solve_gmres
from solver.newton.period_preconditioner import PeriodFactor, build_period_factor

FORCING = 1e-3
"""Relative residual of a Newton direction: an iteration gains up to three digits. With half and twice this value the
states of the dovetail are equal to 1e-6. Also the residual of a node of a sweep as a fraction of rtol: with a tenth and
with ten times this value the motion of the dovetail is equal to 1e-4; with the tolerance of a result, nodes take 1.4
times the iterations."""

KEPT_PRODUCTS = 25
"""Most products of a solve with a kept factorisation, before a new one is built, which takes as long as 20 products
with 48 pairs. Histories of 16 and 48 pairs take equal times, within 10 %, with 12 to 80."""

SETTLED = 0.1
"""Residual over modulus of an eigenvalue below which its sign is known, and real part above which an eigenvalue is
certainly positive (all are 1 for an exact factorisation). With 0.15 for the real part the same cases are equal."""

DENSE_UNKNOWNS = 200
"""Unknowns up to which a Jacobian is factorised at each solve. With 100 and 400, sweeps and histories of 16 and 48
pairs take equal times."""

LARGEST_DENSE = 3000
"""Largest number of unknowns of a factorisation: 72 MB and 0.6 s. Above, the highest harmonics are left out."""

EXPENSIVE_UNKNOWNS = 1000
"""Unknowns of an expensive dense solve: above, no odd harmonics above 79, no harmonics from force samples, no 3 N + 2
samples to compare, and no eigenvalues of Hill's matrix (255 unknowns take 0.15 s, 800 take 3 s)."""

SMALL_JOINT = 40
"""Relative displacements up to which a joint is small and its Jacobian is factorised: impacts couple most harmonics and
directions, and products with any other factorisation are in vain (three pairs with 115 harmonics,
`tests/solver/test_refinement.py`)."""

# Shift of the eigenvalues, which are 1 for a pair that sticks. The position of a joint that slips as a whole is
# arbitrary along its slip: round-off in a zero eigenvalue would give the determinant any sign.
_NEUTRAL_SHIFT = 1e-8


@dataclass(frozen=True)
class DenseFactor:
    """LU factors of a Jacobian in the rows of its active pairs and the first m' harmonics; the identity elsewhere.

    rows (n,): these rows. factor: LU factors and pivots of n m' rows. exact: whether no harmonics are left out.
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
"""A factorisation of a Jacobian or of a matrix near the Jacobian; each gives the sign of its determinant."""


def build_dense_factor(tangent: Linearisation) -> DenseFactor:
    """Factorisation of a Jacobian, for small joints, for masses, and for a sign that is not certain otherwise.

    Singular matrices give infinities, not errors: Newton's method goes on and judges by the residual.
    """
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

    def solve(self, tangent: Linearisation, right: FloatArray, rtol: float = FORCING) -> FloatArray:
        """Step (n_rel, m) with Jacobian times step = right (n_rel, m), N, to the relative residual `rtol`."""
        return np.asarray(self.solve_all(tangent, [right], rtol)[0])

    def solve_all(
        self, tangent: Linearisation, rights: Sequence[FloatArray] | FloatArray, rtol: float = FORCING
    ) -> FloatArray:
        """Steps (k, n_rel, m) for k right-hand sides; a small system is factorised once."""
        rows, rest = tangent.active_rows, tangent.passive_rows
        steps = np.zeros((len(rights), *rights[0].shape))
        if 0 < rows.size * steps.shape[2] <= DENSE_UNKNOWNS:
            wanted = np.stack([right[rows].ravel() for right in rights], axis=1)
            steps[:, rows] = _solve_dense(tangent.dense(tangent.active), wanted).T.reshape(len(rights), rows.size, -1)
        elif rows.size:
            for step, right in zip(steps, rights, strict=True):
                step[rows] = self._solve_kept(tangent, right, rtol)[rows]
        for step, right in zip(steps, rights, strict=True) if rest.size else ():
            # the columns of all other unknowns are those of the identity
            step[rest] = (right - tangent.apply_roughly(step))[rest]
        return steps

    def _solve_kept(self, tangent: Linearisation, right: FloatArray, rtol: float) -> FloatArray:
        """Solution (n_rel, m) in the rows of the active pairs, with the kept factorisation while products are few."""

        def cleared(values: FloatArray) -> FloatArray:
            # the steps of these rows do not act on the rows of the active pairs
            values[tangent.passive_rows] = 0.0
            return values

        def iterate(factor: Factor, products: int, cycles: float) -> tuple[FloatArray, bool]:
            def inverse(vector: FloatArray) -> FloatArray:
                return factor.solve(vector.reshape(right.shape))

            # preconditioned from the right: the residual of GMRES is the true one
            solution, found = solve_gmres(
                lambda vector: cleared(tangent.apply_roughly(inverse(vector))).ravel(),
                lambda vector: cleared(tangent.apply(inverse(vector))).ravel(),
                cleared(right.copy()).ravel(),
                rtol,
                products,
                cycles,
            )
            return inverse(solution), found

        if self._factor is not None:
            solution, found = iterate(self._factor, KEPT_PRODUCTS, 1)
            if found:
                return solution
        self._factor = build_factor(tangent)
        # convergence is not required: Newton's method judges by the true residual
        return iterate(self._factor, MOST_PRODUCTS, np.inf)[0]

    def determinant_sign(self, tangent: Linearisation) -> float:
        """Sign of the determinant of the Jacobian: 1, -1, or 0 where it is singular.

        For a large joint, the sign is that of the kept factorisation P times (-1)^k, with k the number of real negative
        eigenvalues of J P^-1. Most eigenvalues are near 1, and Arnoldi's method finds the outliers first. Where the
        outliers do not converge, this Jacobian is factorised instead of the kept one, and then densely.
        """
        if self._factor is not None and not self._factor.exact:
            sign, settled = _judge(self._factor, tangent)
            if settled:
                return sign
        self._factor = factor = build_factor(tangent)
        if factor.exact:
            return factor.sign
        sign, settled = _judge(factor, tangent)
        if settled:
            return sign
        whole = build_dense_factor(tangent)
        return whole.sign if whole.exact else sign


def _judge(factor: Factor, tangent: Linearisation) -> tuple[float, bool]:
    """Sign of the determinant from outlying eigenvalues of J P^-1, and whether these eigenvalues have converged."""
    shape = tangent.joint.component_index.size, tangent.joint.basis.synthesis.shape[0]

    def product(vector: FloatArray) -> FloatArray:
        return tangent.apply_roughly(factor.solve(vector.reshape(shape))).ravel()

    # a fixed start: the result must not depend on earlier computations
    start = np.random.default_rng(0).normal(size=shape[0] * shape[1])
    values, residuals = ritz_values(product, start, MOST_PRODUCTS, _settled)
    # complex eigenvalues come in conjugate pairs and do not change the sign
    negative = np.count_nonzero((values.real < 0.0) & (values.imag == 0.0))
    return factor.sign * float((-1) ** negative), _settled(values, residuals)


def _settled(values: ComplexArray, residuals: FloatArray) -> bool:
    """Whether it is certain which eigenvalues are negative, from Ritz values and their residuals."""
    doubtful = ~(values.real >= SETTLED)
    return bool(np.all((residuals < SETTLED * np.abs(values))[doubtful]))


def _solve_dense(matrix: FloatArray, rights: FloatArray) -> FloatArray:
    """Solutions (n, k) of a small system; the shortest least-squares ones where it is singular."""
    try:
        return np.asarray(np.linalg.solve(matrix, rights))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.lstsq(matrix, rights)[0])

"""Newton directions: the exact Jacobian, solved directly where it is small and with a kept factorisation where not."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import cast

import numpy as np
import scipy.linalg
from scipy.sparse.linalg import LinearOperator, gmres

from solver.balance import Linearisation
from solver.model import ComplexArray, FloatArray, IntArray

SMALL = 250  # unknowns up to which a fresh factorisation is cheaper than an iteration
KRYLOV = 30  # products after which a kept factorisation has aged too much
FORCING = 1e-3  # relative residual of an iterative solve
ARNOLDI = 24  # products from which the sign of a determinant is taken where a kept factorisation serves
CERTAIN = 0.15  # a real part of an eigenvalue, 1 where the factorisation is exact, that is taken as far from zero


@dataclass
class JacobianSolver:
    """Solves with `Linearisation`; keeps one LU between calls as the preconditioner of GMRES on the exact Jacobian."""

    _factor: tuple[FloatArray, IntArray] | None = field(default=None, repr=False)
    _pairs: IntArray = field(default_factory=lambda: np.zeros(0, np.int64), repr=False)
    _sign: float = field(default=1.0, repr=False)

    def solve(self, tangent: Linearisation, right: FloatArray) -> FloatArray:
        """Step (n_rel, m) with Jacobian times step = right (n_rel, m), N."""
        m = right.shape[1]
        pairs = tangent.active()
        rows = np.flatnonzero(np.isin(tangent.joint.slots // 3, pairs))
        step = np.zeros_like(right)
        if rows.size:
            if rows.size * m <= SMALL:
                step[rows] = _solve_dense(tangent.dense(pairs), right[rows].ravel()).reshape(rows.size, m)
            else:
                step[rows] = self._solve_kept(tangent, pairs, rows, right[rows])
        # the columns of all other unknowns are those of the identity
        rest = np.ones(right.shape[0], bool)
        rest[rows] = False
        step[rest] = (right - tangent.apply(step))[rest]
        return step

    def solve_two(self, tangent: Linearisation, first: FloatArray, second: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Steps (n_rel, m) for two right sides; a small system is factorised once."""
        pairs = tangent.active()
        rows = np.flatnonzero(np.isin(tangent.joint.slots // 3, pairs))
        if not rows.size or rows.size * first.shape[1] > SMALL:
            return self.solve(tangent, first), self.solve(tangent, second)
        both = np.stack([first[rows].ravel(), second[rows].ravel()], axis=1)
        solved = _solve_dense(tangent.dense(pairs), both)
        steps = []
        for right, column in ((first, solved[:, 0]), (second, solved[:, 1])):
            step = np.zeros_like(right)
            step[rows] = column.reshape(rows.size, -1)
            rest = np.ones(right.shape[0], bool)
            rest[rows] = False
            step[rest] = (right - tangent.apply(step))[rest]
            steps.append(step)
        return steps[0], steps[1]

    def determinant_sign(self, tangent: Linearisation) -> float:
        """Sign of the determinant of the Jacobian: 1, -1, or 0 where it is singular.

        Columns of pairs that stay stuck or closed are those of the identity and do not count. In a large system the
        sign is that of the kept factorisation P times (-1)^k, k the number of real negative eigenvalues of J P^-1. All
        but few of its eigenvalues are near 1, and Arnoldi's method finds those that stand apart first: where none is
        near or below zero k = 0, else a new factorisation decides.
        """
        pairs = tangent.active()
        rows = np.flatnonzero(np.isin(tangent.joint.slots // 3, pairs))
        m = tangent.joint.basis.synthesis.shape[0]
        if not rows.size:
            return 1.0
        if rows.size * m <= SMALL:
            return float(np.linalg.slogdet(tangent.dense(pairs))[0])
        if self._factor is None or not np.isin(pairs, self._pairs).all() or not self._near(tangent, m):
            self._refresh(tangent, pairs)
        return self._sign

    def _near(self, tangent: Linearisation, m: int) -> bool:
        """Whether the kept factorisation and the Jacobian certainly have the same sign."""
        kept = np.flatnonzero(np.isin(tangent.joint.slots // 3, self._pairs))
        full = np.zeros((tangent.joint.slots.size, m))

        def product(vector: FloatArray) -> FloatArray:
            full[kept] = self._precondition(tangent, kept, vector.reshape(kept.size, m))
            return tangent.apply(full)[kept].ravel()

        # a fixed start: the answer must not depend on what was computed before
        start = np.random.default_rng(0).normal(size=kept.size * m)
        values = ritz_values(product, start, ARNOLDI)
        return bool(np.all(np.isfinite(values)) and values.real.min() > CERTAIN)

    def _solve_kept(self, tangent: Linearisation, pairs: IntArray, rows: IntArray, right: FloatArray) -> FloatArray:
        m = right.shape[1]
        if self._factor is None or not np.isin(pairs, self._pairs).all():
            self._refresh(tangent, pairs)
            return self._precondition(tangent, rows, right)
        full = np.zeros((tangent.joint.slots.size, m))

        def product(vector: FloatArray) -> FloatArray:
            full[rows] = self._precondition(tangent, rows, vector.reshape(rows.size, m))
            return tangent.apply(full)[rows].ravel()

        # preconditioned from the right, so that the residual that GMRES watches is the true one
        size = rows.size * m
        solution, failed = gmres(
            LinearOperator((size, size), matvec=product, dtype=float),
            right.ravel(),
            rtol=FORCING,
            restart=KRYLOV,
            maxiter=1,
        )
        if failed:
            self._refresh(tangent, pairs)
            return self._precondition(tangent, rows, right)
        return self._precondition(tangent, rows, solution.reshape(rows.size, m))

    def _refresh(self, tangent: Linearisation, pairs: IntArray) -> None:
        with warnings.catch_warnings():
            # an exactly singular matrix: Newton's method goes on and judges by the residual
            warnings.simplefilter("ignore", scipy.linalg.LinAlgWarning)
            factor, pivots = scipy.linalg.lu_factor(tangent.dense(pairs), overwrite_a=True, check_finite=False)
        swaps = np.count_nonzero(pivots != np.arange(pivots.size))
        self._sign = float(np.prod(np.sign(np.diag(factor)))) * (-1.0) ** swaps
        self._factor, self._pairs = (factor, pivots), pairs

    def _precondition(self, tangent: Linearisation, rows: IntArray, right: FloatArray) -> FloatArray:
        assert self._factor is not None
        kept = np.flatnonzero(np.isin(tangent.joint.slots // 3, self._pairs))
        padded = np.zeros((kept.size, right.shape[1]))
        position = np.searchsorted(kept, rows)
        padded[position] = right
        solved: FloatArray = scipy.linalg.lu_solve(self._factor, padded.ravel(), check_finite=False)
        return solved.reshape(padded.shape)[position]


def ritz_values(product: Callable[[FloatArray], FloatArray], start: FloatArray, most: int) -> ComplexArray:
    """Eigenvalues of a real operator as Arnoldi's method knows them after at most `most` products."""
    size = min(most, start.size)
    basis = np.zeros((size + 1, start.size))
    projected = np.zeros((size + 1, size))
    basis[0] = start / np.linalg.norm(start)
    for k in range(size):
        image = product(basis[k])
        length = float(np.linalg.norm(image))
        for _ in range(2):  # twice, so that the basis stays orthogonal to round-off
            share = basis[: k + 1] @ image
            projected[: k + 1, k] += share
            image = image - share @ basis[: k + 1]
        projected[k + 1, k] = np.linalg.norm(image)
        if not projected[k + 1, k] > 1e-12 * length:
            size = k + 1
            break
        basis[k + 1] = image / projected[k + 1, k]
    if not np.all(np.isfinite(projected)):
        return np.full(size, np.nan, complex)
    return np.linalg.eigvals(projected[:size, :size]).astype(complex)


def _solve_dense(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solution of a small system, the shortest one where the matrix is singular: Newton goes on and judges by the
    residual.
    """
    try:
        solution = cast("FloatArray", np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:
        solution = cast("FloatArray", np.linalg.lstsq(matrix, right)[0])
    return solution

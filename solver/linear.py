"""Newton directions: the exact Jacobian, solved directly where it is small and with a kept factorisation where not."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import cast

import numpy as np
import scipy.linalg
from scipy.sparse.linalg import LinearOperator, gmres

from solver.balance import Linearisation
from solver.model import FloatArray, IntArray

SMALL = 250  # unknowns up to which a fresh factorisation is cheaper than an iteration
KRYLOV = 30  # products after which a kept factorisation has aged too much
FORCING = 1e-3  # relative residual of an iterative solve


@dataclass
class JacobianSolver:
    """Solves with `Linearisation`; keeps one LU between calls as the preconditioner of GMRES on the exact Jacobian."""

    _factor: tuple[FloatArray, IntArray] | None = field(default=None, repr=False)
    _pairs: IntArray = field(default_factory=lambda: np.zeros(0, np.int64), repr=False)

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
        self._factor = scipy.linalg.lu_factor(tangent.dense(pairs), overwrite_a=True, check_finite=False)
        self._pairs = pairs

    def _precondition(self, tangent: Linearisation, rows: IntArray, right: FloatArray) -> FloatArray:
        assert self._factor is not None
        kept = np.flatnonzero(np.isin(tangent.joint.slots // 3, self._pairs))
        padded = np.zeros((kept.size, right.shape[1]))
        position = np.searchsorted(kept, rows)
        padded[position] = right
        solved: FloatArray = scipy.linalg.lu_solve(self._factor, padded.ravel(), check_finite=False)
        return solved.reshape(padded.shape)[position]


def _solve_dense(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solution of a small system, the shortest one where the matrix is singular: Newton goes on and judges by the
    residual.
    """
    try:
        solution = cast("FloatArray", np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:
        solution = cast("FloatArray", np.linalg.lstsq(matrix, right)[0])
    return solution

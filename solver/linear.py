"""Newton directions: the exact Jacobian, solved directly where it is small and with a kept factorisation where not."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import cast

import numpy as np
from scipy.sparse.linalg import LinearOperator, gmres

from solver.balance import Linearisation
from solver.factor import Factor, build_factor
from solver.model import FloatArray, IntArray

SMALL = 250  # unknowns up to which a fresh factorisation is cheaper than an iteration
KRYLOV = 30  # products after which a kept factorisation has aged too much
RESTARTS = 6  # of so many products each, where the factorisation is a new one and yet not the Jacobian itself
FORCING = 1e-3  # relative residual of an iterative solve


@dataclass
class JacobianSolver:
    """Solves with `Linearisation`; keeps one factorisation between calls, with which GMRES on the exact Jacobian is
    preconditioned.
    """

    _factor: Factor | None = field(default=None, repr=False)

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
        if self._factor is not None and np.isin(pairs, self._factor.pairs).all():
            solution, found = self._iterate(self._factor, tangent, rows, right, 1)
            if found:
                return solution
        self._factor = build_factor(tangent, pairs)
        if self._factor.exact:
            return self._factor.solve(right)
        # as far as it gets: Newton judges by the true residual
        return self._iterate(self._factor, tangent, rows, right, RESTARTS)[0]

    def _iterate(
        self, factor: Factor, tangent: Linearisation, rows: IntArray, right: FloatArray, restarts: int
    ) -> tuple[FloatArray, bool]:
        """Solution (n_rows, m) by GMRES, and whether it was found."""
        full = np.zeros((tangent.joint.slots.size, right.shape[1]))
        position = np.searchsorted(factor.rows, rows)
        padded = np.zeros((factor.rows.size, right.shape[1]))

        def precondition(vector: FloatArray) -> FloatArray:
            padded[position] = vector.reshape(right.shape)
            return factor.solve(padded)[position]

        def product(vector: FloatArray) -> FloatArray:
            full[rows] = precondition(vector)
            return tangent.apply(full)[rows].ravel()

        # preconditioned from the right, so that the residual that GMRES watches is the true one
        solution, failed = gmres(
            LinearOperator((right.size, right.size), matvec=product, dtype=float),
            right.ravel(),
            rtol=FORCING,
            restart=KRYLOV,
            maxiter=restarts,
        )
        return precondition(solution), not failed


def _solve_dense(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solution of a small system, the shortest one where the matrix is singular: Newton goes on and judges by the
    residual.
    """
    try:
        solution = cast("FloatArray", np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:
        solution = cast("FloatArray", np.linalg.lstsq(matrix, right)[0])
    return solution

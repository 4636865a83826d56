"""Newton directions: the exact Jacobian, solved directly where it is small and with a kept factorisation where not."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import cast

import numpy as np

from solver.harmonic_balance.dlft import Linearisation
from solver.model import ComplexArray, FloatArray, IntArray
from solver.newton.krylov import ritz_values, solve_gmres
from solver.newton.period_preconditioner import PeriodFactor
from solver.newton.preconditioner import Factor, SignedFactor, build_factor, build_signed_factor
from solver.newton.slip_preconditioner import build_slip_factor, find_slip_space

SMALL = 250  # unknowns up to which a fresh factorisation is cheaper than an iteration
AGED = 12  # products after which a kept factorisation has aged too much: a new one takes as long
KRYLOV = 30  # the same where a new one would not be exact either
WIDE = 80  # the same where the march through the period preconditions: resonances are found one by one
RESTARTS = 6  # of so many products each, where the factorisation is a new one and yet not the Jacobian itself
FORCING = 1e-3  # relative residual of an iterative solve
ARNOLDI = 24  # products from which the sign of a determinant is taken where a kept factorisation serves
WHOLE = 4000  # directions of the slip space up to which all of them are factorised where it does not
CERTAIN = 0.15  # a real part of an eigenvalue, 1 where the factorisation is exact, that is taken as far from zero


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

        Where the slip space is large it is that of the kept factorisation P times (-1)^k, k the number of real negative
        eigenvalues of J P^-1. All but few of its eigenvalues are near 1, and Arnoldi's method finds those that stand
        apart first: where none is near or below zero k = 0, else the whole slip space is factorised. Where it is too
        large for that, k is counted among the eigenvalues found.
        """
        factor = self._factor
        if (
            factor is None
            or isinstance(factor, PeriodFactor)
            or factor.exact
            or not np.isin(tangent.active(), factor.pairs).all()
        ):
            kept, factor = factor, build_signed_factor(tangent, tangent.active())
            # the march knows no sign, but solves better
            self._factor = kept if isinstance(kept, PeriodFactor) else factor
            if factor.exact:
                return factor.sign
        values = self._eigenvalues(factor, tangent, tangent.joint.basis.synthesis.shape[0])
        if np.all(np.isfinite(values)) and values.real.min() > CERTAIN:
            return factor.sign
        whole = find_slip_space(tangent, WHOLE, 0, 0.0)
        if whole is not None:
            return build_slip_factor(tangent, whole).sign
        below = np.count_nonzero((values.real < 0.0) & (np.abs(values.imag) <= 1e-9 * np.abs(values.real)))
        return factor.sign * float((-1) ** below)

    def _eigenvalues(self, factor: SignedFactor, tangent: Linearisation, m: int) -> ComplexArray:
        """Eigenvalues of J P^-1 that stand apart from the others."""
        full = np.zeros((tangent.joint.slots.size, m))

        def product(vector: FloatArray) -> FloatArray:
            full[factor.rows] = factor.solve(vector.reshape(factor.rows.size, m))
            return tangent.apply(full)[factor.rows].ravel()

        # a fixed start: the answer must not depend on what was computed before
        start = np.random.default_rng(0).normal(size=factor.rows.size * m)
        return ritz_values(product, start, ARNOLDI)

    def _solve_kept(self, tangent: Linearisation, pairs: IntArray, rows: IntArray, right: FloatArray) -> FloatArray:
        if self._factor is not None and np.isin(pairs, self._factor.pairs).all():
            products = AGED if self._factor.exact else _most_products(self._factor)
            solution, found = self._iterate(self._factor, tangent, rows, right, products, 1)
            if found:
                return solution
        self._factor = build_factor(tangent, pairs)
        if self._factor.exact:
            return self._solve_exactly(self._factor, tangent, rows, right)
        # as far as it gets: Newton judges by the true residual
        return self._iterate(self._factor, tangent, rows, right, _most_products(self._factor), RESTARTS)[0]

    def _solve_exactly(self, factor: Factor, tangent: Linearisation, rows: IntArray, right: FloatArray) -> FloatArray:
        """Solution by a factorisation of this Jacobian; a second solve takes away what `NEUTRAL` has put in."""
        padded = np.zeros((tangent.joint.slots.size, right.shape[1]))
        padded[rows] = right
        first = factor.solve(padded)
        # the rows of all other pairs follow from these
        first[~np.isin(np.arange(len(first)), rows)] = 0.0
        padded[rows] = right - tangent.apply(first)[rows]
        solution = (first + factor.solve(padded))[rows]
        return solution if np.all(np.isfinite(solution)) else first[rows]

    def _iterate(
        self,
        factor: Factor,
        tangent: Linearisation,
        rows: IntArray,
        right: FloatArray,
        products: int,
        restarts: int,
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
        solution, found = solve_gmres(product, right.ravel(), FORCING, products, restarts)
        return precondition(solution), found


def _most_products(factor: Factor) -> int:
    """Products after which a factorisation that is not exact is given up, or GMRES begins again."""
    return WIDE if isinstance(factor, PeriodFactor) else KRYLOV


def _solve_dense(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solution of a small system, the shortest one where the matrix is singular: Newton goes on and judges by the
    residual.
    """
    try:
        solution = cast("FloatArray", np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:
        solution = cast("FloatArray", np.linalg.lstsq(matrix, right)[0])
    return solution

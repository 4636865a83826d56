"""Newton directions: solves with the exact Jacobian, Eqs. (16) and (17).

A small Jacobian is factorised. A large one is solved by GMRES, with a factorisation kept from solve to solve as the
preconditioner.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import cast

import numpy as np

from solver.harmonic_balance.dlft import Linearisation
from solver.model import ComplexArray, FloatArray, IntArray
from solver.newton.krylov import MOST_PRODUCTS, ritz_values, solve_gmres
from solver.newton.period_preconditioner import PeriodFactor, build_period_factor
from solver.newton.slip_preconditioner import SlipFactor, build_slip_factor, largest_directions

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
"""Unknowns up to which a Jacobian is factorised as it is. With 100 and 400, sweeps and histories of 16 and 48 pairs
take equal times."""

EXPENSIVE_UNKNOWNS = 1000
"""Unknowns of an expensive dense solve: above, no odd harmonics above 79, no homotopy in the harmonics, no 3 N + 2
samples to compare, and no eigenvalues of Hill's matrix (255 unknowns take 0.15 s, 800 take 3 s)."""

SMALL_JOINT = 40
"""Relative displacements up to which a joint is small and its slip space is factorised: impacts couple most harmonics
and directions, and products with any other factorisation are in vain (three pairs with 115 harmonics,
`tests/solver/test_refinement.py`)."""

MOST_DIRECTIONS = 2500
"""Most directions of a factorisation in the slip space, 0.4 s. For the sign of a determinant that is not certain
otherwise, and for sliding masses, to which the march does not apply."""


Factor = SlipFactor | PeriodFactor
"""A factorisation of a Jacobian or of a matrix near the Jacobian; each gives the sign of its determinant."""


def build_factor(tangent: Linearisation) -> Factor:
    """A march through the period, or the slip space for small joints, masses, and where a sample is singular."""
    small = tangent.joint.component_index.size <= SMALL_JOINT
    march = None if small else build_period_factor(tangent)
    return march or build_slip_factor(tangent, largest_directions(tangent, MOST_DIRECTIONS))


@dataclass
class JacobianSolver:
    """Solver of systems with a `Linearisation` that keeps one factorisation between its calls."""

    _factor: Factor | None = field(default=None, repr=False)

    def solve(self, tangent: Linearisation, right: FloatArray, rtol: float = FORCING) -> FloatArray:
        """Step (n_rel, m) with Jacobian times step = right (n_rel, m), N, to the relative residual `rtol`."""
        m = right.shape[1]
        pairs = tangent.active()
        rows = tangent.joint.rows_of(pairs)
        step = np.zeros_like(right)
        if rows.size:
            if rows.size * m <= DENSE_UNKNOWNS:
                step[rows] = _solve_dense(tangent.dense(pairs), right[rows].ravel()).reshape(rows.size, m)
            else:
                step[rows] = self._solve_kept(tangent, right, rtol)[rows]
        # the columns of all other unknowns are those of the identity
        rest = np.ones(right.shape[0], bool)
        rest[rows] = False
        step[rest] = (right - tangent.apply_roughly(step))[rest]
        return step

    def solve_all(
        self, tangent: Linearisation, rights: Sequence[FloatArray] | FloatArray, rtol: float = FORCING
    ) -> list[FloatArray]:
        """Steps (n_rel, m) for several right-hand sides; a small system is factorised once."""
        if not _is_dense(tangent, rights[0].shape[1]):
            return [self.solve(tangent, right, rtol) for right in rights]
        pairs = tangent.active()
        rows = tangent.joint.rows_of(pairs)
        solved = _solve_dense(tangent.dense(pairs), np.stack([right[rows].ravel() for right in rights], axis=1))
        steps = []
        for right, column in zip(rights, solved.T, strict=True):
            step = np.zeros_like(right)
            step[rows] = column.reshape(rows.size, -1)
            rest = np.ones(right.shape[0], bool)
            rest[rows] = False
            step[rest] = (right - tangent.apply_roughly(step))[rest]
            steps.append(step)
        return steps

    def determinant_sign(self, tangent: Linearisation) -> float:
        """Sign of the determinant of the Jacobian: 1, -1, or 0 where it is singular.

        For a large slip space, the sign is that of the kept factorisation P times (-1)^k, with k the number of real
        negative eigenvalues of J P^-1. Most eigenvalues are near 1, and Arnoldi's method finds the outliers first.
        Where the outliers do not converge, this Jacobian is factorised instead of the kept one. Where they still do
        not, the whole slip space is factorised, unless it is too large.
        """
        kept = self._factor
        if kept is not None and not kept.exact:
            sign, settled = self._judge(kept, tangent)
            if settled:
                return sign
        self._factor = factor = build_factor(tangent)
        if factor.exact:
            return factor.sign
        sign, settled = self._judge(factor, tangent)
        if not settled:
            whole = largest_directions(tangent, MOST_DIRECTIONS)
            sign = build_slip_factor(tangent, whole).sign if whole.exact else sign
        return sign

    def _judge(self, factor: Factor, tangent: Linearisation) -> tuple[float, bool]:
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

    def _solve_kept(self, tangent: Linearisation, right: FloatArray, rtol: float) -> FloatArray:
        """Solution (n_rel, m) in the rows of the active pairs, with the kept factorisation while products are few."""
        if self._factor is not None:
            solution, found = self._iterate(self._factor, tangent, right, rtol, KEPT_PRODUCTS, 1)
            if found:
                return solution
        self._factor = factor = build_factor(tangent)
        if factor.exact:
            return self._solve_exactly(factor, tangent, right)
        # convergence is not required: Newton's method judges by the true residual
        return self._iterate(factor, tangent, right, rtol, MOST_PRODUCTS, np.inf)[0]

    def _solve_exactly(self, factor: Factor, tangent: Linearisation, right: FloatArray) -> FloatArray:
        """Solution by a factorisation of this Jacobian; a second solve corrects for the shift of neutral directions."""
        rest = _passive_rows(tangent)
        right = right.copy()
        right[rest] = 0.0
        first = factor.solve(right)
        # the rows of all other pairs follow from the rows of the active ones
        first[rest] = 0.0
        left = right - tangent.apply(first)
        left[rest] = 0.0
        solution = first + factor.solve(left)
        return solution if np.all(np.isfinite(solution)) else first

    def _iterate(
        self, factor: Factor, tangent: Linearisation, right: FloatArray, rtol: float, products: int, cycles: float
    ) -> tuple[FloatArray, bool]:
        """Solution (n_rel, m) by GMRES in the rows of the active pairs, and whether it was found."""
        rest = _passive_rows(tangent)

        def precondition(vector: FloatArray) -> FloatArray:
            solved = factor.solve(vector.reshape(right.shape))
            solved[rest] = 0.0
            return solved

        def product(vector: FloatArray) -> FloatArray:
            image = tangent.apply_roughly(precondition(vector))
            image[rest] = 0.0
            return image.ravel()

        def exact(vector: FloatArray) -> FloatArray:
            image = tangent.apply(precondition(vector))
            image[rest] = 0.0
            return image.ravel()

        wanted = right.copy()
        wanted[rest] = 0.0
        # preconditioned from the right: the residual of GMRES is the true one
        solution, found = solve_gmres(product, wanted.ravel(), rtol, products, cycles, exact)
        return precondition(solution), found


def _passive_rows(tangent: Linearisation) -> IntArray:
    """Rows of the pairs that are not active: the columns of their unknowns are those of the identity."""
    active = np.zeros(tangent.joint.contact.n_contact, bool)
    active[tangent.active()] = True
    return np.flatnonzero(~active[tangent.joint.component_index // 3])


def _settled(values: ComplexArray, residuals: FloatArray) -> bool:
    """Whether it is certain which eigenvalues are negative, from Ritz values and their residuals."""
    doubtful = ~(values.real >= SETTLED)
    return bool(np.all((residuals < SETTLED * np.abs(values))[doubtful]))


def _is_dense(tangent: Linearisation, m: int) -> bool:
    """Whether the rows of the active pairs, times m unknowns, are few enough for a dense factorisation."""
    rows = tangent.joint.rows_of(tangent.active()).size
    return 0 < rows * m <= DENSE_UNKNOWNS


def _solve_dense(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solution of a small system; for a singular matrix the shortest least-squares solution.

    Newton's method goes on and judges by the residual.
    """
    try:
        solution = cast("FloatArray", np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:
        solution = cast("FloatArray", np.linalg.lstsq(matrix, right)[0])
    return solution

"""The factorisation of the balance's Jacobian that preconditions GMRES, chosen by the state.

In the space in which the pairs slip or open where that is small (`slip_preconditioner`), else by a march through the
period (`period_preconditioner`). The march has no determinant and does not apply to masses on sliders; there the
factorisation is by groups of harmonics (`HarmonicFactor`). Pairs that slip or open couple the harmonics of a balance,
strongly the lowest ones: these are factorised together, up to `NEWTON.low_unknowns`. Each higher harmonic is factorised
alone, with the part of the pairs' tangents that does not leave the harmonic: a complex matrix (n_rel, n_rel).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import cast

import numpy as np
import scipy.linalg

from solver.harmonic_balance.dlft import Linearisation
from solver.model import ComplexArray, FloatArray, IntArray
from solver.newton.options import NEWTON
from solver.newton.period_preconditioner import PeriodFactor, build_period_factor
from solver.newton.slip_preconditioner import (
    SlipFactor,
    build_slip_factor,
    find_slip_space,
    sign_of,
)

RealFactor = tuple[FloatArray, IntArray]


@dataclass(frozen=True)
class HarmonicFactor:
    """Block factorisation by groups of harmonics.

    pairs: those whose rows (n_rows,) it holds, with all their harmonics, 2H+1.
    low: factorisation of the lowest harmonics up to `n_low`. high (H - n_low, n_rows, n_rows): inverses of the others.
    """

    pairs: IntArray
    rows: IntArray
    n_low: int
    low: RealFactor
    high: ComplexArray
    exact: bool = False

    @property
    def sign(self) -> float:
        """Sign of the determinant, 0 where it is singular; a complex factor has the square of a modulus."""
        return sign_of(self.low)

    def solve(self, right: FloatArray) -> FloatArray:
        """Approximate solution (n_rows, 2H+1) for a right-hand side (n_rows, 2H+1)."""
        m_low = 2 * self.n_low + 1
        solved = np.empty_like(right)
        low = scipy.linalg.lu_solve(self.low, np.ascontiguousarray(right[:, :m_low]).ravel(), check_finite=False)
        solved[:, :m_low] = low.reshape(-1, m_low)
        # inverses, because one product of all harmonics takes less time than solves one by one
        moving = (right[:, m_low::2] - 1j * right[:, m_low + 1 :: 2]).T[:, :, None]
        amplitude = np.matmul(self.high, np.ascontiguousarray(moving))[:, :, 0].T
        solved[:, m_low::2], solved[:, m_low + 1 :: 2] = amplitude.real, -amplitude.imag
        return solved


Factor = SlipFactor | PeriodFactor | HarmonicFactor


def build_factor(tangent: Linearisation, pairs: IntArray) -> Factor:
    """Factorisation of a Jacobian whose pairs other than `pairs` do not depend on their predicted force."""
    few = tangent.joint.component_index.size <= NEWTON.small_joint_displacements
    exact = NEWTON.exact_directions_of_few if few else NEWTON.exact_directions
    space = find_slip_space(tangent, exact, 0, 0.0)
    found = None if space is not None else build_period_factor(tangent)
    if found is not None:
        return found
    # masses on sliders: the march does not apply
    space = space or find_slip_space(tangent, exact, NEWTON.partial_directions, NEWTON.partial_cutoff)
    return build_harmonic_factor(tangent, pairs) if space is None else build_slip_factor(tangent, space)


def build_harmonic_factor(tangent: Linearisation, pairs: IntArray) -> HarmonicFactor:
    """Factorisation of the rows and columns of `pairs`; singular matrices give infinities, not errors."""
    rows = tangent.joint.rows_of(pairs)
    n_harmonics = tangent.joint.basis.n_harmonics
    n_low = n_harmonics
    while n_low > 0 and rows.size * (2 * n_low + 1) > NEWTON.low_unknowns:
        n_low -= 1
    matrix = tangent.dense(pairs, n_low)
    matrix[np.diag_indices_from(matrix)] += NEWTON.neutral_shift
    with warnings.catch_warnings():
        # an exactly singular matrix: Newton's method goes on and judges by the residual
        warnings.simplefilter("ignore", scipy.linalg.LinAlgWarning)
        low = scipy.linalg.lu_factor(matrix, overwrite_a=True, check_finite=False)
    high = np.empty((n_harmonics - n_low, rows.size, rows.size), complex)
    for place in range(n_low, n_harmonics):
        high[place - n_low] = _inverse(tangent.dense_harmonic(pairs, place))
    return HarmonicFactor(pairs, rows, n_low, low, high)


def _inverse(matrix: ComplexArray) -> ComplexArray:
    """Inverse of a matrix, the identity where it is singular: it is only a preconditioner."""
    try:
        return cast("ComplexArray", np.linalg.inv(matrix))
    except np.linalg.LinAlgError:
        return np.eye(matrix.shape[0], dtype=complex)

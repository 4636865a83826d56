"""A factorisation of the balance's Jacobian, exact where it is small, else by groups of harmonics: a preconditioner.

The harmonics of a balance are coupled by the pairs that slip or open. That coupling is strong among the lowest ones,
which are factorised together as far as `DENSE` unknowns go; above, each harmonic is factorised on its own with the part
of the pairs' tangents that keeps it to itself, a complex matrix of as many rows as there are relative displacements.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import cast

import numpy as np
import scipy.linalg

from solver.balance import Linearisation
from solver.model import ComplexArray, FloatArray, IntArray

DENSE = 800  # unknowns that are factorised together: 48 pairs with two harmonics
FEW_ROWS = 40  # relative displacements up to which each of them couples most harmonics: impacts
DENSE_FEW = 2500  # unknowns that are factorised together then

NEUTRAL = 1e-8  # of an eigenvalue of the Jacobian, which is dimensionless and 1 for a pair that sticks

RealFactor = tuple[FloatArray, IntArray]


@dataclass(frozen=True)
class Factor:
    """pairs: those whose rows (n_rows,) it holds, all harmonics of them, 2H+1.

    low: factorisation of the lowest harmonics up to `n_low`. high (H - n_low, n_rows, n_rows): inverses of the others.
    """

    pairs: IntArray
    rows: IntArray
    n_low: int
    low: RealFactor
    high: ComplexArray

    @property
    def sign(self) -> float:
        """Sign of the determinant, 0 where it is singular; a complex factor has the square of a modulus."""
        factor, pivots = self.low
        swaps = np.count_nonzero(pivots != np.arange(pivots.size))
        return float(np.prod(np.sign(np.diag(factor)))) * (-1.0) ** swaps

    @property
    def exact(self) -> bool:
        """Whether this is the Jacobian itself."""
        return len(self.high) == 0

    def solve(self, right: FloatArray) -> FloatArray:
        """Approximate (where `exact`: the) solution (n_rows, 2H+1) for a right-hand side (n_rows, 2H+1)."""
        m_low = 2 * self.n_low + 1
        solved = np.empty_like(right)
        low = scipy.linalg.lu_solve(self.low, np.ascontiguousarray(right[:, :m_low]).ravel(), check_finite=False)
        solved[:, :m_low] = low.reshape(-1, m_low)
        if not self.exact:
            # inverses, because one product of all harmonics takes less time than solves one by one
            moving = (right[:, m_low::2] - 1j * right[:, m_low + 1 :: 2]).T[:, :, None]
            amplitude = np.matmul(self.high, np.ascontiguousarray(moving))[:, :, 0].T
            solved[:, m_low::2], solved[:, m_low + 1 :: 2] = amplitude.real, -amplitude.imag
        return solved


def build_factor(tangent: Linearisation, pairs: IntArray) -> Factor:
    """Factorisation of the rows and columns of `pairs`; singular matrices give infinities, not errors."""
    rows = np.flatnonzero(np.isin(tangent.joint.slots // 3, pairs))
    n_harmonics = tangent.joint.basis.n_harmonics
    n_low = n_harmonics
    most = DENSE_FEW if rows.size <= FEW_ROWS else DENSE
    while n_low > 0 and rows.size * (2 * n_low + 1) > most:
        n_low -= 1
    with warnings.catch_warnings():
        # an exactly singular matrix: Newton's method goes on and judges by the residual
        warnings.simplefilter("ignore", scipy.linalg.LinAlgWarning)
        low = scipy.linalg.lu_factor(without_neutral(tangent.dense(pairs, n_low)), overwrite_a=True, check_finite=False)
    high = np.empty((n_harmonics - n_low, rows.size, rows.size), complex)
    for place in range(n_low, n_harmonics):
        high[place - n_low] = _inverse(tangent.dense_harmonic(pairs, place))
    return Factor(pairs, rows, n_low, low, high)


def without_neutral(matrix: FloatArray) -> FloatArray:
    """The matrix with its eigenvalues shifted by `NEUTRAL`, in place.

    A joint that slips as a whole may lie anywhere along its slip: an eigenvalue that is zero but for round-off would
    give the determinant any sign.
    """
    matrix[np.diag_indices_from(matrix)] += NEUTRAL
    return matrix


def _inverse(matrix: ComplexArray) -> ComplexArray:
    """Inverse of a matrix, the identity where it has none: it only steers an iteration."""
    try:
        return cast("ComplexArray", np.linalg.inv(matrix))
    except np.linalg.LinAlgError:
        return np.eye(matrix.shape[0], dtype=complex)

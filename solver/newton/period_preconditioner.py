"""An approximate inverse of the balance's Jacobian by a march through the period, for joints that slip and open.

The state x of a pair (normal: predicted less contact force; tangential: that of Eqs. (11)-(15)) moves the pair by
`x / eps`, and the Jacobian maps a step `dp` to `dp + (Z_r / eps - 1) dx`. With one real stiffness Z in all harmonics
this holds sample by sample,

    dp(t) + (Z / eps - 1) dx(t) = r(t),      dx(t) = A(t) dp(t) + B(t) dx(t - 1),

with the derivatives A and B of the contact law at a sample (`sampled_law`), in blocks of the pairs. So

    dx(t) = B(t) dx(t - 1) + [1 + A(t) (Z / eps - 1)]^-1 A(t) [r(t) - (Z / eps - 1) B(t) dx(t - 1)]

is a march with one small system at each sample, in the rows of pairs that slip or are open (A is zero where a pair
sticks), and `dp = r - (Z / eps - 1) dx` follows. Resonances of the structure and the truncation of the series are left
to GMRES. CPU s of a history of the dovetail, and with a factorisation of the most important directions instead: 48
pairs 4.8 and 10.5, 336 pairs 35 and 59.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from solver.contact.sampled_law import sample_tangents
from solver.harmonic_balance.dlft import Linearisation
from solver.model import FloatArray, IntArray
from solver.structure.condensation import KEPT_STRUCTURES, CondensedStructure
from solver.structure.fourier import FourierBasis, build_basis
from solver.structure.joint import Joint

MARCH_PERIODS = 2  # slip removes the influence of the start

SingleArray = NDArray[np.float32]


class PeriodMatrices(NamedTuple):
    """Matrices of the march through N samples, for the n pairs that slip or are open at one of them.

    - own (N, n, 3, 3), carried (N, n, 2, 2): A and B.
    - row (k,): nonzero rows of A, sample by sample, as `3 place + component` with the place among the n pairs.
    - first (N + 1,): index in `row` of the first row of each sample.
    - swept (2 n k,): `A (Z / eps - 1)` in these rows and the tangential columns.
    - inverse: inverses of `1 + A (Z / eps - 1)` in these rows and columns, sample by sample.
    """

    own: FloatArray
    carried: FloatArray
    row: IntArray
    first: IntArray
    swept: SingleArray
    inverse: SingleArray


@dataclass(frozen=True)
class PeriodFactor:
    """March of some pairs (n,) of a joint through the samples of a Fourier basis; coupling (n_rel, 3n): Z / eps - 1."""

    joint: Joint
    basis: FourierBasis
    pairs: IntArray
    coupling: FloatArray
    matrices: PeriodMatrices

    exact = False

    @property
    def sign(self) -> float:
        """Sign of the determinant of the march; the truncation of the harmonics may change that of the Jacobian."""
        n_rows = np.diff(self.matrices.first)
        inverses = np.split(self.matrices.inverse, np.cumsum(n_rows**2)[:-1])
        systems = (part.reshape(n, n) for part, n in zip(inverses, n_rows, strict=True) if n)
        return float(np.prod([np.linalg.slogdet(system)[0] for system in systems]))

    def solve(self, right: FloatArray) -> FloatArray:
        """Approximate solution (n_rel, 2H+1) for a right-hand side (n_rel, 2H+1)."""
        if not self.pairs.size:
            return right.copy()
        spread = self.joint.to_pairs(right)
        right_t = (spread[self.pairs].reshape(-1, right.shape[1]) @ self.basis.synthesis).T
        state_t = march_samples(np.ascontiguousarray(right_t), self.matrices, MARCH_PERIODS)
        return right - self.coupling @ (state_t.T @ self.basis.analysis)


def build_period_factor(tangent: Linearisation) -> PeriodFactor | None:
    """March of a Jacobian; None for pairs with sliding masses, or where the system of a sample is singular."""
    joint, at = tangent.joint, tangent.at
    if joint.law.rate_dependent:
        return None
    # the fewest samples that resolve the harmonics, for every sample costs a system
    n_samples, highest = joint.basis.n_samples, max(joint.basis.orders, default=0)
    while n_samples % 2 == 0 and n_samples // 2 > 2 * highest:
        n_samples //= 2
    stride = joint.basis.n_samples // n_samples
    own, carried = sample_tangents(joint.law, at, stride)
    pairs = np.flatnonzero(own.any(axis=(0, 2, 3)))
    own, carried = np.ascontiguousarray(own[:, pairs]), np.ascontiguousarray(carried[:, pairs])
    components = (3 * pairs[:, None] + np.arange(3)).ravel()
    # rows and columns of displacements that a pair does not have are zero
    square = np.zeros((3 * joint.contact.n_contact, 3 * joint.contact.n_contact))
    square[np.ix_(joint.component_index, joint.component_index)] = stiffness_of_most(
        joint.structure
    ) / joint.relative_penalty - np.eye(joint.component_index.size)
    blocks = square[np.ix_(components, components)].reshape(pairs.size, 3, components.size)
    tangential = np.flatnonzero(np.arange(components.size) % 3)
    rows, swept, inverse = [], [], []
    for sample in own:
        row = np.flatnonzero(sample.any(axis=2))
        product = np.matmul(sample.reshape(-1, 1, 3)[row], blocks[row // 3])[:, 0]
        matrix = product[:, row]
        matrix[np.diag_indices(row.size)] += 1.0
        # single precision suffices for a preconditioner and halves the memory read in a solve
        try:
            inverse.append(np.linalg.inv(matrix.astype(np.float32)).ravel())
        except np.linalg.LinAlgError:
            return None
        swept.append(product[:, tangential].astype(np.float32).ravel())
        rows.append(row)
    first = np.cumsum([0, *(row.size for row in rows)])
    coupling = np.ascontiguousarray(square[np.ix_(joint.component_index, components)])
    all_rows, all_swept, all_inverse = np.concatenate(rows), np.concatenate(swept), np.concatenate(inverse)
    matrices = PeriodMatrices(own, carried, all_rows, first, all_swept, all_inverse)
    return PeriodFactor(joint, build_basis(joint.basis.orders, n_samples), pairs, coupling, matrices)


@lru_cache(maxsize=KEPT_STRUCTURES)
def stiffness_of_most(structure: CondensedStructure) -> FloatArray:
    """Real stiffness (n_rel, n_rel), N/m: median of all harmonics, which ignores those near a resonance."""
    every = np.concatenate([structure.static_stiffness[None], structure.dynamic_stiffness.real])
    return np.asarray(np.median(every, axis=0, overwrite_input=True))


@njit(cache=True)
def march_samples(right_t: FloatArray, of: PeriodMatrices, periods: int) -> FloatArray:
    """Changes of the state (N, 3n) in the last of some periods, for right-hand sides (N, 3n) at the pairs."""
    own, carried, row, first, swept, inverse = of
    n_samples, size = right_t.shape
    n_pairs = size // 3
    state_t = np.zeros((n_samples, size))
    before = np.zeros(2 * n_pairs, inverse.dtype)
    after = np.zeros((n_pairs, 2))
    pushed = np.zeros(size, inverse.dtype)
    for _ in range(periods):
        system = 0
        for n in range(n_samples):
            begin, end = first[n], first[n + 1]
            n_rows = end - begin
            for pair in range(n_pairs):
                for i in range(2):
                    left = carried[n, pair, i, 0] * after[pair, 0] + carried[n, pair, i, 1] * after[pair, 1]
                    before[2 * pair + i] = left
                    state_t[n, 3 * pair + 1 + i] = left
            if n_rows > 0:
                matrix = swept[2 * n_pairs * begin : 2 * n_pairs * end].reshape(n_rows, 2 * n_pairs)
                by_history = np.dot(matrix, before)
                for place in range(n_rows):
                    pair, i = row[begin + place] // 3, row[begin + place] % 3
                    total = 0.0
                    for k in range(3):
                        total += own[n, pair, i, k] * right_t[n, 3 * pair + k]
                    pushed[place] = total - by_history[place]
                small = inverse[system : system + n_rows**2].reshape(n_rows, n_rows)
                system += n_rows**2
                change = np.dot(small, pushed[:n_rows])
                for place in range(n_rows):
                    where = row[begin + place]
                    if where % 3 == 0:
                        state_t[n, where] = change[place]
                    else:
                        state_t[n, where] += change[place]
            for pair in range(n_pairs):
                for i in range(2):
                    after[pair, i] = state_t[n, 3 * pair + 1 + i]
    return state_t

"""An approximate inverse of the balance's Jacobian by a march through the period, for joints that slip and open.

The state x of a pair (normal: predicted less contact force; tangential: that of Eqs. (11)-(15)) moves the pair by
`x / eps`, and the Jacobian maps a step `dp` to `dp + (Z_r / eps - 1) dx`. With one real stiffness Z in all harmonics
this holds sample by sample,

    dp(t) + (Z / eps - 1) dx(t) = r(t),      dx(t) = A(t) dp(t) + B(t) dx(t - 1),

with the derivatives A and B of the contact law at a sample (`law`), in blocks of the pairs. So

    dx(t) = B(t) dx(t - 1) + [1 + A(t) (Z / eps - 1)]^-1 A(t) [r(t) - (Z / eps - 1) B(t) dx(t - 1)]

is a march with one small system at each sample, in the rows of pairs that slip or are open (A is zero where a pair
sticks), and `dp = r - (Z / eps - 1) dx` follows. Resonances of the structure and the truncation of the series are left
to GMRES. CPU s of a history of the dovetail, and with a factorisation of the most important directions instead: 48
pairs 4.8 and 10.5, 336 pairs 35 and 59.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from solver.harmonic_balance.dlft import Linearisation
from solver.model import FloatArray, IntArray
from solver.structure.condensation import CACHED_STRUCTURES, CondensedStructure
from solver.structure.fourier import FourierBasis, build_basis
from solver.structure.joint import Joint
from solver.structure.ring_stiffness import RingStiffness

MARCH_PERIODS = 2
"""Periods of a march: slip removes the influence of the start. With one and three ring and damper are equal to 2e-6."""

SingleArray = NDArray[np.float32]


class PeriodMatrices(NamedTuple):
    """Matrices of the march through N samples, for the n pairs that slip or are open at one of them.

    - own (N, n, 3, 3), carried (N, n, 2, 2): A and B.
    - row (N, k): rows of each sample with all nonzero ones of A, as `3 place + component` of the n pairs.
    - swept (N, k, 2n): `A (Z / eps - 1)` in these rows and the tangential columns.
    - inverse (N, k, k): of `1 + A (Z / eps - 1)` in these rows and columns.
    """

    own: FloatArray
    carried: FloatArray
    row: IntArray
    swept: SingleArray
    inverse: SingleArray


@dataclass(frozen=True)
class PeriodFactor:
    """Marches of pairs that slip or open through the samples of a Fourier basis: one march of all of them, or, as in
    a ring, one of each group, whose coupling with the others is left to GMRES.

    parts: pairs, rows (r,) of the group in the joint, coupling (r, 3n): Z / eps - 1, and matrices of each march.
    """

    joint: Joint
    basis: FourierBasis
    parts: tuple[tuple[IntArray, IntArray, FloatArray, PeriodMatrices], ...]

    exact = False

    @property
    def sign(self) -> float:
        """Sign of the determinant of the march; the truncation of the harmonics may change that of the Jacobian."""
        return float(np.prod([np.prod(np.linalg.slogdet(matrices.inverse)[0]) for *_, matrices in self.parts]))

    def solve(self, right: FloatArray) -> FloatArray:
        """Approximate solution (n_rel, 2H+1) for a right-hand side (n_rel, 2H+1)."""
        found, spread = right.copy(), self.joint.to_pairs(right)
        for pairs, rows, coupling, matrices in self.parts:
            right_t = (spread[pairs].reshape(-1, right.shape[1]) @ self.basis.synthesis).T
            state_t = march_samples(np.ascontiguousarray(right_t), matrices)
            found[rows] -= coupling @ (state_t.T @ self.basis.analysis)
        return found


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
    own, carried = joint.law.sample_tangents(at, stride)
    switch, parts = np.asarray(own.any(axis=(0, 2, 3))), []
    blocks = stiffness_of_most(joint.structure)
    n_pairs, n_rows = joint.contact.n_contact // len(blocks), joint.component_index.size // len(blocks)
    for group, stiffness in enumerate(blocks):
        pairs = n_pairs * group + np.flatnonzero(switch[n_pairs * group : n_pairs * (group + 1)])
        if not pairs.size:
            continue
        rows = np.arange(n_rows * group, n_rows * (group + 1))
        coupling = np.zeros((n_rows, 3 * n_pairs))
        components = joint.component_index[rows] - 3 * n_pairs * group
        # rows and columns of displacements that a pair does not have are zero
        coupling[:, components] = stiffness / joint.relative_penalty[rows] - np.eye(n_rows)
        chosen = (3 * (pairs - n_pairs * group)[:, None] + np.arange(3)).ravel()
        square = np.zeros((3 * n_pairs, chosen.size))
        square[components] = coupling[:, chosen]
        matrices = _matrices_of(own[:, pairs], carried[:, pairs], square[chosen].reshape(pairs.size, 3, chosen.size))
        if matrices is None:
            return None
        parts.append((pairs, rows, np.ascontiguousarray(coupling[:, chosen]), matrices))
    return PeriodFactor(joint, build_basis(joint.basis.orders, n_samples), tuple(parts))


def _matrices_of(own: FloatArray, carried: FloatArray, blocks: FloatArray) -> PeriodMatrices | None:
    """Matrices of the march of n pairs with A and B, and the blocks (n, 3, 3n) of Z / eps - 1; None if singular."""
    n_samples, n_pairs = own.shape[:2]
    tangential = np.flatnonzero(np.arange(3 * n_pairs) % 3)
    nonzero = own.any(axis=3).reshape(n_samples, -1)
    row = np.argsort(~nonzero, axis=1, kind="stable")[:, : nonzero.sum(axis=1).max()].copy()
    # single precision suffices for a preconditioner and halves the memory read in a solve
    swept = np.empty((*row.shape, tangential.size), np.float32)
    systems = np.empty((*row.shape, row.shape[1]), np.float32)
    for place, (sample, rows) in enumerate(zip(own, row, strict=True)):
        product = np.matmul(sample.reshape(-1, 1, 3)[rows], blocks[rows // 3])[:, 0]
        swept[place], systems[place] = product[:, tangential], product[:, rows] + np.eye(rows.size)
    try:
        inverse = np.asarray(np.linalg.inv(systems), np.float32)
    except np.linalg.LinAlgError:
        return None
    return PeriodMatrices(np.ascontiguousarray(own), np.ascontiguousarray(carried), row, swept, inverse)


@lru_cache(maxsize=CACHED_STRUCTURES)
def stiffness_of_most(structure: CondensedStructure) -> FloatArray:
    """Real stiffness, N/m: median of all harmonics, which ignores those near a resonance; (G, n, n) of each of G groups
    of rows that are one after the other: one, or the sectors of a ring.
    """
    moving = structure.moving
    if isinstance(moving, RingStiffness):
        n = moving.waves.shape[-1]
        # all sectors have the same block on the diagonal, but for deviations of their blades
        every = np.concatenate([structure.static_stiffness[None, :n, :n], moving.waves.mean(axis=1).real])
        return np.broadcast_to(np.median(every, axis=0), (moving.n_sectors, n, n))
    every = np.concatenate([structure.static_stiffness[None], structure.dynamic_stiffness.real])
    return np.asarray(np.median(every, axis=0, overwrite_input=True))[None]


@njit(cache=True)
def march_samples(right_t: FloatArray, of: PeriodMatrices) -> FloatArray:
    """Changes of the state (N, 3n) in the last period, for right-hand sides (N, 3n) at the pairs."""
    own, carried, row, swept, inverse = of
    (n_samples, n_rows), n_pairs = row.shape, own.shape[1]
    state_t, after = np.zeros(right_t.shape), np.zeros((n_pairs, 2))
    before, pushed = np.zeros(2 * n_pairs, inverse.dtype), np.zeros(n_rows, inverse.dtype)
    by_history, change = np.empty(n_rows, inverse.dtype), np.empty(n_rows, inverse.dtype)
    for _ in range(MARCH_PERIODS):
        for n in range(n_samples):
            for pair in range(n_pairs):
                state_t[n, 3 * pair] = 0.0
                for i in range(2):
                    left = carried[n, pair, i, 0] * after[pair, 0] + carried[n, pair, i, 1] * after[pair, 1]
                    before[2 * pair + i] = left
                    state_t[n, 3 * pair + 1 + i] = left
            np.dot(swept[n], before, by_history)
            for place in range(n_rows):
                pair, i = row[n, place] // 3, row[n, place] % 3
                total = 0.0
                for k in range(3):
                    total += own[n, pair, i, k] * right_t[n, 3 * pair + k]
                pushed[place] = total - by_history[place]
            np.dot(inverse[n], pushed, change)
            for place in range(n_rows):
                state_t[n, row[n, place]] += change[place]
            for pair in range(n_pairs):
                for i in range(2):
                    after[pair, i] = state_t[n, 3 * pair + 1 + i]
    return state_t

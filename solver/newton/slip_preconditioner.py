"""A factorisation of the balance's Jacobian in the space in which its pairs slip or open.

The Jacobian is the identity but for what the pairs do not pass on, `S = I - d lambda/dp` (`Linearisation`):

    J = I - S + Z_r D,      D = d u/dp

S and D are zero where a pair sticks all period long, and where it slips or opens for a part of the period they have
a low rank: its slip is the same throughout a phase of sticking. With an orthonormal basis V of the rows of S and D of
each pair, `S = S V V^T` and `D = D V V^T`, so that with y = V^T x

    (I + V^T (Z_r D V - S V)) y = V^T b,      x = b - (Z_r D V - S V) y

solves `J x = b` by a matrix whose size is the sum of the ranks, and has the determinant of J. Directions that matter
little may be left out where the factorisation only steers an iteration.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import cast

import numpy as np
import scipy.linalg

from solver.harmonic_balance.dlft import Linearisation
from solver.model import BoolArray, FloatArray, IntArray
from solver.structure.joint import Joint

EXACT = 1e-11  # of what a pair does not pass on: directions below it are round-off
# A joint that slips as a whole may lie anywhere along its slip: an eigenvalue that is zero but for round-off would give
# the determinant any sign. All are shifted by so much; the Jacobian is dimensionless, 1 for a pair that sticks.
NEUTRAL = 1e-8


@dataclass(frozen=True)
class SlipSpace:
    """Orthonormal bases of what the pairs do not pass on.

    pairs (n,): those with any. bases: for each the basis (3m, r), with zeros where a pair has no such displacement.
    exact: whether nothing is left out.
    """

    pairs: IntArray
    bases: tuple[FloatArray, ...]
    exact: bool

    @property
    def size(self) -> int:
        """Sum of the ranks."""
        return sum(basis.shape[1] for basis in self.bases)


def find_slip_space(tangent: Linearisation, most_exact: int, most: int, cutoff: float) -> SlipSpace | None:
    """Slip space of up to `most_exact` directions with nothing left out; where there are more, of up to `most` with
    those below `cutoff` (relative to a pair that slips) left out; None where there are too many.
    """
    joint = tangent.joint
    m = joint.basis.synthesis.shape[0]
    present = np.zeros(3 * joint.contact.n_contact, bool)
    present[joint.slots] = True
    columns = np.repeat(present.reshape(-1, 3), m, axis=1)
    surplus = np.eye(3 * m) - tangent.force_tangent
    # the static normal motion carries the wear, which is one more row
    worn = joint.penalty.normal[:, None, None] * tangent.motion_tangent[:, :1]
    rows = np.concatenate([surplus, worn], axis=1) * columns[:, None, :]
    pairs = np.flatnonzero(np.abs(rows).max(axis=(1, 2)) > 1e-14)
    found = [
        scipy.linalg.qr(rows[pair].T, mode="economic", pivoting=True, check_finite=False)[:2]
        if np.all(np.isfinite(rows[pair]))
        else (np.empty((3 * m, 0)), np.empty((0, 3 * m)))
        for pair in pairs
    ]
    for least, limit in ((EXACT, most_exact), (cutoff, most)):
        ranks = [int(np.count_nonzero(np.abs(np.diag(right)) > least)) for _, right in found]
        if sum(ranks) <= limit:
            bases = tuple(np.ascontiguousarray(q[:, :rank]) for (q, _), rank in zip(found, ranks, strict=True))
            return SlipSpace(pairs, bases, least == EXACT)
    return None


@dataclass(frozen=True)
class SlipFactor:
    """Factorisation of `I + V^T (Z_r D V - S V)`, and what leads there and back.

    there (n, r_most, 3m): `V^T` of each pair of the space, filled up with zeros to the largest rank. kept
    (n, r_most): which of these rows there are. back (n, 6m, r_most): `D V` and `S V`. pairs, rows: all of the joint.
    """

    joint: Joint
    space: SlipSpace
    there: FloatArray
    kept: BoolArray
    back: FloatArray
    factor: tuple[FloatArray, IntArray]
    pairs: IntArray
    rows: IntArray

    @property
    def exact(self) -> bool:
        """Whether this is the Jacobian itself."""
        return self.space.exact

    @property
    def sign(self) -> float:
        """Sign of the determinant, 0 where it is singular."""
        return sign_of(self.factor)

    def solve(self, right: FloatArray) -> FloatArray:
        """Approximate (where `exact`: the) solution (n_rel, 2H+1) for a right-hand side (n_rel, 2H+1)."""
        joint, pairs, m = self.joint, self.space.pairs, right.shape[1]
        if not pairs.size:
            return right
        spread = joint.to_pairs(right).reshape(-1, 3 * m)
        slips = np.zeros(self.kept.shape)
        slips[self.kept] = scipy.linalg.lu_solve(
            self.factor, np.matmul(self.there, spread[pairs][:, :, None])[self.kept, 0], check_finite=False
        )
        both = np.matmul(self.back, slips[:, :, None]).reshape(-1, 2, 3, m)
        motion, force = np.zeros((2, joint.contact.n_contact, 3, m))
        motion[pairs], force[pairs] = both[:, 0], both[:, 1]
        return right - joint.structure.apply(joint.to_relative(motion)) + joint.to_relative(force)


def build_slip_factor(tangent: Linearisation, space: SlipSpace) -> SlipFactor:
    """Factorisation of a Jacobian in its slip space; singular matrices give infinities, not errors."""
    joint = tangent.joint
    m = joint.basis.synthesis.shape[0]
    moved = tuple(tangent.motion_tangent[pair] @ basis for pair, basis in zip(space.pairs, space.bases, strict=True))
    held = tuple(
        basis - tangent.force_tangent[pair] @ basis for pair, basis in zip(space.pairs, space.bases, strict=True)
    )
    pushed = _pushed(joint, space, moved)
    matrix = np.eye(space.size)
    matrix[np.diag_indices_from(matrix)] += NEUTRAL
    place = 0
    present = np.zeros((3 * joint.contact.n_contact, m), bool)
    present[joint.slots] = True
    for pair, basis, own in zip(space.pairs, space.bases, held, strict=True):
        rank = basis.shape[1]
        here = _rows(joint, int(pair))
        inside = present[3 * pair : 3 * pair + 3].ravel()
        matrix[place : place + rank] += basis[inside].T @ pushed[here].reshape(-1, space.size)
        matrix[place : place + rank, place : place + rank] -= basis.T @ own
        place += rank
    with warnings.catch_warnings():
        # an exactly singular matrix: Newton's method goes on and judges by the residual
        warnings.simplefilter("ignore", scipy.linalg.LinAlgWarning)
        factor = scipy.linalg.lu_factor(matrix, overwrite_a=True, check_finite=False)
    most = max((basis.shape[1] for basis in space.bases), default=0)
    there, back = np.zeros((space.pairs.size, most, 3 * m)), np.zeros((space.pairs.size, 6 * m, most))
    kept = np.zeros((space.pairs.size, most), bool)
    for place, (basis, motion, force) in enumerate(zip(space.bases, moved, held, strict=True)):
        rank = basis.shape[1]
        there[place, :rank], kept[place, :rank] = basis.T, True
        back[place, : 3 * m, :rank], back[place, 3 * m :, :rank] = motion, force
    every = np.arange(joint.contact.n_contact), np.arange(joint.slots.size)
    return SlipFactor(joint, space, there, kept, back, cast("tuple[FloatArray, IntArray]", factor), *every)


def sign_of(factor: tuple[FloatArray, IntArray]) -> float:
    """Sign of the determinant of a matrix from its LU factors and pivots, 0 where it is singular."""
    triangle, pivots = factor
    swaps = np.count_nonzero(pivots != np.arange(pivots.size))
    return float(np.prod(np.sign(np.diag(triangle))) * (-1.0) ** swaps)


def _pushed(joint: Joint, space: SlipSpace, moved: tuple[FloatArray, ...]) -> FloatArray:
    """`Z_r D V` (n_rel, m, size) of the motion of all pairs of a slip space."""
    m = joint.basis.synthesis.shape[0]
    structure = joint.structure
    pushed = np.empty((joint.slots.size, m, space.size))
    place = 0
    for pair, motion in zip(space.pairs, moved, strict=True):
        rank = motion.shape[1]
        here = _rows(joint, int(pair))
        harmonics = motion.reshape(3, m, rank)[joint.slots[here] % 3]
        columns = slice(place, place + rank)
        pushed[:, 0, columns] = structure.static_stiffness[:, here] @ harmonics[:, 0]
        if m > 1:
            amplitude = (harmonics[:, 1::2] - 1j * harmonics[:, 2::2]).transpose(1, 0, 2)
            force = np.matmul(structure.dynamic_stiffness[:, :, here], np.ascontiguousarray(amplitude))
            pushed[:, 1::2, columns] = force.real.transpose(1, 0, 2)
            pushed[:, 2::2, columns] = -force.imag.transpose(1, 0, 2)
        place += rank
    return pushed


def _rows(joint: Joint, pair: int) -> IntArray:
    """Places of a pair's relative displacements, in the order of its components."""
    return np.flatnonzero(joint.slots // 3 == pair)

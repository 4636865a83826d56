"""A factorisation of the Jacobian of a balance in the space in which the pairs slip or open.

The Jacobian, Eqs. (16)-(17) in the unknown p, differs from the identity by two terms: the part of the predicted force
that the pairs do not transmit, `S = I - d lambda/dp`, and the motion of the pairs (`Linearisation`):

    J = I - S + Z_r D,      D = d u/dp

S and D are zero for a pair that sticks throughout the period. For a pair that slips or opens during a part of the
period the rank of both is low: the slip does not change during a phase of sticking. With an orthonormal basis V of the
rows of S and D of each pair, `S = S V V^T` and `D = D V V^T`. With y = V^T x, the equations

    (I + V^T (Z_r D V - S V)) y = V^T b,      x = b - (Z_r D V - S V) y

solve `J x = b`. The size of the matrix is the sum of the ranks, its determinant is that of J. Directions of small
singular values may be left out where the factorisation is only a preconditioner.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import cast

import numpy as np
import scipy.linalg

from solver.harmonic_balance.dlft import Linearisation
from solver.model import BoolArray, FloatArray, IntArray
from solver.newton.krylov import NO_DIRECTION
from solver.structure.joint import Joint

# Shift of the eigenvalues, which are 1 for a pair that sticks. The position of a joint that slips as a whole is
# arbitrary along its slip: round-off in a zero eigenvalue would give the determinant any sign.
_NEUTRAL_SHIFT = 1e-8

# direct calls of LAPACK: the wrappers of scipy take as long as the factorisation of one pair
_PIVOTED_QR, _ORTHOGONAL = scipy.linalg.get_lapack_funcs(("geqp3", "orgqr"), dtype=np.float64)


@dataclass(frozen=True)
class SlipSpace:
    """Orthonormal bases of the part of the predicted force that the pairs do not transmit.

    pairs (n,): pairs with such a part.
    bases: basis (3m, r) for each of these pairs, zero along displacements that a pair does not have.
    exact: whether all directions are included.
    """

    pairs: IntArray
    bases: tuple[FloatArray, ...]
    exact: bool

    @property
    def size(self) -> int:
        """Sum of the ranks."""
        return sum(basis.shape[1] for basis in self.bases)


def largest_directions(tangent: Linearisation, most: int) -> SlipSpace:
    """The part of the slip space of a Jacobian with the `most` largest directions of all pairs."""
    pairs, rows = _held_back_rows(tangent)
    found = [_directions(own) for own in rows]
    sizes = np.sort(np.concatenate([np.empty(0), *(size for _, size in found)]))[::-1]
    least = sizes[most - 1] if most <= sizes.size else 0.0
    bases = (np.ascontiguousarray(basis[:, : np.count_nonzero(size >= least)]) for basis, size in found)
    return SlipSpace(pairs, tuple(bases), bool(most >= sizes.size))


def _held_back_rows(tangent: Linearisation) -> tuple[IntArray, FloatArray]:
    """Pairs (n,) with a part of the predicted force that they do not transmit, and its rows (n, 3m + 1, 3m)."""
    joint = tangent.joint
    m = joint.basis.synthesis.shape[0]
    present = np.zeros(3 * joint.contact.n_contact, bool)
    present[joint.component_index] = True
    columns = np.repeat(present.reshape(-1, 3), m, axis=1)
    held_back = np.eye(3 * m) - tangent.force_tangent
    # one more row for the wear, which the static normal motion carries
    worn = joint.penalty.normal[:, None, None] * tangent.motion_tangent[:, :1]
    rows = np.concatenate([held_back, worn], axis=1) * columns[:, None, :]
    pairs = np.flatnonzero(np.abs(rows).max(axis=(1, 2)) > NO_DIRECTION)
    return pairs, rows[pairs]


def _directions(rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Orthonormal basis (3m, r) of the rows (k, 3m) of a pair, the largest direction first, and the sizes (r,).

    The basis of rows that are not finite is empty.
    """
    width = rows.shape[1]
    if not np.all(np.isfinite(rows)):
        return np.empty((width, 0)), np.empty(0)
    factor, _, scales, _, _ = _PIVOTED_QR(rows.T)
    sizes = np.abs(np.diag(factor))
    rank = int(np.count_nonzero(sizes > NO_DIRECTION))
    return np.ascontiguousarray(_ORTHOGONAL(factor[:, :width], scales)[0][:, :rank]), sizes[:rank]


@dataclass(frozen=True)
class SlipFactor:
    """Factorisation of `I + V^T (Z_r D V - S V)` with the maps to the slip space and back.

    joint, space: the joint and the slip space.
    there (n, r_most, 3m): `V^T` of each pair of the space, filled up with zeros to the largest rank.
    kept (n, r_most): rows of `there` that are not filled up.
    back (n, 6m, r_most): `D V` and `S V`.
    factor: LU factors and pivots of the matrix.
    """

    joint: Joint
    space: SlipSpace
    there: FloatArray
    kept: BoolArray
    back: FloatArray
    factor: tuple[FloatArray, IntArray]

    @property
    def exact(self) -> bool:
        """Whether the factorisation is that of the complete Jacobian."""
        return self.space.exact

    @property
    def sign(self) -> float:
        """Sign of the determinant, 0 where it is singular."""
        return sign_of(self.factor)

    def solve(self, right: FloatArray) -> FloatArray:
        """Solution (n_rel, 2H+1), approximate unless `exact`, for a right-hand side (n_rel, 2H+1)."""
        joint, pairs, m = self.joint, self.space.pairs, right.shape[1]
        if not pairs.size:
            return right.copy()
        spread = joint.to_pairs(right).reshape(-1, 3 * m)
        slips = np.zeros(self.kept.shape)
        slips[self.kept] = scipy.linalg.lu_solve(
            self.factor, np.matmul(self.there, spread[pairs][:, :, None])[self.kept, 0], check_finite=False
        )
        both = np.matmul(self.back, slips[:, :, None]).reshape(-1, 2, 3, m)
        motion, force = np.zeros((2, joint.contact.n_contact, 3, m))
        motion[pairs], force[pairs] = both[:, 0], both[:, 1]
        return right - joint.structure.apply_roughly(joint.to_relative(motion)) + joint.to_relative(force)


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
    matrix[np.diag_indices_from(matrix)] += _NEUTRAL_SHIFT
    place = 0
    present = np.zeros((3 * joint.contact.n_contact, m), bool)
    present[joint.component_index] = True
    for pair, basis, own in zip(space.pairs, space.bases, held, strict=True):
        rank = basis.shape[1]
        here = joint.rows_of(int(pair))
        inside = present[3 * pair : 3 * pair + 3].ravel()
        matrix[place : place + rank] += basis[inside].T @ pushed[here].reshape(-1, space.size)
        matrix[place : place + rank, place : place + rank] -= basis.T @ own
        place += rank
    with warnings.catch_warnings():
        # no warning for a singular matrix: Newton's method goes on and judges by the residual
        warnings.simplefilter("ignore", scipy.linalg.LinAlgWarning)
        factor = scipy.linalg.lu_factor(matrix, overwrite_a=True, check_finite=False)
    most = max((basis.shape[1] for basis in space.bases), default=0)
    there, back = np.zeros((space.pairs.size, most, 3 * m)), np.zeros((space.pairs.size, 6 * m, most))
    kept = np.zeros((space.pairs.size, most), bool)
    for place, (basis, motion, force) in enumerate(zip(space.bases, moved, held, strict=True)):
        rank = basis.shape[1]
        there[place, :rank], kept[place, :rank] = basis.T, True
        back[place, : 3 * m, :rank], back[place, 3 * m :, :rank] = motion, force
    return SlipFactor(joint, space, there, kept, back, cast("tuple[FloatArray, IntArray]", factor))


def sign_of(factor: tuple[FloatArray, IntArray]) -> float:
    """Sign of the determinant of a matrix from its LU factors and pivots, 0 where it is singular."""
    triangle, pivots = factor
    swaps = np.count_nonzero(pivots != np.arange(pivots.size))
    return float(np.prod(np.sign(np.diag(triangle))) * (-1.0) ** swaps)


def _pushed(joint: Joint, space: SlipSpace, moved: tuple[FloatArray, ...]) -> FloatArray:
    """`Z_r D V` (n_rel, m, size) of the motion of all pairs of a slip space."""
    m = joint.basis.synthesis.shape[0]
    structure, dynamic = joint.structure, joint.structure.dynamic_stiffness
    pushed = np.empty((joint.component_index.size, m, space.size))
    place = 0
    for pair, motion in zip(space.pairs, moved, strict=True):
        rank = motion.shape[1]
        here = joint.rows_of(int(pair))
        harmonics = motion.reshape(3, m, rank)[joint.component_index[here] % 3]
        columns = slice(place, place + rank)
        pushed[:, 0, columns] = structure.static_stiffness[:, here] @ harmonics[:, 0]
        if m > 1:
            amplitude = (harmonics[:, 1::2] - 1j * harmonics[:, 2::2]).transpose(1, 0, 2)
            force = np.matmul(dynamic[:, :, here], np.ascontiguousarray(amplitude))
            pushed[:, 1::2, columns] = force.real.transpose(1, 0, 2)
            pushed[:, 2::2, columns] = -force.imag.transpose(1, 0, 2)
        place += rank
    return pushed

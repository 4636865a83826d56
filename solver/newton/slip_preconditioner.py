"""A factorisation of the Jacobian of a balance in the space in which the pairs slip or open.

The Jacobian, Eqs. (16)-(17) in the unknown p, differs from the identity by two terms: the part of the predicted force
that the pairs do not transmit, `S = I - d lambda/dp`, and the motion of the pairs (`Linearisation`):

    J = I - S + Z_r D,      D = d u/dp

S and D are zero for a pair that sticks throughout the period. For a pair that slips or opens during a part of the
period the rank of both is low: the slip does not change during a phase of sticking. With an orthonormal basis V of the
rows of S and D of each pair, `S = S V V^T` and `D = D V V^T`. With y = V^T x, the equations

    (I + V^T (Z_r D V - S V)) y = V^T b,      x = b - (Z_r D V - S V) y

solve `J x = b`. The size of the matrix is the sum of the ranks, its determinant is that of J. Directions of small
singular values are left out where there are too many: then the factorisation is only a preconditioner.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from itertools import pairwise
from typing import cast

import numpy as np
import scipy.linalg

from solver.harmonic_balance.dlft import Linearisation
from solver.model import BoolArray, FloatArray, IntArray
from solver.newton.krylov import NO_DIRECTION
from solver.structure.joint import Joint

MOST_DIRECTIONS = 2500
"""Most directions of a factorisation, 0.4 s. For the sign of a determinant that is not certain otherwise, and for
sliding masses, to which the march does not apply."""

# Shift of the eigenvalues, which are 1 for a pair that sticks. The position of a joint that slips as a whole is
# arbitrary along its slip: round-off in a zero eigenvalue would give the determinant any sign.
_NEUTRAL_SHIFT = 1e-8

# direct calls of LAPACK: the wrappers of scipy take as long as the factorisation of one pair
_PIVOTED_QR, _ORTHOGONAL = scipy.linalg.get_lapack_funcs(("geqp3", "orgqr"), dtype=np.float64)


@dataclass(frozen=True)
class SlipFactor:
    """Factorisation of `I + V^T (Z_r D V - S V)` with the maps to the slip space and back.

    pairs (n,): pairs that do not transmit a part of the predicted force.
    there (n, r_most, 3m): `V^T` of each of these pairs, filled up with zeros to the largest rank; zero along
        displacements that a pair does not have.
    kept (n, r_most): rows of `there` that are not filled up.
    back (n, 6m, r_most): `D V` and `S V`.
    factor: LU factors and pivots of the matrix, whose size is the sum of the ranks.
    exact: whether all directions are included.
    """

    joint: Joint
    pairs: IntArray
    there: FloatArray
    kept: BoolArray
    back: FloatArray
    factor: tuple[FloatArray, IntArray]
    exact: bool

    @property
    def sign(self) -> float:
        """Sign of the determinant, 0 where it is singular."""
        triangle, pivots = self.factor
        swaps = np.count_nonzero(pivots != np.arange(pivots.size))
        return float(np.prod(np.sign(np.diag(triangle))) * (-1.0) ** swaps)

    def solve(self, right: FloatArray) -> FloatArray:
        """Solution (n_rel, 2H+1), approximate unless `exact`, for a right-hand side (n_rel, 2H+1)."""
        joint, pairs, m = self.joint, self.pairs, right.shape[1]
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


def build_slip_factor(tangent: Linearisation) -> SlipFactor:
    """Factorisation of a Jacobian in its slip space, at most in the `MOST_DIRECTIONS` largest directions of all pairs.

    Singular matrices give infinities, not errors.
    """
    joint = tangent.joint
    m = joint.basis.synthesis.shape[0]
    present = np.zeros(3 * joint.contact.n_contact, bool)
    present[joint.component_index] = True
    pairs, bases, exact = _slip_space(tangent, np.repeat(present.reshape(-1, 3), m, axis=1))
    moved = [tangent.motion_tangent[pair] @ basis for pair, basis in zip(pairs, bases, strict=True)]
    held = [basis - tangent.force_tangent[pair] @ basis for pair, basis in zip(pairs, bases, strict=True)]
    ends = np.cumsum([0, *(basis.shape[1] for basis in bases)])
    places = [slice(begin, end) for begin, end in pairwise(ends)]
    pushed = np.empty((joint.component_index.size, m, ends[-1]))
    for pair, motion, place in zip(pairs, moved, places, strict=True):
        pushed[:, :, place] = _push(joint, int(pair), motion)
    matrix = np.eye(ends[-1])
    matrix[np.diag_indices_from(matrix)] += _NEUTRAL_SHIFT
    there = np.zeros((pairs.size, int(np.diff(ends).max(initial=0)), 3 * m))
    back, kept = np.zeros((pairs.size, 6 * m, there.shape[1])), np.zeros(there.shape[:2], bool)
    for row, (pair, basis, own, place) in enumerate(zip(pairs, bases, held, places, strict=True)):
        here = joint.rows_of(int(pair))
        inside = np.repeat(present[3 * pair : 3 * pair + 3], m)
        matrix[place] += basis[inside].T @ pushed[here].reshape(-1, ends[-1])
        matrix[place, place] -= basis.T @ own
        rank = basis.shape[1]
        there[row, :rank], kept[row, :rank] = basis.T, True
        back[row, : 3 * m, :rank], back[row, 3 * m :, :rank] = moved[row], own
    with warnings.catch_warnings():
        # no warning for a singular matrix: Newton's method goes on and judges by the residual
        warnings.simplefilter("ignore", scipy.linalg.LinAlgWarning)
        factor = scipy.linalg.lu_factor(matrix, overwrite_a=True, check_finite=False)
    return SlipFactor(joint, pairs, there, kept, back, cast("tuple[FloatArray, IntArray]", factor), exact)


def _slip_space(tangent: Linearisation, columns: BoolArray) -> tuple[IntArray, list[FloatArray], bool]:
    """Pairs (n,) of the slip space, basis (3m, r) of each, and whether these are all directions.

    columns (n_contact, 3m): whether the displacement of an unknown exists.
    """
    held_back = np.eye(columns.shape[1]) - tangent.force_tangent
    # one more row for the wear, which the static normal motion carries
    worn = tangent.joint.penalty.normal[:, None, None] * tangent.motion_tangent[:, :1]
    rows = np.concatenate([held_back, worn], axis=1) * columns[:, None, :]
    pairs = np.flatnonzero(np.abs(rows).max(axis=(1, 2)) > NO_DIRECTION)
    found = [_directions(rows[pair]) for pair in pairs]
    sizes = np.sort(np.concatenate([np.empty(0), *(size for _, size in found)]))[::-1]
    least = sizes[MOST_DIRECTIONS - 1] if sizes.size >= MOST_DIRECTIONS else 0.0
    bases = [np.ascontiguousarray(basis[:, : np.count_nonzero(size >= least)]) for basis, size in found]
    return pairs, bases, sizes.size <= MOST_DIRECTIONS


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


def _push(joint: Joint, pair: int, motion: FloatArray) -> FloatArray:
    """`Z_r D V` (n_rel, m, r) of the motion `D V` (3m, r) of a pair."""
    here, structure, m = joint.rows_of(pair), joint.structure, joint.basis.synthesis.shape[0]
    harmonics = motion.reshape(3, m, -1)[joint.component_index[here] % 3]
    pushed = np.empty((joint.component_index.size, m, motion.shape[1]))
    pushed[:, 0] = structure.static_stiffness[:, here] @ harmonics[:, 0]
    if m > 1:
        amplitude = (harmonics[:, 1::2] - 1j * harmonics[:, 2::2]).transpose(1, 0, 2)
        force = np.matmul(structure.dynamic_stiffness[:, :, here], np.ascontiguousarray(amplitude))
        pushed[:, 1::2] = force.real.transpose(1, 0, 2)
        pushed[:, 2::2] = -force.imag.transpose(1, 0, 2)
    return pushed

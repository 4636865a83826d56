"""An approximate inverse of the balance's Jacobian by a march through the period, for joints that slip and open.

With the state `x` of a pair (normal: the part of the predicted force that is no contact force; tangents: lambda_x of
Eqs. (11)-(15)), which moves the pair by `x / eps`, the Jacobian maps a step `dp` to `dp + (Z_r / eps - 1) dx`. If Z_r
were one real stiffness Z in all harmonics, this would hold sample by sample,

    dp(t) + (Z / eps - 1) dx(t) = r(t),      dx(t) = A(t) dp(t) + B(t) dx(t - 1),

with A and B the derivatives of the contact law at a sample, blocks of the pairs; B is the history. So

    [1 + (Z / eps - 1) A(t)] dp(t) = r(t) - (Z / eps - 1) B(t) dx(t - 1)

is solved by a march with one small system a sample, whatever the number of harmonics that the pairs couple, and costs
less than one factorisation in harmonics. The stiffness of an elastic joint hardly changes with the harmonic, except for
resonances of the structure behind it: each adds a term of rank two, `U V^T`, to the harmonics that are near it. With T
the march to `dp` and T_x that to `dx`, the Woodbury identity

    J^-1 r = T r - T U (1 + V^T T_x U)^-1 V^T T_x r

accounts for them. The truncation of the series is neglected: its effect is smaller.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from solver.contact.coulomb import sample_tangents
from solver.harmonic_balance.dlft import Linearisation
from solver.model import FloatArray, IntArray
from solver.newton.options import NEWTON
from solver.structure.fourier import FourierBasis, build_basis
from solver.structure.harmonic_stiffness import SingleArray
from solver.structure.joint import Joint


@dataclass(frozen=True)
class SampleMarch:
    """Matrices of the march through N samples; n = 3 n_contact, with identity rows where a pair has no displacement.

    inverse (N, n, n): of `1 + (Z / eps - 1) A`. coupling (n, n): `Z / eps - 1`. own (N, n_contact, 3, 3): A. carried
    (N, n_contact, 2, 2): B.
    """

    joint: Joint
    basis: FourierBasis
    inverse: SingleArray
    coupling: SingleArray
    own: FloatArray
    carried: FloatArray

    def solve(self, right: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Step `T r` and change of the state `T_x r` (n_rel, 2H+1) for a right-hand side (n_rel, 2H+1)."""
        spread = self.joint.to_pairs(right).reshape(-1, right.shape[1])
        right_t = np.ascontiguousarray((spread @ self.basis.synthesis).T, np.float32)
        both_t = march_samples(self.inverse, self.coupling, self.own, self.carried, right_t, NEWTON.march_periods)
        step, state = (
            self.joint.to_relative((part_t.T @ self.basis.analysis).reshape(-1, 3, right.shape[1])) for part_t in both_t
        )
        return step, state


@dataclass(frozen=True)
class PeriodFactor:
    """The march, and k directions in which the harmonics differ.

    seen (k, n_rel (2H+1)): `V^T`. bent (n_rel (2H+1), k): `T U (1 + V^T T_x U)^-1`. pairs, rows: all of the joint.
    """

    march: SampleMarch
    seen: FloatArray
    bent: FloatArray
    pairs: IntArray
    rows: IntArray
    exact: bool = False

    def solve(self, right: FloatArray) -> FloatArray:
        """Approximate solution (n_rel, 2H+1) for a right-hand side (n_rel, 2H+1)."""
        step, state = self.march.solve(right)
        return step - (self.bent @ (self.seen @ state.ravel())).reshape(right.shape)


def build_period_factor(tangent: Linearisation) -> PeriodFactor | None:
    """Factor of a Jacobian; None where it has none: a sample's system is singular, or pairs are marched with masses."""
    joint = tangent.joint
    if joint.penalty.inertial.any():
        return None
    try:
        march = build_march(tangent)
        added, seen = resonances(joint)
        both = [march.solve(column.reshape(joint.component_index.size, -1)) for column in added]
        steps, states = (np.reshape([part[place] for part in both], added.shape).T for place in (0, 1))
        bent = np.linalg.solve((np.eye(len(seen)) + seen @ states).T, steps.T).T
    except np.linalg.LinAlgError:
        return None
    return PeriodFactor(march, seen, bent, np.arange(joint.contact.n_contact), np.arange(joint.component_index.size))


def build_march(tangent: Linearisation) -> SampleMarch:
    """March of a Jacobian. Raises numpy.linalg.LinAlgError where a sample's system is singular."""
    joint = tangent.joint
    # every sample costs a system: as few as tell the harmonics apart
    n_samples, highest = joint.basis.n_samples, max(joint.basis.orders, default=0)
    while n_samples % 2 == 0 and n_samples // 2 > 2 * highest:
        n_samples //= 2
    at, stride = tangent.at, joint.basis.n_samples // n_samples
    own, carried = sample_tangents(
        at.predicted_t, joint.friction_coefficient, at.state_t, at.status_t, joint.has_normal, stride
    )
    n_contact, size = joint.contact.n_contact, 3 * joint.contact.n_contact
    coupling = np.zeros((size, size))
    coupling[np.ix_(joint.component_index, joint.component_index)] = stiffness_of_most(joint) / joint.relative_penalty
    coupling[joint.component_index, joint.component_index] -= 1.0
    blocks = np.ascontiguousarray(coupling.reshape(size, n_contact, 3).transpose(1, 0, 2))
    # in single precision: the matrices are read from memory at every solve, and this is only a preconditioner
    matrix = np.empty((n_samples, size, size), np.float32)
    for sample in range(n_samples):
        matrix[sample] = np.matmul(blocks, own[sample]).transpose(1, 0, 2).reshape(size, size)
    matrix[:, np.arange(size), np.arange(size)] += 1.0
    basis = build_basis(joint.basis.orders, n_samples)
    inverse = np.asarray(np.linalg.inv(matrix), np.float32)
    return SampleMarch(joint, basis, inverse, coupling.astype(np.float32), own, carried)


def resonances(joint: Joint) -> tuple[FloatArray, FloatArray]:
    """Low-rank difference `U V^T` of the stiffness over the penalty from that of most harmonics.

    For each harmonic it has the singular values above `NEWTON.resonant_difference`, at most `NEWTON.resonances` of
    them, found by a few powers of the difference on fixed vectors, which is accurate enough for large ones.

    Returns
    -------
    added, seen : array (k, n_rel (2H+1))
        Rows of `U^T` and `V^T`, dimensionless.
    """
    structure, n_rel, m = joint.structure, joint.component_index.size, joint.basis.synthesis.shape[0]
    most, penalty = stiffness_of_most(joint), joint.relative_penalty
    added, seen = [], []
    for place, stiffness in enumerate((structure.static_stiffness, *structure.dynamic_stiffness)):
        change = (stiffness - most) / penalty
        image = change @ np.random.default_rng(0).normal(size=(n_rel, min(NEWTON.resonances, n_rel)))
        for _ in range(NEWTON.power_iterations):
            image = change @ (change.conj().T @ np.linalg.qr(image)[0])
        basis = np.linalg.qr(image)[0]
        left, size, right = np.linalg.svd(basis.conj().T @ change, full_matrices=False)
        for direction in np.flatnonzero(size > NEWTON.resonant_difference):
            force, motion = size[direction] * (basis @ left[:, direction]), right[direction]
            both = np.zeros((2, 2, n_rel, m))
            if place == 0:
                both[:, 0, :, 0] = force.real, motion.real
            else:
                # an amplitude `cosine - i sine`: real and imaginary part of its product with the motion
                cosine, sine = 2 * place - 1, 2 * place
                both[0, :, :, cosine], both[0, :, :, sine] = (force.real, -force.imag), (-force.imag, -force.real)
                both[1, :, :, cosine], both[1, :, :, sine] = (motion.real, motion.imag), (motion.imag, -motion.real)
            added += list(both[0, : 1 + (place > 0)])
            seen += list(both[1, : 1 + (place > 0)])
    shape = (len(seen), n_rel * m)
    return np.reshape(added, shape), np.reshape(seen, shape)


def stiffness_of_most(joint: Joint) -> FloatArray:
    """Real stiffness (n_rel, n_rel), N/m, of most harmonics: the median ignores those near a resonance."""
    structure = joint.structure
    return np.asarray(
        np.median(np.concatenate([structure.static_stiffness[None], structure.dynamic_stiffness.real]), axis=0)
    )


@njit(cache=True)
def march_samples(
    inverse: SingleArray,
    coupling: SingleArray,
    own: FloatArray,
    carried: FloatArray,
    right_t: SingleArray,
    periods: int,
) -> tuple[FloatArray, FloatArray]:
    """March through the samples of some periods, without any change of the state before the first one.

    Parameters
    ----------
    inverse, coupling, own, carried : array
        As in `SampleMarch`.
    right_t : array (N, n)
        Right-hand sides.
    periods : int
        Times that the period is marched through; the last one counts.

    Returns
    -------
    step_t, state_t : array (N, n)
        Steps of the predicted force and changes of the state.
    """
    n_samples, size = right_t.shape
    n_contact = size // 3
    step_t, state_t = np.zeros((n_samples, size)), np.zeros((n_samples, size))
    state, before = np.zeros((n_contact, 2)), np.zeros(size, right_t.dtype)
    for _ in range(periods):
        for n in range(n_samples):
            for pair in range(n_contact):
                for i in range(2):
                    before[3 * pair + 1 + i] = (
                        carried[n, pair, i, 0] * state[pair, 0] + carried[n, pair, i, 1] * state[pair, 1]
                    )
            step = np.dot(inverse[n], right_t[n] - np.dot(coupling, before))
            for pair in range(n_contact):
                for i in range(3):
                    changed = before[3 * pair + i]
                    for k in range(3):
                        changed += own[n, pair, i, k] * step[3 * pair + k]
                    state_t[n, 3 * pair + i] = changed
                    if i > 0:
                        state[pair, i - 1] = changed
            step_t[n] = step
    return step_t, state_t

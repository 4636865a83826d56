"""The monodromy of a joint: integration in time of a small disturbance of a periodic state over one period.

A disturbance (dy, dlambda) of the displacements y, m, and of the contact force, N, obeys

    M dy'' + C dy' + K dy + dlambda = 0,                                                                     (1)

and at each sample the derivative of the contact law with the statuses of the periodic state (`contact.sampled_law`).

Equation (1) is integrated by backward differences of second order (BDF2). The contact holds displacements suddenly,
which needs a scheme with damping at high rates. In a period of N samples the scheme damps a vibration at r times the
frequency of the state by the fraction `(2 pi r)^4 / (4 N^3)`. Pairs that stick during the whole period are held, pairs
that are open during the whole period are free: they need no law.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numba import njit

from solver.contact.coulomb import SEPARATED, STICK
from solver.contact.sampled_law import SampledLaw, sampled_law
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.model import BoolArray, FloatArray, IntArray, LinearModel
from solver.structure.fourier import build_basis
from solver.structure.joint import Joint

_SAMPLES_AT_ONCE = 64  # of the contact law: bounds the memory of large joints


class Monodromy(NamedTuple):
    """Integration of disturbances through the N samples of a period, with n displacements and p switching pairs.

    - response (n, 2n): motion without contact forces from the known parts of acceleration and velocity, m per sample.
    - spread (n, 3p): motion under unit contact forces, m/N.
    - inverse (N, 3p, 3p): contact forces from the right-hand side of the law.
    - past (N, p, 3, 12): right-hand side of the law from `du` without contact forces, `du'`, known velocity, `dv'`.
    - places (12p,): rows of these four motions, and 4n for a displacement that does not exist.

    A disturbance (4n, j) has the displacements now and at the sample before, and the velocities (m per sample)
    likewise.
    """

    response: FloatArray
    spread: FloatArray
    inverse: FloatArray
    past: FloatArray
    places: IntArray

    @property
    def size(self) -> int:
        """Size of a disturbance."""
        return 4 * len(self.response)

    def apply(self, disturbance: FloatArray) -> FloatArray:
        """Disturbances (size, j) a period later."""
        return pass_period(self, disturbance)

    def matrix(self) -> FloatArray:
        """The monodromy (size, size)."""
        return self.apply(np.eye(self.size))


@njit(cache=True)
def pass_period(of: Monodromy, disturbance: FloatArray) -> FloatArray:
    """Disturbances (4n, j) through the N samples of a period."""
    n, n_rows = of.response.shape[0], of.inverse.shape[1]
    now, before = disturbance[:n].copy(), disturbance[n : 2 * n].copy()
    speed, speed_before = disturbance[2 * n : 3 * n].copy(), disturbance[3 * n :].copy()
    right = np.zeros((n_rows, disturbance.shape[1]))
    for sample in range(of.inverse.shape[0]):
        # BDF2: v = 3/2 y + known; acceleration from v in the same way
        known = 0.5 * before - 2.0 * now
        after = np.dot(of.response, np.concatenate((1.5 * known + 0.5 * speed_before - 2.0 * speed, known)))
        if n_rows > 0:
            past = np.concatenate((after, now, known, speed))
            right[:] = 0.0
            for row in range(n_rows):
                for m in range(12):
                    place = of.places[12 * (row // 3) + m]
                    if place < 4 * n:
                        right[row] += of.past[sample, row // 3, row % 3, m] * past[place]
            after -= np.dot(of.spread, np.dot(of.inverse[sample], right))
        now, before, speed, speed_before = after, now, 1.5 * after + known, speed
    return np.concatenate((now, before, speed, speed_before))


def build_monodromy(joint: Joint, linear: LinearModel, at: Evaluation, n_samples: int) -> Monodromy:
    """Monodromy of a state at a fixed wear depth, with `n_samples` samples of the contact law.

    linear: the structure in which disturbances move. Raises numpy.linalg.LinAlgError where the structure is singular.
    """
    fine = replace(joint, basis=build_basis(joint.basis.orders, n_samples))
    state = Balance(fine, at.history, at.wear_depth).evaluate(at.predicted_h)
    switching, stuck = switching_pairs(state)
    dofs = joint.contact.dofs
    moves = np.ones(len(linear.mass), bool)
    moves[dofs[stuck][dofs[stuck] >= 0]] = False
    mass, damping, stiffness = (
        np.ascontiguousarray(np.real(part)[np.ix_(moves, moves)])
        for part in (linear.mass, linear.damping, linear.stiffness)
    )
    inertia, drag = mass / fine.law.sample_step**2, damping / fine.law.sample_step
    compliance = np.linalg.inv(2.25 * inertia + 1.5 * drag + stiffness)
    # displacements of the switching pairs among those that move, -1 for none
    place = np.where(dofs[switching] >= 0, (np.cumsum(moves) - 1)[dofs[switching]], -1).reshape(-1, 1, 3)
    there, rows, n = place.ravel() >= 0, place.ravel(), len(mass)
    spread = np.where(there, compliance[rows].T, 0.0)
    law = sampled_law(fine.law, state, np.flatnonzero(switching))
    parts = (-law.by_motion - 1.5 * law.by_speed, law.by_last_motion, -law.by_speed, law.by_last_speed)
    return Monodromy(
        response=-compliance @ np.hstack([inertia, drag]),
        spread=np.ascontiguousarray(spread),
        inverse=_inverse_of_law(law, np.where(there[:, None], spread[rows], 0.0)),
        past=np.concatenate(parts, axis=3),
        places=np.where(place < 0, 4 * n, place + n * np.arange(4)[:, None]).ravel(),
    )


def _inverse_of_law(law: SampledLaw, flexibility: FloatArray) -> FloatArray:
    """Inverse (N, 3p, 3p) of the law for the contact forces; flexibility (3p, 3p): motion under them, m/N."""
    n_samples, n_pairs = law.by_force.shape[:2]
    blocks, pairs = flexibility.reshape(n_pairs, 3, 3 * n_pairs), np.arange(n_pairs)
    inverse = np.empty((n_samples, 3 * n_pairs, 3 * n_pairs))
    for first in range(0, n_samples, _SAMPLES_AT_ONCE):
        part = slice(first, first + _SAMPLES_AT_ONCE)
        system = -((law.by_motion[part] + 1.5 * law.by_speed[part]) @ blocks)
        system.reshape(len(system), n_pairs, 3, n_pairs, 3)[:, pairs, :, pairs] += law.by_force[part].swapaxes(0, 1)
        inverse[part] = np.linalg.inv(system.reshape(len(system), 3 * n_pairs, 3 * n_pairs))
    return inverse


def switching_pairs(at: Evaluation) -> tuple[BoolArray, BoolArray]:
    """Pairs (n_contact,) that slip or open in a part of the period; pairs that stick during the whole period."""
    stuck = (at.status_t == STICK).all(axis=1)
    return ~stuck & ~(at.status_t == SEPARATED).all(axis=1), stuck

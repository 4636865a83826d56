"""The harmonic balance of a joint: residual, exact Jacobian, and wear that goes with the motion.

The unknown is the predicted force p (n_rel, 2H+1), N: `lambda_u` of Eq. (10). It gives at each pair, by itself, the
contact force `lambda(p)` and the motion `u = (p - lambda) / eps + g + W` (Eqs. (10)-(12), with `X` the corrected
motion), so that

    R(p) = Z_r u(p) + lambda(p) - F_r                                                                      (8)

is the only coupled equation. For a given wear depth this is the residual in u of the paper after a linear change of
variable, so a Newton iteration takes the same steps. With the implicit scheme `W = W_k + h g(p)`, Eq. (24) (the print
of (26b) lacks h): the wear rate of a pair depends on its own p alone, W is eliminated there, and the Jacobian changes
by a rank-one block a pair:

    dR/dp = Z_r [(I - dlambda/dp) / eps + d W/dp] + dlambda/dp
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from solver.joint import Joint
from solver.law import Marched, law_tangent, march_law
from solver.model import ComplexArray, FloatArray, IntArray


@dataclass(frozen=True)
class Balance:
    """A periodic problem: a joint, the history of its pairs and the wear.

    history (n_contact, 2): corrected slip X_T at the start of the period, m. wear_depth (n_contact,): m, at the start
    of the slow step. wear_gain (n_contact,): `h k_w / alpha`, 1/N; zero where W does not grow with the motion.
    """

    joint: Joint
    history: FloatArray
    wear_depth: FloatArray
    wear_gain: FloatArray

    def predict(self, displacement_h: FloatArray, force_h: FloatArray) -> FloatArray:
        """Predicted force (n_rel, m), N, that gives a motion, m, and contact force, N, (n_contact, 3, m) of a state."""
        motion = displacement_h.copy()
        motion[:, 0, 0] -= self.joint.contact.gap + self.wear_depth
        held = self.joint.penalty.inertial
        motion[held, 1:, 0] -= self.history[held]
        return self.joint.to_relative(force_h + self.joint.surplus(motion))

    def evaluate(self, predicted_h: FloatArray) -> Evaluation:
        """Residual and everything that it passes through, for a predicted force (n_rel, 2H+1), N."""
        joint = self.joint
        pairs = joint.to_pairs(predicted_h)
        pairs[~joint.has_normal, 0, 0] = joint.contact.normal_load[~joint.has_normal]
        marched = march_law(joint, pairs, self.history)
        wear_depth = self.wear_depth + self.wear_gain * marched.slip_work
        displacement_h = joint.motion(pairs - marched.force_h)
        displacement_h[:, 0, 0] += wear_depth + joint.contact.gap
        inertial = joint.penalty.inertial
        displacement_h[inertial, 1:, 0] += self.history[inertial]
        motion, force = joint.to_relative(displacement_h), joint.to_relative(marched.force_h)
        reduced_force = joint.structure.force_h()
        residual = joint.structure.apply(motion) + force - reduced_force
        return Evaluation(
            **vars(marched),
            predicted_h=predicted_h,
            residual=residual,
            scale=_residual_scale(reduced_force, force),
            history=self.history,
            displacement_h=displacement_h,
            wear_depth=wear_depth,
        )

    def linearise(self, at: Evaluation) -> Linearisation:
        """Exact derivative of the residual: closure of the history and wear included."""
        joint = self.joint
        force_tangent, slip_tangent = law_tangent(joint, at)
        m = joint.basis.synthesis.shape[0]
        surplus = (np.eye(3 * m) - force_tangent).reshape(-1, 3, m, 3 * m)
        motion_tangent = joint.motion(surplus).reshape(-1, 3 * m, 3 * m)
        motion_tangent[:, 0, :] += self.wear_gain[:, None] * slip_tangent
        return Linearisation(joint, force_tangent, motion_tangent)


@dataclass(frozen=True)
class Evaluation(Marched):
    """Residual (n_rel, 2H+1), N, of a predicted force (n_rel, 2H+1), N, with what the pairs do under it.

    scale: N, of the static and of the other harmonics. history (n_contact, 2): m, as in `Balance`.
    displacement_h (n_contact, 3, 2H+1), wear_depth (n_contact,): m.
    """

    predicted_h: FloatArray
    residual: FloatArray
    scale: tuple[float, float]
    history: FloatArray
    displacement_h: FloatArray
    wear_depth: FloatArray

    def scaled_residual(self, scale: tuple[float, float] | None = None) -> float:
        """Euclidean norm of the residual, the static harmonic and the others each over its scale."""
        static, moving = scale or self.scale
        return float(
            np.hypot(np.linalg.norm(self.residual[:, 0]) / static, np.linalg.norm(self.residual[:, 1:]) / moving)
        )


def _residual_scale(reduced_force: FloatArray, contact_force: FloatArray) -> tuple[float, float]:
    """Scales of the residual, N: the static preload must not hide an error in the vibration, which may be far less."""
    moving = max(float(np.linalg.norm(reduced_force[:, 1:])), float(np.linalg.norm(contact_force[:, 1:])))
    static = max(float(np.linalg.norm(reduced_force[:, 0])), float(np.linalg.norm(contact_force[:, 0])), moving)
    if static == 0.0:
        return 1.0, 1.0
    # below this share of the preload the vibration is lost in round-off
    return static, max(moving, 1e-6 * static)


@dataclass(frozen=True)
class Linearisation:
    """`dR/dp = Z_r motion_tangent + force_tangent`, both (n_contact, 3m, 3m) blocks of the pairs, m = 2H+1.

    Where a pair stays stuck or closed all period long its motion does not depend on p: these unknowns stand in the
    Jacobian as columns of the identity, are left out of the coupled system and follow from it (`active`).
    """

    joint: Joint
    force_tangent: FloatArray
    motion_tangent: FloatArray

    def active(self) -> IntArray:
        """Pairs whose motion depends on their predicted force."""
        return np.flatnonzero(np.abs(np.eye(self.force_tangent.shape[1]) - self.force_tangent).max(axis=(1, 2)) > 1e-14)

    def apply(self, step: FloatArray) -> FloatArray:
        """Jacobian times a step (n_rel, m), N."""
        joint = self.joint
        spread = joint.to_pairs(step).reshape(joint.contact.n_contact, -1, 1)
        shape = (joint.contact.n_contact, 3, step.shape[1])
        motion = np.matmul(self.motion_tangent, spread).reshape(shape)
        force = np.matmul(self.force_tangent, spread).reshape(shape)
        return joint.structure.apply(joint.to_relative(motion)) + joint.to_relative(force)

    def dense(self, pairs: IntArray, n_harmonics: int | None = None) -> FloatArray:
        """Rows and columns of the Jacobian that belong to `pairs`, in the order (relative displacement, harmonic).

        n_harmonics: where given, of the lowest harmonics only.
        """
        joint = self.joint
        whole = joint.basis.synthesis.shape[0]
        m = whole if n_harmonics is None else 2 * n_harmonics + 1
        rows = np.flatnonzero(np.isin(joint.slots // 3, pairs))
        matrix = np.zeros((rows.size, m, rows.size, m))
        static = joint.structure.static_stiffness
        dynamic = joint.structure.dynamic_stiffness
        for pair in pairs:
            own = np.flatnonzero(joint.slots[rows] // 3 == pair)
            component = joint.slots[rows[own]] % 3
            select = (component[:, None] * whole + np.arange(m)).ravel()
            block = self.motion_tangent[pair][np.ix_(select, select)].reshape(own.size, m, own.size * m)
            product = np.empty((rows.size, m, own.size * m))
            product[:, 0] = static[np.ix_(rows, rows[own])] @ block[:, 0]
            for n in range((m - 1) // 2):
                amplitude = block[:, 2 * n + 1] - 1j * block[:, 2 * n + 2]
                force = dynamic[n][np.ix_(rows, rows[own])] @ amplitude
                product[:, 2 * n + 1] = force.real
                product[:, 2 * n + 2] = -force.imag
            matrix[:, :, own] = product.reshape(rows.size, m, own.size, m)
            tangent = self.force_tangent[pair][np.ix_(select, select)].reshape(own.size, m, own.size, m)
            matrix[own[:, None], :, own[None, :]] += tangent.transpose(0, 2, 1, 3)
        return matrix.reshape(rows.size * m, rows.size * m)

    def dense_harmonic(self, pairs: IntArray, place: int) -> ComplexArray:
        """What the Jacobian does within one harmonic above the static one: a complex matrix over the rows of `pairs`.

        place: of the harmonic among those of the basis. The pairs' tangents mix its cosine and sine in any way; the
        part that a complex factor can express is taken.
        """
        joint = self.joint
        m = joint.basis.synthesis.shape[0]
        rows = np.flatnonzero(np.isin(joint.slots // 3, pairs))
        matrix = np.zeros((rows.size, rows.size), complex)
        stiffness = joint.structure.dynamic_stiffness[place]
        for pair in pairs:
            own = np.flatnonzero(joint.slots[rows] // 3 == pair)
            cosine = (joint.slots[rows[own]] % 3) * m + 2 * place + 1
            motion, force = (_complex_part(part[pair], cosine) for part in (self.motion_tangent, self.force_tangent))
            matrix[:, own] = stiffness[np.ix_(rows, rows[own])] @ motion
            matrix[np.ix_(own, own)] += force
        return matrix


def _complex_part(tangent: FloatArray, cosine: IntArray) -> ComplexArray:
    """Complex-linear part (k, k) of a real map between amplitudes `cosine - i sine` of k displacements."""
    cc, cs = tangent[np.ix_(cosine, cosine)], tangent[np.ix_(cosine, cosine + 1)]
    sc, ss = tangent[np.ix_(cosine + 1, cosine)], tangent[np.ix_(cosine + 1, cosine + 1)]
    return cast("ComplexArray", 0.5 * (cc + ss) + 0.5j * (cs - sc))

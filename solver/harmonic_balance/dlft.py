"""The harmonic balance of a joint: residual, exact Jacobian, and wear depth that depends on the motion.

The unknown is the predicted force p (n_rel, 2H+1), N: `lambda_u` of Eqs. (9), (10). It determines the contact force
`lambda(p)` and the motion `u = (p - lambda) / eps + g + W` of a pair, Eqs. (10)-(12), so that

    R(p) = Z_r u(p) + lambda(p) - F_r                                                                      (8)

is the only coupled equation. With the implicit scheme `W = W_k + h g(p)`, Eqs. (24), (26) (the print of (26b) lacks h).
The wear rate of a pair depends on p of this pair alone, so that W is eliminated pair by pair:

    dR/dp = Z_r [(I - dlambda/dp) / eps + d W/dp] + dlambda/dp                                          (16)-(18)

So is the energy that friction has dissipated, `e = e_k + h mu(e) S / alpha`, where friction mu, flexibility c of the
contact (`u` in (8) is then `u + c lambda`) or wear coefficient change with it (`Evolution`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numba import njit

from solver.contact.coulomb import friction_limit
from solver.contact.element import Element, Marched
from solver.contact.wear_law import ARCHARDS_WORK, WearingWork
from solver.model import ComplexArray, ContactInterface, FloatArray, IntArray
from solver.packing import packable
from solver.settings import NEGLIGIBLE
from solver.structure.joint import Joint

MOST_MARCHES = 20
SAME_FRICTION = 1e-12
"""Most marches until the friction of an evolving contact agrees with the energy that it dissipates, and by how much.
Four are usual."""


@dataclass(frozen=True)
class Balance:
    """A periodic problem: a joint, the tangential history of its pairs, and the wear.

    - history (n_contact, n_history): tangential history, m (`Element`). before_t (n_contact, 3, N): predicted force, N,
      with this history, from which that of the state has slowly come; None where it was always the same.
    - wear_depth (n_contact,): depth without the growth, m; constant through the period, Eq. (6). Default: 0.
    - wear_gain (n_contact,): growth of the depth per wearing work, m/J; 0 where W is given. wearing: this work.
    - energy, energy_gain (n_contact,): in the same way, the energy that friction has dissipated, J/m2, and its growth
      over the work of friction, 1/m2.
    """

    joint: Joint
    history: FloatArray
    wear_depth: FloatArray = field(default_factory=lambda: np.zeros(1))
    wear_gain: FloatArray | float = 0.0
    wearing: WearingWork = ARCHARDS_WORK
    before_t: FloatArray | None = None
    energy: FloatArray = field(default_factory=lambda: np.zeros(1))
    energy_gain: FloatArray | float = 0.0

    def predict(self, displacement_h: FloatArray, force_h: FloatArray) -> FloatArray:
        """Predicted force (n_rel, m), N, Eq. (10), of a motion, m, and a contact force, N, both (n_contact, 3, m)."""
        motion = displacement_h.copy()
        motion[:, 0, 0] -= self.joint.contact.gap + self.wear_depth
        motion[:, 1:, 0] -= self.joint.law.origin(self.history)
        return self.joint.to_relative(force_h + self.joint.law.force(motion))

    def evaluate(self, predicted_h: FloatArray) -> Evaluation:
        """Residual, Eq. (8), contact force, motion, Eq. (12), and wear depth, Eq. (24), for a predicted force, N."""
        joint = self.joint
        pairs = joint.to_pairs(predicted_h)
        given = ~joint.contact.has_normal
        pairs[given, 0, 0] = joint.contact.normal_load[given]
        contact, marched, energy = self._marched(pairs)
        worn = marched.slip_work, marched.force_h[:, 0, 0], self.wear_depth
        wearing, gain = self.wearing.rubbing(contact.friction), self.wear_gain * contact.wear_factor[0]
        wear_depth = self.wear_depth + wearing.growth(gain, *worn)
        displacement_h = joint.law.motion(pairs - marched.force_h)
        displacement_h[:, 0, 0] += wear_depth + joint.contact.gap
        displacement_h[:, 1:, 0] += joint.law.origin(self.history)
        moved = displacement_h + contact.flexibility[0][:, :, None] * marched.force_h
        motion, force = joint.to_relative(moved), joint.to_relative(marched.force_h)
        return Evaluation(
            **vars(marched),
            predicted_h=predicted_h,
            residual=joint.structure.apply(motion) + force - joint.structure.force_h,
            scale=_residual_scale(joint.structure.force_h, force),
            start_history=joint.law.started_from(marched, self.history),
            displacement_h=displacement_h,
            wear_depth=wear_depth,
            energy=energy,
        )

    def _marched(self, pairs: FloatArray) -> tuple[ContactInterface, Marched, FloatArray]:
        """Contact at the end of the step, the period under a predicted force (n_contact, 3, m), and the energy.

        The friction depends on the energy that it dissipates itself: by the secant method, pair by pair.
        """
        unworn, last = self.joint.model.contact, None
        energy = np.broadcast_to(self.energy, unworn.area.shape)
        for _ in range(MOST_MARCHES):
            contact = unworn.after(energy)
            law, before_t = self._law(contact)
            marched = law.march(pairs, self.history, before_t)
            after = self.energy + self.energy_gain * friction_limit(contact.friction, marched.slip_work)
            found = unworn.after(after)
            if np.abs(found.friction - contact.friction).max(initial=0.0) <= SAME_FRICTION:
                return found, marched, after
            rise = np.zeros_like(after)
            if last is not None:
                moved = energy - last[0]
                rise = np.divide(after - last[1], moved, out=rise, where=moved != 0.0)
            last, energy = (energy, after), energy + (after - energy) / np.where(rise < 0.9, 1.0 - rise, 1.0)
        # no state: the residual is not known
        return found, replace(marched, force_h=np.full_like(marched.force_h, np.nan)), after

    def _law(self, contact: ContactInterface) -> tuple[Element, FloatArray | None]:
        """The law with the friction of a contact, and the predicted force before (n_contact, 3, N), with friction discs
        of the size that they had there.
        """
        now, before = contact.friction, self.joint.contact.friction
        if now is before:
            return self.joint.law, self.before_t
        before_t = None if self.before_t is None else self.before_t.copy()
        if before_t is not None:
            before_t[:, 0] *= np.divide(before, now, out=np.ones_like(now), where=now > 0.0)[:, None]
        return self.joint.law.rubbing(now), before_t

    def linearise(self, at: Evaluation) -> Linearisation:
        """Exact derivative of the residual, Eqs. (16)-(18), including wear, evolution, and periodicity of friction."""
        if self.before_t is None and at.slid.any():
            at = replace(at, slid=np.zeros_like(at.slid))
        contact = self.joint.model.contact.after(at.energy)
        law, before_t = self._law(contact)
        force_tangent, work_tangent, by_friction = law.tangent(at, self.history, before_t)
        friction, slope, gain = contact.friction, contact.friction_slope, self.energy_gain
        back = gain * slope * (at.slip_work + friction * by_friction[:, -1])
        energy_tangent = (gain * friction / (1.0 - back))[:, None] * work_tangent
        evolving = np.flatnonzero(slope)
        changed = slope[evolving, None] * energy_tangent[evolving]
        force_tangent[evolving] += by_friction[evolving, :-1, None] * changed[:, None]
        work_tangent[evolving] += by_friction[evolving, -1:] * changed
        wearing, (factor, factor_slope) = self.wearing.rubbing(friction), contact.wear_factor
        pushed = factor_slope * wearing.work(*worn_by(at)) + factor * slope * wearing.by_friction(at.slip_work)
        growth_tangent = wearing.growth_tangent(
            self.wear_gain * factor,
            worn_by(at),
            (work_tangent, force_tangent[:, 0, :]),
            (self.wear_gain * pushed)[:, None] * energy_tangent,
        )
        flexibility, softens = contact.flexibility
        eased = (softens[:, :, None] * at.force_h).reshape(energy_tangent.shape)
        tangents = force_tangent, growth_tangent, flexibility, eased, energy_tangent, work_tangent, by_friction
        return Linearisation(self.joint, at, *tangents)


@packable
@dataclass(frozen=True)
class Evaluation(Marched):
    """Residual for a predicted force, with the contact forces and states of the pairs.

    - predicted_h, residual (n_rel, 2H+1): N. scale: of the residual in the static and in the other harmonics, N.
    - start_history (n_contact, n_history): with which the period begins, m.
    - displacement_h (n_contact, 3, 2H+1): motion of the contact, m; that of the structure is `Joint.motion`.
    - wear_depth, energy (n_contact,): m, J/m2; at the end of the step in an implicit step.
    """

    predicted_h: FloatArray
    residual: FloatArray
    scale: tuple[float, float]
    start_history: FloatArray
    displacement_h: FloatArray
    wear_depth: FloatArray
    energy: FloatArray

    @property
    def slow(self) -> FloatArray:
        """What changes slowly (2, n_contact): wear depth, m, and dissipated energy, J/m2."""
        return np.array([self.wear_depth, np.broadcast_to(self.energy, self.wear_depth.shape)])

    def scaled_residual(self, scale: tuple[float, float] | None = None) -> float:
        """Euclidean norm of the residual, with the static harmonic and the other harmonics divided by their scales."""
        static, moving = scale or self.scale
        errors = np.linalg.norm(self.residual[:, 0]) / static, np.linalg.norm(self.residual[:, 1:]) / moving
        return float(np.hypot(*errors))


def worn_by(at: Evaluation) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Arguments of a wear law in a state, each (n_contact,): slip work, J, mean normal force, N, depth, m."""
    return at.slip_work, at.force_h[:, 0, 0], at.wear_depth


def _residual_scale(reduced_force: FloatArray, contact_force: FloatArray) -> tuple[float, float]:
    """Scales of the residual, N, static and vibrating: a large preload must not hide an error of the vibration."""
    moving = max(float(np.linalg.norm(reduced_force[:, 1:])), float(np.linalg.norm(contact_force[:, 1:])))
    static = max(float(np.linalg.norm(reduced_force[:, 0])), float(np.linalg.norm(contact_force[:, 0])), moving)
    if static == 0.0:
        return 1.0, 1.0
    # a smaller vibration is lost in the round-off of the static force
    return static, max(moving, NEGLIGIBLE * static)


@dataclass(frozen=True)
class Linearisation:
    """`dR/dp = Z_r motion_tangent + force_tangent` at a point, both (n_contact, 3m, 3m) blocks of the pairs, m = 2H+1.

    growth_tangent, energy_tangent (n_contact, 3m): derivatives of the wear depth, m/N, which is a part of the static
    normal motion, and of the dissipated energy, 1/m2. flexibility (n_contact, 3): motion of the structure over contact
    force, m/N, beside that of the contact; eased (n_contact, 3m): that motion over the dissipated energy, m3/J.
    work_tangent, by_friction: of the slip work, and by the friction coefficient, as in `Tangents`.
    Columns of pairs that stick during the whole period, without flexibility, are those of the identity: only `active`
    pairs are coupled.
    """

    joint: Joint
    at: Marched
    force_tangent: FloatArray
    growth_tangent: FloatArray
    flexibility: FloatArray
    eased: FloatArray
    energy_tangent: FloatArray
    work_tangent: FloatArray
    by_friction: FloatArray

    @property
    def motion_tangent(self) -> FloatArray:
        """`du/dp` (n_contact, 3m, 3m), m/N, Eq. (12), with the wear and the flexibility of the contact."""
        size = self.force_tangent.shape[1]
        transmitted = self.force_tangent.reshape(-1, 3, size // 3, size)
        correction = np.eye(size).reshape(3, size // 3, size) - transmitted
        tangent = self.joint.law.motion(correction) + self.flexibility[:, :, None, None] * transmitted
        tangent = tangent.reshape(-1, size, size) + self.eased[:, :, None] * self.energy_tangent[:, None, :]
        tangent[:, 0, :] += self.growth_tangent
        return tangent

    @cached_property
    def active(self) -> IntArray:
        """Pairs whose motion depends on their predicted force."""
        return np.flatnonzero(~self.at.stuck | self.flexibility.any(axis=1))

    @cached_property
    def active_rows(self) -> IntArray:
        """Relative displacements of the active pairs."""
        return self.joint.rows_of(self.active)

    @cached_property
    def passive_rows(self) -> IntArray:
        """All other relative displacements."""
        return np.delete(np.arange(self.joint.component_index.size), self.active_rows)

    def apply(self, step: FloatArray, *, roughly: bool = False) -> FloatArray:
        """Jacobian times a step (n_rel, m), N; roughly: to at least three digits."""
        rest, motion = self.rest_and_motion(step)
        return self.joint.structure.apply(motion, roughly=roughly) + step - rest

    def rest_and_motion(self, step: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Part of a step (n_rel, m), N, that the pairs do not transmit, and their motion (n_rel, m), m."""
        joint = self.joint
        by_energy = self.eased, self.energy_tangent
        blocks = self.force_tangent, joint.law.compliance, self.growth_tangent, self.flexibility, by_energy
        return untransmitted(np.ascontiguousarray(step), joint.contact.pair_rows, self.active, *blocks)

    def apply_transposed(self, weight: FloatArray) -> FloatArray:
        """Transposed Jacobian times y (n_rel, m)."""
        return self.by_predicted_force(self.joint.structure.apply_transposed(weight), weight)

    def by_predicted_force(self, on_motion: FloatArray, on_force: FloatArray) -> FloatArray:
        """Derivative (n_rel, m), per N, of a scalar with derivatives a by the motion of the structure, per m, and b by
        the contact force, per N, both (n_rel, m): `motion_tangent^T a + force_tangent^T b`.
        """
        joint, places = self.joint, self.active
        moved, forced = joint.to_pairs(on_motion), joint.to_pairs(on_force)
        back, eased = joint.law.motion_transposed(moved), (self.eased * moved.reshape(self.eased.shape)).sum(axis=1)
        through = (forced - back + self.flexibility[:, :, None] * moved).reshape(len(eased), -1)
        found = np.einsum("pij,pi->pj", self.force_tangent[places], through[places])
        found += self.growth_tangent[places] * moved[places, 0, :1] + self.energy_tangent[places] * eased[places, None]
        # the other pairs transmit the predicted force, and do not move
        forced[places] = back[places] + found.reshape(forced[places].shape)
        return joint.to_relative(forced)

    def dense(self, pairs: IntArray, width: int | None = None) -> FloatArray:
        """Rows and columns (displacement, coefficient) of the Jacobian for some pairs and their first `width`
        coefficients, by default all.
        """
        motion, matrix = self.matrices(pairs, width)
        rows, k, structure = self.joint.rows_of(pairs), motion.shape[1], self.joint.structure
        matrix[:, 0] += structure.static_stiffness[np.ix_(rows, rows)] @ motion[:, 0]
        if k > 1:
            amplitude = (motion[:, 1::2] - 1j * motion[:, 2::2]).transpose(1, 0, 2)
            stiffness = structure.moving.block(k // 2, rows)
            moved = np.matmul(stiffness, amplitude).transpose(1, 0, 2)
            matrix[:, 1::2] += moved.real
            matrix[:, 2::2] -= moved.imag
        return np.asarray(matrix.reshape(rows.size * k, rows.size * k))

    def matrices(self, pairs: IntArray, width: int | None = None) -> FloatArray:
        """`du/dp`, m/N, and `dlambda/dp` (2, n, k, n k) of the n displacements of some pairs; order as in `dense`."""
        m, rows = self.joint.basis.synthesis.shape[0], self.joint.rows_of(pairs)
        pair, component = np.divmod(self.joint.component_index[rows], 3)
        blocks = self.motion_tangent[pairs], self.force_tangent[pairs]
        return spread_blocks(np.array(blocks), np.searchsorted(pairs, pair), component, width or m)


def spread_blocks(blocks: FloatArray, pair: IntArray, component: IntArray, width: int) -> FloatArray:
    """Blocks (2, p, 3m, 3m) of pairs over the rows and columns (n,) of existing displacements (2, n, k, n k).

    pair, component (n,): of each displacement. width: k, the first coefficients of m.
    """
    n, m = pair.size, blocks.shape[2] // 3
    spread = np.zeros((2, n, width, n, width))
    row, column = np.nonzero(pair[:, None] == pair[None, :])
    for place, part in enumerate(blocks):
        each = part.reshape(-1, 3, m, 3, m)[:, :, :width, :, :width]
        spread[place][row, :, column] = each[pair[row], component[row], :, component[column]]
    return spread.reshape(2, n, width, n * width)


@njit(cache=True)
def untransmitted(
    step: FloatArray,
    rows: IntArray,
    active: IntArray,
    force_tangent: FloatArray,
    compliance: ComplexArray,
    growth: FloatArray,
    flexibility: FloatArray,
    by_energy: tuple[FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """Part of a predicted force (n_rel, m), N, that the pairs do not transmit, and their motion (n_rel, m), m.

    rows (n_contact, 3): row of each component, -1 for none. compliance (n_contact, 3, H+1): displacement per force in
    each harmonic, m/N. by_energy: `eased` and `energy_tangent`. The others as in `Linearisation`.
    """
    m, (eased, energy_tangent) = step.shape[1], by_energy
    rest, motion = np.zeros(step.shape), np.zeros(step.shape)
    own, passed, grown = np.empty((3 * m, 1)), np.empty((3 * m, 1)), np.empty((1, 1))
    for pair in active:
        for i in range(3):
            for k in range(m):
                own[i * m + k, 0] = step[rows[pair, i], k] if rows[pair, i] >= 0 else 0.0
        np.dot(force_tangent[pair], own, passed)
        for i in range(3):
            row = rows[pair, i]
            if row < 0:
                continue
            for k in range(m):
                rest[row, k] = own[i * m + k, 0] - passed[i * m + k, 0]
            motion[row, 0] = compliance[pair, i, 0].real * rest[row, 0]
            for n in range(1, m // 2 + 1):
                cosine, sine, of = rest[row, 2 * n - 1], rest[row, 2 * n], compliance[pair, i, n]
                # a complex amplitude is cosine - i sine
                motion[row, 2 * n - 1] = of.real * cosine + of.imag * sine
                motion[row, 2 * n] = of.real * sine - of.imag * cosine
            if i == 0:
                np.dot(growth[pair : pair + 1], own, grown)
                motion[row, 0] += grown[0, 0]
            for k in range(m):
                motion[row, k] += flexibility[pair, i] * passed[i * m + k, 0]
        np.dot(energy_tangent[pair : pair + 1], own, grown)
        for i in range(3):
            for k in range(m if rows[pair, i] >= 0 else 0):
                motion[rows[pair, i], k] += eased[pair, i * m + k] * grown[0, 0]
    return rest, motion

"""Derivatives of a balance by its parameters, at a fixed predicted force: by friction, gap, contact stiffness and wear
coefficient of each pair, and by the load. That by the frequency is `frequency_derivative` of
`solver.continuation.phase_lag`.

A parameter of a pair changes what this pair alone does. With the changes du of its motion and dlambda of its force the
residual, Eq. (8), changes by `Z_r du + dlambda`.
"""

from dataclasses import dataclass

import numpy as np

from solver.harmonic_balance.dlft import Balance, Evaluation, Linearisation, worn_by
from solver.model import FloatArray
from solver.structure.condensation import build_structure
from solver.structure.joint import Joint


@dataclass(frozen=True)
class PairSlope:
    """Derivatives by a parameter of each pair: of the motion of the structure at this pair and of its contact force,
    both (n_contact, 3, m), m and N per unit, and of its slip work (n_contact,), J per unit.
    """

    motion: FloatArray
    force: FloatArray | float = 0.0
    work: FloatArray | float = 0.0


def by_friction(balance: Balance, at: Evaluation, tangent: Linearisation) -> PairSlope:
    """By the friction coefficients; at a given dissipated energy."""
    joint, found = balance.joint, tangent.by_friction
    force, work = found[:, :-1].reshape(at.force_h.shape), found[:, -1]
    motion = joint.law.motion(-force) + tangent.flexibility[:, :, None] * force
    contact = joint.model.contact.after(at.energy)
    wearing, gain = balance.wearing.rubbing(contact.friction), balance.wear_gain * contact.wear_factor[0]
    pushed = (gain * wearing.by_friction(at.slip_work))[:, None]
    motion[:, 0, :1] += wearing.growth_tangent(gain, worn_by(at), (work[:, None], force[:, 0, :1]), pushed)
    return PairSlope(motion, force, work)


def by_gap(at: Evaluation) -> PairSlope:
    """By the initial gaps, m: the motion of a pair that presses begins so much later."""
    motion = np.zeros_like(at.force_h)
    motion[:, 0, 0] = 1.0
    return PairSlope(motion)


def by_contact_stiffness(balance: Balance, at: Evaluation, stiffness: FloatArray | float) -> PairSlope:
    """By the stiffnesses of the contact, `solver.compliant_contact`, N/m3, of pairs that rub and have these ones."""
    softer = -balance.joint.model.contact.flexibility_share / np.square(stiffness)[..., None]
    return PairSlope(softer[:, :, None] * at.force_h)


def by_wear_coefficient(balance: Balance, at: Evaluation) -> PairSlope:
    """By the logarithms of the wear coefficients k_w: the depth at the end of an implicit step, Eq. (24)."""
    contact, motion = balance.joint.model.contact.after(at.energy), np.zeros_like(at.force_h)
    wearing, gain = balance.wearing.rubbing(contact.friction), balance.wear_gain * contact.wear_factor[0]
    grown, nothing = (gain * wearing.work(*worn_by(at)))[:, None], np.zeros((len(motion), 1))
    motion[:, 0, :1] = wearing.growth_tangent(gain, worn_by(at), (nothing, nothing), grown)
    return PairSlope(motion)


def by_load(joint: Joint) -> FloatArray:
    """By the excitation amplitude, N: of the residual (n_rel, m), 1."""
    slope = -build_structure(joint.model, joint.omega, 1.0, joint.basis.orders).force_h
    slope[:, 0] = 0.0
    return slope

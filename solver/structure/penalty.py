"""The penalty of each pair and the formulation that suits it, from the scene alone.

With any penalty the balance is exact as the number of harmonics grows; at a finite number it is as good as those of the
*predicted* force that are left out are small. With the structure's stiffness `Z_n` these are
`(1 - E_n / Z_n) lambda_n`, where E_n is the penalty as it acts on the displacement. So E_n has to be near Z_n above the
highest harmonic:

- a pair on an elastic joint, whose stiffness no longer changes with frequency, is taken at displacement level, with
  E_n = eps near that stiffness, Eq. (10);
- a mass that sits directly on a slider (`Z_n` near `-(n w)^2 m`) is marched with its mass
  (`solver.contact.rigid_slider`),
  `E_n = -(n w)^2 m + i n w c`;
- a mass that a stiff spring ties to its slider is marched with its mass as long as the harmonics left out see that, and
  taken at displacement level from where they see the spring.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.model import BoolArray, FloatArray, Matrix, ReducedModel
from solver.structure.condensation import condense, relative_indices

INERTIAL = 2.0  # ratio of the stiffness at twice the rate to that at the rate: 1 for a spring, 4 for a mass
INERTIAL_RATE = 8.0  # of the frequency: where that is judged first, for any number of harmonics alike
DRAG = 0.1  # of m w: forgets the start of a period to a half within the next
STATIC_SHARE = 1e-5  # of the stiffness at the frequency: what holds the mean position of a marched mass


@dataclass(frozen=True)
class Penalty:
    """normal, tangential (n_contact,): N/m. inertial (n_contact,): whether the pair is marched with its mass.

    mass (n_contact,): kg. drag (n_contact,): N s/m. mean (n_contact,): N/m, holds the mean tangential position of pairs
    that are marched with their mass: their friction force alone leaves it undetermined while they stick. It is so small
    that it does not hold one that slips. These three are used for inertial pairs only, `tangential` for the others.
    """

    normal: FloatArray
    tangential: FloatArray
    inertial: BoolArray
    mass: FloatArray
    drag: FloatArray
    mean: FloatArray


def build_penalty(model: ReducedModel, omega: float, highest: int) -> Penalty:
    """Penalty from the condensed `K + s^2 M` at the real rate s of the first harmonic left out, `(highest + 1) omega`.

    At a real rate the structure has no resonances: it shows an elastic joint its stiffness and a slider its mass.
    """
    rate = (highest + 1) * omega
    size = _stiffness_at(model, rate)
    low, high = (_stiffness_at(model, times * INERTIAL_RATE * omega)[:, 1] for times in (1.0, 2.0))
    has_tangent = (model.contact.dofs[:, 1:] >= 0).any(axis=1)
    inertial = has_tangent & (high > INERTIAL * low)
    if inertial.any() and highest + 1 > INERTIAL_RATE:
        # a mass behind a spring: harmonics that see the spring alone are not left to the mass
        inertial &= _stiffness_at(model, 2.0 * rate)[:, 1] > INERTIAL * size[:, 1]
    mass = np.ones(size.shape[0])
    if inertial.any():
        mass[inertial] = _mass_at(model, rate)[inertial]
    return Penalty(
        normal=size[:, 0],
        tangential=size[:, 1],
        inertial=inertial,
        mass=mass,
        drag=DRAG * mass * omega,
        mean=STATIC_SHARE * _stiffness_at(model, omega)[:, 1],
    )


def _stiffness_at(model: ReducedModel, rate: float) -> FloatArray:
    """Diagonal of the condensed `K + s^2 M` at each pair, normal and (larger) tangential, (n_contact, 2), N/m.

    The diagonal is what a pair shows that moves alone. Measured on the dovetail sector at resonance: three times as
    much takes four times the Newton iterations, half as much takes as many, all within 1 % in the response.
    """
    _, slots = relative_indices(model.contact)
    size = np.zeros((model.contact.n_contact, 2))
    diagonal = np.real(np.diag(_condensed_at(model, rate)))
    np.maximum.at(size, (slots // 3, np.minimum(slots % 3, 1)), diagonal)
    # a pair without such a displacement, or one that nothing resists, still needs a number to divide by
    return np.where(size > 0.0, size, 1.0)


def _mass_at(model: ReducedModel, rate: float) -> FloatArray:
    """Mass (n_contact,), kg, that a pair moves against a force along a tangent, all other pairs being free."""
    _, slots = relative_indices(model.contact)
    # 1 / G grows as k + m s^2 where it is inertial, G the compliance
    low, high = (1.0 / compliance_at(model, s) for s in (rate, 2.0 * rate))
    mass = np.full(model.contact.n_contact, np.inf)
    tangent = slots % 3 > 0
    np.minimum.at(mass, slots[tangent] // 3, ((high - low) / (3.0 * rate**2))[tangent])
    return mass


def compliance_at(model: ReducedModel, rate: float) -> FloatArray:
    """Compliance (n_rel,), m/N, of each relative displacement at a real rate, 1/s, all others being free."""
    return np.asarray(np.real(np.diag(np.linalg.inv(_condensed_at(model, rate)))))


def _condensed_at(model: ReducedModel, rate: float) -> Matrix:
    relative, _ = relative_indices(model.contact)
    linear, _ = model.harmonic_structure(1)
    full = linear.stiffness + rate**2 * linear.mass
    return condense(full, relative, np.zeros(full.shape[0])).stiffness


def static_penalty(penalty: Penalty) -> Penalty:
    """The same penalty for a static state, in which nothing is inertial: every pair at displacement level."""
    none = np.zeros_like(penalty.inertial)
    return Penalty(penalty.normal, penalty.tangential, none, penalty.mass, penalty.drag, penalty.mean)

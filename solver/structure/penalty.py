"""The penalty eps of each pair, Eq. (9), and the formulation of the pair (elastic or inertial), from the scene alone.

The error of a balance comes from the harmonics of the *predicted* force that are left out, `(1 - E_n / Z_n) lambda_n`
with the stiffness Z_n of the structure and the penalty E_n. So E_n has to be near Z_n above the highest harmonic:

- A pair on an elastic joint is taken at displacement level, with E_n = eps near its stiffness, Eq. (10).
- A mass directly on a slider (`Z_n` near `-(n w)^2 m`) is inertial: the pair is marched with its mass
  (`solver.contact.sliding_masses`), with `E_n = -(n w)^2 m + i n w c`. So is a mass behind a stiff spring where the
  mass dominates in the harmonics that are left out.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from solver.model import BoolArray, FloatArray, IntArray, LinearModel, ReducedModel
from solver.structure.ring import RingModel
from solver.structure.schur import condense, regular

INERTIAL_RATIO = 2.0
"""Ratio of the stiffness at twice a rate to the stiffness at the rate, above which a pair is inertial: 1 for a spring,
4 for a mass. With 4 no pair is inertial, and the motion of the two masses is 20 % off with H = 5; with 1.5 and 3
slider, masses, waves and blocks are equal."""

INERTIAL_RATE = 8.0
"""Rate of the first test for `INERTIAL_RATIO` over the frequency, for any number of harmonics. Half and twice: slider,
masses, waves and blocks are equal."""

DRAG_FRACTION = 0.1
"""Drag of an inertial pair over m w: the mean velocity falls to exp(-2 pi 0.1) = 0.53 of its value in a period. Half
and twice the value change the motion of slider and two masses by 1e-4."""

HOLD_FRACTION = 1e-5
"""Stiffness on a mean position that friction alone determines, over the stiffness of the joint at the frequency, and
the most that such a hold takes up, over the friction of all pairs. Motion and wear change by this fraction at most, far
below any rtol: half and twice the value change states of masses by at most 3e-6; the hold of the dovetail, friction
0.3, 1 N, has 5e-7 to 2e-6 of the friction after 20 000 cycles."""


@dataclass(frozen=True)
class Penalty:
    """Penalties of the pairs, Eq. (9), and masses of the inertial pairs.

    - normal, tangential (n_contact,): eps, N/m; `tangential` for elastic pairs only.
    - inertial (n_contact,): whether the pair is marched with its mass. The others are for inertial pairs only:
    - mass, drag (n_contact,): kg, N s/m.
    - mean (n_contact,): stiffness on the mean tangential position, N/m, which friction alone does not determine while
      such a pair sticks. It is too small to hold a pair that slips.
    """

    normal: FloatArray
    tangential: FloatArray
    inertial: BoolArray
    mass: FloatArray
    drag: FloatArray
    mean: FloatArray

    def at(self, places: IntArray) -> "Penalty":
        """That of some pairs (k,)."""
        return Penalty(*(each[places] for each in vars(self).values()))

    @property
    def stiffness(self) -> FloatArray:
        """Penalty (n_contact, 3), N/m, of the three displacements of elastic pairs."""
        return np.stack([self.normal, self.tangential, self.tangential], axis=1)


def build_penalty(model: ReducedModel, omega: float, highest: int) -> Penalty:
    """Penalty from the condensed `K + s^2 M` at the real rate s = `(highest + 1) omega`, the first harmonic left out.

    At a real rate the structure has no resonances: an elastic joint acts as a stiffness, a slider as a mass.
    omega: rad/s. highest: highest harmonic of the balance. A ring has that of its sector.
    """
    if isinstance(model, RingModel):
        of_sector = build_penalty(model.tuned, omega, highest)
        return Penalty(*(np.tile(each, model.n_sectors) for each in vars(of_sector).values()))
    rate, contact = (highest + 1) * omega, model.contact
    size = _stiffness_at(model, rate)
    low, high = (_stiffness_at(model, times * INERTIAL_RATE * omega)[:, 1] for times in (1.0, 2.0))
    inertial = contact.rubs & (contact.dofs[:, 1:] >= 0).any(axis=1) & (high > INERTIAL_RATIO * low)
    if inertial.any() and highest + 1 > INERTIAL_RATE:
        # a mass behind a spring: where the spring dominates in the harmonics left out, the pair is elastic
        inertial &= _stiffness_at(model, 2.0 * rate)[:, 1] > INERTIAL_RATIO * size[:, 1]
    mass = np.ones(contact.n_contact)
    if inertial.any():
        # the mass that a tangential force accelerates, with all other pairs free: 1 / G = k + m s^2, compliance G
        of = model.harmonic_structure(1), tuple(contact.relative.tolist())
        low, high = (1.0 / _diagonal(*of, s, compliance=True) for s in (rate, 2.0 * rate))
        pair, component = np.divmod(contact.component_index, 3)
        least, tangent = np.full(contact.n_contact, np.inf), component > 0
        np.minimum.at(least, pair[tangent], ((high - low) / (3.0 * rate**2))[tangent])
        mass[inertial] = least[inertial]
    return Penalty(
        normal=size[:, 0],
        tangential=size[:, 1],
        inertial=inertial,
        mass=mass,
        drag=DRAG_FRACTION * mass * omega,
        mean=HOLD_FRACTION * _stiffness_at(model, omega)[:, 1],
    )


def _stiffness_at(model: ReducedModel, rate: float) -> FloatArray:
    """Stiffness of each pair that moves alone, normal and (larger) tangential, (n_contact, 2), N/m. With three times
    the value the dovetail at resonance takes four times the Newton iterations; its responses agree within 1 %.
    """
    relative, components = model.contact.relative, model.contact.component_index
    size = np.zeros((model.contact.n_contact, 2))
    diagonal = _diagonal(model.harmonic_structure(1), tuple(relative.tolist()), rate, compliance=False)
    np.maximum.at(size, (components // 3, np.minimum(components % 3, 1)), diagonal)
    # a pair without such a displacement or without stiffness still needs a divisor
    return np.where(size > 0.0, size, 1.0)


@lru_cache(maxsize=64)
def _diagonal(linear: LinearModel, relative: tuple[int, ...], rate: float, *, compliance: bool) -> FloatArray:
    """Diagonal (n_rel,) of the condensed `K + s^2 M`, N/m, or of its inverse, m/N: the same for many states."""
    full = linear.stiffness + rate**2 * linear.mass
    with regular(f"in motions that grow at {rate:.6g} 1/s: a part has neither mass nor stiffness"):
        condensed = condense(full, np.array(relative, np.intp), np.zeros(full.shape[0])).stiffness
        return np.asarray(np.real(np.diag(np.linalg.inv(condensed) if compliance else condensed)))

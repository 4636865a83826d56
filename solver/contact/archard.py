"""Archard's wear law: slip work, rate, growth. All laws are this one with another work (`solver.contact.wear_law`).

Nothing here is compiled; the kernels compile what they use.

The depth of a pair grows by `k_w / alpha` times the normal force times the slip, Eq. (7); over a cycle, Eq. (21):

    g = k_w / alpha * slip work,      slip work = integral over a period of lambda_N |dX_T|

Two quantities in J are told apart:

- *slip work*: normal force times slip distance. It is no work of any force; Archard's law is proportional to it.
- *friction work*: what friction dissipates, the integral of lambda_T . dX_T. Friction is at its limit wherever a pair
  slips, so that it is the friction coefficient of the pair times its slip work
  (`alternating_frequency_time.friction_work`).

An implicit step of h cycles, Eq. (24), solves for a depth that grows with the slip work of the state that is sought:
its gain is the derivative of the growth with respect to the slip work (the print of (26b) lacks h).
"""

from __future__ import annotations

from solver.model import FloatArray


def slip_work_rate(normal: float, speed: float) -> float:
    """Slip work per time, W, of a normal force, N, and a sliding speed, m/s; per increment with the slip of one."""
    return normal * speed


def slip_work_slopes(normal: float, speed: float) -> tuple[float, float]:
    """Derivatives of `slip_work_rate` with respect to the normal force and to the speed."""
    return speed, normal


def wear_gain(wear_coefficient: float, area: FloatArray, cycles: float) -> FloatArray:
    """Growth of the depth per slip work (n_contact,), m/J, in so many cycles: `h k_w / alpha`, Eqs. (7), (24).

    wear_coefficient: 1/Pa. area (n_contact,): weights alpha of the pairs, m2.
    """
    return cycles * wear_coefficient / area


def wear_rate(wear_coefficient: float, area: FloatArray, wearing_work: FloatArray) -> FloatArray:
    """Wear rate g (n_contact,), m per cycle, Eqs. (7), (21), of the work that wears in a cycle (n_contact,), J."""
    return wear_gain(wear_coefficient, area, 1.0) * wearing_work


def volume_rate(wear_coefficient: float, wearing_work: float) -> float:
    """Volume that a work, J, wears off in a cycle, m3: depth times area, so that the area does not matter."""
    return wear_coefficient * wearing_work

"""Archard's wear law: all that depends on which law it is. Nothing here is compiled; the kernels compile what they use.

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

from dataclasses import dataclass

from solver.model import FloatArray


@dataclass(frozen=True)
class WearLaw:
    """What others than the solver have to know of a wear law.

    name: as a study names it. proportional: whether the rate is proportional to the wear coefficient,
    `dW/dt = k_w f(W)`: then a history depends on wear coefficient and cycles through `k_w` times cycles only, and
    nothing wears at 0.
    """

    name: str
    proportional: bool


ARCHARD = WearLaw("archard", proportional=True)


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


def wear_growth(gain: FloatArray, slip_work: FloatArray) -> FloatArray:
    """Growth of the depth (n_contact,), m, from the gain, m/J, and the slip work of a cycle, J, both (n_contact,)."""
    return gain * slip_work


def wear_growth_tangent(gain: FloatArray, slip_work_tangent: FloatArray) -> FloatArray:
    """Derivative of the growth, (n_contact, k), from that of the slip work (n_contact, k)."""
    return gain[:, None] * slip_work_tangent


def wear_rate(wear_coefficient: float, area: FloatArray, slip_work: FloatArray) -> FloatArray:
    """Wear rate g (n_contact,), m per cycle, Eqs. (7), (21)."""
    return wear_growth(wear_gain(wear_coefficient, area, 1.0), slip_work)


def volume_rate(wear_coefficient: float, slip_work: float) -> float:
    """Volume that a slip work, J, wears off in a cycle, m3: depth times area, so that the area does not matter."""
    return wear_coefficient * slip_work

"""Archard's wear law: slip work, wear rate, growth of the depth.

The other wear laws replace the slip work by another work (`solver.contact.wear_law`). These functions are plain Python;
the kernels compile them.

The wear depth of a pair grows by `k_w / alpha` times normal force times slip, Eq. (7). The growth in a cycle is,
Eq. (21):

    g = k_w / alpha * slip work,      slip work = integral over a period of lambda_N |dX_T|

Two quantities in J must not be confused:

- *slip work*: normal force times slip distance. Archard's law is proportional to the slip work, which is no work of a
  force.
- *friction work*: energy dissipated by friction, the integral of lambda_T . dX_T. The friction force is at its limit
  during slip, so that friction work is friction coefficient times slip work
  (`law.ContactLaw.friction_work`).

In an implicit step of h cycles, Eq. (24), the depth grows with the slip work of the unknown state at the end of the
step. The gain is the derivative of the growth with respect to the slip work (the print of (26b) lacks h).
"""

from __future__ import annotations

from solver.model import FloatArray


def slip_work_rate(normal: float, speed: float) -> float:
    """Slip work per time, W, from normal force, N, and sliding speed, m/s; or slip work, J, with slip, m, for speed."""
    return normal * speed


def slip_work_slopes(normal: float, speed: float) -> tuple[float, float]:
    """Derivatives of `slip_work_rate` with respect to the normal force and to the speed."""
    return speed, normal


def wear_gain(wear_coefficient: float, area: FloatArray, cycles: float) -> FloatArray:
    """Growth of the depth per slip work (n_contact,), m/J, in h = `cycles`: `h k_w / alpha`, Eqs. (7), (24).

    wear_coefficient: 1/Pa. area (n_contact,): weights alpha of the pairs, m2.
    """
    return cycles * wear_coefficient / area


def wear_rate(wear_coefficient: float, area: FloatArray, wearing_work: FloatArray) -> FloatArray:
    """Wear rate g (n_contact,), m per cycle, Eqs. (7), (21), from the wearing work of a cycle (n_contact,), J."""
    return wear_gain(wear_coefficient, area, 1.0) * wearing_work


def volume_rate(wear_coefficient: float, wearing_work: float) -> float:
    """Worn volume per cycle, m3, from the wearing work of a cycle, J; depth times area, so that the area cancels."""
    return wear_coefficient * wearing_work

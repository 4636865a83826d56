"""Worn depth within a step on the slow time scale, between the states at its ends."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from solver.model import FloatArray


def depth_within(
    fraction: FloatArray,
    length: float,
    before: tuple[FloatArray, FloatArray],
    after: tuple[FloatArray, FloatArray],
    smooth: bool,
) -> FloatArray:
    """Worn depth within a step.

    Linear, or a cubic Hermite polynomial. The slopes of the cubic are limited so that the depth never falls: a cubic is
    monotone where both slopes are at most three times the mean slope (Fritsch and Carlson 1980).

    Parameters
    ----------
    fraction
        (n,), fractions of the step.
    length
        Length of the step, cycles.
    before, after
        Depth, m, and wear rate, m per cycle, both (n_contact,), at the ends of the step.
    smooth
        True for the cubic, False for the line.

    Returns
    -------
    FloatArray
        (n, n_contact), m.
    """
    s = fraction[:, None]
    grown = after[0] - before[0]
    if not smooth or length <= 0.0:
        return np.asarray(before[0] + s * grown)
    slopes = bent_within(grown, length, before[1], after[1])
    bent = (1.0 - s) ** 2 * s * slopes[0] - s**2 * (1.0 - s) * slopes[1]
    return np.asarray(before[0] + s**2 * (3.0 - 2.0 * s) * grown + bent)


def bent_within(grown: FloatArray, length: float, first: FloatArray, last: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Slopes of the cubic at both ends of a step, times its length, m, limited so that the depth never falls.

    grown (n_contact,): growth of the depth over the step, m.
    length: length of the step, cycles.
    first, last (n_contact,): wear rates at the ends of the step, m per cycle.
    """
    return np.minimum(first * length, 3.0 * grown), np.minimum(last * length, 3.0 * grown)


def fraction_where(value: float, volume: Callable[[float], float]) -> float:
    """Fraction of a step at which a monotone function of the fraction reaches a value.

    volume: the function, never falling; 0 or 1 is returned for a value beyond its ends.
    """
    if volume(0.0) >= value or volume(1.0) <= value:
        return 0.0 if volume(0.0) >= value else 1.0
    from scipy.optimize import brentq  # where it is used: it takes a while to load

    return float(brentq(lambda fraction: volume(fraction) - value, 0.0, 1.0, xtol=1e-12))

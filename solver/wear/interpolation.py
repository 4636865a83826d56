"""Worn depth within a step on the slow time scale, between the states at its ends."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

from solver.model import FloatArray


def depth_within(
    fraction: FloatArray,
    length: float,
    before: tuple[FloatArray, FloatArray],
    after: tuple[FloatArray, FloatArray],
    smooth: bool,
) -> FloatArray:
    """Worn depth within a step.

    Linear, or smooth: Hermite's cubic with slopes that are cut so that wear never falls; a cubic is monotone where both
    slopes are at most three times the mean one (Fritsch and Carlson 1980).

    Parameters
    ----------
    fraction
        (n,), of the step.
    length
        Of the step, cycles.
    before, after
        Depth, m, and wear rate, m per cycle, both (n_contact,), at the ends of the step.
    smooth
        Whether the cubic is taken.

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
    """Slopes of the depth at both ends of a step of `length` cycles, over the step, m; none so steep that it falls.

    grown: depth that the step wears, m. first, last: wear rates at its ends, m per cycle. All (n_contact,).
    """
    return np.minimum(first * length, 3.0 * grown), np.minimum(last * length, 3.0 * grown)


def fraction_where(value: float, volume: Callable[[float], float]) -> float:
    """Fraction of a step at which a function of the fraction that never falls comes to a value.

    volume: the function, at 1 at least the value.
    """
    if volume(0.0) >= value or volume(1.0) <= value:
        return 0.0 if volume(0.0) >= value else 1.0
    return float(brentq(lambda fraction: volume(fraction) - value, 0.0, 1.0, xtol=1e-12))

"""What a hair decides in a history, and its difference to another solution does not show, as both decide it alike.

Equal pairs. A joint that is symmetric wears symmetrically only as long as this is stable: where a pair wears the faster
the deeper it is, any disturbance grows, and round-off decides which one of equal pairs goes ahead. A reference solution
goes to the same side in half of all cases. Each of these pairs may have the depth of the other. Dovetail, 212.087 Hz,
1.04 N, 16 pairs: depths of 8 pairs that differ by 5 % from their equals, where 1.3 % was told.

Pairs that cease to wear. With a rate r that grows by itself, dr/dn = g r - s, a pair ceases to wear, unless its rate is
larger by -dr/dn / g: then it wears on, and faster and faster. History and reference solution, both with few harmonics
or long steps, may see it cease although it does not. Where the history is above the coarser reference solution, the
truth is above the history; how far, tells their difference at some count before, grown until then. Dovetail, 212.281
Hz, 1.16 N, `rtol` 0.1: 147 mm3 for 45, where 4 % were told. The difference when the pair ceases is as in other loads.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from solver.model import BoolArray, FloatArray
from solver.settings import ROUND_OFF, SMALL
from solver.wear.slow_time import Course
from solver.wear.step import rate_slope
from solver.wear.wearing_joint import WearingJoint, WearState

WINDOW = 0.5
"""Fraction of the count at which a pair ceases to wear from which on rates are compared, as `CROSSING_WINDOW`; and not
before the last time in which a difference grows by e, as g is not constant for longer."""

BESIDE = 3.0
"""How far the true rate of such a pair may be above that of the history, over how far that is above the reference
solution. The 147 mm3 of above, with `rtol` 0.2 to 0.07: this is 1.5 to 0.37 times what it may be, -dr/dn / g. Other
random loads, 61 with `rtol` 0.1 and ten with 0.01, that slide: at most 0.30. Mesh 2, 211 to 212.75 Hz: below 0.15, and
0.85 at 212.5 Hz, where 0.072 or 0.094 mm3 wear, by the harmonics of the sweep."""


def own_growth(wearing: WearingJoint, state: WearState, end: WearState) -> FloatArray:
    """Rise of the wear rate of each pair with its own depth (n_contact,), 1 per cycle, where it is above 0 and the pair
    ceases to wear between a state and the end of a step; else 0.
    """
    before, after = (each.rate > ROUND_OFF * each.rate.max(initial=0.0) for each in (state, end))
    if not (ceases := before & ~after).any():
        return np.zeros(ceases.size)
    # the next step shall not depend on this factorisation
    own, wearing.run = wearing.run, wearing.run.fresh()
    slope = np.diag(rate_slope(wearing, state, ceases))
    wearing.run = own
    return np.maximum(np.nan_to_num(slope, nan=1.0, posinf=1.0), 0.0)


def undecided_from(course: Course, other: Course) -> float:
    """Count from which on it is not known whether a pair goes on to wear; inf if it is always known.

    course: of a history, whose nodes have the `own_growth` of their step. other: of its reference solution.
    """
    if "own_growth" not in course.nodes[-1].values:
        return math.inf
    at, rates = course.counts, course.rates
    for end in range(1, at.size):
        growth = course.nodes[end].values["own_growth"]
        for pair in np.flatnonzero(growth):
            g, ceases = growth[pair], at[end - 1]
            # where one of both goes on to wear their difference shows it; too late it does not matter
            if _wears(course)[pair] or _wears(other)[pair] or g * (at[-1] - ceases) < 1.0:
                continue
            rate, beside = rates[:, pair], np.interp(at, other.counts, other.rates[:, pair])
            first = int(np.searchsorted(at, ceases - min(1.0 / g, (1.0 - WINDOW) * ceases)))
            above = ((rate - beside)[first:end] * np.exp(g * (ceases - at[first:end]))).max()
            falls = (-np.diff(rate) / np.diff(at))[max(end - 2, 0) : end].max()
            if BESIDE * g * above >= falls:
                return float(ceases)
    return math.inf


def _wears(course: Course) -> BoolArray:
    """Pairs (n_contact,) that wear at the end of a history."""
    return np.asarray(course.rates[-1] > ROUND_OFF * course.rates[-1].max(initial=0.0))


def exchanged(values: Mapping[str, Any], name: str) -> FloatArray:
    """Largest difference (n, n_contact) of a value of each pair to its equals: pairs that slip under the same pressure
    and wear as fast at the first count. 0 where there is none, or where the first state is not known as this.
    """
    grown: FloatArray = values[name]
    if "mean_pressure" not in values:
        return np.zeros_like(grown)
    pressure, rate = values["mean_pressure"][0], values["depth_rate"][0]
    apart = np.zeros_like(grown)
    for pair in np.flatnonzero((pressure > 0.0) & (rate > 0.0)):
        equal = (np.abs(pressure - pressure[pair]) <= SMALL * pressure[pair]) & (
            np.abs(rate - rate[pair]) <= SMALL * rate[pair]
        )
        apart[:, pair] = np.abs(grown[:, equal] - grown[:, [pair]]).max(axis=1)
    return apart

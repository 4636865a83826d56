"""Within a step on the slow time scale: worn depth, and the count at which a target is reached.

A target is a wear depth, a worn volume, or a shift of the resonance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from solver.model import FloatArray
from solver.settings import WearTarget

if TYPE_CHECKING:
    from solver.wear.course import Node


def depth_within(
    fraction: FloatArray,
    length: ArrayLike,
    before: tuple[FloatArray, FloatArray],
    after: tuple[FloatArray, FloatArray],
    smooth: bool,
) -> FloatArray:
    """Worn depth (n, n_contact), m, at fractions (n,) of a step each: linear, or a cubic Hermite polynomial.

    The slopes of the cubic are limited so that the depth never falls: a cubic is monotone where both slopes are at most
    three times the mean slope (Fritsch and Carlson 1980).

    length: of the step, or (n,) of the steps, cycles.
    before, after: depth, m, and wear rate, m per cycle, both (n_contact,) or (n, n_contact), at the ends of the step.
    smooth: True for the cubic.
    """
    s, cycles = fraction[:, None], np.reshape(length, (-1, 1))
    grown = after[0] - before[0]
    if not smooth:
        return np.asarray(before[0] + s * grown)
    first, last = (np.minimum(rate * cycles, 3.0 * grown) for rate in (before[1], after[1]))
    bent = (1.0 - s) ** 2 * s * first - s**2 * (1.0 - s) * last
    return np.asarray(before[0] + s**2 * (3.0 - 2.0 * s) * grown + bent)


def fraction_where(value: float, volume: Callable[[float], float]) -> float:
    """Fraction of a step at which a function that never falls reaches a value; 0 or 1 for a value beyond its ends."""
    if volume(0.0) >= value or volume(1.0) <= value:
        return 0.0 if volume(0.0) >= value else 1.0
    from scipy.optimize import brentq  # where it is used: it takes a while to load

    return float(brentq(lambda fraction: volume(fraction) - value, 0.0, 1.0, xtol=1e-12))


@dataclass(frozen=True)
class TargetSearch:
    """Seeks a target within steps. area (n_contact,): m2. smooth: whether the depth is a cubic within a step."""

    target: WearTarget
    area: FloatArray
    smooth: bool

    def within(self, nodes: Sequence[Node], *, straight: bool = False) -> float:
        """Count at which the last step of some reaches the target, NaN where it does not.

        The resonance is a parabola in the worn volume through both ends of the step and the end before, or straight.
        """
        start, end = nodes[-2:]
        wanted = self._volume_at_shift(nodes, straight=straight) if self._shifts else self.target.value
        if self._worn(end.report.wear_depth) < wanted:
            return math.nan
        length = end.cycle - start.cycle
        ends = [(node.report.wear_depth, node.rate) for node in (start, end)]

        def worn_at(fraction: float) -> float:
            return self._worn(depth_within(np.array([fraction]), length, ends[0], ends[1], self.smooth)[0])

        return start.cycle + fraction_where(wanted, worn_at) * length

    def count(self, nodes: Sequence[Node]) -> float:
        """Count at which some steps reach the target; if they do not, extrapolated by the mean rate of the last one,
        inf where this rate is 0.
        """
        for end in range(2, len(nodes) + 1):
            if not math.isnan(found := self.within(nodes[:end])):
                return found
        if len(nodes) < 2:
            return math.inf
        first, last = (
            abs(_shift(node, nodes)) if self._shifts else self._worn(node.report.wear_depth) for node in nodes[-2:]
        )
        grown, length = last - first, nodes[-1].cycle - nodes[-2].cycle
        return nodes[-1].cycle + (self.target.value - last) * length / grown if grown > 0.0 else math.inf

    def by_resonance(self, nodes: Sequence[Node], reached: float) -> float:
        """Error, cycles, of the count `reached` by the errors of the resonance at the end of its step and at the start;
        0 for other targets.
        """
        if not self._shifts:
            return 0.0
        start, end = next(step for step in pairwise(nodes) if reached <= step[1].cycle)
        shifted = abs(_shift(end, nodes) - _shift(start, nodes))
        error = max(node.report.resonance_error for node in (nodes[0], end))
        return error * (end.cycle - start.cycle) / shifted if shifted > 0.0 else math.inf

    @property
    def _shifts(self) -> bool:
        return self.target.quantity == "frequency_shift"

    def _volume_at_shift(self, nodes: Sequence[Node], *, straight: bool) -> float:
        """Worn volume, m3, at which the resonance has shifted to the target in the last step; inf where it has not."""
        wanted, way = self.target.value, math.copysign(1.0, _shift(nodes[-1], nodes))
        *before, volume, end_volume = (float(node.report.wear_depth @ self.area) for node in nodes[-3:])
        *earlier, shift, end_shift = (way * _shift(node, nodes) for node in nodes[-3:])
        if not end_shift >= wanted:
            return math.inf
        if not end_shift > shift:
            return volume
        slope = (end_volume - volume) / (end_shift - shift)
        line = volume + max(wanted - shift, 0.0) * slope
        if straight or not before or not (before[0] < volume < end_volume and earlier[0] < shift < wanted):
            return line
        # Newton's form of the volume as a function of the shift, which has to rise
        bend = (slope - (volume - before[0]) / (shift - earlier[0])) / (end_shift - earlier[0])
        found = line + bend * (wanted - shift) * (wanted - end_shift)
        return found if volume < found < end_volume else line

    def _worn(self, depth: FloatArray) -> float:
        """Largest of the depths (n_contact,), m, or else their volume, m3, of which a resonance is a function."""
        return float(depth.max(initial=0.0) if self.target.quantity == "wear_depth" else depth @ self.area)


def _shift(node: Node, nodes: Sequence[Node]) -> float:
    """Relative change of the resonance since the first of some states; above 0 where it rises."""
    return node.report.resonance / nodes[0].report.resonance - 1.0

"""Estimated errors of a state, from its differences to other states."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.packing import packable


@packable
@dataclass(frozen=True)
class Estimate:
    """Estimated relative errors of a state.

    response: of the first harmonic of the response.
    wear_rate: of the total wear rate.
    weight: factor on `wear_rate` in `largest`; less than 1 where almost nothing wears.
    """

    response: float
    wear_rate: float
    weight: float = 1.0

    @property
    def largest(self) -> float:
        """The larger error, with the weight of the wear rate."""
        return max(self.response, self.weight * self.wear_rate)

    def __add__(self, other: Estimate) -> Estimate:
        """Sum of the errors of two causes: the worst case."""
        weight = max(self.weight, other.weight)
        return Estimate(self.response + other.response, self.wear_rate + other.wear_rate, weight)

    def times(self, factor: float) -> Estimate:
        """The errors times a safety factor."""
        return Estimate(factor * self.response, factor * self.wear_rate, self.weight)


NOTHING = Estimate(0.0, 0.0)
UNKNOWN = Estimate(np.inf, np.inf)

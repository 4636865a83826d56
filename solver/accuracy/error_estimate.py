"""How wrong a state is, as far as other states tell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from solver.model import FloatArray
from solver.packing import packable

Values = TypeVar("Values", float, FloatArray)


@packable
@dataclass(frozen=True)
class Estimate:
    """Estimated relative errors of a state: of the first harmonic of its response and of its total wear rate.

    weight: of the error of the wear rate where it is judged, less than 1 where next to nothing wears.
    """

    response: float
    wear_rate: float
    weight: float = 1.0

    @property
    def largest(self) -> float:
        """The larger one, as it is judged."""
        return max(self.response, self.weight * self.wear_rate)

    def __add__(self, other: Estimate) -> Estimate:
        """Errors of two causes, at their worst."""
        weight = max(self.weight, other.weight)
        return Estimate(self.response + other.response, self.wear_rate + other.wear_rate, weight)

    def times(self, factor: float) -> Estimate:
        """Larger errors."""
        return Estimate(factor * self.response, factor * self.wear_rate, self.weight)


def euler_error(length: float, change: Values) -> Values:
    """Estimated error of an Euler step, explicit or implicit: its difference to the trapezoidal rule.

    length: of the step, cycles. change: of the wear rate over the step, of each pair, m per cycle, or of all, m3 per
    cycle. The error is as signed as the change.
    """
    return 0.5 * length * change


NOTHING = Estimate(0.0, 0.0)
UNKNOWN = Estimate(np.inf, np.inf)

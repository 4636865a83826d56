"""Samples of a quantity, some of them without a value, and statistics of them as bands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SampleValues:
    """Samples of a quantity, n in the last dimension, at any number of points.

    low, high (..., n): the value, twice; where a sample has none, or one that is not to be trusted, what it lies
    between, high may be inf. error (..., n): absolute numerical error of a value, 0 or more.
    """

    low: Array
    high: Array
    error: Array

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return int(self.low.shape[-1])

    @property
    def is_known(self) -> NDArray[np.bool_]:
        """Whether a sample has a value, (..., n)."""
        return np.asarray(self.low == self.high)

    def at(self, place: Any) -> SampleValues:
        """Some of the points or samples, as numpy's indices select them."""
        return SampleValues(self.low[place], self.high[place], self.error[place])

    @property
    def widened(self) -> SampleValues:
        """The samples between their values less and more the numerical error, without error."""
        return SampleValues(self.low - self.error, self.high + self.error, np.zeros_like(self.error))


@dataclass(frozen=True)
class Band:
    """A statistic of samples, arrays of one shape.

    lowest, highest: over all that the samples without a value may have; equal where all have one.
    interval_low, interval_high: confidence interval, from the one of `lowest` to the one of `highest`.
    error_low, error_high: lowest and highest, with each value less or more its numerical error, all in one direction.
    """

    lowest: Array
    highest: Array
    interval_low: Array
    interval_high: Array
    error_low: Array
    error_high: Array

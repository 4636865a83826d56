"""Cost model of tasks: expected run times, corrected by the run times of finished tasks.

Expected times decide the order of the tasks and the time left that a user sees. They decide no number of a result.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

CostKeys = Sequence[tuple[Hashable, ...]]
"""Groups of similar tasks that a task belongs to: sequences of keys, each from a general group to a special one."""


@dataclass(frozen=True)
class Measurement:
    """What the cost model has learnt from one task.

    entries: key of a group, measured time and expected time in seconds. The expected time of an entry contains the
    corrections of all other sequences of keys.
    """

    entries: tuple[tuple[Hashable, float, float], ...]


class CostModel:
    """Corrects estimated times by the measured times of similar tasks.

    The correction is a product of factors, one for each sequence of keys. The factor of a key is the sum of the
    measured times over the sum of the expected times. The factor of the key before counts as one more measurement, so
    that a few unusual times do not decide. Before the first key the factor is 1.
    """

    def __init__(self) -> None:
        self._sums: dict[Hashable, tuple[float, float, int]] = {}
        # Factors asked for since the last measurement: most of thousands of waiting tasks share their keys.
        self._factors: dict[tuple[Hashable, ...], float] = {}

    def learn(self, cost_keys: CostKeys, estimated: float, measured: float) -> Measurement:
        """Adds the times of a task, s; the estimated time is positive."""
        factors = [self._factor(keys) for keys in cost_keys]
        expected = estimated * math.prod(factors)
        entries = tuple(
            (key, measured, expected / factor) for keys, factor in zip(cost_keys, factors, strict=True) for key in keys
        )
        for entry in entries:
            self._add(*entry, 1)
        return Measurement(entries)

    def forget(self, measurement: Measurement) -> None:
        """Takes back a measurement."""
        for key, measured, expected in measurement.entries:
            self._add(key, -measured, -expected, -1)

    def correction(self, cost_keys: CostKeys) -> float:
        """Factor by which an estimated time is multiplied, positive."""
        return math.prod(self._factor(keys) for keys in cost_keys)

    def measured(self, key: Hashable) -> float:
        """Sum of the measured times, s, of all tasks with a key."""
        return self._sums.get(key, (0.0, 0.0, 0))[0]

    def _factor(self, keys: tuple[Hashable, ...]) -> float:
        known = self._factors.get(keys)
        if known is not None:
            return known
        found = 1.0
        for key in keys:
            measured, expected, n = self._sums.get(key, (0.0, 0.0, 0))
            if n > 0:
                mean = expected / n
                found = (measured + found * mean) / (expected + mean)
        self._factors[keys] = found = max(found, _LEAST)
        return found

    def _add(self, key: Hashable, measured: float, expected: float, n: int) -> None:
        self._factors.clear()
        before = self._sums.get(key, (0.0, 0.0, 0))
        self._sums[key] = (before[0] + measured, before[1] + expected, before[2] + n)


_LEAST = 1e-6

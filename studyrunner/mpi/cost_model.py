"""Cost model of tasks: expected run times, corrected by the run times of finished tasks.

Expected times decide the order of the tasks and the time left that a user sees. They decide no number of a result.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence

CostKeys = Sequence[tuple[Hashable, ...]]
"""Groups of similar tasks that a task belongs to: sequences of keys, each from a general group to a special one."""

Measurement = Sequence[tuple[Hashable, float, float]]
"""What is learnt from one task: keys of groups, each with the measured and the expected time, s. The expected time of a
key contains the corrections of all other sequences of keys."""

_LEAST = 1e-6


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
        found = [
            (key, measured, expected / each) for keys, each in zip(cost_keys, factors, strict=True) for key in keys
        ]
        self._add(found, 1)
        return found

    def forget(self, measurement: Measurement) -> None:
        """Takes back a measurement."""
        self._add(measurement, -1)

    def correction(self, cost_keys: CostKeys) -> float:
        """Factor by which an estimated time is multiplied, positive."""
        return math.prod(self._factor(keys) for keys in cost_keys)

    def measured(self, key: Hashable) -> float:
        """Sum of the measured times, s, of all tasks with a key."""
        return self._sums.get(key, (0.0, 0.0, 0))[0]

    def _factor(self, keys: tuple[Hashable, ...]) -> float:
        if keys not in self._factors:
            found = 1.0
            for key in keys:
                measured, expected, n = self._sums.get(key, (0.0, 0.0, 0))
                if n > 0:
                    mean = expected / n
                    found = (measured + found * mean) / (expected + mean)
            self._factors[keys] = max(found, _LEAST)
        return self._factors[keys]

    def _add(self, measurement: Measurement, sign: int) -> None:
        self._factors.clear()
        for key, measured, expected in measurement:
            before = self._sums.get(key, (0.0, 0.0, 0))
            self._sums[key] = (before[0] + sign * measured, before[1] + sign * expected, before[2] + sign)

"""What tasks take, learnt from those that ran: for the order of the others and the time left, nothing else."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

Kin = Sequence[tuple[Hashable, ...]]
"""What a task has in common with others, in several respects: for each, keys from the general to the special."""


@dataclass(frozen=True)
class Lesson:
    """What was learnt of one task: key, measured seconds, and those that were expected for all other reasons."""

    entries: tuple[tuple[Hashable, float, float], ...]


class LearnedCosts:
    """Corrects estimated times by those measured of tasks that are alike.

    The correction is a product with a factor for each respect. A key's factor is the sum of measured times over that of
    expected ones. What its parent, the key before it, says counts as one more measurement, so that a few odd times do
    not decide; the first key's parent says 1.
    """

    def __init__(self) -> None:
        self._sums: dict[Hashable, tuple[float, float, int]] = {}
        # those asked for since something was learnt: of thousands of tasks that are put in order, most are alike
        self._factors: dict[tuple[Hashable, ...], float] = {}

    def learn(self, kin: Kin, estimated: float, measured: float) -> Lesson:
        """Takes note of a task: times in seconds, the estimated one positive."""
        factors = [self._factor(keys) for keys in kin]
        expected = estimated * math.prod(factors)
        entries = tuple(
            (key, measured, expected / factor) for keys, factor in zip(kin, factors, strict=True) for key in keys
        )
        for entry in entries:
            self._add(*entry, 1)
        return Lesson(entries)

    def forget(self, lesson: Lesson) -> None:
        """Takes back what was learnt too early."""
        for key, measured, expected in lesson.entries:
            self._add(key, -measured, -expected, -1)

    def correction(self, kin: Kin) -> float:
        """By what an estimate is to be multiplied, positive."""
        return math.prod(self._factor(keys) for keys in kin)

    def measured(self, key: Hashable) -> float:
        """Seconds that all tasks with this key took."""
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

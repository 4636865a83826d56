"""Whether wear rates go up and down from step to step, as they do with explicit steps beyond their stable length."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from solver.model import FloatArray, IntArray

SUCCESSIVE = 4  # increments of a wear rate that alternate in sign and do not shrink
NOTICEABLE = 1e-3  # of the largest rate of all pairs together: increments below it are no oscillation
CALMING = 0.98  # an increment that is smaller than this share of the one before calms


@dataclass
class WearRates:
    """Follows the wear rates of pairs and, last, of all together (n,) from step to step, and forgets them.

    An explicit Euler step beyond its limit turns the sign of the error and enlarges it; a physical rise and fall takes
    many steps. largest (n,): of all so far. strongest (n,): the smallest of `SUCCESSIVE` - 1 increments that followed
    each other in this way, where they were strongest.
    """

    n: int
    value: FloatArray = field(init=False)
    increment: FloatArray = field(init=False)
    n_alternating: IntArray = field(init=False)
    last: FloatArray = field(init=False)
    largest: FloatArray = field(init=False)
    strongest: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        self.value, self.increment = np.full(self.n, np.nan), np.full(self.n, np.nan)
        self.n_alternating = np.zeros(self.n, np.int64)
        self.last = np.zeros((SUCCESSIVE - 1, self.n))
        self.largest, self.strongest = np.zeros(self.n), np.zeros(self.n)

    def add(self, rates: FloatArray) -> None:
        """Rates (n,) of the state after the next step."""
        before, self.increment = self.increment, rates - self.value
        size = np.abs(self.increment)
        alternates = (before * self.increment < 0.0) & (size >= CALMING * np.abs(before))
        self.n_alternating = np.where(alternates, self.n_alternating + 1, 0)
        self.last = np.vstack([self.last[1:], size])
        weakest = np.where(self.n_alternating >= SUCCESSIVE - 1, self.last.min(axis=0), 0.0)
        self.strongest = np.maximum(self.strongest, weakest)
        self.largest = np.maximum(self.largest, np.abs(rates))
        self.value = rates

    def oscillate(self, least: float = 0.0) -> bool:
        """Whether one of them went up and down `SUCCESSIVE` times in a row without calming, by more than `least` and a
        share of what all of them wear together: a pair at the edge of the slip zone that wears next to nothing does so
        at any step.
        """
        return bool(self.strongest.max(initial=0.0) > max(NOTICEABLE * self.largest[-1], least))

    def carried(self) -> dict[str, Any]:
        """What goes on from step to step, to be packed."""
        return {entry.name: getattr(self, entry.name) for entry in fields(self) if not entry.init}

    def take_up(self, carried: dict[str, Any]) -> None:
        """Go on from what another one has carried so far."""
        for name, value in carried.items():
            setattr(self, name, value)

"""Whether wear rates go up and down from step to step, as they do with explicit steps beyond their stable length."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypedDict

import numpy as np

from solver.model import FloatArray, IntArray
from solver.packing import attributes, set_attributes
from solver.results.options import RESULTS


class RatesState(TypedDict):
    """What goes on from step to step: attributes of `WearRates`."""

    value: FloatArray
    increment: FloatArray
    n_alternating: IntArray
    last: FloatArray
    largest: FloatArray
    strongest: FloatArray


@dataclass
class WearRates:
    """Follows the wear rates of pairs and, last, of all together (n,) from step to step, and forgets them.

    An explicit Euler step beyond its limit turns the sign of the error and enlarges it; a physical rise and fall takes
    many steps. largest (n,): of all so far. strongest (n,): the smallest of `alternations` - 1 increments that followed
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
        self.last = np.zeros((RESULTS.alternations - 1, self.n))
        self.largest, self.strongest = np.zeros(self.n), np.zeros(self.n)

    def add(self, rates: FloatArray) -> None:
        """Rates (n,) of the state after the next step."""
        before, self.increment = self.increment, rates - self.value
        size = np.abs(self.increment)
        alternates = (before * self.increment < 0.0) & (size >= RESULTS.calming * np.abs(before))
        self.n_alternating = np.where(alternates, self.n_alternating + 1, 0)
        self.last = np.vstack([self.last[1:], size])
        weakest = np.where(self.n_alternating >= RESULTS.alternations - 1, self.last.min(axis=0), 0.0)
        self.strongest = np.maximum(self.strongest, weakest)
        self.largest = np.maximum(self.largest, np.abs(rates))
        self.value = rates

    def oscillate(self, least: float = 0.0) -> bool:
        """Whether one of them went up and down `alternations` times in a row without calming, by more than `least` and
        a fraction of what all of them wear together: a pair at the edge of the slip zone that wears next to nothing
        does so at any step.
        """
        return bool(self.strongest.max(initial=0.0) > max(RESULTS.noticeable_oscillation * self.largest[-1], least))

    def state_dict(self) -> RatesState:
        """What goes on from step to step, to be packed."""
        return attributes(self, RatesState)

    def load_state(self, state: RatesState) -> None:
        """Go on from the state of another one."""
        set_attributes(self, state)

"""Wear rates from step to step: largest values, and oscillations by unstable steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.accuracy.options import ACCURACY
from solver.model import FloatArray, IntArray
from solver.packing import packable
from solver.wear.options import WEAR


@packable
@dataclass(frozen=True)
class WearRates:
    """Wear rates of the pairs and, as the last entry, of all pairs together (n,), m3 per cycle.

    An explicit Euler step beyond the stable length changes the sign of an error and enlarges the error. A physical rise
    and fall of the rate takes many steps.

    value (n,): rates of the current state, NaN before the first state.
    increment (n,): change of the rates in the last step.
    n_alternating (n,): number of successive steps in which the increment changed its sign without decay.
    last (alternations - 1, n): sizes of the last increments.
    largest (n,): largest rates so far.
    strongest (n,): amplitude of the strongest oscillation: the smallest of its `alternations` successive increments.
    """

    value: FloatArray
    increment: FloatArray
    n_alternating: IntArray
    last: FloatArray
    largest: FloatArray
    strongest: FloatArray

    @classmethod
    def none(cls, n: int) -> WearRates:
        """Rates before the first state. n: number of pairs plus one."""
        nothing, unknown = np.zeros(n), np.full(n, np.nan)
        return cls(unknown, unknown, np.zeros(n, np.int64), np.zeros((WEAR.alternations - 1, n)), nothing, nothing)

    def after(self, rates: FloatArray) -> WearRates:
        """The rates after another step. rates (n,): of the new state."""
        increment = rates - self.value
        size = np.abs(increment)
        alternates = (self.increment * increment < 0.0) & (size >= np.abs(self.increment))
        n_alternating = np.where(alternates, self.n_alternating + 1, 0)
        last = np.vstack([self.last[1:], size])
        weakest = np.where(n_alternating >= WEAR.alternations - 1, last.min(axis=0), 0.0)
        return WearRates(
            value=rates,
            increment=increment,
            n_alternating=n_alternating,
            last=last,
            largest=np.maximum(self.largest, np.abs(rates)),
            strongest=np.maximum(self.strongest, weakest),
        )

    def oscillate(self, least: float = 0.0) -> bool:
        """Whether a rate went up and down `alternations` times in a row without decay.

        The tiny rate of a pair at the edge of the slip zone alternates with steps of any length. So the increments must
        be larger than `least`, m3 per cycle, and larger than a fraction of the wear rate of the whole joint.
        """
        return bool(self.strongest.max(initial=0.0) > max(ACCURACY.small_work * self.largest[-1], least))

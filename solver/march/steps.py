"""One step along a line of states, as long as allowed: along frequency, load, amplitude, cycles or missions.

The length follows from the change of the state over a step, or its local error, over the one allowed. Where no step is
found, the line has one rescue; where this fails, too, the line ends.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from solver.harmonic_balance.state import Failure

STEP_SAFETY = 0.85
"""Length of a step over the length with the allowed error, and the largest factor on a step that was refused."""

LARGEST_STEP_RATIO = 2.0
"""Largest ratio of two successive steps of a sweep, of an amplitude and on the slow time scale; BDF2 is zero-stable
below 1 + sqrt(2). With 1.4 the damping of a nonlinear mode of the dovetail changes by 5e-6."""

SMALLEST_STEP_RATIO = 0.25
"""Factor on a step whose end was not found, and smallest factor on a step that was refused."""

HereT = TypeVar("HereT", contravariant=True)
EndT = TypeVar("EndT")


class Line(Protocol[HereT, EndT]):
    """What is marched along."""

    def attempt(self, here: HereT, length: float, /) -> EndT | None:
        """End of a step; None where it is not found."""

    def judge(self, here: HereT, end: EndT, length: float, /) -> float:
        """Change or error of a step over the allowed one; above 1 the step is refused."""

    def rescue(self, here: HereT, length: float, /) -> EndT | Failure:
        """End of a step that is not found, or refused, however short; or why the line ends."""


@dataclass(frozen=True)
class Lengths:
    """The rule for the length of a step.

    order: power of the length with which the judged quantity grows. safety: as `STEP_SAFETY`.
    shortest: shortest step. rescue: length at and below which a step that is not found is left to the rescue.
    """

    order: int
    safety: float = STEP_SAFETY
    shortest: float = 0.0
    rescue: float = 0.0

    def factor(self, ratio: float, *, accepted: bool) -> float:
        """Length of the next step, or of the next attempt of a refused one, over the present length."""
        wanted = self.safety * max(ratio, 1e-12) ** (-1.0 / self.order)
        least, most = self.safety, LARGEST_STEP_RATIO
        return float(np.clip(wanted, *((least, most) if accepted else (SMALLEST_STEP_RATIO, least))))


def take_step(line: Line[HereT, EndT], here: HereT, length: float, lengths: Lengths) -> tuple[EndT, float] | Failure:
    """The end of one step and the length of the next one, or why there is none; length: of the first attempt."""
    length = max(length, lengths.shortest)
    while True:
        end = line.attempt(here, length)
        ratio = math.inf if end is None else line.judge(here, end, length)
        if end is not None and ratio <= 1.0:
            return end, length * lengths.factor(ratio, accepted=True)
        if length <= (lengths.rescue if end is None else lengths.shortest):
            rescued = line.rescue(here, length)
            return rescued if isinstance(rescued, Failure) else (rescued, length)
        floor = lengths.rescue if end is None else lengths.shortest
        length = max(lengths.factor(ratio, accepted=False) * length, floor)

"""One step along a line of states, as long as allowed: along frequency, load, amplitude, cycles or missions.

A judge compares a step with what is allowed: the change of the state over the step, or its local error. The next length
follows from this ratio. Where no step is found, the line has one rescue; where this fails, too, the line ends.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from solver.harmonic_balance.state import Failure
from solver.options import COMMON

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

    order: power of the length with which the judged quantity grows.
    safety: length of the next step over the one that would just be allowed, and largest factor on a refused step.
    shortest: shortest step. rescue: length at and below which a step that is not found is left to the rescue.
    """

    order: int
    safety: float = COMMON.step_safety
    shortest: float = 0.0
    rescue: float = 0.0

    def factor(self, ratio: float, *, accepted: bool) -> float:
        """Length of the next step, or of the next attempt of a refused one, over the present length."""
        wanted = self.safety * max(ratio, 1e-12) ** (-1.0 / self.order)
        least, most = self.safety, COMMON.largest_step_ratio
        return float(np.clip(wanted, *((least, most) if accepted else (COMMON.smallest_step_ratio, least))))


def take_step(line: Line[HereT, EndT], here: HereT, length: float, lengths: Lengths) -> tuple[EndT, float] | Failure:
    """The end of one step from a state and the length of the next step, or why there is none.

    length: of the first attempt.
    """
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

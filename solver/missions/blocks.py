"""What a mission is: blocks of vibration in order, and how often they are repeated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from solver.contact.wear_law import ARCHARD, WearLaw
from solver.model import FloatArray, ReducedModel
from solver.settings import Direction, SolverSettings, WearTarget

Begin = Literal["ramp", "up", "down", "continue"]
"""How a block begins: from the static state by a ramp of the excitation or by a sweep, or from the last block."""


@dataclass(frozen=True)
class Passage:
    """Frequencies that a machine passes: start and stop, Hz, not equal, and the rate, Hz/s, above 0 up or down."""

    start: float
    stop: float
    rate: float

    @property
    def cycles(self) -> float:
        """Cycles of one passage."""
        return abs(self.stop**2 - self.start**2) / (2.0 * self.rate)

    @property
    def sweep(self) -> Direction:
        """The direction."""
        return "up" if self.stop > self.start else "down"


@dataclass(frozen=True)
class Block:
    """A part of a mission: steady vibration for a number of cycles, or a passage (`solver.missions.passage`).

    - model: the joint, e.g. at the speed of the block. All blocks of a mission have equal contact pairs.
    - frequency: Hz, or a passage.
    - excitation_amplitude: N.
    - friction_coefficient: one number, (n_contact,) for each pair, or None for the model's own.
    - cycles: of the block in one mission, above 0; None for a passage, whose cycles follow from its rate.
    - begin: "ramp", "up" and "down": from the static state of the model with the depths worn so far, as `sweep` of
      `solver.march_wear`. "continue": from the last state of the block before (before the first block: of the last
      block of the mission before), whose tangential history goes on. Amplitude and frequency then change slowly, one
      after the other, the frequency at the smaller of both amplitudes. By default "ramp"; a passage begins with a sweep
      of its own direction.
    - name: of the block, for messages.
    """

    model: ReducedModel
    frequency: float | Passage
    excitation_amplitude: float
    friction_coefficient: float | FloatArray | None
    cycles: float | None = None
    begin: Begin | None = None
    name: str = ""

    @property
    def way(self) -> Begin:
        """How the block begins."""
        default: Begin = self.frequency.sweep if isinstance(self.frequency, Passage) else "ramp"
        return self.begin or default

    @property
    def ends(self) -> tuple[float, float]:
        """Frequencies at begin and end, Hz."""
        of = self.frequency
        return (of.start, of.stop) if isinstance(of, Passage) else (of, of)

    @property
    def steady(self) -> tuple[float, float]:
        """Frequency, Hz, and cycles of a block that is no passage."""
        assert isinstance(self.frequency, float)
        assert self.cycles is not None
        return self.frequency, self.cycles


@dataclass(frozen=True)
class Mission:
    """Blocks in order, at least one, repeated a number of times. Arguments as of `solver.integrate_mission`.

    - missions (n_output,): ascending whole numbers of missions at which the history is reported, the first 0.
    - first: how the first mission begins where its first block continues.
    """

    blocks: tuple[Block, ...]
    wear_coefficient: float
    missions: tuple[int, ...]
    settings: SolverSettings
    law: WearLaw = ARCHARD
    until: WearTarget | None = None
    first: Direction = "up"
    largest_step: int | None = None

    @property
    def area(self) -> FloatArray:
        """Area of the pairs (n_contact,), m2."""
        return self.blocks[0].model.contact.area

    def called(self, place: int) -> str:
        """Name of a block in messages."""
        return self.blocks[place].name or f"block {place + 1}"

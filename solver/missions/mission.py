"""What a mission is, blocks of vibration in order and how often they are repeated; and the result of its history."""

from dataclasses import dataclass
from typing import Literal

from solver.contact.wear_law import ARCHARD, WearLaw
from solver.model import ComplexArray, FloatArray, ReducedModel
from solver.outcome import Ended, Outcome
from solver.presentation import Presented
from solver.settings import Direction, Passage, SolverSettings, WearTarget

Begin = Literal["ramp", "up", "down", "continue"]
"""How a block begins: from the static state by a ramp of the excitation or by a sweep, or from the last block."""


@dataclass(frozen=True)
class Block:
    """A part of a mission: steady vibration for a number of cycles, or a passage (`solver.missions.passage`).

    - model: the joint, e.g. at the speed of the block. All blocks of a mission have equal contact pairs.
    - frequency: Hz, or a passage. excitation_amplitude: N.
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
        """Frequencies at start and end, Hz."""
        of = self.frequency
        return (of.start, of.stop) if isinstance(of, Passage) else (of, of)


@dataclass(frozen=True)
class MissionRequest:
    """Blocks in order, at least one, repeated a number of times. Arguments as of `solver.integrate_mission`.

    - blocks: with the friction in their models.
    - missions (n_output,): ascending whole numbers of missions at which the history is reported, the first 0.
    - first_sweep: how the first mission begins where its first block continues.
    """

    blocks: tuple[Block, ...]
    wear_coefficient: float
    missions: tuple[int, ...]
    settings: SolverSettings
    law: WearLaw = ARCHARD
    until: WearTarget | None = None
    first_sweep: Direction = "up"
    largest_step: int | None = None

    @property
    def area(self) -> FloatArray:
        """Area of the pairs (n_contact,), m2."""
        return self.blocks[0].model.contact.area

    def called(self, place: int) -> str:
        """Name of a block in messages."""
        return self.blocks[place].name or f"block {place + 1}"


@dataclass(frozen=True, repr=False)
class MissionHistory(Ended, Presented):
    """A joint over its missions, at `n_output` numbers of missions. Values not reached are NaN, all errors estimated.

    - missions (n_output,); worn_volume (n_output,), m3, wear_depth (n_output, n_contact), m.
    - dissipated_energy, dissipated_energy_error (n_output, n_contact): by friction, J/m2, over the area of each pair.
    - worn_volume_error, relative, wear_depth_error, m: by the steps over missions, the integration of each block and
      their propagation, harmonics, samples and start states; 0 where nothing has worn.
    - block_volume (n_output, n_block): m3, their sum is `worn_volume`; block_volume_error: relative.
    - response_begin, response_end (n_output, n_block, n_response): complex first harmonic, m, at start and end of each
      block, in the mission that ends at the number, at 0 in the first one. response_peak_begin, response_peak_end:
      largest magnitude over a period there, m. response_error (n_output, n_block): relative, of these responses.
    - excitation_frequency (n_block, 2): Hz, at start and end of each block.
    - reference_volume (n_output,), m3, reference_end, outcome, message: as of `WearHistory`.
    - sweep_rate (n_block,): `|df/dt| / (zeta f)^2` of each passage, of the damping ratio of the joint at rest; 0 where
      nothing wears and for other blocks. A passage far below 1 wears as its steady states (`solver.missions.passage`).
    - error_estimate: `worn_volume_error` at the last number that was reached; NaN at 0 where the joint wears.
    - last_mission: number of missions that were computed. steps (n_step,): missions in each step.
    - missions_to_target, missions_to_target_error: number at which the target was reached, and its error; NaN if never.
    - newton_iterations, run_time, CPU seconds: of history and reference solution.
    """

    OVER = ("missions", "mission")

    outcome: Outcome
    missions: FloatArray
    worn_volume: FloatArray
    worn_volume_error: FloatArray
    wear_depth: FloatArray
    wear_depth_error: FloatArray
    dissipated_energy: FloatArray
    dissipated_energy_error: FloatArray
    block_volume: FloatArray
    block_volume_error: FloatArray
    response_begin: ComplexArray
    response_end: ComplexArray
    response_peak_begin: FloatArray
    response_peak_end: FloatArray
    response_error: FloatArray
    excitation_frequency: FloatArray
    reference_volume: FloatArray
    sweep_rate: FloatArray
    error_estimate: float
    last_mission: float
    steps: FloatArray
    missions_to_target: float
    missions_to_target_error: float
    newton_iterations: int
    run_time: float
    message: str = ""
    reference_end: str = ""

"""The result of a mission history, immutable."""

from __future__ import annotations

from dataclasses import dataclass

from solver.model import ComplexArray, FloatArray
from solver.outcome import Outcome
from solver.presentation import PresentedHistory


@dataclass(frozen=True, repr=False)
class MissionHistory(PresentedHistory):
    """A joint over its missions, at `n_output` numbers of missions. Values not reached are NaN, all errors estimated.

    - missions (n_output,): numbers of missions.
    - worn_volume (n_output,): m3; worn_volume_error: relative, by the steps over missions, the integration of each
      block and their propagation, harmonics, samples and start states; 0 where nothing has worn.
    - wear_depth, wear_depth_error (n_output, n_contact): m.
    - block_volume (n_output, n_block): m3, their sum is `worn_volume`; block_volume_error: relative.
    - response_begin, response_end (n_output, n_block, n_response): complex first harmonic, m, at begin and end of each
      block, in the mission that ends at the number, at 0 in the first one.
    - response_peak_begin, response_peak_end: largest magnitude over a period there, m.
    - response_error (n_output, n_block): relative, of these responses.
    - excitation_frequency (n_block, 2): Hz, at begin and end of each block.
    - reference_volume (n_output,): m3, worn volume of the reference solution.
    - sweep_rate (n_block,): `|df/dt| / (zeta f)^2` of each passage, of the damping ratio of the joint at rest; 0 where
      nothing wears and for other blocks. A passage far below 1 wears as its steady states (`solver.missions.passage`).
    - error_estimate: `worn_volume_error` at the last number that was reached.
    - last_mission: number of missions up to which the history was computed.
    - steps (n_step,): missions computed in each step.
    - missions_to_target: number of missions at which the target was reached, and its error; NaN if never.
    - newton_iterations: of history and reference solution. run_time: CPU seconds of the computing thread.
    - outcome, message: how the computation ended, and additions.
    """

    OVER = ("missions", "mission")

    outcome: Outcome
    missions: FloatArray
    worn_volume: FloatArray
    worn_volume_error: FloatArray
    wear_depth: FloatArray
    wear_depth_error: FloatArray
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

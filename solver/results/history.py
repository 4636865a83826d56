"""Frozen results that the solver hands out."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from solver.model import BoolArray, ComplexArray, FloatArray, IntArray
from solver.outcome import Outcome
from solver.packing import packable
from solver.settings import Resolution


@packable
@dataclass(frozen=True)
class PeriodicState:
    """One periodic state of the joint.

    omega: angular frequency, rad/s. excitation_amplitude: N.
    displacement_h (n_contact, 3, 2H+1): relative displacement, m, harmonics ordered 0, cos 1, sin 1, ...
    contact_force_h (n_contact, 3, 2H+1): force that the contact takes up, N, compression positive.
    start_history (n_contact, 2): corrected slip X_T that the state was found from, m. With it the state is reproduced;
        the period itself ends at the slip that the next state starts from.
    wear_depth (n_contact,): m.
    """

    omega: float
    excitation_amplitude: float
    displacement_h: FloatArray
    contact_force_h: FloatArray
    start_history: FloatArray
    wear_depth: FloatArray


@packable
@dataclass(frozen=True)
class StartState:
    """Unworn state of one frequency of a sweep, or the reason why there is none.

    coarse: the state that a sweep in steps twice as long has come to, with the same harmonics and samples; None where
    it has found none. penalty_omega: rad/s, the frequency that the penalty was taken at, the same for all points of a
    quarter octave. resolution: harmonics and samples of the state. response_error, wear_rate_error: its estimated
    relative errors, what the steps of the sweep leave wrong included.
    newton_iterations and run_time (CPU seconds of the computing thread) are those spent up to this frequency.
    branch: number of folds that the sweep has jumped over since it began; 0 on its first branch.
    fold_frequency: Hz, the last of them; NaN if none, and for a ramp, whose folds are none of the frequency.
    message: what an unexpected error said, see `Outcome.EXCEPTION`.
    """

    outcome: Outcome
    state: PeriodicState | None
    penalty_omega: float
    resolution: Resolution
    response_error: float
    wear_rate_error: float
    newton_iterations: int
    run_time: float
    branch: int = 0
    fold_frequency: float = float("nan")
    message: str = ""
    coarse: PeriodicState | None = None


@dataclass(frozen=True)
class WearHistory:
    """A point of a study on the slow time scale, at `n_output` cycle counts.

    cycles (n_output,); worn_volume (n_output,) m3; wear_rate (n_output,) m3 per cycle; wear_depth, mean_pressure (Pa),
    slip_range (m), open_fraction (n_output, n_contact); response (n_output, n_response) complex first harmonic, m;
    response_peak (n_output, n_response) m. Output counts that were not reached hold NaN, whole numbers 0 there.
    last_cycle: count up to which the point was computed, whatever ended it; NaN where there is no state at all.
    loop_displacement, m, loop_force, N (n_output, n_loops, n_phase, 3): fretting loops of the pairs asked for, as
        `solver.results.loops.contact_loops` has them.
    jump_cycle: first cycle count at which the branch was lost, NaN if never. cycles_to_target: count at which the wear
        asked for was reached, NaN if never or if none was asked for; the march ends with the step that reached it.
    worn_volume_error (n_output,): estimated relative error of the worn volume: steps with their propagation, harmonics,
        samples and start state; 0 where nothing has worn. wear_depth_error (n_output, n_contact): the same of the
        depths, m. error_estimate: `worn_volume_error` at the last count that was reached.
    residual, penetration, tension, cone_violation, energy_error, response_error, wear_rate_error (n_output,): the
        certificate of the states, all relative; NaN where not estimated. stable (n_output,): bool.
    harmonics_used, samples_used (n_output,): int, 0 where there is no state.
    run_time: CPU seconds of the computing thread, start state included.
    branch, fold_frequency: those of the start state.
    step_limit: cycles, largest stable explicit step at the first state that wears (`solver.wear.step_limit`); inf where
        there is none.
    oscillates: the wear rate went up and down from step to step without calming, as in an unstable explicit scheme.
    final_method: "active_set" or "march", how the scheme "final" has found the final state; empty with the others. A
        final state of an active set has the count inf, and nothing is known between the unworn one and it.
    cut_off_cycle: first of the counts at which a pair at an edge of the modelled contact carries load or has worn
        (`ContactInterface.edge`), NaN if never.
    reference_volume (n_output,): m3, worn volume of the reference solution; NaN where it has not come to.
    inaccurate_from: count from which on harmonics and samples do not bring the error of a state below rtol, inf if
        never. inaccurate_in, inaccurate_error: of what, and the largest error from there on.
    held_from: count from which on the mean position of a joint that slides as a whole is held, inf if never.
    message: what the outcome does not say by itself: an unexpected error, the cycle from which on something holds no
        longer and the error reached; empty where there is nothing to add.
    """

    outcome: Outcome
    cycles: FloatArray
    worn_volume: FloatArray
    wear_rate: FloatArray
    wear_depth: FloatArray
    mean_pressure: FloatArray
    slip_range: FloatArray
    open_fraction: FloatArray
    response: ComplexArray
    response_peak: FloatArray
    loop_displacement: FloatArray
    loop_force: FloatArray
    jump_cycle: float
    error_estimate: float
    newton_iterations: int
    run_time: float
    residual: FloatArray
    penetration: FloatArray
    tension: FloatArray
    cone_violation: FloatArray
    energy_error: FloatArray
    response_error: FloatArray
    wear_rate_error: FloatArray
    harmonics_used: IntArray
    samples_used: IntArray
    stable: BoolArray
    worn_volume_error: FloatArray
    wear_depth_error: FloatArray
    last_cycle: float = math.nan
    cycles_to_target: float = math.nan
    branch: int = 0
    fold_frequency: float = math.nan
    step_limit: float = math.inf
    oscillates: bool = False
    final_method: str = ""
    cut_off_cycle: float = math.nan
    message: str = ""
    reference_volume: FloatArray = field(default_factory=lambda: np.array([math.nan]))
    inaccurate_from: float = math.inf
    inaccurate_in: str = ""
    inaccurate_error: float = 0.0
    held_from: float = math.inf

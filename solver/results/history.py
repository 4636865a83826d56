"""The result classes of the solver, immutable; and the outcome of a wear history with its sentence."""

import math
from dataclasses import dataclass

import numpy as np

from solver.accuracy.resolved_state import UNKNOWN, Estimate
from solver.model import ComplexArray, ContactInterface, FloatArray, IntArray
from solver.outcome import SENSITIVE_ERROR, Ended, Outcome, in_digits, is_known_to, known_to
from solver.packing import packable
from solver.presentation import Presented
from solver.settings import NEGLIGIBLE, Resolution
from solver.structure.penalty import HOLD_FRACTION


@packable
@dataclass(frozen=True)
class PeriodicState:
    """One periodic state of a joint whose gaps contain what has worn before.

    omega: angular frequency, rad/s. excitation_amplitude: N.
    displacement_h (n_contact, 3, 2H+1): relative displacement, m, harmonics ordered 0, cos 1, sin 1, ...
    contact_force_h (n_contact, 3, 2H+1): contact force, N, compression positive.
    start_history (n_contact, 2): corrected slip X_T at the start of the solution, m, which reproduces the state. The
        next state starts from the slip at the end of the period.
    """

    omega: float
    excitation_amplitude: float
    displacement_h: FloatArray
    contact_force_h: FloatArray
    start_history: FloatArray


@packable
@dataclass(frozen=True)
class StartState(Ended):
    """Unworn state of one frequency of a sweep, or the reason why there is none.

    outcome: whether the state is a result. state: None where there is none.
    penalty_omega: rad/s, frequency at which the penalty is taken, common to all points of a quarter octave.
    resolution: harmonics and samples of the state.
    response_error, wear_rate_error: estimated relative errors of the state, errors by the steps of the sweep included.
    newton_iterations: of the whole sweep to this frequency and of the state, as for this frequency alone.
    run_time: CPU seconds of the computing thread since the last frequency.
    branch, fold_frequency: number of folds that the sweep has jumped over, 0 on its first branch, and frequency of the
        last one, Hz; NaN if none, and for a ramp, whose folds are load factors.
    message: why there is no state, or what is above rtol; or how far a sweep came.
    unjudged: why it is not known whether the state is stable, else "".
    reference: state of the reference sweep, solved with the resolution of the state; None where there is none.
    by_resolution: the errors by harmonics and samples alone.
    """

    outcome: Outcome
    state: PeriodicState | None
    penalty_omega: float
    resolution: Resolution
    response_error: float
    wear_rate_error: float
    newton_iterations: int = 0
    run_time: float = 0.0
    branch: int = 0
    fold_frequency: float = math.nan
    message: str = ""
    unjudged: str = ""
    reference: PeriodicState | None = None
    by_resolution: Estimate = UNKNOWN


@dataclass(frozen=True, repr=False)
class WearHistory(Ended, Presented):
    """A point of a study on the slow time scale, at `n_output` cycle counts; not reached: NaN, whole numbers 0.

    - cycles (n_output,); worn_volume, m3, wear_rate, m3 per cycle; wear_depth (n_output, n_contact), m.
    - dissipated_energy, dissipated_energy_error (n_output, n_contact): by friction, J/m2, over the area of each pair.
      pair_friction, pair_stiffness (n_output, n_contact): what an evolving contact has; the stiffness, N/m3, inf where
      it does not evolve.
    - mean_pressure, Pa, slip_range, m, open_fraction (n_output, n_contact): of a period.
    - friction_use (n_output,): largest friction force of any pair over its limit, at any time.
    - friction_power (n_output, n_contact): power density of friction, W/m2, of a period.
    - response (n_output, n_response): complex first harmonic, m; response_mean, response_peak: mean and largest
      magnitude over a period, m.
    - loop_displacement, loop_force (n_output, n_loops, n_phase, 3): fretting loops of the chosen pairs, m and N.
    - excitation_frequency, excitation_frequency_error (n_output,): Hz; the error of a given frequency is 0.
    - worn_volume_error (n_output,), relative, wear_depth_error (n_output, n_contact), m: estimated errors by steps and
      their propagation, harmonics, samples and start state; 0 where nothing has worn.
    - error_estimate: `worn_volume_error` at the last count that was reached; NaN at 0 where the joint wears.
    - reference_volume (n_output,): m3, of the reference solution; NaN beyond its end. reference_end: why it, or what it
      is compared with, ends early; or "".
    - residual, penetration, tension, cone_violation, energy_error, response_error, wear_rate_error (n_output,):
      certificate of the states, all relative; errors inf where unknown. harmonics_used, samples_used (n_output,): int.
    - last_cycle: count up to which the point was computed; NaN where there is no state.
    - jump_cycle: first count at which the branch was lost, NaN if never.
    - cycles_to_target, cycles_to_target_error: count at which the target was reached, and its error; NaN if never. The
      history ends with this step.
    - cut_off_cycle: first count at which a pair at an edge of the modelled contact carries load or has worn, NaN if
      never.
    - inaccurate_from, inaccurate_in, inaccurate_error: count from which on the error of a state is above rtol, inf if
      never; name of the result, and its largest error from there on.
    - undecided_from: count from which on it is not known whether a pair goes on to wear, inf if never.
    - held_from: count from which on the mean position of a joint that slides as a whole is held, inf if never.
    - adaptive: whether its steps were chosen to keep rtol.
    - unjudged: why it is not known whether the first or the last vibration is stable; "" where both are.
    - step_limit: largest stable explicit step at the first state that wears, cycles; or inf.
    - newton_iterations, run_time, CPU seconds: both with those of the start state. branch, fold_frequency: of it.
    - outcome, message: how the history ended, and a sentence about it.
    """

    OVER = ("cycles", "cycle")

    outcome: Outcome
    cycles: FloatArray
    worn_volume: FloatArray
    wear_rate: FloatArray
    wear_depth: FloatArray
    dissipated_energy: FloatArray
    mean_pressure: FloatArray
    slip_range: FloatArray
    open_fraction: FloatArray
    friction_use: FloatArray
    friction_power: FloatArray
    response: ComplexArray
    response_mean: FloatArray
    response_peak: FloatArray
    loop_displacement: FloatArray
    loop_force: FloatArray
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
    worn_volume_error: FloatArray
    wear_depth_error: FloatArray
    dissipated_energy_error: FloatArray
    pair_friction: FloatArray
    pair_stiffness: FloatArray
    excitation_frequency: FloatArray
    excitation_frequency_error: FloatArray
    reference_volume: FloatArray
    last_cycle: float = math.nan
    jump_cycle: float = math.nan
    cycles_to_target: float = math.nan
    cycles_to_target_error: float = math.nan
    branch: int = 0
    fold_frequency: float = math.nan
    step_limit: float = math.inf
    cut_off_cycle: float = math.nan
    message: str = ""
    reference_end: str = ""
    inaccurate_from: float = math.inf
    inaccurate_in: str = ""
    inaccurate_error: float = 0.0
    held_from: float = math.inf
    undecided_from: float = math.inf
    adaptive: bool = False
    unjudged: str = ""


def judge(history: WearHistory, rows: IntArray, rtol: float, slower: float = 1.0) -> tuple[Outcome, str]:
    """Outcome of a complete history, judged at some of its counts, and a sentence about the outcome.

    rows: indices of the judged counts, ascending: all counts, or those of another history that is read from this one.
    rtol: wanted relative error. slower: ratio of the wear coefficients of the other and the integrated history: counts
    of the integrated history are so many times larger.
    """
    if not rows.size:
        return Outcome.CONVERGED, ""
    last = int(rows[-1])
    at, error = history.cycles[last], float(history.worn_volume_error[last])
    volumes = float(history.worn_volume[last]), float(history.reference_volume[last])
    coarser = "with longer steps, other harmonics and a coarser sweep"
    uncertain = describe_uncertain(*volumes, error, rtol, coarser, history.reference_end)
    if history.undecided_from < at:
        ceases = f"at cycle {in_digits(history.undecided_from / slower)} a pair ceases to wear, or by a hair does not"
        uncertain = f"the error of the worn volume is not known: {ceases}, and wears on ever faster"
    cut_off = describe_cut_off(history.cut_off_cycle / slower) if at >= history.cut_off_cycle else ""
    inaccurate = held = ""
    # inf means "never", but is the count of a final state, too
    if math.inf > history.inaccurate_from <= at:
        begin = f"from cycle {history.inaccurate_from / slower:,.0f} on ".replace(",", " ")
        inaccurate = begin + f"the {history.inaccurate_in} {is_known_to(history.inaccurate_error, rtol)}"
    if math.inf > history.held_from <= at:
        held = (
            f"from cycle {in_digits(history.held_from / slower)} on every pair slips and only friction holds the joint"
            f" in one direction: its mean position is held there, by at most {HOLD_FRACTION:g} of the friction"
        )
    most = rtol if history.adaptive else math.inf
    outcome, message = verdict(error, most, uncertain, inaccurate, cut_off, held, history.unjudged)
    return Outcome.INACCURATE if history.unjudged and outcome is Outcome.CONVERGED else outcome, message


def verdict(
    error: float, most: float, uncertain: str, inaccurate: str, cut_off: str, *notes: str
) -> tuple[Outcome, str]:
    """Outcome of a complete history of wear or of missions, and its sentence.

    error: of the last worn volume, relative; most: the one at which the steps aim, inf for given steps. uncertain:
    sentence in case the error is larger or not known. The other sentences are "" where there is nothing to say: about
    states above rtol, about a contact that is cut off, additions.
    """
    if cut_off:
        return Outcome.CONTACT_CUT_OFF, cut_off
    if SENSITIVE_ERROR < error < math.inf:
        return Outcome.SENSITIVE, "; ".join(filter(None, (uncertain, *notes)))
    reasons = (uncertain if error > most or math.isinf(error) else "", inaccurate)
    outcome = Outcome.INACCURATE if any(reasons) else Outcome.CONVERGED
    return outcome, "; ".join(filter(None, (*reasons, *notes)))


def last_error(counts: FloatArray, error: FloatArray, rate: FloatArray, last: float) -> float:
    """Estimated relative error of the last worn volume of a history; NaN where there is none, as where a history
    reaches its target before its first count.

    counts, error, rate (n,): of cycles or missions; errors of the worn volume, NaN where not reached, and wear rates.
    last: count that was computed.
    """
    reached = np.flatnonzero(~np.isnan(error))
    if not reached.size or (counts[reached[-1]] == 0.0 and last > 0.0 and bool(rate[reached[-1]] > 0.0)):
        return math.nan
    return float(error[reached[-1]])


def describe_uncertain(volume: float, other: float, error: float, rtol: float, coarser: str, reason: str) -> str:
    """About an uncertain worn volume, m3, beside that of a solution `coarser`; reason: why it ended, or ""."""
    if math.isinf(error):
        ends = f"{coarser} the history ends early: {reason}"
        why = ends if reason else "that of a vibration on the way is not known"
        return f"the error of the worn volume is not known: {why}"
    known = known_to(error, rtol) if error < 1.0 else "not known"
    volumes, others = f"worn volume {1e9 * volume:.3g} mm3", f"{1e9 * other:.3g} mm3 {coarser}"
    if abs(volume - other) < 0.5 * error * volume:
        return f"{volumes}, {known}, by its harmonics, its steps, or pairs that wear otherwise: {others}"
    return f"{volumes}, but {others}: {known}"


def first_cut_off(contact: ContactInterface, cycles: FloatArray, pressure: FloatArray, depth: FloatArray) -> float:
    """First of the counts (n_output,) at which a pair at an edge of the modelled contact carries load or has worn, NaN
    if never. pressure, depth (n_output, n_contact): Pa and m, NaN without a state.
    """
    if contact.edge is None or not contact.edge.any():
        return math.nan
    reached = [values[:, contact.edge].max(axis=1) > NEGLIGIBLE * values.max(axis=1) for values in (pressure, depth)]
    found = np.flatnonzero(np.logical_or(*reached))
    return float(cycles[found[0]]) if found.size else math.nan


def describe_cut_off(count: float, of: str = "cycle") -> str:
    """Sentence with the first count of a cut off contact."""
    when = f"at {of} {in_digits(count)}" + (" already" if count else "")
    return f"pairs at the edge of the modelled contact carry load or have worn {when}"

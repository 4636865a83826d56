"""Unworn periodic states at the frequencies of a study, each with the loading history that leads to the state.

The excitation frequency is swept slowly "up" or "down", as in the run-up or run-down of a machine; on a branch that
bends over, both find different states. In a "ramp" the excitation is raised slowly at the frequency of the point.

A history with followed frequency begins at the resonance that the sweep meets first in a range: between two nodes,
where the phase lag passes pi/2. A resonance that the sweep jumps over at a fold is none of its states. The largest
amplitude is sought from there, as it has small maxima where pairs begin to slip, far from any resonance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from solver.clock import computing_time
from solver.continuation.phase_lag import phase_lag, solve_at_lag, solve_at_peak
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import Failure, State, history_at_rest
from solver.loading_history.frequency_sweep import FrequencySweep, cell_of, edge_of, lost
from solver.loading_history.path import FREE_STEP, Step
from solver.loading_history.sweep import Sweep
from solver.model import FloatArray, ReducedModel
from solver.newton.run import Budget, Run, guarded
from solver.outcome import Outcome
from solver.packing import Packed
from solver.results.history import StartState
from solver.settings import Direction, FollowedFrequency, SolverSettings


def follow_branch(
    model: ReducedModel,
    friction_coefficient: float | FloatArray | None,
    excitation_amplitude: float,
    frequencies: FloatArray | FollowedFrequency,
    sweep: Direction,
    settings: SolverSettings,
    keep: Callable[[Packed | str], None] | None = None,
    resume: Packed | None = None,
) -> Iterator[tuple[int, StartState]]:
    """Unworn periodic states at given frequencies, one by one, in the order of the sweep: index and state.

    A state depends on its own frequency only.

    friction_coefficient: of all pairs or of each pair. excitation_amplitude: N.
    frequencies: Hz, ascending. Or what is sought in a range of frequencies: the first resonance that the sweep meets.
    keep: called from time to time with the progress of the sweep, also on the way to a state, and with a string for the
        position and the activity of the sweep, in words.
    resume: progress, as given to `keep`, of a sweep that differs in its frequencies only. The sweep goes on from there
        to frequencies not yet passed. The states are equal to the last bit, except `run_time`.
    """
    asked = model, friction_coefficient, excitation_amplitude, sweep, settings
    sweeps = FrequencySweep(*asked, keep=keep or (lambda _: None))
    if resume is not None:
        sweeps.load(resume)
    return states_of_sweeps(sweeps, frequencies)


def states_of_sweeps(
    sweeps: FrequencySweep, frequencies: FloatArray | FollowedFrequency
) -> Iterator[tuple[int, StartState]]:
    """The states of `follow_branch`, from sweeps before their first state."""
    n_states = 1 if isinstance(frequencies, FollowedFrequency) else frequencies.size
    started = computing_time()
    for index in np.arange(n_states)[:: -1 if sweeps.direction == "down" else 1].tolist():
        sweeps.set_deadline(started + sweeps.settings.time_limit)
        ended = guarded(partial(_next_state, sweeps, frequencies, index))
        found = sweeps.without_state(ended) if isinstance(ended, Failure) else ended
        now = computing_time()
        yield index, replace(found, newton_iterations=sweeps.n_iterations, run_time=now - started)
        started = now
        sweeps.save()


def _next_state(
    sweeps: FrequencySweep, frequencies: FloatArray | FollowedFrequency, index: int
) -> StartState | Failure:
    if not isinstance(frequencies, FollowedFrequency):
        return sweeps.advance(float(frequencies[index]))
    resonance = find_resonance(sweeps, frequencies)
    return resonance if isinstance(resonance, Failure) else sweeps.advance(resonance)


def find_resonance(sweeps: FrequencySweep, follow: FollowedFrequency) -> float | Failure:
    """Frequency of the first resonance that a sweep meets in a range, Hz, or why it meets none.

    sweeps: "up" or "down", at their beginning or as saved on their way.
    """
    for near, far in _segments(follow, sweeps.direction == "down"):
        # the state at a frequency belongs to the sweep of its cell
        present = sweeps.sweep_to(0.5 * (near + far), beyond=True)
        present.advance_to(2.0 * math.pi * near)
        while (here := present.here) is not None and (step := present.ahead) is not None:
            found = _resonance_between(sweeps, present, here, step, follow)
            if found is not None:
                return found
            end = step.state.parameter
            if (2.0 * math.pi * far - end) * present.sign <= 0.0:
                break
            present.advance_to(float(np.nextafter(end, present.sign * math.inf)))
        else:
            return lost(present, present.failure or Failure(Outcome.BRANCH_LOST))
    within = f"between {follow.low:g} and {follow.high:g} Hz: give another range"
    return Failure(Outcome.RESONANCE_LOST, f"the sweep {sweeps.direction} meets no {follow.of} {within}")


def _segments(follow: FollowedFrequency, down: bool) -> Iterator[tuple[float, float]]:
    """Parts of a range, Hz, in each of which one sweep passes all frequencies, in the order of the sweep."""
    edges = [edge_of(cell) for cell in range(cell_of(follow.low) + 1, cell_of(follow.high) + 1)]
    parts = pairwise([follow.low, *(edge for edge in edges if follow.low < edge < follow.high), follow.high])
    return ((high, low) for low, high in reversed(list(parts))) if down else parts


def _resonance_between(
    sweeps: FrequencySweep, present: Sweep[State], here: State, step: Step[State], follow: FollowedFrequency
) -> float | Failure | None:
    """Frequency, Hz, of a resonance between two nodes, with the history of the first one; None where there is none."""
    path, load, ahead = present.path, sweeps.excitation_amplitude, step.state
    # positive before a resonance on the way of the sweep, negative behind
    one, other = (present.sign * math.cos(phase_lag(path.joint_of(at), at.evaluation)) for at in (here, ahead))
    if not one > 0.0 >= other:
        return None
    part = 0.0 if step.folds else one / (one - other)
    joint = path.case.joint(here.parameter + part * (ahead.parameter - here.parameter), load)
    balance = Balance(joint, history_at_rest(joint, here), here.evaluation.wear_depth)
    before = here.evaluation.predicted_h
    run = Run(sweeps.settings.tolerance, Budget(deadline=sweeps.run.budget.deadline))
    start = before + part * (ahead.evaluation.predicted_h - before)
    found = solve_at_lag(path.case, balance, start, 0.5 * math.pi, run)
    omega = math.nan if found is None else float(found.values[0])
    if not abs(omega - joint.omega) <= 2.0 * abs(ahead.parameter - here.parameter):
        # none, or another resonance
        found = None
    for fold in step.folds:
        before_fold = (fold - omega) * present.sign > FREE_STEP * fold
        if found is None or not before_fold or not run.is_stable(found.balance, found.at):
            way = f'give sweep = "{"down" if sweeps.direction == "up" else "up"}"'
            over = f"the sweep {sweeps.direction} jumps over the resonance at {fold / (2.0 * math.pi):.6g} Hz"
            return Failure(Outcome.RESONANCE_LOST, f"{over}: {way}")
    if found is not None and not follow.low <= omega / (2.0 * math.pi) <= follow.high:
        return None
    if found is not None and follow.of == "peak":
        peak = solve_at_peak(path.case, found.balance, found.at.predicted_h, 0.5 * math.pi, run)
        found = None if peak is None else peak[0]
    if found is None:
        return Failure(Outcome.RESONANCE_LOST, f"no {follow.of} is found near {joint.omega / (2.0 * math.pi):.6g} Hz")
    return float(found.values[0]) / (2.0 * math.pi)

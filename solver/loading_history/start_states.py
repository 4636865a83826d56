"""Unworn periodic states at the frequencies of a study, each with the loading history that leads to the state.

- "up", "down": the excitation frequency is swept slowly, as in the run-up or run-down of a machine. On a branch that
  bends over, the two directions find different states.
- "ramp": the excitation is raised slowly at the frequency of the point, as at the onset of flutter or of a flow
  disturbance at constant speed. Every point is independent of all others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from solver.clock import computing_time
from solver.harmonic_balance.state import Failure
from solver.loading_history.frequency_sweep import FrequencySweep
from solver.loading_history.resonance_search import find_resonance
from solver.loading_history.sweep_start import Direction
from solver.model import FloatArray, ReducedModel
from solver.newton.run import OutOfTimeError
from solver.outcome import Outcome, describe_error
from solver.packing import Packed, pack, unpack
from solver.results.history import StartState
from solver.settings import FollowedFrequency, SolverSettings


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

    A state depends on its own frequency only: the sweep begins at a frequency common to all points of a quarter octave
    (`sweep_start`) and chooses its own steps (`sweep`). Where the branch ends, the structure settles in time from the
    last state, as in a slow sweep of the machine. The last attempt starts from the static state.

    friction_coefficient: of all pairs or of each pair. excitation_amplitude: N.
    frequencies: Hz, ascending. Or what is sought in a range of frequencies: the first resonance that the sweep meets.
    sweep: "up" or "down" along the frequency, or "ramp" of the excitation at a given frequency.
    settings: harmonics, samples, tolerances, limit of time.
    keep: called from time to time with the progress of the sweep, also on the way to a state, and with a string for the
        position and the activity of the sweep, in words.
    resume: progress, as given to `keep`, of a sweep that differs in its frequencies only. The sweep goes on from there
        to frequencies not yet passed. The states are equal to the last bit, except `run_time`.
    """
    line = FrequencySweep(model, friction_coefficient, excitation_amplitude, sweep, settings)
    return follow_line(line, frequencies, keep, resume)


def follow_line(
    line: FrequencySweep,
    frequencies: FloatArray | FollowedFrequency,
    keep: Callable[[Packed | str], None] | None = None,
    resume: Packed | None = None,
) -> Iterator[tuple[int, StartState]]:
    """The states of `follow_branch` from a sweep before its first state."""
    n_states = 1 if isinstance(frequencies, FollowedFrequency) else frequencies.size
    line.run.budget.report = keep or line.run.budget.report
    if resume is not None:
        line.load(unpack(resume))

    def save() -> None:
        if keep is not None and (state := line.state()) is not None:
            keep(pack(state))

    line.save = save
    started = computing_time()
    for index in np.arange(n_states)[:: -1 if line.sweep == "down" else 1].tolist():
        line.set_deadline(started + line.settings.time_limit)
        try:
            wanted: float | Failure
            if isinstance(frequencies, FollowedFrequency):
                wanted = find_resonance(line, frequencies)
            else:
                wanted = float(frequencies[index])
            if isinstance(wanted, Failure):
                found = line.without_state(wanted.outcome, wanted.message)
            else:
                found = line.advance(wanted)
        except OutOfTimeError:
            found = line.without_state(Outcome.TIME_LIMIT)
        except Exception as error:
            # an error spoils one point only: the sweep goes on from the state before
            found = line.without_state(Outcome.EXCEPTION, describe_error(error))
        now = computing_time()
        yield index, replace(found, newton_iterations=line.n_iterations, run_time=now - started)
        started = now
        save()

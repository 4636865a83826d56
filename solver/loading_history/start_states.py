"""Unworn periodic states of a study's frequencies, each with the loading history that leads to it.

- "up", "down": the excitation frequency is swept slowly, as when a machine is run up or down. Along a branch that bends
  over, the two directions find different states.
- "ramp": the excitation is raised slowly at the frequency of the point, as when a flutter or a flow disturbance sets in
  at speed. Every point is independent of all others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from solver.clock import computing_time
from solver.loading_history.frequency_sweep import Found, FrequencySweep
from solver.loading_history.options import LOADING
from solver.loading_history.sweep_start import Sweep
from solver.model import FloatArray, ReducedModel
from solver.newton.solve_balance import OutOfTimeError
from solver.outcome import Outcome, describe_error
from solver.packing import Packed, pack, unpack
from solver.results.history import StartState
from solver.settings import SolverSettings


def follow_branch(
    model: ReducedModel,
    friction_coefficient: float | FloatArray | None,
    excitation_amplitude: float,
    frequencies: FloatArray,
    sweep: Sweep,
    settings: SolverSettings,
    keep: Callable[[Packed], None] | None = None,
    resume: Packed | None = None,
    tell: Callable[[str], None] | None = None,
) -> Iterator[tuple[int, StartState]]:
    """Unworn periodic states at some frequencies: index and state, one by one.

    A state depends on its own frequency and on no other: the sweep to it begins at a frequency that is the same for
    all points of a quarter octave (`sweep_start`) and has steps of its own (`sweep`). Where the branch ends at a fold
    it is followed by arc length until it reaches the next node in a stable state, which is where a slow sweep of the
    machine would land if the branch is one curve. Where that fails, the structure is left to settle in time from the
    last state, and at last the state is sought from the static one.

    Parameters
    ----------
    model, friction_coefficient
        The case.
    excitation_amplitude
        N.
    frequencies
        Hz, ascending.
    sweep
        How the states are reached: "up" or "down" along the frequency, "ramp" at a fixed one.
    settings
        Harmonics, samples, tolerances, limit of time.
    keep
        Called now and then, after the state was taken from the iterator, with the progress of the sweep.
    resume
        Such progress of a sweep that differs in its frequencies only. Frequencies beyond those that it had passed are
        reached from there; the states are the same to the last bit, but for `run_time`.
    tell
        Called with where the sweep is and what it does there, in words.

    Yields
    ------
    tuple of int and StartState
        Index of the frequency, in the order of the sweep, and its state or why there is none.
    """
    order = np.arange(frequencies.size)[:: -1 if sweep == "down" else 1]
    line = FrequencySweep(model, friction_coefficient, excitation_amplitude, sweep, settings)
    line.budget.tell = tell or line.budget.tell
    counted = 0
    if resume is not None:
        counted, state = unpack(resume)
        line.load_state(state)
    kept = counted
    started = computing_time()
    for index in order:
        line.set_deadline(started + settings.time_limit)
        message = ""
        try:
            found = line.advance(float(frequencies[index]))
        except OutOfTimeError:
            found = Found(Outcome.TIME_LIMIT)
        except Exception as error:
            # one bad point is one bad point: the sweep goes on from the state before
            found, message = Found(Outcome.EXCEPTION), describe_error(error)
        now = computing_time()
        yield (
            int(index),
            StartState(
                outcome=found.outcome,
                state=found.state,
                coarse=found.coarse,
                penalty_omega=line.penalty_omega,
                resolution=found.resolution or line.resolution,
                response_error=found.estimate.response,
                wear_rate_error=found.estimate.wear_rate,
                newton_iterations=line.n_iterations - counted,
                run_time=now - started,
                branch=found.branch,
                fold_frequency=found.fold / (2.0 * np.pi),
                message=message or found.message,
            ),
        )
        started, counted = now, line.n_iterations
        # a sweep that has found no state to begin with has nothing to go on from
        begun = line.nodes is not None and line.nodes.saved is not None
        if keep is not None and begun and counted >= kept + LOADING.iterations_per_report:
            keep(pack((counted, line.state_dict())))
            kept = counted

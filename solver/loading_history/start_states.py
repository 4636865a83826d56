"""Unworn periodic states at the frequencies of a study, each with the loading history that leads to the state.

- "up", "down": the excitation frequency is swept slowly, as in the run-up or run-down of a machine. On a branch that
  bends over, the two directions find different states.
- "ramp": the excitation is raised slowly at the frequency of the point, as at the onset of flutter or of a flow
  disturbance at constant speed. Every point is independent of all others.

A history with followed frequency begins at the resonance that the sweep "up" or "down" meets first in a range: between
two nodes, where the phase lag passes pi/2. A resonance that the sweep jumps over, from a fold to a branch beyond, is
none of its states. The largest amplitude is sought from there, and the sweep then leads to its frequency: along the
sweep the amplitude has small maxima where pairs begin to slip, far from any resonance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from solver.clock import computing_time
from solver.continuation.phase_lag import phase_lag, solve_at_peak
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import Failure, State
from solver.loading_history.frequency_sweep import FrequencySweep, cell_of, edge_of, why_lost
from solver.loading_history.path import FREE_STEP
from solver.loading_history.sweep import NODE_ITERATIONS, Sweep
from solver.model import FloatArray, ReducedModel
from solver.newton.run import Budget, OutOfTimeError, Run
from solver.outcome import Outcome, describe_error
from solver.packing import Packed, pack, unpack
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

    A state depends on its own frequency only. Where the branch ends, the structure settles in time from the last state,
    as in a slow sweep of the machine. The last attempt starts from the static state.

    friction_coefficient: of all pairs or of each pair. excitation_amplitude: N.
    frequencies: Hz, ascending. Or what is sought in a range of frequencies: the first resonance that the sweep meets.
    sweep: "up" or "down" along the frequency, or "ramp" of the excitation at a given frequency.
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
            if isinstance(frequencies, FollowedFrequency):
                found = line.advance(find_resonance(line, frequencies))
            else:
                found = line.advance(float(frequencies[index]))
        except _NoResonanceError as error:
            found = line.without_state(error.failure.outcome, error.failure.message)
        except OutOfTimeError:
            found = line.without_state(Outcome.TIME_LIMIT)
        except Exception as error:
            # an error spoils one point only: the sweep goes on from the state before
            found = line.without_state(Outcome.EXCEPTION, describe_error(error))
        now = computing_time()
        yield index, replace(found, newton_iterations=line.n_iterations, run_time=now - started)
        started = now
        save()


class _NoResonanceError(Exception):
    """The sweep meets no resonance, or has no state at a frequency."""

    def __init__(self, message: str, outcome: Outcome = Outcome.RESONANCE_LOST) -> None:
        super().__init__(message)
        self.failure = Failure(outcome, message)


def find_resonance(line: FrequencySweep, follow: FollowedFrequency) -> float:
    """Frequency of the first resonance that a sweep meets in a range, Hz. Raises _NoResonanceError.

    line: sweep "up" or "down", at its beginning or as saved on its way.
    """
    before = None
    for near, far in _segments(follow, line.sweep == "down"):
        # the state at a frequency belongs to the sweep of its cell
        search = _Between(line, line.sweep_to(0.5 * (near + far), beyond=True))
        nodes = search.nodes
        place, end = (2.0 * math.pi * frequency for frequency in (near, far))
        if nodes.here is not None and nodes.has_passed(place):
            # saved on the way
            place = nodes.here.parameter
        nodes.advance_to(place)
        here = search.excess(place)
        if before is not None and before > 0.0 >= here:
            return near
        while place != end:
            nodes.advance_to(float(np.nextafter(place, nodes.direction * math.inf)))
            if nodes.ahead is None:
                raise search.lost(place, nodes.state.failure or Outcome.BRANCH_LOST)
            target = min(nodes.ahead.state.parameter, end, key=lambda at: (at - place) * nodes.direction)
            there = search.excess(target)
            if here > 0.0 >= there:
                found = search.zero(place, target)
                return (found if follow.of == "resonance" else search.peak(found)) / (2.0 * math.pi)
            place, here = target, there
        before = here
    raise _NoResonanceError(
        f"the sweep {line.sweep} meets no {follow.of} between {follow.low:g} and {follow.high:g} Hz: give another range"
    )


def _segments(follow: FollowedFrequency, down: bool) -> Iterator[tuple[float, float]]:
    """Parts of a range, Hz, in each of which one sweep passes all frequencies, in the order of the sweep."""
    edges = [edge_of(cell) for cell in range(cell_of(follow.low) + 1, cell_of(follow.high) + 1)]
    ends = [follow.low, *(edge for edge in edges if follow.low < edge < follow.high), follow.high]
    # a frequency on an edge belongs to the part above
    parts = [(low, high if high == follow.high else float(np.nextafter(high, 0.0))) for low, high in pairwise(ends)]
    return ((high, low) for low, high in reversed(parts)) if down else iter(parts)


class _Between:
    """States of a sweep between its present and its next node. Its functions raise _NoResonanceError."""

    def __init__(self, line: FrequencySweep, nodes: Sweep[State]) -> None:
        self.line, self.nodes = line, nodes
        self.run = Run(line.settings.tolerance, Budget(deadline=line.run.budget.deadline))

    def lost(self, omega: float, failure: Outcome) -> _NoResonanceError:
        """The sweep has no state at a frequency, rad/s."""
        said = f"ends at {omega / (2.0 * math.pi):.6g} Hz and has met no resonance until there"
        return _NoResonanceError(f"the sweep {self.line.sweep} {said}", why_lost(self.nodes, failure))

    def state_at(self, omega: float) -> State:
        """State at a frequency, rad/s."""
        found = self.nodes.state_at(omega, self.run.fresh())
        if isinstance(found, Outcome):
            raise self.lost(omega, found)
        return found.state

    def excess(self, omega: float) -> float:
        """Positive before the resonance on the way of the sweep, negative behind."""
        self.run.budget.iterations, self.run.budget.limit = 0, NODE_ITERATIONS
        state = self.state_at(omega)
        joint = self.nodes.path.case.joint(omega, self.line.excitation_amplitude)
        return self.nodes.direction * math.cos(phase_lag(joint, state.evaluation))

    def zero(self, one: float, other: float) -> float:
        """Frequency, rad/s, at which the excess passes zero."""
        if self.excess(one) <= 0.0:
            # zero but for round-off
            return one
        from scipy.optimize import brentq  # where it is used: it takes a while to load

        found = float(brentq(self.excess, one, other, xtol=self.line.settings.tolerance * one, rtol=1e-12))
        for fold in self.nodes.ahead.folds if self.nodes.ahead is not None else ():
            if abs(found - fold) <= FREE_STEP * fold:
                back = "down" if self.line.sweep == "up" else "up"
                over = f"resonance at {fold / (2.0 * math.pi):.6g} Hz"
                raise _NoResonanceError(f'the sweep {self.line.sweep} jumps over the {over}: give sweep = "{back}"')
        return found

    def peak(self, omega: float) -> float:
        """Frequency of the largest amplitude near phase resonance, rad/s."""
        at, case = self.state_at(omega).evaluation, self.nodes.path.case
        balance = Balance(case.joint(omega, self.line.excitation_amplitude), at.history, at.wear_depth)
        found = solve_at_peak(case, balance, at.predicted_h, 0.5 * math.pi, self.run.fresh())
        if found is None:
            at_hertz = f"{omega / (2.0 * math.pi):.6g} Hz"
            raise _NoResonanceError(f"no largest amplitude is found near phase resonance at {at_hertz}")
        return float(found[0].values[0])

"""The resonance that a sweep over a range of frequencies meets first: where a history with followed frequency begins.

The sweep is the loading history of the point, up or down, with nodes of its own (`sweep`). Between two nodes the
resonance is where the phase lag passes pi/2. A resonance that the sweep jumps over, from a fold to a branch beyond, is
none of its states. The largest amplitude is sought from there, and the sweep then leads to its frequency. Along the
sweep the amplitude has small maxima where pairs begin to slip, far from any resonance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from solver.continuation.largest_response import solve_at_peak
from solver.continuation.phase_lag import phase_lag
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import State
from solver.loading_history.frequency_sweep import Found, FrequencySweep
from solver.loading_history.path import FREE_STEP
from solver.loading_history.path_of_states import Step
from solver.loading_history.sweep import NODE_ITERATIONS, Sweep
from solver.loading_history.sweep_start import CELLS_PER_OCTAVE
from solver.newton.run import Budget, Run
from solver.outcome import Outcome
from solver.settings import FollowedFrequency


def advance_to_resonance(line: FrequencySweep, follow: FollowedFrequency) -> Found:
    """State at the first resonance that a sweep meets in a range, or the reason why there is none.

    line: sweep "up" or "down", at its beginning or as saved on its way.
    """
    try:
        frequency = find_resonance(line, follow)
    except _NoneFoundError as error:
        return Found(error.outcome, message=str(error))
    return line.advance(frequency)


class _NoneFoundError(Exception):
    """The sweep meets no resonance."""

    def __init__(self, message: str, outcome: Outcome = Outcome.RESONANCE_LOST) -> None:
        super().__init__(message)
        self.outcome = outcome


def find_resonance(line: FrequencySweep, follow: FollowedFrequency) -> float:
    """Frequency of the first resonance that a sweep meets in a range, Hz. Raises _NoneFoundError."""
    before = None
    for near, far in _segments(follow, line.sweep == "down"):
        # the state at a frequency belongs to the sweep of its quarter octave
        nodes = line.sweep_in_cell(0.5 * (near + far))
        run = Run(line.settings.tolerance, Budget(deadline=line.run.budget.deadline))

        def excess(omega: float, nodes: Sweep[State] = nodes, run: Run = run) -> float:
            """Positive before the resonance on the way of the sweep, negative behind."""
            run.budget.iterations, run.budget.limit = 0, NODE_ITERATIONS
            state = _state_at(line, nodes, omega, run)
            joint = nodes.path.case.joint(omega, line.excitation_amplitude)
            return nodes.direction * math.cos(phase_lag(joint, state.evaluation))

        place, end = (2.0 * math.pi * frequency for frequency in (near, far))
        if nodes.here is not None and (nodes.here.parameter - place) * nodes.direction > 0.0:
            # saved on the way
            place = nodes.here.parameter
        nodes.advance_to(place)
        here = excess(place)
        if before is not None and before > 0.0 >= here:
            return near
        while place != end:
            nodes.advance_to(float(np.nextafter(place, nodes.direction * math.inf)))
            if nodes.ahead is None:
                raise _lost(line, nodes, place)
            target = min(nodes.ahead.state.parameter, end, key=lambda at: (at - place) * nodes.direction)
            there = excess(target)
            if here > 0.0 >= there:
                found = _between(line, excess, place, target, nodes)
                return (found if follow.of == "resonance" else _peak(line, nodes, found, run)) / (2.0 * math.pi)
            place, here = target, there
        before = here
    raise _NoneFoundError(
        f"the sweep {line.sweep} meets no {follow.of} between {follow.low:g} and {follow.high:g} Hz: give another range"
    )


def _segments(follow: FollowedFrequency, down: bool) -> Iterator[tuple[float, float]]:
    """Parts of a range, Hz, in each of which one sweep passes all frequencies, in the order of the sweep."""
    per_octave = CELLS_PER_OCTAVE
    first, last = (math.floor(per_octave * math.log2(end)) for end in (follow.low, follow.high))
    edges = [2.0 ** (cell / per_octave) for cell in range(first + 1, last + 1)]
    ends = [follow.low, *(edge for edge in edges if follow.low < edge < follow.high), follow.high]
    # a frequency on an edge belongs to the part above
    parts = [(low, high if high == follow.high else float(np.nextafter(high, 0.0))) for low, high in pairwise(ends)]
    return ((high, low) for low, high in reversed(parts)) if down else iter(parts)


def _peak(line: FrequencySweep, nodes: Sweep[State], omega: float, run: Run) -> float:
    """Frequency of the largest amplitude near phase resonance, rad/s. Raises _NoneFoundError."""
    at, case = _state_at(line, nodes, omega, run).evaluation, nodes.path.case
    balance = Balance(case.joint(omega, line.excitation_amplitude), at.history, at.wear_depth)
    found = solve_at_peak(case, balance, at.predicted_h, 0.5 * math.pi, run.fresh())
    if found is None:
        raise _NoneFoundError(f"no largest amplitude is found near phase resonance at {omega / (2.0 * math.pi):.6g} Hz")
    return float(found[0].values[0])


def _state_at(line: FrequencySweep, nodes: Sweep[State], omega: float, run: Run) -> State:
    """State of the sweep between its nodes. Raises _NoneFoundError."""
    found = nodes.state_at(omega, run.fresh())
    if not isinstance(found, Step):
        nodes.state = replace(nodes.state, failure=found)
        raise _lost(line, nodes, omega)
    return found.state


def _between(
    line: FrequencySweep, excess: Callable[[float], float], one: float, other: float, nodes: Sweep[State]
) -> float:
    """Frequency, rad/s, at which the excess passes zero between two nodes. Raises _NoneFoundError."""
    if excess(one) <= 0.0:
        # zero but for round-off
        return one
    from scipy.optimize import brentq  # where it is used: it takes a while to load

    found = float(brentq(excess, one, other, xtol=line.settings.tolerance * one, rtol=1e-12))
    assert nodes.ahead is not None
    for fold in nodes.ahead.folds:
        if abs(found - fold) <= FREE_STEP * fold:
            way, back = ("up", "down") if nodes.direction > 0.0 else ("down", "up")
            over = f"resonance at {fold / (2.0 * math.pi):.6g} Hz"
            raise _NoneFoundError(f'the sweep {way} jumps over the {over}: give sweep = "{back}"')
    return found


def _lost(line: FrequencySweep, nodes: Sweep[State], omega: float) -> _NoneFoundError:
    return _NoneFoundError(
        f"the sweep {line.sweep} ends at {omega / (2.0 * math.pi):.6g} Hz and has met no resonance until there",
        line.why_lost(nodes),
    )

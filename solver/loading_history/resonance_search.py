"""The resonance that a sweep over a range of frequencies meets first: where a history with followed frequency begins.

The sweep is the loading history of the point, up or down, with nodes of its own (`sweep`). Between two nodes the
resonance is where the phase lag passes pi/2. A resonance that the sweep jumps over, from a fold to a branch beyond, is
none of its states. The largest amplitude is sought from there, and the sweep then leads to its frequency. Along the
sweep the amplitude has small maxima where pairs begin to slip, far from any resonance.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from solver.continuation.largest_response import solve_at_peak
from solver.continuation.phase_lag import phase_lag
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import Failure, State
from solver.loading_history.frequency_sweep import FrequencySweep, why_lost
from solver.loading_history.path import FREE_STEP
from solver.loading_history.path_of_states import Step
from solver.loading_history.sweep import NODE_ITERATIONS, Sweep
from solver.loading_history.sweep_start import CELLS_PER_OCTAVE, cell_of
from solver.newton.run import Budget, Run
from solver.outcome import Outcome
from solver.settings import FollowedFrequency


def find_resonance(line: FrequencySweep, follow: FollowedFrequency) -> float | Failure:
    """Frequency of the first resonance that a sweep meets in a range, Hz, or why there is none.

    line: sweep "up" or "down", at its beginning or as saved on its way.
    """
    try:
        return _first_resonance(line, follow)
    except _NoneFoundError as error:
        return error.failure


class _NoneFoundError(Exception):
    """The sweep meets no resonance, or has no state at a frequency."""

    def __init__(self, message: str, outcome: Outcome = Outcome.RESONANCE_LOST) -> None:
        super().__init__(message)
        self.failure = Failure(outcome, message)


def _first_resonance(line: FrequencySweep, follow: FollowedFrequency) -> float:
    before = None
    for near, far in _segments(follow, line.sweep == "down"):
        # the state at a frequency belongs to the sweep of its quarter octave
        search = _Between(line, line.sweep_to(0.5 * (near + far), beyond=True))
        nodes = search.nodes
        place, end = (2.0 * math.pi * frequency for frequency in (near, far))
        if nodes.here is not None and (nodes.here.parameter - place) * nodes.direction > 0.0:
            # saved on the way
            place = nodes.here.parameter
        nodes.advance_to(place)
        here = search.excess(place)
        if before is not None and before > 0.0 >= here:
            return near
        while place != end:
            nodes.advance_to(float(np.nextafter(place, nodes.direction * math.inf)))
            if nodes.ahead is None:
                raise search.lost(place, nodes.state.failure)
            target = min(nodes.ahead.state.parameter, end, key=lambda at: (at - place) * nodes.direction)
            there = search.excess(target)
            if here > 0.0 >= there:
                found = search.zero(place, target)
                return (found if follow.of == "resonance" else search.peak(found)) / (2.0 * math.pi)
            place, here = target, there
        before = here
    raise _NoneFoundError(
        f"the sweep {line.sweep} meets no {follow.of} between {follow.low:g} and {follow.high:g} Hz: give another range"
    )


def _segments(follow: FollowedFrequency, down: bool) -> Iterator[tuple[float, float]]:
    """Parts of a range, Hz, in each of which one sweep passes all frequencies, in the order of the sweep."""
    first, last = cell_of(follow.low), cell_of(follow.high)
    edges = [2.0 ** (cell / CELLS_PER_OCTAVE) for cell in range(first + 1, last + 1)]
    ends = [follow.low, *(edge for edge in edges if follow.low < edge < follow.high), follow.high]
    # a frequency on an edge belongs to the part above
    parts = [(low, high if high == follow.high else float(np.nextafter(high, 0.0))) for low, high in pairwise(ends)]
    return ((high, low) for low, high in reversed(parts)) if down else iter(parts)


class _Between:
    """States of a sweep between its present and its next node. Its functions raise _NoneFoundError."""

    def __init__(self, line: FrequencySweep, nodes: Sweep[State]) -> None:
        self.line, self.nodes = line, nodes
        self.run = Run(line.settings.tolerance, Budget(deadline=line.run.budget.deadline))

    def lost(self, omega: float, failure: Outcome) -> _NoneFoundError:
        """The sweep has no state at a frequency, rad/s."""
        said = f"ends at {omega / (2.0 * math.pi):.6g} Hz and has met no resonance until there"
        return _NoneFoundError(f"the sweep {self.line.sweep} {said}", why_lost(self.nodes, failure))

    def state_at(self, omega: float) -> State:
        """State at a frequency, rad/s."""
        found = self.nodes.state_at(omega, self.run.fresh())
        if isinstance(found, Step):
            return found.state
        raise self.lost(omega, found)

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
        assert self.nodes.ahead is not None
        for fold in self.nodes.ahead.folds:
            if abs(found - fold) <= FREE_STEP * fold:
                way, back = ("up", "down") if self.nodes.direction > 0.0 else ("down", "up")
                over = f"resonance at {fold / (2.0 * math.pi):.6g} Hz"
                raise _NoneFoundError(f'the sweep {way} jumps over the {over}: give sweep = "{back}"')
        return found

    def peak(self, omega: float) -> float:
        """Frequency of the largest amplitude near phase resonance, rad/s."""
        at, case = self.state_at(omega).evaluation, self.nodes.path.case
        balance = Balance(case.joint(omega, self.line.excitation_amplitude), at.history, at.wear_depth)
        found = solve_at_peak(case, balance, at.predicted_h, 0.5 * math.pi, self.run.fresh())
        if found is not None:
            return float(found[0].values[0])
        at_hertz = f"{omega / (2.0 * math.pi):.6g} Hz"
        raise _NoneFoundError(f"no largest amplitude is found near phase resonance at {at_hertz}")

"""Steps of a march whose length is not known beforehand: kept on the way, and read evenly along the history."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from solver.accuracy.error_estimate import euler_error
from solver.contact.archard import wear_rate
from solver.model import FloatArray
from solver.outcome import Outcome
from solver.packing import attributes
from solver.results.history import WearHistory
from solver.results.options import RESULTS
from solver.results.recorder import Recorder, RecorderState, bent_within
from solver.results.state_report import StateReport

Step = tuple[float, StateReport, float, FloatArray | None]
"""Count at the end of a step, the state there, the error of the step, m3, and what its depths differ from those of the
companion, (n_contact,), m; None where the companion was not there."""


class TrailState(RecorderState):
    """What was kept so far: attributes of `TrailRecorder`."""

    steps: list[Step]


@dataclass
class TrailRecorder(Recorder):
    """Takes the steps of a march to the end; in the end its counts divide the history evenly.

    The way from one count to the next is what wears over all that has worn, and the cycles over all cycles: each is the
    same, so that neither a burst of wear nor the long calm behind it falls between two outputs, and straight lines
    between them show the history. Where the steps become many those are left out that go the least way.
    cycles (n_output,): all 0.
    """

    wear_coefficient: float = field(init=False, default=0.0)
    steps: list[Step] = field(init=False, default_factory=list, repr=False)

    def add(self, cycle: float, report: StateReport, wear_coefficient: float, error: float | None = None) -> None:
        """As that of a `Recorder`."""
        super().add(cycle, report, wear_coefficient, error)
        self.wear_coefficient, own = wear_coefficient, 0.0
        if self.steps:
            before, other, _, _ = self.steps[-1]
            change = wear_coefficient * abs(float(report.wearing_work.sum() - other.wearing_work.sum()))
            own = euler_error(cycle - before, change) if error is None else error
        self.steps.append((cycle, report, own, None))
        if len(self.steps) > self._most:
            self._thin()

    def compare(self, difference: FloatArray | None) -> None:
        """Depths of the companion less those of the last step; None where it has not come to it."""
        cycle, report, error, _ = self.steps[-1]
        self.steps[-1] = (cycle, report, error, difference)

    def state_dict(self) -> TrailState:
        """What was kept so far, to be packed."""
        return attributes(self, TrailState)

    def finish(
        self,
        outcome: Outcome,
        jump_cycle: float,
        iterations: int,
        run_time: float,
        companion: FloatArray,
        met: Sequence[tuple[float, float]] = (),
        start_error: float = 0.0,
    ) -> WearHistory:
        """As that of a `Recorder`; the last count is that at which the target was reached, or that of the last step."""
        if not self.steps:
            return super().finish(outcome, jump_cycle, iterations, run_time, companion, met, start_error)
        end = self.steps[-1][0] if np.isnan(self.reached) else self.reached
        read = Recorder(
            self.model, self._counts(end), self.start_iterations, self.start_time, self.scheme, self.n_loops
        )
        for cycle, report, error, _ in self.steps:
            read.add(cycle, report, self.wear_coefficient, error)
        read.reached = self.reached
        self.compared = self._companion(read.cycles, read.kept["wear_depth"])
        return read.finish(outcome, jump_cycle, iterations, run_time, self.compared, met, start_error)

    @property
    def _most(self) -> int:
        """Steps that are kept at most."""
        return RESULTS.trail_steps * max(self.cycles.size, RESULTS.trail_outputs)

    def _volumes(self) -> FloatArray:
        return np.array([report.wear_depth @ self.model.contact.area for _, report, _, _ in self.steps])

    def _thin(self) -> None:
        """Leave out steps that go a little way; their errors go to those that follow."""
        at, volumes = np.array([step[0] for step in self.steps]), self._volumes()
        way = at / at[-1] + volumes / max(volumes[-1], 1e-300)
        least = 2.0 * way[-1] / self._most
        kept, error, left, difference = [self.steps[0]], 0.0, 0, None
        for place, (cycle, report, own, differs) in enumerate(self.steps[1:], start=1):
            error += own
            difference = differs if differs is not None else difference
            if place == len(self.steps) - 1 or way[place + 1] - way[left] > least:
                kept.append((cycle, report, error, difference))
                error, left, difference = 0.0, place, None
        self.steps = kept

    def _counts(self, end: float) -> FloatArray:
        """Counts (n_output,) that divide the way to the count `end` evenly."""
        at, volumes = np.array([step[0] for step in self.steps]), self._volumes()
        courses = [self._course(one, other) for one, other in pairwise(self.steps)]
        found = np.zeros(self.cycles.size)
        found[-1] = end
        if not courses or volumes[-1] <= 0.0:
            return found
        last = int(np.clip(np.searchsorted(at, end), 1, len(courses)))
        whole = volumes[last - 1] + _cubic(courses[last - 1], (end - at[last - 1]) / (at[last] - at[last - 1]))
        way = at / end + volumes / whole
        for place in range(1, found.size - 1):
            wanted = 2.0 * place / (found.size - 1)
            step = int(np.clip(np.searchsorted(way, wanted), 1, last))
            # the cycles of a step are a cubic with equal slopes
            straight = (at[step] - at[step - 1]) / end
            grown, first, behind = (value / whole + straight for value in courses[step - 1])
            within = _solve_cubic((grown, first, behind), wanted - way[step - 1])
            found[place] = min(at[step - 1] + within * (at[step] - at[step - 1]), end)
        return found

    def _course(self, start: Step, end: Step) -> tuple[float, float, float]:
        """Volume that a step wears, and its slopes at both ends, over the step: m3."""
        area, length, grown = self.model.contact.area, end[0] - start[0], end[1].wear_depth - start[1].wear_depth
        rates = [wear_rate(self.wear_coefficient, area, step[1].wearing_work) for step in (start, end)]
        first, last = bent_within(grown, length, rates[0], rates[1]) if self.scheme == "adaptive" else (grown, grown)
        return float(grown @ area), float(first @ area), float(last @ area)

    def _companion(self, counts: FloatArray, depth: FloatArray) -> FloatArray:
        """Depths of the companion at counts at which those of the march are `depth`, both (n_output, n_contact), m."""
        met = [(cycle, differs) for cycle, _, _, differs in self.steps if differs is not None]
        if not met:
            return np.full_like(depth, np.nan)
        # both begin unworn
        at = np.array([0.0, *(cycle for cycle, _ in met)])
        differences = np.array([np.zeros_like(met[0][1]), *(differs for _, differs in met)])
        place = np.clip(np.searchsorted(at, counts), 1, len(at) - 1)
        fraction = np.clip((counts - at[place - 1]) / (at[place] - at[place - 1]), 0.0, 1.0)[:, None]
        return np.asarray(depth + differences[place - 1] + fraction * (differences[place] - differences[place - 1]))


def _cubic(course: tuple[float, float, float], fraction: Any) -> Any:
    """Hermite's cubic from 0, as in `recorder.depth_within`, at a fraction of the step."""
    grown, first, last = course
    s = fraction
    return s**2 * (3.0 - 2.0 * s) * grown + (1.0 - s) ** 2 * s * first - s**2 * (1.0 - s) * last


def _solve_cubic(course: tuple[float, float, float], wanted: float) -> float:
    """Fraction of the step at which the cubic, which never falls, has a value."""
    low, high = 0.0, 1.0
    while high - low > RESULTS.target_resolution:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _cubic(course, middle) >= wanted else (middle, high)
    return high

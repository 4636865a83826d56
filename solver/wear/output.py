"""Dense output of a wear history: stored steps, interpolated at any cycle counts."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.model import BoolArray, FloatArray
from solver.packing import packable
from solver.results.loops import LOOP_PHASES
from solver.results.state_report import StateReport
from solver.settings import Resolution, WearTarget
from solver.wear.interpolation import TargetSearch, depth_within, fraction_where

KEPT_STEPS = 800
"""Most stored steps of a history beside those with an output, and most at whose ends it is compared with its reference
solution; half as many after the steps with the least progress are dropped. A result has 101 outputs by default, an
adaptive history of 1e5 cycles about 100 steps."""

INTERPOLATED = (
    "wear_depth",
    "mean_pressure",
    "slip_range",
    "open_fraction",
    "response",
    "response_mean",
    "response_peak",
    "excitation_frequency",
    "excitation_frequency_error",
    "loop_displacement",
    "loop_force",
)
"""Reported values that are interpolated between the ends of a step."""

CERTIFIED = (
    "residual",
    "penetration",
    "tension",
    "cone_violation",
    "energy_error",
    "response_error",
    "wear_rate_error",
)
"""Values of the certificate; within a step, the larger value of both ends holds."""


@packable
@dataclass(frozen=True)
class Node:
    """The end of a step.

    cycle: cycle count.
    report: report of the state.
    rate (n_contact,): wear rates, m per cycle.
    local: sum of the local errors of the steps so far, as worn volume, m3.
    """

    cycle: float
    report: StateReport
    rate: FloatArray
    local: float


@packable
@dataclass(frozen=True)
class Course:
    """The steps of a history.

    ends (n_steps + 1,): counts at the first state and at the ends of all steps.
    resolutions: cycle count from which on a resolution holds, and this resolution.
    """

    ends: tuple[float, ...] = ()
    resolutions: tuple[tuple[float, Resolution], ...] = ()

    def after(self, cycle: float, resolution: Resolution) -> Course:
        """The course with the end of another step."""
        changed = not self.resolutions or self.resolutions[-1][1] != resolution
        resolutions = (*self.resolutions, (cycle, resolution)) if changed else self.resolutions
        return Course((*self.ends, cycle), resolutions)


@packable
@dataclass(frozen=True)
class OutputState:
    """Data of a dense output.

    nodes: first state and ends of the steps, ascending, thinned where the steps are many.
    course: course of all steps.
    reached: count at which the target was reached, NaN until then.
    reached_within: estimated error of this count by the interpolation within the step.
    """

    nodes: tuple[Node, ...] = ()
    course: Course = Course()
    reached: float = math.nan
    reached_within: float = 0.0

    @property
    def cycles(self) -> FloatArray:
        """Counts (n,) of the nodes."""
        return np.array([node.cycle for node in self.nodes])


@dataclass
class DenseOutput:
    """Takes the state after every step and stores the steps that are read later.

    Euler steps: all values are linear over the step. Adaptive steps: the depth is a cubic with the wear rates at both
    ends, and all other values are linear in the worn volume, of which the state is a function. Fretting loops are
    interpolated phase by phase. So they close, lie within the friction cone and agree with the interpolated mean
    pressure.

    area (n_contact,): m2.
    smooth: whether the depth is a cubic within a step.
    counts (n_output,): ascending counts to be read, whose steps are stored; empty for counts not known beforehand.
    target: wear whose count is sought within the steps; None for none.
    taken: data stored so far.
    """

    area: FloatArray
    smooth: bool
    counts: FloatArray = field(default_factory=lambda: np.zeros(0))
    target: WearTarget | None = None
    taken: OutputState = OutputState()

    @property
    def last(self) -> Node | None:
        """End of the last step; None before the first state."""
        return self.taken.nodes[-1] if self.taken.nodes else None

    @property
    def reached_target(self) -> bool:
        """Whether a step has reached the target."""
        return not math.isnan(self.taken.reached)

    def add(self, cycle: float, report: StateReport, rate: FloatArray, error: float) -> None:
        """Take the state at the end of a step.

        cycle: count at the end of the step, never lower than the last one. report: of the state.
        rate (n_contact,): wear rates, m per cycle. error: estimated local error of the step, as worn volume, m3.
        """
        last, reached, within = self.last, self.taken.reached, self.taken.reached_within
        nodes = (*self.taken.nodes, Node(cycle, report, rate, error + (0.0 if last is None else last.local)))
        if math.isnan(reached) and last is not None and self._search is not None:
            reached = self._search.within(nodes)
            within = abs(reached - self._search.within(nodes, straight=True))
        course = self.taken.course.after(cycle, report.resolution)
        self.taken = OutputState(nodes, course, reached, within)
        if len(nodes) > KEPT_STEPS + 2 * self.counts.size:
            self.taken = replace(self.taken, nodes=self._thinned())

    def _thinned(self) -> tuple[Node, ...]:
        """The nodes without those of little progress, see `even_counts`, between which nothing is read."""
        nodes, at = self.taken.nodes, self.taken.cycles
        read = np.append(self.counts, self.taken.reached)
        ends = np.searchsorted(at, read[read <= at[-1]])
        needed = {0, len(nodes) - 1, *ends, *(ends - 1)}
        volumes = self.values()["wear_depth"] @ self.area
        way = at / at[-1] + volumes / max(volumes[-1], 1e-300)
        least, kept = 2.0 * way[-1] / KEPT_STEPS, [0]
        for place in range(1, len(nodes)):
            if place in needed or way[place + 1] - way[kept[-1]] > least:
                kept.append(place)
        return tuple(nodes[place] for place in kept)

    def values(self) -> dict[str, Any]:
        """Values at the nodes, by their names in `read`; the first axis is that of the counts."""
        nodes, names = self.taken.nodes, ("wear_depth", "response", "response_peak")
        found = {name: np.array([getattr(node.report, name) for node in nodes]) for name in names}
        return found | {"wear_rate": np.array([node.rate @ self.area for node in nodes])}

    @property
    def _search(self) -> TargetSearch | None:
        return None if self.target is None else TargetSearch(self.target, self.area, self.smooth)

    def target_count(self) -> float:
        """Count at which the stored steps reach the target; if they do not, extrapolated by the mean rate of the last
        one, inf where this rate is 0.
        """
        return math.inf if self._search is None else self._search.count(self.taken.nodes)

    def target_within(self) -> float:
        """Error, cycles, of the count at which the target was reached by the interpolation within the step, and by the
        errors of the resonance at its end and at the start.
        """
        by_resonance = 0.0 if self._search is None else self._search.by_resonance(self.taken.nodes, self.taken.reached)
        return self.taken.reached_within + by_resonance

    def read(self, counts: FloatArray) -> dict[str, Any]:
        """All values at ascending counts (n,), by name; the first axis is that of the counts.

        - `INTERPOLATED` and `CERTIFIED`, `harmonics_used`, `samples_used`, `stable`: as in `WearHistory`.
        - `wear_rate` (n,): m3 per cycle.
        - `depth_rate` (n, n_contact): wear rate of each pair, m per cycle.
        - `local` (n,): sum of the local errors, m3.

        Values beyond the last step are NaN, whole numbers 0; empty before the first state.
        """
        nodes, cycles = self.taken.nodes, self.taken.cycles
        reached = counts <= (cycles[-1] if nodes else -math.inf)
        places = np.searchsorted(cycles, counts[reached], "left")
        rows = [
            self._row(nodes[max(place - 1, 0)], nodes[place], float(at))
            for place, at in zip(places, counts[reached], strict=True)
        ]
        return {name: _column([row[name] for row in rows], reached) for name in (rows[0] if rows else ())}

    def _row(self, start: Node, end: Node, count: float) -> dict[str, Any]:
        """Values at a count within a step."""
        length = end.cycle - start.cycle
        fraction = (count - start.cycle) / length if length > 0.0 else 1.0
        depth = self._depth(start, end, fraction)
        if self.smooth and length > 0.0:
            whole = float((end.report.wear_depth - start.report.wear_depth) @ self.area)
            fraction = float((depth - start.report.wear_depth) @ self.area) / whole if whole > 0.0 else fraction
        one, other = start.report, end.report
        between: dict[str, Any] = {
            name: getattr(one, name) + fraction * (getattr(other, name) - getattr(one, name)) for name in INTERPOLATED
        }
        between["wear_depth"] = depth
        between["depth_rate"] = start.rate + fraction * (end.rate - start.rate)
        between["wear_rate"] = float(between["depth_rate"] @ self.area)
        # a step may be much longer than the history to the count
        between["local"] = start.local + fraction * (end.local - start.local)
        for name in CERTIFIED:
            between[name] = np.fmax(getattr(one.certificate, name), getattr(other.certificate, name))
        between["harmonics_used"], between["samples_used"] = other.resolution.highest, other.resolution.samples
        between["stable"] = other.certificate.stable
        return between

    def _depth(self, start: Node, end: Node, fraction: float) -> FloatArray:
        """Depths (n_contact,), m, at a fraction of a step."""
        ends = [(node.report.wear_depth, node.rate) for node in (start, end)]
        return np.asarray(depth_within(np.array([fraction]), end.cycle - start.cycle, ends[0], ends[1], self.smooth)[0])

    def even_counts(self, n_outputs: int) -> FloatArray:
        """Counts (n_outputs,) that divide the progress of the history evenly, up to its end or its target.

        The progress is the fraction of the worn volume plus the fraction of the cycles. So neither a burst of wear nor
        a long calm phase is missed, and straight lines between the outputs show the history.
        """
        nodes = self.taken.nodes
        end = self.taken.reached if self.reached_target else nodes[-1].cycle
        found = np.zeros(n_outputs)
        found[-1] = end
        at, volumes = self.taken.cycles, self.values()["wear_depth"] @ self.area
        if len(nodes) < 2 or volumes[-1] <= 0.0:
            return found
        last = int(np.clip(np.searchsorted(at, end), 1, len(nodes) - 1))
        whole = self._volume_at(nodes[last - 1], nodes[last], end)
        way = at / end + volumes / whole
        for place in range(1, n_outputs - 1):
            wanted = 2.0 * place / (n_outputs - 1)
            step = int(np.clip(np.searchsorted(way, wanted), 1, last))
            start, behind = nodes[step - 1], nodes[step]

            def way_at(fraction: float, start: Node = start, behind: Node = behind) -> float:
                count = start.cycle + fraction * (behind.cycle - start.cycle)
                return count / end + self._volume_at(start, behind, count) / whole

            within = fraction_where(wanted, way_at)
            found[place] = min(start.cycle + within * (behind.cycle - start.cycle), end)
        return found

    def _volume_at(self, start: Node, end: Node, count: float) -> float:
        """Worn volume at a count within a step, m3."""
        return float(self._depth(start, end, (count - start.cycle) / (end.cycle - start.cycle)) @ self.area)


def _column(values: list[Any], reached: BoolArray) -> NDArray[np.generic]:
    """Values of one name at all counts: those at the counts that are reached, NaN, or 0 for whole numbers, at others.

    values: at the counts that are reached. reached (n,).
    """
    found = np.array(values)
    column = np.full((reached.size, *found.shape[1:]), np.nan if found.dtype.kind in "fc" else 0, found.dtype)
    column[reached] = found
    return column


def no_output(n_outputs: int, n_contact: int, n_response: int, n_loops: int) -> dict[str, Any]:
    """Values as from `DenseOutput.read` for a history without any state."""
    of_pairs, of_responses = np.full((n_outputs, n_contact), np.nan), np.full((n_outputs, n_response), np.nan)
    loops, whole = np.full((n_outputs, n_loops, LOOP_PHASES, 3), np.nan), np.zeros(n_outputs, np.int64)
    found: dict[str, Any] = dict.fromkeys(
        ("wear_depth", "mean_pressure", "slip_range", "open_fraction", "depth_rate"), of_pairs
    )
    found |= {"response": of_responses.astype(complex), "response_mean": of_responses, "response_peak": of_responses}
    found |= dict.fromkeys(("loop_displacement", "loop_force"), loops)
    frequencies = "excitation_frequency", "excitation_frequency_error"
    found |= dict.fromkeys((*CERTIFIED, *frequencies, "wear_rate", "local"), np.full(n_outputs, np.nan))
    return found | {"harmonics_used": whole, "samples_used": whole, "stable": np.zeros(n_outputs, np.bool_)}

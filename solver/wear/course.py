"""The course of a wear history: the ends of its steps, read at any cycle counts, and the count of a target."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from solver.accuracy.certificate import NOT_CERTIFIED, Certificate
from solver.model import FloatArray, IntArray, ReducedModel
from solver.packing import packable
from solver.results.history import WearHistory
from solver.results.state_report import LOOP_PHASES, StateReport
from solver.settings import Resolution, WearTarget

KEPT_STEPS = 800
"""Most stored steps of a history beside those with an output; half as many after the steps with the least progress are
dropped. A result has 101 outputs by default, an adaptive history of 1e5 cycles about 100 steps."""

_REPORTED = {each.name for each in fields(WearHistory)} - {"wear_depth", "stable"}

INTERPOLATED = tuple(each.name for each in fields(StateReport) if each.name in _REPORTED)
"""Reported values that are interpolated between the ends of a step."""

CERTIFIED = tuple(each.name for each in fields(Certificate) if each.name in _REPORTED)
"""Values of the certificate; within a step, the larger value of both ends holds."""

BISECTIONS = 100
"""Halvings of a range of cycle counts: more than a number has digits."""


@dataclass(frozen=True)
class DenseOutput:
    """Worn depths between the ends of steps, over cycles or missions: linear, or a cubic with the rates at both ends.

    The slopes of the cubic are at most three times the mean slope, so that the depth never falls (Fritsch and Carlson
    1980). All other values are linear over a linear step, and in the worn volume over a smooth one.

    counts (n_node,): ends of the steps, ascending, the start first.
    depth, rate (n_node, k): m, and m per count. area (k,): m2.
    """

    counts: FloatArray
    depth: FloatArray
    rate: FloatArray
    area: FloatArray
    smooth: bool = True

    def at(self, counts: FloatArray) -> FloatArray:
        """Depths (n, k), m, at counts (n,); beyond the last step those at its end."""
        start, end, fraction = self.steps_of(counts)
        s, length = fraction[:, None], (self.counts[end] - self.counts[start])[:, None]
        grown = self.depth[end] - self.depth[start]
        if not self.smooth:
            return np.asarray(self.depth[start] + s * grown)
        first, last = (np.minimum(self.rate[place] * length, 3.0 * grown) for place in (start, end))
        bent = (1.0 - s) ** 2 * s * first - s**2 * (1.0 - s) * last
        return np.asarray(self.depth[start] + s**2 * (3.0 - 2.0 * s) * grown + bent)

    def interpolation(self, counts: FloatArray) -> Callable[[ArrayLike], Any]:
        """Function that reads values (n_node, ...) at counts (n,)."""
        start, end, fraction = self.steps_of(counts)
        if self.smooth:
            volumes = self.depth @ self.area
            grown = volumes[end] - volumes[start]
            part = self.at(counts) @ self.area - volumes[start]
            fraction = np.divide(part, grown, out=fraction, where=grown > 0.0)

        def between(values: ArrayLike) -> Any:
            each = np.asarray(values)
            return each[start] + fraction.reshape(-1, *[1] * (each.ndim - 1)) * (each[end] - each[start])

        return between

    def count_of(self, value: float, worn: Callable[[FloatArray], float], end: int) -> float:
        """Count within the step to node `end` at which a function of the depths (k,) that never falls has a value."""
        from scipy.optimize import brentq  # where it is used: it takes a while to load

        low, high = self.counts[end - 1 : end + 1]

        def above(fraction: float) -> float:
            return worn(self.at(np.array([low + fraction * (high - low)]))[0]) - value

        if above(0.0) >= 0.0 or above(1.0) <= 0.0:
            return float(low if above(0.0) >= 0.0 else high)
        return float(low + brentq(above, 0.0, 1.0, xtol=1e-12) * (high - low))

    def steps_of(self, counts: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Nodes (n,) at the start and the end of the steps with counts (n,), and the fractions (n,) of these steps."""
        counts = np.minimum(counts, self.counts[-1])
        end = np.searchsorted(self.counts, counts, "left")
        start = np.maximum(end - 1, 0)
        length = self.counts[end] - self.counts[start]
        fraction = np.divide(counts - self.counts[start], length, out=np.ones(counts.size), where=length > 0.0)
        return start, end, fraction


@packable
@dataclass(frozen=True)
class Node:
    """The end of a step.

    cycle: count. report: of the state. rate (n_contact,): wear rates, m per cycle.
    local: sum of the local errors of the steps so far, as worn volume, m3.
    """

    cycle: float
    report: StateReport
    rate: FloatArray
    local: float


@packable
@dataclass(frozen=True)
class Course:
    """The steps of a history so far, read as `DenseOutput`; fretting loops are interpolated phase by phase.

    area (n_contact,): m2. smooth: of `DenseOutput`; adaptive steps are.
    counts (n_output,): ascending counts to be read, whose steps are stored; empty for counts not known beforehand.
    target: wear whose count is sought; None for none. final_share: `ToTheEnd.final_share` of a history to the end.
    nodes: first state and ends of the steps, ascending, thinned where the steps are many.
    ends (n_steps + 1,): counts at the first state and at the ends of all steps.
    resolutions: cycle count from which on a resolution holds, and this resolution.
    """

    area: FloatArray
    smooth: bool
    counts: FloatArray = field(default_factory=lambda: np.zeros(0))
    target: WearTarget | None = None
    final_share: float = 0.0
    nodes: tuple[Node, ...] = ()
    ends: tuple[float, ...] = ()
    resolutions: tuple[tuple[float, Resolution], ...] = ()

    @cached_property
    def dense(self) -> DenseOutput:
        """The depths between the nodes."""
        depth, rate = np.array([(node.report.wear_depth, node.rate) for node in self.nodes]).transpose(1, 0, 2)
        return DenseOutput(np.array([node.cycle for node in self.nodes]), depth, rate, self.area, self.smooth)

    @property
    def volumes(self) -> FloatArray:
        """Worn volumes (n_node,) at the nodes, m3."""
        return np.asarray(self.dense.depth @ self.area)

    @property
    def end(self) -> float:
        """Last count; inf for a history to the end of wear."""
        return float(self.counts[-1]) if self.counts.size else math.inf

    @cached_property
    def reached(self) -> float:
        """Count at which the target was reached, NaN until then."""
        return math.nan if self.target is None or not self.nodes else self.reach(self.target)[0]

    def after(self, cycle: float, report: StateReport, rate: FloatArray, error: float) -> Course:
        """The course with another step.

        cycle: at its end. report: of its state. rate (n_contact,): m per cycle. error: local error of the step, m3.
        """
        nodes = (*self.nodes, Node(cycle, report, rate, error + (self.nodes[-1].local if self.nodes else 0.0)))
        resolutions = self.resolutions
        if not resolutions or resolutions[-1][1] != report.resolution:
            resolutions = (*resolutions, (cycle, report.resolution))
        longer = replace(self, nodes=nodes, ends=(*self.ends, cycle), resolutions=resolutions)
        return longer if len(nodes) <= KEPT_STEPS + 2 * self.counts.size else longer._thinned()

    def _thinned(self) -> Course:
        """The course without nodes of little progress, see `even_counts`, between which nothing is read."""
        at, volumes = self.dense.counts, self.volumes
        read = np.append(self.counts, self.reached)
        ends = np.searchsorted(at, read[read <= at[-1]])
        needed = {0, at.size - 1, *ends, *(ends - 1)}
        way = at / at[-1] + volumes / max(volumes[-1], 1e-300)
        least, kept = 2.0 * way[-1] / KEPT_STEPS, [0]
        for place in range(1, at.size):
            if place in needed or way[place + 1] - way[kept[-1]] > least:
                kept.append(place)
        return replace(self, nodes=tuple(self.nodes[place] for place in kept))

    def read(self, counts: FloatArray) -> dict[str, Any]:
        """Values at ascending counts (n,), by name; beyond the last step NaN, whole numbers 0.

        - Names and shapes of `INTERPOLATED`, of `CERTIFIED`, `wear_depth`, `harmonics_used` and `samples_used` as in
          `WearHistory`.
        - `wear_rate` (n,): m3 per cycle; `depth_rate` (n, n_contact): of each pair, m per cycle.
        - `local` (n,): sum of the local errors, m3.
        """
        dense, reports = self.dense, [node.report for node in self.nodes]
        (start, end, _), between = dense.steps_of(counts), dense.interpolation(counts)
        found: dict[str, Any] = {"wear_depth": dense.at(counts)}
        found |= {name: between([getattr(report, name) for report in reports]) for name in INTERPOLATED}
        found["depth_rate"] = between(dense.rate)
        found["wear_rate"] = found["depth_rate"] @ self.area
        # a step may be much longer than the history to the count
        found["local"] = between([node.local for node in self.nodes])
        for name in CERTIFIED:
            each = np.array([getattr(report.certificate, name) for report in reports])
            found[name] = np.fmax(each[start], each[end])
        at_end = [reports[place] for place in end]
        found["harmonics_used"] = np.array([report.resolution.highest for report in at_end])
        found["samples_used"] = np.array([report.resolution.samples for report in at_end])
        for values in found.values():
            values[counts > dense.counts[-1]] = np.nan if values.dtype.kind in "fc" else 0
        return found

    def even_counts(self, n_outputs: int) -> FloatArray:
        """Counts (n_outputs,) to the end or the target, evenly spaced in the shares of worn volume and cycles together.

        So neither a burst of wear nor a long calm phase is missed.
        """
        end = self.nodes[-1].cycle if math.isnan(self.reached) else self.reached
        whole = float(self.dense.at(np.array([end]))[0] @ self.area)
        low, high = np.zeros(n_outputs), np.full(n_outputs, end)
        if whole > 0.0:
            wanted = np.linspace(0.0, 2.0, n_outputs)
            for _ in range(BISECTIONS):
                middle = 0.5 * (low + high)
                before = middle / end + self.dense.at(middle) @ self.area / whole < wanted
                low, high = np.where(before, middle, low), np.where(before, high, middle)
        low[-1] = end
        return low

    def reach(self, target: WearTarget) -> tuple[float, float]:
        """Count at which a target is reached, NaN if never, and its error by a resonance and its interpolation.

        The worn volume is a parabola in the shift of the resonance, through both ends of the step and the end before.
        """
        worn = target.quantity != "frequency_shift"
        # asked after every step: depths and volumes never fall
        if worn and not self._value(self.nodes[-1], target) >= target.value:
            return math.nan, 0.0
        values = np.array([self._value(node, target) for node in self.nodes])
        if not (values >= target.value).any():
            return math.nan, 0.0
        end, volumes = int(np.argmax(values >= target.value)), self.volumes
        if target.quantity == "wear_depth":
            return self.dense.count_of(target.value, lambda depth: float(depth.max(initial=0.0)), end), 0.0

        def count(volume: float) -> float:
            return self.dense.count_of(volume, lambda depth: float(depth @ self.area), end)

        if target.quantity == "worn_volume":
            return count(target.value), 0.0
        ends = slice(max(end - 2, 0), end + 1)
        shifts = np.array([node.report.resonance for node in self.nodes[ends]]) / self.nodes[0].report.resonance - 1.0
        shifts, volumes = math.copysign(1.0, shifts[-1]) * shifts, volumes[ends]
        ahead, moved = target.value - shifts[-2], shifts[-1] - shifts[-2]
        line = found = volumes[-2] + ahead * (volumes[-1] - volumes[-2]) / moved
        if shifts.size > 2 and (np.diff(volumes) > 0.0).all() and shifts[0] < shifts[1] < target.value:
            # Newton's form of the volume as a function of the shift, which has to rise
            slopes = np.diff(volumes) / np.diff(shifts)
            bend = (slopes[1] - slopes[0]) / (shifts[2] - shifts[0])
            curved = line + bend * ahead * (target.value - shifts[2])
            found = curved if volumes[1] < curved < volumes[2] else line
        error = max(self.nodes[place].report.resonance_error for place in (0, end))
        by_resonance = error * (self.nodes[end].cycle - self.nodes[end - 1].cycle) / moved
        return count(found), abs(count(found) - count(line)) + by_resonance

    def reach_ahead(self, target: WearTarget) -> float:
        """As `reach`; a target not reached is extrapolated by the mean rate of the last step, inf where that is 0."""
        found = self.reach(target)[0]
        if not math.isnan(found) or len(self.nodes) < 2:
            return math.inf if math.isnan(found) else found
        before, end = self.nodes[-2:]
        first, last = (self._value(node, target) for node in (before, end))
        ahead = (target.value - last) * (end.cycle - before.cycle)
        return end.cycle + ahead / (last - first) if last > first else math.inf

    def _value(self, node: Node, target: WearTarget) -> float:
        """What a target is compared with: largest depth, m, worn volume, m3, or relative shift of the resonance."""
        if target.quantity == "frequency_shift":
            return abs(node.report.resonance / self.nodes[0].report.resonance - 1.0)
        depth = node.report.wear_depth
        return float(depth.max(initial=0.0) if target.quantity == "wear_depth" else depth @ self.area)


def unknown_course(model: ReducedModel, n_loops: int) -> Course:
    """The course of a history without any state: all values are NaN."""
    of_pairs, of_responses = np.full(model.contact.n_contact, np.nan), np.full(len(model.response_names), np.nan)
    loops = np.full((n_loops, LOOP_PHASES, 3), np.nan)
    report = StateReport(
        *(of_pairs,) * 4,
        response=of_responses.astype(complex),
        response_mean=of_responses,
        response_peak=of_responses,
        loop_displacement=loops,
        loop_force=loops,
        certificate=NOT_CERTIFIED,
        resolution=Resolution((), 0),
    )
    # before all counts
    return Course(model.contact.area, False, nodes=(Node(-1.0, report, of_pairs, math.nan),))

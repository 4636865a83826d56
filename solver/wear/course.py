"""The course of a wear history: the ends of its steps, stored, and read at any cycle counts."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from solver.accuracy.certificate import NOT_CERTIFIED
from solver.model import FloatArray, IntArray, ReducedModel
from solver.packing import packable
from solver.results.state_report import LOOP_PHASES, StateReport
from solver.settings import Resolution, WearTarget
from solver.wear.interpolation import TargetSearch, depth_within

KEPT_STEPS = 800
"""Most stored steps of a history beside those with an output, and most at whose ends it is compared with its reference
solution; half as many after the steps with the least progress are dropped. A result has 101 outputs by default, an
adaptive history of 1e5 cycles about 100 steps."""

INTERPOLATED = (
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

BISECTIONS = 100
"""Halvings of a range of cycle counts: more than a number has digits."""


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
    """The steps of a history so far.

    Euler steps: all values are linear over the step. Adaptive steps: the depth is a cubic with the wear rates at both
    ends, and all other values are linear in the worn volume. Fretting loops are interpolated phase by phase: they
    close, lie within the friction cone and agree with the interpolated mean pressure.

    area (n_contact,): m2.
    smooth: whether the depth is a cubic within a step.
    counts (n_output,): ascending counts to be read, whose steps are stored; empty for counts not known beforehand.
    target: wear whose count is sought within the steps; None for none.
    nodes: first state and ends of the steps, ascending, thinned where the steps are many.
    ends (n_steps + 1,): counts at the first state and at the ends of all steps.
    resolutions: cycle count from which on a resolution holds, and this resolution.
    reached: count at which the target was reached, NaN until then.
    reached_within: estimated error of this count by the interpolation within the step.
    """

    area: FloatArray
    smooth: bool
    counts: FloatArray = field(default_factory=lambda: np.zeros(0))
    target: WearTarget | None = None
    nodes: tuple[Node, ...] = ()
    ends: tuple[float, ...] = ()
    resolutions: tuple[tuple[float, Resolution], ...] = ()
    reached: float = math.nan
    reached_within: float = 0.0

    @property
    def cycles(self) -> FloatArray:
        """Counts (n_node,) of the nodes."""
        return np.array([node.cycle for node in self.nodes])

    @property
    def volumes(self) -> FloatArray:
        """Worn volumes (n_node,) at the nodes, m3."""
        return np.array([node.report.wear_depth @ self.area for node in self.nodes])

    @property
    def end(self) -> float:
        """Last count; inf for a history to the end of wear."""
        return float(self.counts[-1]) if self.counts.size else math.inf

    @property
    def reached_target(self) -> bool:
        """Whether a step has reached the target."""
        return not math.isnan(self.reached)

    def after(self, cycle: float, report: StateReport, rate: FloatArray, error: float) -> Course:
        """The course with another step.

        cycle: count at its end, never lower than the last one. report: of its state.
        rate (n_contact,): wear rates, m per cycle. error: estimated local error of the step, as worn volume, m3.
        """
        nodes = (*self.nodes, Node(cycle, report, rate, error + (self.nodes[-1].local if self.nodes else 0.0)))
        resolutions, reached, within = self.resolutions, self.reached, self.reached_within
        if not resolutions or resolutions[-1][1] != report.resolution:
            resolutions = (*resolutions, (cycle, report.resolution))
        if self.target is not None and self.nodes and not self.reached_target:
            search = TargetSearch(self.target, self.area, self.smooth)
            reached = search.within(nodes)
            within = abs(reached - search.within(nodes, straight=True))
        ends = (*self.ends, cycle)
        longer = replace(self, nodes=nodes, ends=ends, resolutions=resolutions, reached=reached, reached_within=within)
        return longer if len(nodes) <= KEPT_STEPS + 2 * self.counts.size else longer._thinned()

    def _thinned(self) -> Course:
        """The course without nodes of little progress, see `even_counts`, between which nothing is read."""
        at, volumes = self.cycles, self.volumes
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
        """Values at ascending counts (n,), by name.

        - Names and shapes of `INTERPOLATED`, of `CERTIFIED`, `wear_depth`, `harmonics_used`, `samples_used` and
          `stable` as in `WearHistory`.
        - `wear_rate` (n,): m3 per cycle.
        - `depth_rate` (n, n_contact): wear rate of each pair, m per cycle.
        - `local` (n,): sum of the local errors, m3.

        Values beyond the last step are NaN, whole numbers 0.
        """
        start, end, fraction = self._steps_of(counts)
        found: dict[str, Any] = {"wear_depth": self.depth_at(counts)}
        if self.smooth:
            volumes = self.volumes
            grown = volumes[end] - volumes[start]
            part = found["wear_depth"] @ self.area - volumes[start]
            fraction = np.divide(part, grown, out=fraction, where=grown > 0.0)
        reports = [node.report for node in self.nodes]

        def between(values: list[Any]) -> Any:
            one = np.array(values)
            within = fraction.reshape(-1, *[1] * (one.ndim - 1))
            return one[start] + within * (one[end] - one[start])

        found |= {name: between([getattr(report, name) for report in reports]) for name in INTERPOLATED}
        found["depth_rate"] = between([node.rate for node in self.nodes])
        found["wear_rate"] = found["depth_rate"] @ self.area
        # a step may be much longer than the history to the count
        found["local"] = between([node.local for node in self.nodes])
        for name in CERTIFIED:
            each = np.array([getattr(report.certificate, name) for report in reports])
            found[name] = np.fmax(each[start], each[end])
        for name, ends in (
            ("harmonics_used", [report.resolution.highest for report in reports]),
            ("samples_used", [report.resolution.samples for report in reports]),
            ("stable", [report.certificate.stable for report in reports]),
        ):
            found[name] = np.array(ends)[end]
        for values in found.values():
            values[counts > self.nodes[-1].cycle] = np.nan if values.dtype.kind in "fc" else 0
        return found

    def depth_at(self, counts: FloatArray) -> FloatArray:
        """Depths (n, n_contact), m, at counts (n,); of counts beyond the last step those at its end."""
        start, end, fraction = self._steps_of(counts)
        length = self.cycles[end] - self.cycles[start]
        depth, rate = np.array([node.report.wear_depth for node in self.nodes]), np.array([n.rate for n in self.nodes])
        return depth_within(fraction, length, (depth[start], rate[start]), (depth[end], rate[end]), self.smooth)

    def _steps_of(self, counts: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Nodes (n,) at the start and the end of the steps with these counts, and fractions (n,) of these steps."""
        at = self.cycles
        counts = np.minimum(counts, at[-1])
        end = np.searchsorted(at, counts, "left")
        start = np.maximum(end - 1, 0)
        length = at[end] - at[start]
        fraction = np.divide(counts - at[start], length, out=np.ones(counts.size), where=length > 0.0)
        return start, end, fraction

    def even_counts(self, n_outputs: int) -> FloatArray:
        """Counts (n_outputs,) that divide the progress of the history evenly, up to its end or its target.

        The progress is the fraction of the worn volume plus that of the cycles: neither a burst of wear nor a long calm
        phase is missed.
        """
        end = self.reached if self.reached_target else self.nodes[-1].cycle
        whole = float(self.depth_at(np.array([end]))[0] @ self.area)
        low, high = np.zeros(n_outputs), np.full(n_outputs, end)
        if whole > 0.0:
            wanted = np.linspace(0.0, 2.0, n_outputs)
            for _ in range(BISECTIONS):
                middle = 0.5 * (low + high)
                before = middle / end + self.depth_at(middle) @ self.area / whole < wanted
                low, high = np.where(before, middle, low), np.where(before, high, middle)
        low[-1] = end
        return low


def unknown_course(model: ReducedModel, n_loops: int) -> Course:
    """The course of a history without any state: all values are NaN."""
    of_pairs, of_responses = np.full(model.contact.n_contact, np.nan), np.full(len(model.response_names), np.nan)
    loops = np.full((n_loops, LOOP_PHASES, 3), np.nan)
    four = of_pairs, of_pairs, of_pairs, of_pairs
    report = StateReport(
        *four,
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

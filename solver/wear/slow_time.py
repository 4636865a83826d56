"""The integration over the slow time, of cycles or of missions, step by step; saved from time to time, and resumed.

A `Course` has the ends of the steps, read at any counts, and the count of a target.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from typing import Any, Protocol

import numpy as np

from solver.accuracy.certificate import Certificate
from solver.clock import computing_time
from solver.harmonic_balance.state import Failure
from solver.loading_history.sweep import STEPS_OF_REFERENCE
from solver.model import FloatArray, IntArray
from solver.newton.run import Run, guarded
from solver.outcome import Outcome, in_digits
from solver.packing import Packed, in_rows, pack, packable, unpack
from solver.settings import Resolution, WearTarget

RTOL_RATIO = float(STEPS_OF_REFERENCE)
"""Ratio of the step tolerances of reference solution and adaptive history, as of the steps of both sweeps. With 4 steps
are too long for pairs that stick again (dovetail, 16 pairs, 13 harmonics, 212.75 Hz: 1.208 mm3 for 1.540, an error of
32 % where 0.4 % is true)."""

MOST_NODES = 800
"""Most frequencies of a passage, and most stored steps of a history beside those with an output; half as many after
those with the least progress are dropped. An adaptive history of 1e5 cycles has about 100 steps."""

CERTIFIED = tuple(each.name for each in fields(Certificate) if each.name != "periodicity_error")
"""Values of a certificate; within a step, the larger value of both ends holds."""


Report = Callable[[str, int, float], object]
"""Takes after each step where a computation is: in words; how many solutions are complete; how far this one is to
its last count or its target, 0 to 1, or 0 where that is not known."""


@packable
@dataclass(frozen=True)
class Node:
    """The end of a step.

    count: of cycles or missions. depth, rate (k,): worn depths, m, and their rates, m per count, of the pairs; of
    missions those of all blocks in one row. energy, energy_rate (k,): in the same way, the energy that friction has
    dissipated, J/m2. values: other numbers and arrays, by name. guides: of the blocks of a mission.
    """

    count: float
    depth: FloatArray
    rate: FloatArray
    energy: FloatArray
    energy_rate: FloatArray
    values: dict[str, Any]
    guides: tuple[Any, ...] = ()

    @property
    def slow(self) -> FloatArray:
        """Depths, m, and dissipated energies, J/m2 (2, k)."""
        return np.array([self.depth, self.energy])


@packable
@dataclass(frozen=True)
class Course:
    """The steps of a history so far, with a dense output.

    Within a step depth and energy are cubics with the rates at both ends, whose slopes are at most three times the mean
    slope, so that they never fall (Fritsch and Carlson 1980). All other values are linear in the worn volume.

    area (n_contact,): m2. target: wear whose count is sought; None for none.
    outputs (n_output,): ascending counts to be read, whose steps are stored; empty for counts not known beforehand.
    nodes: first state and ends of the steps, thinned where they are many. ends (n_step + 1,): counts of all of them.
    """

    area: FloatArray
    outputs: FloatArray = field(default_factory=lambda: np.zeros(0))
    target: WearTarget | None = None
    nodes: tuple[Node, ...] = ()
    ends: tuple[float, ...] = ()

    @cached_property
    def counts(self) -> FloatArray:
        """Counts (n_node,) of the nodes."""
        return np.array([node.count for node in self.nodes])

    @cached_property
    def depths(self) -> FloatArray:
        """Depths (n_node, k), m."""
        return np.array([node.depth for node in self.nodes])

    @cached_property
    def rates(self) -> FloatArray:
        """Wear rates (n_node, k), m per count."""
        return np.array([node.rate for node in self.nodes])

    @cached_property
    def reached(self) -> float:
        """Count at which the target was reached, NaN until then."""
        return math.nan if self.target is None else self.reach(self.target)[0]

    @property
    def share(self) -> float:
        """How far the last node is on the way to the last count or to the target; 0 where that is not known."""
        shares = [float(self.counts[-1] / self.outputs[-1])] if self.outputs.size and self.outputs[-1] > 0.0 else []
        if self.target is not None:
            shares.append(float(self._values_of(self.target, self.counts[-1:])[0]) / self.target.value)
        return min(1.0, max(shares, default=0.0))

    def after(self, node: Node) -> Course:
        """The course with another step."""
        longer = replace(self, nodes=(*self.nodes, node), ends=(*self.ends, node.count))
        return longer if len(longer.nodes) <= MOST_NODES + 2 * self.outputs.size else longer._thinned()

    def _thinned(self) -> Course:
        """The course without nodes of little progress in count and volume, between which nothing is read."""
        at, volumes = self.counts, self._volumes(self.depths)
        read = np.append(self.outputs, self.reached)
        ends = np.searchsorted(at, read[read <= at[-1]])
        way = at / at[-1] + volumes / max(volumes[-1], 1e-300)
        # the first one in each of so many equal parts
        firsts = np.unique(np.floor(0.5 * MOST_NODES * way / way[-1]), return_index=True)[1]
        # with the last three, from which a step over missions goes on
        places = np.unique([*range(at.size - 3, at.size), *ends, *np.maximum(ends - 1, 0), *firsts])
        return replace(self, nodes=tuple(self.nodes[place] for place in places))

    def depth_at(self, counts: FloatArray) -> FloatArray:
        """Depths (n, k), m, at counts (n,); beyond the last step those at its end."""
        return self._grown(counts, self.depths, self.rates)

    def _grown(self, counts: FloatArray, values: FloatArray, rates: FloatArray) -> FloatArray:
        """What grows, at counts (n,), from values and rates (n_node, k) at the nodes."""
        start, end, fraction = self._steps_of(counts)
        s, length = fraction[:, None], (self.counts[end] - self.counts[start])[:, None]
        grown = values[end] - values[start]
        first, last = (np.minimum(rates[place] * length, 3.0 * grown) for place in (start, end))
        bent = (1.0 - s) ** 2 * s * first - s**2 * (1.0 - s) * last
        return np.asarray(values[start] + s**2 * (3.0 - 2.0 * s) * grown + bent)

    def _steps_of(self, counts: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Nodes at start and end of the steps at counts (n,), and the fractions of the steps."""
        counts = np.minimum(counts, self.counts[-1])
        end = np.searchsorted(self.counts, counts, "left")
        start = np.maximum(end - 1, 0)
        length = self.counts[end] - self.counts[start]
        return start, end, np.divide(counts - self.counts[start], length, out=np.ones(counts.size), where=length > 0.0)

    def _volumes(self, depths: FloatArray) -> FloatArray:
        """Worn volumes (n,), m3, of depths (n, k), m."""
        return np.asarray(depths @ np.tile(self.area, depths.shape[1] // self.area.size))

    def read(self, counts: FloatArray) -> dict[str, Any]:
        """Values at ascending counts (n,), by name; beyond the last step NaN, whole numbers 0.

        `wear_depth`, `depth_rate`, `dissipated_energy` (n, k): m, m per count, J/m2; `wear_rate` (n,): m3 per count;
        and the values of the nodes.
        """
        (start, end, fraction), depth = self._steps_of(counts), self.depth_at(counts)
        volumes = self._volumes(self.depths)
        grown, part = volumes[end] - volumes[start], self._volumes(depth) - volumes[start]
        fraction = np.divide(part, grown, out=fraction, where=grown > 0.0)

        def between(each: FloatArray) -> FloatArray:
            first, last = each[start], each[end]
            part, known = fraction.reshape(-1, *[1] * (each.ndim - 1)), np.isfinite(first) & np.isfinite(last)
            inside = first + part * np.subtract(last, first, out=np.zeros_like(last), where=known)
            # what is not known at one end of a step is not known within
            return np.where(known, inside, np.where(part == 0.0, first, np.where(part == 1.0, last, first + last)))

        energy = np.array([node.slow[1] for node in self.nodes])
        energy_rate = np.array([np.broadcast_to(node.energy_rate, node.depth.shape) for node in self.nodes])
        found = {"wear_depth": depth, "depth_rate": between(self.rates)}
        found["dissipated_energy"] = self._grown(counts, energy, energy_rate)
        found["wear_rate"] = self._volumes(found["depth_rate"])
        for name in self.nodes[-1].values:
            each = np.array([node.values[name] for node in self.nodes])
            if name in CERTIFIED:
                found[name] = np.maximum(each[start], each[end])
            else:
                found[name] = each[end] if each.dtype.kind == "i" else between(each)
        for values in found.values():
            values[counts > self.counts[-1]] = np.nan if values.dtype.kind in "fc" else 0
        return found

    def even_counts(self, n_outputs: int) -> FloatArray:
        """Counts (n_outputs,) to the end or the target, evenly spaced in the shares of volume and cycles together."""
        end = self.nodes[-1].count if math.isnan(self.reached) else self.reached
        whole = float(self._volumes(self.depth_at(np.array([end])))[0])
        low, high, wanted = np.zeros(n_outputs), np.full(n_outputs, end), np.linspace(0.0, 2.0, n_outputs)
        # halvings: more than a number has digits
        for _ in range(100 if whole > 0.0 else 0):
            middle = 0.5 * (low + high)
            before = middle / end + self._volumes(self.depth_at(middle)) / whole < wanted
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        low[-1] = end
        return low

    def reach(self, target: WearTarget) -> tuple[float, float]:
        """Count at which a target is reached, NaN if never, and its error by a resonance and its interpolation."""
        from scipy.optimize import brentq  # where it is used: it takes a while to load

        if not self.nodes:
            return math.nan, 0.0
        values = self._values_of(target, self.counts)
        end = int(np.argmax(values >= target.value))
        if not values[end] >= target.value:
            return math.nan, 0.0
        start = max(end - 1, 0)
        low, high = float(self.counts[start]), float(self.counts[end])

        def above(fraction: float) -> float:
            return float(self._values_of(target, np.array([low + fraction * (high - low)]))[0]) - target.value

        count = low if above(0.0) >= 0.0 else high
        if above(0.0) < 0.0 < above(1.0):
            count = low + float(brentq(above, 0.0, 1.0, xtol=1e-12)) * (high - low)
        if target.quantity != "frequency_shift":
            return count, 0.0
        # linear in the worn volume, against linear in the count
        per_shift = (high - low) / (values[end] - values[start])
        straight = low + per_shift * (target.value - values[start])
        error = max(self.nodes[place].values["resonance_error"] for place in (0, end))
        return count, float(abs(count - straight) + error * per_shift)

    def _values_of(self, target: WearTarget, counts: FloatArray) -> FloatArray:
        """What a target is compared with at counts (n,): wear, or the relative shift of the resonance up or down."""
        if target.quantity == "frequency_shift":
            return np.asarray(np.abs(self.read(counts)["resonance"] / self.nodes[0].values["resonance"] - 1.0))
        depths = self.depth_at(counts)
        if target.quantity == "worn_volume":
            return self._volumes(depths)
        return np.asarray(depths.reshape(len(depths), -1, self.area.size).sum(axis=1).max(axis=1, initial=0.0))


class SlowProblem(Protocol):
    """What is integrated. The next step depends on state and course alone; both are frozen and packable.

    name: tells apart histories that belong together. course: before the first step. run: has a factorisation, and the
    Newton iterations so far. iterations_per_save: iterations after which the progress is saved. unit: of the counts.
    """

    name: str
    unit: str
    course: Course
    run: Run
    iterations_per_save: int

    def advance(self, state: Any, course: Course, /) -> tuple[Any, Course] | Failure | None:
        """State and course after the next step, or the first ones where the state is None; None where the history is
        complete, or why it ends before.
        """


@packable
@dataclass(frozen=True)
class Guide:
    """What a reference solution takes from its history.

    resolutions: cycle count from which on a resolution holds, and this resolution; of a passage the frequency, Hz.
    first_length: of its first adaptive step, cycles.
    """

    resolutions: tuple[tuple[float, Resolution], ...]
    first_length: float


@packable
@dataclass(frozen=True)
class Solution:
    """What an integration has found at its end, or when it is saved, with Newton iterations and CPU seconds.

    state: the last one; None where there is no first state. failure: why it ends before it is complete, else None; or
        INACCURATE where it is not known whether a complete history is stable.
    ended: False when it is saved on its way.
    compared: the solution whose difference is the error (`solver.wear.errors`); None where there is none.
    """

    state: Any
    course: Course
    failure: Failure | None
    ended: bool = True
    iterations: int = 0
    seconds: float = 0.0
    compared: Solution | None = None

    @property
    def breaks_off(self) -> bool:
        """Whether the time is over, or an error has ended the whole history: no other solution is integrated then."""
        return self.failure is not None and self.failure.outcome in (Outcome.TIME_LIMIT, Outcome.EXCEPTION)

    @property
    def totals(self) -> dict[str, Any]:
        """Outcome, message and effort of a whole history, with all that is compared, by their names in its result."""
        every: list[Solution] = [self]
        while (other := every[-1].compared) is not None:
            every.append(other)
        failure = next((each.failure for each in every if each.breaks_off), self.failure)
        return {
            "outcome": Outcome.CONVERGED if failure is None else failure.outcome,
            "message": "" if failure is None else failure.message,
            "reference_end": next((each.failure.message for each in every[1:] if each.failure), ""),
            "newton_iterations": sum(each.iterations for each in every),
            "run_time": sum(each.seconds for each in every),
        }


class Integrator:
    """Integrates histories that belong together, each once.

    time_limit: CPU seconds of each. keep: called from time to time with the packed progress; report: after each step.
    resume: such progress.
    """

    def __init__(
        self,
        time_limit: float,
        keep: Callable[[Packed], None] | None = None,
        resume: Packed | None = None,
        report: Report = lambda *_: None,
    ) -> None:
        self._time_limit, self._keep, self._report = time_limit, keep, report
        self._known: dict[str, Solution] = {} if resume is None else unpack(resume)

    def integrate(self, problem: SlowProblem, spent: float = 0.0) -> Solution:
        """Integrate from the first or the saved state to the end. spent: CPU seconds of the time limit so far."""
        name, budget = problem.name, problem.run.budget
        n_complete = sum(each.ended for each in self._known.values())
        known = self._known.get(name) or Solution(None, problem.course, None, ended=False)
        if known.ended:
            return known
        state, course, budget.iterations = known.state, known.course, known.iterations
        began, saved_at = computing_time() - known.seconds, known.iterations
        budget.deadline = began + self._time_limit - spent
        while True:
            after = guarded(partial(problem.advance, state, course))
            if after is None or isinstance(after, Failure):
                self._known[name] = Solution(state, course, after, True, budget.iterations, computing_time() - began)
                return self._known[name]
            state, course = after
            self._report(f"{problem.unit} {in_digits(course.counts[-1], 3)}", n_complete, course.share)
            if budget.iterations >= saved_at + problem.iterations_per_save:
                # done in every history, so that an interrupted one gives equal numbers
                problem.run = problem.run.fresh()
                state, saved_at = in_rows(state), budget.iterations
                self._known[name] = Solution(state, course, None, False, saved_at, computing_time() - began)
                if self._keep is not None:
                    # what its time limit has ended is not complete
                    self._keep(pack({key: each for key, each in self._known.items() if not each.breaks_off}))

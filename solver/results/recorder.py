"""From the steps of a march to the cycle counts that were asked for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, TypedDict

import numpy as np

from solver.accuracy.error_estimate import euler_error
from solver.contact.archard import volume_rate, wear_gain, wear_rate
from solver.model import FloatArray, ReducedModel
from solver.outcome import Outcome
from solver.packing import attributes, set_attributes
from solver.results.cut_off import first_cut_off
from solver.results.history import WearHistory
from solver.results.loops import LOOP_PHASES
from solver.results.options import RESULTS
from solver.results.state_report import StateReport
from solver.settings import Scheme, WearTarget

REPORTED = (
    "wear_depth",
    "mean_pressure",
    "slip_range",
    "open_fraction",
    "response",
    "response_peak",
    "loop_displacement",
    "loop_force",
)
CERTIFIED = (
    "residual",
    "penetration",
    "tension",
    "cone_violation",
    "energy_error",
    "response_error",
    "wear_rate_error",
)


class RecorderState(TypedDict):
    """What was kept so far: attributes of `Recorder`."""

    kept: dict[str, Any]
    last: tuple[float, StateReport, float] | None
    local: float
    truncation: float
    pair_truncation: FloatArray
    first_resonance: float


@dataclass
class Recorder:
    """Takes the state after every step and keeps the requested counts.

    Between two steps they are interpolated linearly. Adaptive: the depth by cubics with the wear rates at both ends
    instead, and all else by the fraction of the step's worn volume, of which the state is a function: long steps of
    higher order are worth that. Fretting loops (n_loops of them) are interpolated phase by phase like all else, so that
    they close, stay within the friction cone and have the mean pressure that is reported at the same count.

    target: wear whose count is looked for between the steps in the same way; reached: that count, NaN until then.
    first_resonance: rad/s, of the first state, where the target is of it.
    compared (n_output, n_contact): m, depths of the coarser history, once it has finished.
    """

    model: ReducedModel
    cycles: FloatArray
    start_iterations: int
    start_time: float
    scheme: Scheme
    n_loops: int = 0
    target: WearTarget | None = None
    reached: float = field(init=False, default=math.nan)
    kept: dict[str, Any] = field(init=False, repr=False)
    last: tuple[float, StateReport, float] | None = field(init=False, default=None, repr=False)
    local: float = field(init=False, default=0.0, repr=False)
    truncation: float = field(init=False, default=0.0, repr=False)
    pair_truncation: FloatArray = field(init=False, repr=False)
    compared: FloatArray = field(init=False, repr=False)
    first_resonance: float = field(init=False, default=math.nan, repr=False)

    def __post_init__(self) -> None:
        n_output, n_contact = self.cycles.size, self.model.contact.n_contact
        n_response = len(self.model.response_names)
        shapes: dict[str, tuple[int, ...]] = dict.fromkeys(REPORTED, (n_contact,))
        shapes |= dict.fromkeys(("response", "response_peak"), (n_response,))
        shapes |= dict.fromkeys(("loop_displacement", "loop_force"), (self.n_loops, LOOP_PHASES, 3))
        self.kept = {
            name: np.full((n_output, *shape), np.nan, complex if name == "response" else float)
            for name, shape in shapes.items()
        }
        self.kept |= {name: np.full(n_output, np.nan) for name in ("wear_rate", "local", "truncation", *CERTIFIED)}
        self.kept |= {name: np.zeros(n_output, np.int64) for name in ("harmonics_used", "samples_used")}
        self.kept["stable"] = np.zeros(n_output, np.bool_)
        self.kept["pair_truncation"] = np.full((n_output, n_contact), np.nan)
        self.pair_truncation = np.zeros(n_contact)

    def state_dict(self) -> RecorderState:
        """What was kept so far, to be packed."""
        return attributes(self, RecorderState)

    def load_state(self, state: RecorderState) -> None:
        """Go on from the state of another one."""
        set_attributes(self, state)

    def add(self, cycle: float, report: StateReport, wear_coefficient: float, error: float | None = None) -> None:
        """Take the state at the end of a step.

        Parameters
        ----------
        cycle
            Count at the end of the step; it never falls.
        report
            Of the state.
        wear_coefficient
            1/Pa.
        error
            Estimated local error of the step, as worn volume, m3; None for that of an Euler step, which is its
            difference to the trapezoidal rule.
        """
        area = self.model.contact.area
        gain, rate = (
            wear_gain(wear_coefficient, area, 1.0),
            volume_rate(wear_coefficient, float(report.wearing_work.sum())),
        )
        smooth = self.scheme == "adaptive"
        if self.last is None:
            wanted = self.cycles == cycle
            self.first_resonance = report.resonance
            before, before_report, before_rate = cycle, report, rate
        else:
            before, before_report, before_rate = self.last
            wanted = (self.cycles > before) & (self.cycles <= cycle)
            self.local += euler_error(cycle - before, abs(rate - before_rate)) if error is None else error
            # what the wear rates are wrong by for want of harmonics and samples, of all pairs together and of each
            most = RESULTS.unknown_wear_rate_error
            for value, of in ((before_rate, before_report), (rate, report)):
                half = 0.5 * (cycle - before)
                # NaN where harmonics and samples are fixed and no state with more of them was found
                self.truncation += half * value * np.fmin(of.certificate.wear_rate_error, most)
                self.pair_truncation = self.pair_truncation + half * gain * of.wearing_work_error
        fraction = (self.cycles[wanted] - before) / (cycle - before) if cycle > before else np.ones(wanted.sum())
        ends = [(of.wear_depth, wear_rate(wear_coefficient, area, of.wearing_work)) for of in (before_report, report)]
        shifts = tuple(self._shift(of.resonance) for of in (before_report, report))
        self._look_for_target(before, cycle, ends[0], ends[1], shifts)
        depth = depth_within(fraction, cycle - before, ends[0], ends[1], smooth)
        if smooth and cycle > before:
            fraction = self._worn_fraction(depth, before_report.wear_depth, report.wear_depth, fraction)
        for name in REPORTED:
            old, new = getattr(before_report, name), getattr(report, name)
            fractions = fraction.reshape(-1, *(1,) * old.ndim)
            self.kept[name][wanted] = depth if name == "wear_depth" else old + fractions * (new - old)
        self.kept["wear_rate"][wanted] = before_rate + fraction * (rate - before_rate)
        for name in CERTIFIED:
            # what holds for both states holds in between
            self.kept[name][wanted] = np.fmax(
                getattr(before_report.certificate, name), getattr(report.certificate, name)
            )
        self.kept["harmonics_used"][wanted] = report.resolution.highest
        self.kept["samples_used"][wanted] = report.resolution.samples
        self.kept["stable"][wanted] = report.certificate.stable
        self.kept["local"][wanted] = self.local
        self.kept["truncation"][wanted] = self.truncation
        self.kept["pair_truncation"][wanted] = self.pair_truncation
        self.last = (cycle, report, rate)

    def compare(self, difference: FloatArray | None) -> None:
        """The coarser history says by itself what its depths are at the counts."""

    def _look_for_target(
        self,
        before: float,
        cycle: float,
        start: tuple[FloatArray, FloatArray],
        end: tuple[FloatArray, FloatArray],
        shifts: tuple[float, ...],
    ) -> None:
        """Note the count at which a step reaches the target; start, end: depth and wear rate, as `depth_within` has.

        shifts: of the resonance, at both ends.
        """
        if self.target is None or not math.isnan(self.reached):
            return
        wanted = self.target.value
        if self.target.quantity == "frequency_shift":
            if not shifts[1] >= wanted:
                return
            # a function of the state, which is a function of what is worn, as all else that is reported
            share = (wanted - shifts[0]) / (shifts[1] - shifts[0]) if shifts[1] > shifts[0] else 0.0
            wanted = self._worn(start[0]) + max(share, 0.0) * (self._worn(end[0]) - self._worn(start[0]))
        if self._worn(end[0]) < wanted:
            return
        low, high = 0.0, 1.0
        # depths never fall within a step
        while high - low > RESULTS.target_resolution:
            middle = 0.5 * (low + high)
            depth = depth_within(np.array([middle]), cycle - before, start, end, self.scheme == "adaptive")[0]
            low, high = (low, middle) if self._worn(depth) >= wanted else (middle, high)
        self.reached = before + high * (cycle - before)

    def _shift(self, resonance: float) -> float:
        """Change of the resonance since the first state, up or down, relative."""
        return abs(resonance / self.first_resonance - 1.0)

    def _worn(self, depth: FloatArray) -> float:
        """What tells how far wear is: the largest depth, m, or the volume, m3, of depths (n_contact,), m."""
        assert self.target is not None
        if self.target.quantity == "wear_depth":
            return float(depth.max(initial=0.0))
        return float(depth @ self.model.contact.area)

    def _worn_fraction(
        self, depth: FloatArray, before: FloatArray, after: FloatArray, otherwise: FloatArray
    ) -> FloatArray:
        """Fraction (n,) of the worn volume of a step."""
        area = self.model.contact.area
        whole = float((after - before) @ area)
        return np.asarray((depth - before) @ area / whole) if whole > 0.0 else otherwise

    def failed(self, outcome: Outcome, run_time: float) -> WearHistory:
        """History of a point that has no start state: NaN everywhere."""
        return self.finish(outcome, np.nan, 0, run_time, self.kept["wear_depth"])

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
        """The history as far as it was computed.

        Parameters
        ----------
        outcome, jump_cycle, iterations, run_time
            As in `WearHistory`, the last two without the start state.
        companion
            (n_output, n_contact), m, depths of the coarser history, NaN at counts that it has not come to.
        met
            Counts at which it has come to the history, and how much both differ there, m3.
        start_error
            Relative error of the wear rates of the start state, which is at least that of what they wear.

        Returns
        -------
        WearHistory
            With the errors of volume and depths.
        """
        kept, area = dict(self.kept), self.model.contact.area
        self.compared = companion
        local, truncation, of_pairs = (kept.pop(name) for name in ("local", "truncation", "pair_truncation"))
        difference = _held(np.abs(kept["wear_depth"] - companion)) * RESULTS.companion_safety(self.scheme)
        volume = kept["wear_depth"] @ area
        # wear rates wrong by a common factor shift the history in time: this counts where the wear rises steeply
        late = np.divide(self.cycles * kept["wear_rate"], volume, out=np.ones_like(volume), where=volume > 0.0)
        # in the first steps both histories have the same error, which only the wear rates at their ends show
        differs = np.fmax(difference @ area, RESULTS.companion_safety(self.scheme) * _before(self.cycles, met))
        differs = np.fmax(differs, RESULTS.start_safety * start_error * volume)
        error = np.fmax(differs, local) + truncation * np.fmax(late, 1.0)
        relative = np.divide(error, volume, out=np.zeros_like(volume), where=volume > 0.0)
        relative[np.isnan(volume)] = np.nan
        # what the volume is wrong by beyond the difference of the histories falls to the pairs as they are worn
        rest = relative - np.divide(difference @ area, volume, out=np.zeros_like(volume), where=volume > 0.0)
        reached = np.flatnonzero(np.isfinite(volume))
        return WearHistory(
            outcome=outcome,
            cycles=self.cycles,
            worn_volume=volume,
            worn_volume_error=relative,
            wear_depth_error=difference + of_pairs + rest[:, None] * kept["wear_depth"],
            jump_cycle=jump_cycle,
            error_estimate=float(relative[reached[-1]]) if reached.size else float("nan"),
            newton_iterations=self.start_iterations + iterations,
            run_time=self.start_time + run_time,
            last_cycle=float("nan") if self.last is None else min(self.last[0], float(self.cycles[-1])),
            # adaptive steps go beyond the end
            cycles_to_target=self.reached if self.reached <= self.cycles[-1] else math.nan,
            cut_off_cycle=first_cut_off(self.model.contact, self.cycles, kept["mean_pressure"], kept["wear_depth"]),
            **kept,
        )


def _held(difference: FloatArray) -> FloatArray:
    """Differences (n_output, n_contact) of two histories; the last one where the coarser of them knows no more."""
    held = difference.copy()
    for row in range(1, len(held)):
        held[row] = np.where(np.isnan(held[row]), held[row - 1], held[row])
    return held


def _before(cycles: FloatArray, met: Sequence[tuple[float, float]]) -> FloatArray:
    """Largest of the differences met since a fraction of each count; 0 where there is none."""
    at, differences = (np.array(values, dtype=float) for values in (zip(*met, strict=True) if met else ((), ())))
    first, last = np.searchsorted(at, RESULTS.crossing_window * cycles, "left"), np.searchsorted(at, cycles, "right")
    return np.array([differences[one:other].max(initial=0.0) for one, other in zip(first, last, strict=True)])


def depth_within(
    fraction: FloatArray,
    length: float,
    before: tuple[FloatArray, FloatArray],
    after: tuple[FloatArray, FloatArray],
    smooth: bool,
) -> FloatArray:
    """Worn depth within a step.

    Linear, or smooth: Hermite's cubic with slopes that are cut so that wear never falls; a cubic is monotone where both
    slopes are at most three times the mean one (Fritsch and Carlson 1980).

    Parameters
    ----------
    fraction
        (n,), of the step.
    length
        Of the step, cycles.
    before, after
        Depth, m, and wear rate, m per cycle, both (n_contact,), at the ends of the step.
    smooth
        Whether the cubic is taken.

    Returns
    -------
    FloatArray
        (n, n_contact), m.
    """
    s = fraction[:, None]
    grown = after[0] - before[0]
    if not smooth or length <= 0.0:
        return np.asarray(before[0] + s * grown)
    slopes = bent_within(grown, length, before[1], after[1])
    bent = (1.0 - s) ** 2 * s * slopes[0] - s**2 * (1.0 - s) * slopes[1]
    return np.asarray(before[0] + s**2 * (3.0 - 2.0 * s) * grown + bent)


def bent_within(grown: FloatArray, length: float, first: FloatArray, last: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Slopes of the depth at both ends of a step of `length` cycles, over the step, m; none so steep that it falls.

    grown: depth that the step wears, m. first, last: wear rates at its ends, m per cycle. All (n_contact,).
    """
    return np.minimum(first * length, 3.0 * grown), np.minimum(last * length, 3.0 * grown)

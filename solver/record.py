"""From the steps of a march to the cycle counts that were asked for."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from solver.history import WearHistory
from solver.loops import LOOP_PHASES
from solver.model import FloatArray, ReducedModel
from solver.outcome import Outcome
from solver.response import StateReport

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

_CARRIED = ("_kept", "_last", "_local_errors")


@dataclass
class Recorder:
    """Takes the state after every step and keeps the requested counts.

    Between two steps they are interpolated linearly. smooth: the depth by cubics with the wear rates at both ends
    instead, and all else by the share of the step's worn volume, of which the state is a function: long steps of higher
    order are worth that. Fretting loops (n_loops of them) are interpolated phase by phase like all else, so that they
    close, stay within the friction cone and have the mean pressure that is reported at the same count.
    """

    model: ReducedModel
    cycles: FloatArray
    start_iterations: int
    start_time: float
    smooth: bool = False
    n_loops: int = 0
    _kept: dict[str, Any] = field(init=False, repr=False)
    _last: tuple[float, StateReport, float] | None = field(init=False, default=None, repr=False)
    _local_errors: float = field(init=False, default=0.0, repr=False)

    def __post_init__(self) -> None:
        n_output, n_contact = self.cycles.size, self.model.contact.n_contact
        n_response = len(self.model.response_names)
        shapes: dict[str, tuple[int, ...]] = dict.fromkeys(REPORTED, (n_contact,))
        shapes |= dict.fromkeys(("response", "response_peak"), (n_response,))
        shapes |= dict.fromkeys(("loop_displacement", "loop_force"), (self.n_loops, LOOP_PHASES, 3))
        self._kept = {
            name: np.full((n_output, *shape), np.nan, complex if name == "response" else float)
            for name, shape in shapes.items()
        }
        self._kept |= {name: np.full(n_output, np.nan) for name in ("wear_rate", "worn_volume_error", *CERTIFIED)}
        self._kept |= {name: np.zeros(n_output, np.int64) for name in ("harmonics_used", "samples_used")}
        self._kept["stable"] = np.zeros(n_output, np.bool_)
        self._kept["wear_depth_error"] = np.full((n_output, n_contact), np.nan)

    def carried(self) -> dict[str, Any]:
        """What was kept so far, to be packed."""
        return {name: getattr(self, name) for name in _CARRIED}

    def take_up(self, carried: dict[str, Any]) -> None:
        """Go on from what another one has kept so far."""
        for name in _CARRIED:
            setattr(self, name, carried[name])

    def add(self, cycle: float, report: StateReport, wear_coefficient: float, error: float | None = None) -> None:
        """State at the end of a step; `cycle` never falls.

        error: estimated local error of the step, as worn volume, m3; None for that of an Euler step.
        """
        rate = wear_coefficient * float(report.slip_work.sum())
        if self._last is None:
            wanted = self.cycles == cycle
            before, before_report, before_rate = cycle, report, rate
        else:
            before, before_report, before_rate = self._last
            wanted = (self.cycles > before) & (self.cycles <= cycle)
            # Euler against the trapezoidal rule: the leading error of the step, whose share of the volume is reported
            euler = 0.5 * (cycle - before) * abs(rate - before_rate)
            self._local_errors += euler if error is None else error
            # and what each wear rate is wrong by for want of harmonics and samples
            for value, of in ((before_rate, before_report), (rate, report)):
                self._local_errors += 0.5 * (cycle - before) * value * np.nan_to_num(of.certificate.wear_rate_error)
        share = (self.cycles[wanted] - before) / (cycle - before) if cycle > before else np.ones(wanted.sum())
        depth = before_report.wear_depth + share[:, None] * (report.wear_depth - before_report.wear_depth)
        if self.smooth and cycle > before:
            depth = self._cubic(share, cycle - before, before_report, report, wear_coefficient)
            share = self._worn_share(depth, before_report.wear_depth, report.wear_depth, share)
        for name in REPORTED:
            old, new = getattr(before_report, name), getattr(report, name)
            shares = share.reshape(-1, *(1,) * old.ndim)
            self._kept[name][wanted] = depth if name == "wear_depth" else old + shares * (new - old)
        self._kept["wear_rate"][wanted] = before_rate + share * (rate - before_rate)
        for name in CERTIFIED:
            # what holds for both states holds in between
            self._kept[name][wanted] = np.fmax(
                getattr(before_report.certificate, name), getattr(report.certificate, name)
            )
        self._kept["harmonics_used"][wanted] = report.resolution.highest
        self._kept["samples_used"][wanted] = report.resolution.samples
        self._kept["stable"][wanted] = report.certificate.stable
        worn = depth @ self.model.contact.area
        relative = np.divide(self._local_errors, worn, out=np.zeros_like(worn), where=worn > 0.0)
        self._kept["worn_volume_error"][wanted] = relative
        self._kept["wear_depth_error"][wanted] = relative[:, None] * depth
        self._last = (cycle, report, rate)

    def _cubic(
        self, share: FloatArray, length: float, before: StateReport, after: StateReport, wear_coefficient: float
    ) -> FloatArray:
        """Depth (n, n_contact), m, within a step by Hermite's cubic; its slopes are cut so that wear never falls.

        Fritsch and Carlson (1980): a cubic is monotone where both slopes are at most three times the mean one.
        """
        s = share[:, None]
        grown = after.wear_depth - before.wear_depth
        slopes = [
            np.minimum(wear_coefficient / self.model.contact.area * report.slip_work * length, 3.0 * grown)
            for report in (before, after)
        ]
        bent = (1.0 - s) ** 2 * s * slopes[0] - s**2 * (1.0 - s) * slopes[1]
        return np.asarray(before.wear_depth + s**2 * (3.0 - 2.0 * s) * grown + bent)

    def _worn_share(
        self, depth: FloatArray, before: FloatArray, after: FloatArray, otherwise: FloatArray
    ) -> FloatArray:
        """Share (n,) of the worn volume of a step."""
        area = self.model.contact.area
        whole = float((after - before) @ area)
        return np.asarray((depth - before) @ area / whole) if whole > 0.0 else otherwise

    def failed(self, outcome: Outcome, run_time: float) -> WearHistory:
        """History of a point that has no start state: NaN everywhere."""
        return self._history(outcome, np.nan, np.nan, 0, run_time)

    def finish(self, outcome: Outcome, jump_cycle: float, iterations: int, run_time: float) -> WearHistory:
        """The history as far as it was computed."""
        reached = np.flatnonzero(np.isfinite(self._kept["worn_volume_error"]))
        error = float(self._kept["worn_volume_error"][reached[-1]]) if reached.size else float("nan")
        return self._history(outcome, jump_cycle, error, iterations, run_time)

    def _history(
        self, outcome: Outcome, jump_cycle: float, error: float, iterations: int, run_time: float
    ) -> WearHistory:
        kept = self._kept
        return WearHistory(
            outcome=outcome,
            cycles=self.cycles,
            worn_volume=kept["wear_depth"] @ self.model.contact.area,
            jump_cycle=jump_cycle,
            error_estimate=error,
            newton_iterations=self.start_iterations + iterations,
            run_time=self.start_time + run_time,
            last_cycle=float("nan") if self._last is None else min(self._last[0], float(self.cycles[-1])),
            **kept,
        )

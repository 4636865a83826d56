"""Lengths of the steps on the slow time scale: given, by the largest depth, growing, by the local error, or of a list.

A control takes a state and gives a step, or a failure. The length of the next step is kept in the state.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.converged import vibration_change
from solver.model import FloatArray
from solver.settings import Scheme
from solver.wear.bdf2 import bdf2_attempt
from solver.wear.options import WEAR
from solver.wear.state import Failure, WearState
from solver.wear.step import Step, bounded_euler_step, euler_step
from solver.wear.wearing_joint import WearingJoint


class Control(Protocol):
    """What plans the steps of an integration."""

    def begin(self, work: WearingJoint, state: WearState, /) -> WearState:
        """The unworn state with the length of its first step."""

    def step(self, work: WearingJoint, state: WearState) -> Step | Failure:
        """One step. Raises OutOfTimeError, LinAlgError."""


@dataclass(frozen=True)
class GivenSteps:
    """Euler steps of one length, or explicit ones by the largest-depth rule, Eq. (22).

    scheme: "explicit" or "implicit".
    length: h, cycles.
    end: last cycle count, which the last step is shortened to. Without end (inf) steps grow so that each wears as much
        as the first one, at most to twice the last one.
    largest_depth: m, which the deepest pair may wear in a step; None where `length` holds.
    """

    scheme: Scheme
    length: float
    end: float
    largest_depth: float | None = None

    def begin(self, _: WearingJoint, state: WearState) -> WearState:
        """As in `Control`."""
        return replace(state, length=self.length, first_length=self.length)

    def step(self, work: WearingJoint, state: WearState) -> Step | Failure:
        """As in `Control`."""
        planned = self.length
        if self.end == np.inf:
            slower = float(state.rates.largest[-1] / state.rates.value[-1])
            planned = min(WEAR.largest_step_ratio * state.length, self.length * slower)
        if self.largest_depth is not None and self.scheme == "explicit":
            planned = self.largest_depth / float(work.rate(state.point.evaluation).max())
        # a remainder below round-off of the count is no step of its own
        reach = self.end if state.cycle + planned >= self.end * (1.0 - 1e-12) else state.cycle + planned
        return bounded_euler_step(work, replace(state, length=planned), reach - state.cycle, self.scheme)


@dataclass(frozen=True)
class AdaptiveSteps:
    """BDF2 steps with a relative error of the worn volume near `rtol`.

    The steps know neither the last cycle count nor the wear coefficient but through `k_w h`. They go beyond the last
    count, which is interpolated, and histories that differ in k_w alone take equal steps.

    bounded: whether a step that moves many times the normal forces is refused.
    """

    rtol: float
    bounded: bool = True

    def begin(self, work: WearingJoint, state: WearState) -> WearState:
        """As in `Control`."""
        at = state.point.evaluation
        fastest, length = float(work.rate(at).max(initial=0.0)), 1.0
        if fastest > 0.0:
            moved = float(np.abs(at.displacement_h[:, :, 1:]).max())
            # the limit is far off where next to nothing slips
            length = min(WEAR.first_step * state.step_limit, WEAR.first_depth * moved / fastest)
        return replace(state, length=length, first_length=length)

    def step(self, work: WearingJoint, state: WearState) -> Step | Failure:
        """One step that is accurate enough.

        Steps are not cut below half the length to which the end of a branch is known. Where the vibration changes over
        a step of that length, or none is found, an Euler step finds out whether the branch ends there.
        """
        length = state.length
        shortest = max(0.5 * WEAR.fold_resolution * state.cycle, WEAR.shortest_slow_step * state.first_length)
        while True:
            tried = bdf2_attempt(work, state, length)
            shorter = WEAR.smallest_step_ratio
            if tried is not None:
                size = float(np.abs(tried.error) @ work.area)
                ratio = size / self._allowed(work, state, tried.point.evaluation.wear_depth, length)
                wanted = WEAR.step_safety / np.sqrt(max(ratio, 1e-12))
                # down there the wear rate has a corner, or the branch ends, which shows in the vibration
                calm = vibration_change(state.point.evaluation, tried.point.evaluation) < CONTINUATION.smooth_change
                if ratio <= 1.0 or (length <= shortest and calm):
                    ahead = length * float(np.clip(wanted, WEAR.refused_step_ratio, WEAR.largest_step_ratio))
                    return Step(work.accepted(state, tried.point, length).planned(ahead), size, length)
                shorter = float(np.clip(wanted, WEAR.smallest_step_ratio, WEAR.refused_step_ratio))
            if length <= shortest:
                one_step = bounded_euler_step if self.bounded else euler_step
                taken = one_step(work, state, length, "implicit")
                return taken if isinstance(taken, Failure) else replace(taken, state=taken.state.planned(length))
            length = max(shorter * length, 0.999 * shortest)

    def _allowed(self, work: WearingJoint, state: WearState, depth: FloatArray, length: float) -> float:
        """Error of a step that is accurate enough, m3; depth (n_contact,): at its end, m."""
        worn, before = float(depth @ work.area), float(state.depth @ work.area)
        at_mean_rate = worn * length / (state.cycle + length)
        return max(WEAR.step_error_fraction * self.rtol * max(worn - before, at_mean_rate), 1e-300)

"""Lengths of the steps on the slow time scale: given, growing, by the largest depth, or by the local error.

A control takes a state and gives a step or a failure. The state keeps the length of the next step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.converged import vibration_change
from solver.options import COMMON
from solver.settings import Scheme
from solver.wear.bdf2 import Attempt, bdf2_attempt
from solver.wear.options import WEAR
from solver.wear.state import Failure, WearState
from solver.wear.step import Step, bounded_euler_step, euler_step
from solver.wear.wearing_joint import WearingJoint


class Control(Protocol):
    """Plans the steps of an integration."""

    def begin(self, work: WearingJoint, state: WearState, /) -> WearState:
        """The unworn state with the length of its first step."""

    def step(self, work: WearingJoint, state: WearState) -> Step | Failure:
        """One step. Raises OutOfTimeError, LinAlgError."""


@dataclass(frozen=True)
class GivenSteps:
    """Euler steps of one length, or explicit Euler steps by the largest-depth rule, Eq. (22).

    scheme: "explicit" or "implicit".
    length: h, cycles.
    end: last cycle count, at which the last step ends. Without an end (inf) steps grow so that each wears as much as
        the first one; a step is at most twice as long as the one before.
    largest_depth: m, wear of the fastest pair in an explicit step; None for steps of `length`.
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
            slower = float(state.largest_rates[-1] / state.rates[-1])
            planned = min(COMMON.largest_step_ratio * state.length, self.length * slower)
        if self.largest_depth is not None and self.scheme == "explicit":
            planned = self.largest_depth / float(work.rate(state.point.evaluation).max())
        # no extra step for a remainder below the round-off of the count
        reach = self.end if state.cycle + planned >= self.end * (1.0 - 1e-12) else state.cycle + planned
        return bounded_euler_step(work, replace(state, length=planned), reach - state.cycle, self.scheme)


@dataclass(frozen=True)
class AdaptiveSteps:
    """BDF2 steps with a relative error of the worn volume near `rtol`.

    The steps depend neither on the last cycle count, which is interpolated, nor on the wear coefficient alone, but on
    `k_w h`. So histories that differ in k_w only take equal steps in `k_w h`.

    rtol: relative error of the worn volume.
    end: cycle count beyond which no step goes; inf for steps that go beyond the last count. At least two steps lead
        there, where the first one has its usual length.
    first: length of the first step over its usual length.
    """

    rtol: float
    end: float = np.inf
    first: float = 1.0

    def begin(self, work: WearingJoint, state: WearState) -> WearState:
        """As in `Control`."""
        at = state.point.evaluation
        fastest, length = float(work.rate(at).max(initial=0.0)), 1.0
        if fastest > 0.0:
            moved = float(np.abs(at.displacement_h[:, :, 1:]).max())
            # the limit is no bound where almost nothing slips
            usual = min(WEAR.first_step * state.step_limit, WEAR.first_depth * moved / fastest, 0.5 * self.end)
            length = self.first * usual
        return replace(state, length=length, first_length=length)

    def step(self, work: WearingJoint, state: WearState) -> Step | Failure:
        """One step within the allowed error.

        The shortest step is half of the accuracy to which the end of a branch is located. Where the vibration changes
        much over the shortest step, or its end is not found, an Euler step shows whether the branch ends there. An end
        that a longer step goes across is only a corner.
        """
        length = min(state.length, self.end - state.cycle)
        shortest = max(0.5 * WEAR.fold_resolution * state.cycle, WEAR.shortest_slow_step * state.first_length)
        while True:
            tried = bdf2_attempt(work, state, length)
            shorter = COMMON.smallest_step_ratio
            if tried is not None:
                size = float(np.abs(tried.error) @ work.area)
                before, after = (float(at @ work.area) for at in (state.depth, tried.end.point.evaluation.wear_depth))
                ratio = size / allowed_error(WEAR.step_error_fraction * self.rtol, before, after, state.cycle, length)
                # at the shortest step: a corner of the wear rate, or the end of the branch if the vibration changes
                if ratio <= 1.0 or (length <= shortest and is_smooth(state, tried)):
                    ahead = length * next_ratio(ratio, accepted=True)
                    return Step(work.accepted(state, tried.end, length).planned(ahead), size, length)
                shorter = next_ratio(ratio, accepted=False)
            if length <= shortest:
                taken = euler_step(work, state, length, "implicit")
                across = step_across(work, state, length, self.end) if tried is None and not taken.arrived else None
                return across or replace(taken, state=taken.state.planned(length))
            length = max(shorter * length, 0.999 * shortest)


def step_across(work: WearingJoint, state: WearState, shortest: float, end: float) -> Step | None:
    """A step that is longer than the shortest one, across corners of the branch; None where it is not found.

    Where the last pairs that stick come loose one by one, the mean position of the joint is soft, and the branch has a
    corner with a small fold at each pair. Between such corners no step ends, however short, while Newton's method finds
    the state behind all of them.

    shortest: length of the step whose end is not found, cycles.
    end: cycle count beyond which no step goes.
    """
    # a search without success leaves no trace: where a joint begins to slide, round-off decides what is found next
    kept = work.solver
    work.drop_factor()
    for doubling in range(1, WEAR.doublings_across + 1):
        length = 2.0**doubling * shortest
        if state.cycle + length > end:
            break
        tried = bdf2_attempt(work, state, length)
        if tried is not None and is_smooth(state, tried):
            size = float(np.abs(tried.error) @ work.area)
            return Step(work.accepted(state, tried.end, length).planned(length), size, length)
    work.solver = kept
    return None


def is_smooth(state: WearState, tried: Attempt) -> bool:
    """Whether the vibration changes so little over a step that the branch does not end within the step."""
    change = vibration_change(state.point.evaluation, tried.end.point.evaluation)
    return change < CONTINUATION.smooth_change


def allowed_error(share: float, before: float, after: float, count: float, length: float) -> float:
    """Allowed error of an adaptive step, m3.

    share: of the wear of the step, or of its wear at the mean rate so far if this is more.
    before, after: worn volumes at its start and end, m3.
    count, length: count at its start, and its length, in cycles or in missions.
    """
    at_mean_rate = after * length / (count + length)
    return max(share * max(after - before, at_mean_rate), 1e-300)


def next_ratio(error: float, *, accepted: bool) -> float:
    """Length of the next step of second order, or of a step that is tried again, over the length of the present one.

    error: of the present step, over the allowed error.
    """
    wanted = COMMON.step_safety / np.sqrt(max(error, 1e-12))
    least, most = COMMON.step_safety, COMMON.largest_step_ratio
    return float(np.clip(wanted, *((least, most) if accepted else (COMMON.smallest_step_ratio, least))))

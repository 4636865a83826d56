"""Lengths of the steps on the slow time scale: given, growing, by the largest depth, or by the local error.

A control takes a state and gives a step or a failure. The state keeps the length of the next step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.state import Failure, vibration_change
from solver.march.steps import LARGEST_STEP_RATIO, Lengths, take_step
from solver.outcome import Outcome
from solver.settings import Scheme
from solver.wear.options import WEAR
from solver.wear.state import WearState
from solver.wear.step import Step, attempt_step, end_of_branch
from solver.wear.step_limit import too_long
from solver.wear.wearing_joint import WearingJoint

SECOND_ORDER = Lengths(2)
"""Lengths of steps of second order, from their local errors."""


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
        """As in `Control`; a step whose wear would move many times the normal forces is a failure."""
        planned = self.length
        if self.end == np.inf:
            slower = float(state.largest_rates[-1] / state.rates[-1])
            planned = min(LARGEST_STEP_RATIO * state.length, self.length * slower)
        if self.largest_depth is not None and self.scheme == "explicit":
            planned = self.largest_depth / float(work.rate(state.point.evaluation).max())
        # no extra step for a remainder below the round-off of the count
        reach = self.end if state.cycle + planned >= self.end * (1.0 - 1e-12) else state.cycle + planned
        length, state = reach - state.cycle, replace(state, length=planned)
        step = euler_step(work, state, length, self.scheme)
        ahead = step.state.cycle - state.cycle
        said = too_long(work.at(state), state.point.evaluation, step.state.depth, state.cycle, ahead)
        return step if said is None else Failure(Outcome.STEP_TOO_LONG, said)


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
        """As in `Control`: one step within the allowed error.

        The shortest step is half of the accuracy to which the end of a branch is located.
        """
        shortest = max(0.5 * WEAR.fold_resolution * state.cycle, WEAR.shortest_slow_step * state.first_length)
        longest = self.end - state.cycle
        lengths = replace(SECOND_ORDER, shortest=min(shortest, longest), rescue=min(shortest, longest))
        line = _Controlled(work, self.rtol, self.end, lengths.shortest)
        taken = take_step(line, state, min(state.length, longest), lengths)
        if isinstance(taken, Failure):
            return taken
        step, ahead = taken
        return replace(step, state=step.state.planned(ahead))


@dataclass(frozen=True)
class _Controlled:
    """The line of the adaptive steps of a joint. shortest: length of the shortest step, cycles."""

    work: WearingJoint
    rtol: float
    end: float
    shortest: float

    def attempt(self, state: WearState, length: float) -> Step | None:
        """As in Line."""
        return attempt_step(self.work, state, length, "adaptive")

    def judge(self, state: WearState, step: Step, length: float) -> float:
        """As in Line. The shortest step is a corner of the wear rate where the vibration changes little."""
        before, after = (float(at.depth @ self.work.area) for at in (state, step.state))
        allowed = allowed_error(WEAR.step_error_fraction * self.rtol, before, after, state.cycle, length)
        ratio = step.volume_error(self.work.area) / allowed
        return min(ratio, 1.0) if length <= self.shortest and is_smooth(state, step) else ratio

    def rescue(self, state: WearState, length: float) -> Step:
        """As in Line, where the vibration changes much over the shortest step, or its end is not found.

        An Euler step; a longer step across corners; the end of the branch.
        """
        euler = euler_step(self.work, state, length, "implicit")
        if euler.arrived:
            return euler
        return step_across(self.work, state, length, self.end) or euler


def euler_step(work: WearingJoint, state: WearState, length: float, scheme: Scheme) -> Step:
    """An Euler step to a stable state, or the end of the branch within the step."""
    step = attempt_step(work, state, length, scheme)
    if step is not None and (work.follow is not None or work.is_stable(state, step.state.point.evaluation)):
        return step
    return end_of_branch(work, state, length, scheme)


def step_across(work: WearingJoint, state: WearState, shortest: float, end: float) -> Step | None:
    """A step that is longer than the shortest one, across corners of the branch; None where it is not found.

    Where the last pairs that stick come loose one by one, the mean position of the joint is soft, and the branch has a
    corner with a small fold at each pair. Between such corners no step ends, however short, while Newton's method finds
    the state behind all of them.

    shortest: length of the step whose end is not found, cycles.
    end: cycle count beyond which no step goes.
    """
    # a search without success leaves no trace: where a joint begins to slide, round-off decides what is found next
    kept = work.run
    work.drop_factor()
    for doubling in range(1, WEAR.doublings_across + 1):
        length = 2.0**doubling * shortest
        if state.cycle + length > end:
            break
        tried = attempt_step(work, state, length, "adaptive")
        if tried is not None and is_smooth(state, tried):
            return tried
    work.run = kept
    return None


def is_smooth(state: WearState, step: Step) -> bool:
    """Whether the vibration changes so little over a step that the branch does not end within the step."""
    return vibration_change(state.point.evaluation, step.state.point.evaluation) < CONTINUATION.smooth_change


def allowed_error(share: float, before: float, after: float, count: float, length: float) -> float:
    """Allowed error of an adaptive step, m3.

    share: of the wear of the step, or of its wear at the mean rate so far if this is more.
    before, after: worn volumes at its start and end, m3.
    count, length: count at its start, and its length, in cycles or in missions.
    """
    at_mean_rate = after * length / (count + length)
    return max(share * max(after - before, at_mean_rate), 1e-300)

"""Lengths of the steps on the slow time scale, and what is tried where no step is found.

`WearLine.step` takes a step as long as its rule and the branch of the vibration allow. Where the shortest step is not
found, it tries in this order, each once: an implicit Euler step, a longer step across corners of the branch (both in
adaptive histories only), and a jump to a state behind the end of the branch.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from solver.continuation.natural import SMOOTH_CHANGE
from solver.harmonic_balance.state import Failure, vibration_change
from solver.march.steps import Lengths, take_step
from solver.model import FloatArray
from solver.newton.run import SHORTEST_STEP
from solver.outcome import Outcome
from solver.settings import ROUND_OFF, Scheme
from solver.wear.jump import jump
from solver.wear.rate_slope import too_long
from solver.wear.state import WearState
from solver.wear.step import Step, attempt_step
from solver.wear.wearing_joint import WearingJoint

FOLD_RESOLUTION = 0.005
"""Shortest adaptive step, as a fraction of the cycle count."""

STEP_ERROR_FRACTION = 0.25
"""Allowed error of a step over its wear, or over its wear at the mean rate so far if larger, as a fraction of rtol.
Dovetail, 16 pairs, nine harmonics, 212.42 to 213 Hz, `rtol` 1e-2: errors of the worn volume up to 0.21 %. With 0.5 a
quarter to a third less steps, up to 0.5 %, and 5.9 % at 212.5 Hz, where a pair that only just slips then sticks."""

FIRST_STEP, FIRST_DEPTH = 0.05, 0.01
"""Length of the first adaptive step, whose error is not known, as a fraction of the explicit step limit, and its
largest wear, as a fraction of the largest relative motion."""

SHORTEST_SLOW_STEP = 1e-4
"""Shortest adaptive step at the begin, as a fraction of the first step."""

DOUBLINGS_ACROSS = 4
"""Most doublings of the shortest step to go across corners. Dovetail, mesh 2, nodal diameter 3, 213.5 Hz: four steps
across, by 3, 2, 2 and 4 doublings; without them `march_failed` after 846 cycles. Mesh 1, 212.42 Hz, `rtol` 0.05: none,
but with some BLAS kernels three were needed before pairs slid along the steps. The local errors of these steps were 0.1
to 2.7 times the allowed ones."""


@dataclass(frozen=True)
class Given:
    """Euler steps of `length` cycles, which end at its multiples also behind a shorter step.

    So histories that differ in k_w only have equal steps in `k_w h`. To the end of wear, each step wears about as much
    as the first one.
    """

    length: float
    scheme: Scheme = "implicit"


@dataclass(frozen=True)
class LargestDepth:
    """Explicit steps in which the fastest pair wears `depth`, m, at the rate of the start, Eq. (22)."""

    depth: float
    scheme: ClassVar[Scheme] = "explicit"


@dataclass(frozen=True)
class Adaptive:
    """BDF2 steps with a relative error of the worn volume near `rtol`.

    The last cycle count is interpolated. Histories that differ in k_w only take equal steps in `k_w h`.

    first: length of the first step over its usual length.
    """

    rtol: float
    first: float = 1.0
    scheme: ClassVar[Scheme] = "adaptive"


Steps = Given | LargestDepth | Adaptive


def steps_of(scheme: str, length: float, rtol: float, largest_depth: float | None = None) -> Steps:
    """The steps of a scheme by its name, "final" included; largest_depth: in place of the length of explicit steps."""
    if scheme in ("adaptive", "final"):
        return Adaptive(rtol)
    if scheme == "explicit" and largest_depth is not None:
        return LargestDepth(largest_depth)
    return Given(length, "explicit" if scheme == "explicit" else "implicit")


@dataclass(frozen=True)
class WearLine:
    """A joint along its cycles: the line of `take_step`.

    end: cycle count beyond which no step goes; inf for none. Adaptive steps of a history go beyond its last count.
    bounded: whether a step or a jump that moves many times the normal forces is a failure.
    """

    work: WearingJoint
    steps: Steps
    end: float
    bounded: bool = True

    def begin(self, state: WearState) -> WearState:
        """The first state with the length of its step, if that is adaptive; at least two steps lead to `end`."""
        if not isinstance(self.steps, Adaptive):
            return state
        at = state.point.evaluation
        fastest, length = float(self.work.rate(at).max(initial=0.0)), 1.0
        if fastest > 0.0:
            moved = float(np.abs(at.displacement_h[:, :, 1:]).max())
            # the limit is no bound where almost nothing slips
            length = min(FIRST_STEP * state.step_limit, FIRST_DEPTH * moved / fastest, 0.5 * self.end)
            length *= self.steps.first
        return replace(state, length=length, first_length=length)

    def step(self, state: WearState) -> Step | Failure:
        """One step from a state, or why there is none; the new state has the largest length of the next one.

        Raises OutOfTimeError, LinAlgError.
        """
        length = self._wanted(state)
        shortest = self._shortest(state, length)
        length = length if state.previous is None else min(length, state.length)
        # no extra step for a remainder below the round-off of the count
        if state.cycle + length >= self.end * (1.0 - 1e-12):
            length = self.end - state.cycle
        shortest = min(shortest, length)
        taken = take_step(self, state, length, Lengths(2, shortest=shortest, rescue=shortest))
        if isinstance(taken, Failure):
            return taken
        step, ahead = taken
        failure = self._refused(state, step.state.depth, step.state.cycle - state.cycle)
        return failure or replace(step, state=replace(step.state, length=ahead))

    def _wanted(self, state: WearState) -> float:
        """Length of the next step by the rule alone, cycles."""
        steps = self.steps
        if isinstance(steps, Adaptive):
            return state.length
        if isinstance(steps, LargestDepth):
            return steps.depth / float(self.work.rate(state.point.evaluation).max())
        if self.end == math.inf:
            return steps.length * float(state.largest_rates[-1] / state.rates[-1])
        left = steps.length * (math.floor(state.cycle / steps.length + ROUND_OFF) + 1.0) - state.cycle
        return left if left < (1.0 - ROUND_OFF) * steps.length else steps.length

    def _shortest(self, state: WearState, length: float) -> float:
        """Shortest step, cycles: the accuracy to which the end of a branch is located."""
        if isinstance(self.steps, Adaptive):
            return max(FOLD_RESOLUTION * state.cycle, SHORTEST_SLOW_STEP * state.first_length)
        return SHORTEST_STEP * length

    def attempt(self, state: WearState, length: float) -> Step | None:
        """As in Line."""
        if isinstance(self.steps, Adaptive):
            return attempt_step(self.work, state, length, "adaptive")
        return euler_step(self.work, state, length, self.steps.scheme)

    def judge(self, state: WearState, step: Step, length: float) -> float:
        """As in Line: an Euler step counts whatever its error.

        The shortest adaptive step is a corner of the wear rate where the vibration changes little.
        """
        if not isinstance(self.steps, Adaptive):
            return 0.0
        before, after = (float(at.depth @ self.work.area) for at in (state, step.state))
        allowed = allowed_error(STEP_ERROR_FRACTION * self.steps.rtol, before, after, state.cycle, length)
        ratio = step.error / allowed
        return min(ratio, 1.0) if length <= self._shortest(state, length) and is_smooth(state, step) else ratio

    def rescue(self, state: WearState, length: float) -> Step | Failure:
        """As in Line, where the end of the shortest step is not found, or the vibration changes much over it."""
        found = None
        if isinstance(self.steps, Adaptive):
            found = euler_step(self.work, state, length, "implicit") or step_across(self.work, state, length, self.end)
        return found or self._behind(state, length)

    def _behind(self, state: WearState, beyond: float) -> Step | Failure:
        """A jump over so many cycles as a step, at the frequency that is followed."""
        work = self.work
        worn = state.depth + beyond * work.rate(state.point.evaluation)
        if (failure := self._refused(state, worn, beyond)) is not None:
            return failure
        behind = jump(work, state, worn, state.cycle + beyond)
        if isinstance(behind, Failure):
            return work.where.lost(state, behind)
        behind = work.at_followed(behind)
        return behind if isinstance(behind, Failure) else Step(behind)

    def _refused(self, state: WearState, wear_depth: FloatArray, length: float) -> Failure | None:
        """Why a step or a jump to depths (n_contact,), m, after so many cycles is no result; None if it is."""
        if not self.bounded:
            return None
        said = too_long(self.work.at(state), state.point.evaluation, wear_depth, state.cycle, length)
        return None if said is None else Failure(Outcome.STEP_TOO_LONG, said)


def euler_step(work: WearingJoint, state: WearState, length: float, scheme: Scheme) -> Step | None:
    """An Euler step to a stable state; None where it is not found.

    A followed resonance may be unstable at constant frequency.
    """
    step = attempt_step(work, state, length, scheme)
    if step is None or work.where.follows or work.is_stable(work.at(state), step.state.point.evaluation):
        return step
    return None


def step_across(work: WearingJoint, state: WearState, shortest: float, end: float) -> Step | None:
    """A step that is longer than the shortest one, across corners of the branch; None where it is not found.

    Where the last pairs that stick come loose one by one, the branch has a corner with a small fold at each pair.
    Between them no step ends, however short, while Newton's method finds the state behind all of them.

    shortest: length of the step whose end is not found, cycles. end: cycle count beyond which no step goes.
    """
    # a search without success leaves no trace: where a joint begins to slide, round-off decides what is found next
    kept = work.run
    work.drop_factor()
    for doubling in range(1, DOUBLINGS_ACROSS + 1):
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
    return vibration_change(state.point.evaluation, step.state.point.evaluation) < SMOOTH_CHANGE


def allowed_error(share: float, before: float, after: float, count: float, length: float) -> float:
    """Allowed error of an adaptive step, m3.

    share: of the wear of the step, or of its wear at the mean rate so far if this is more.
    before, after: worn volumes at its start and end, m3.
    count, length: count at its start, and its length, in cycles or in missions.
    """
    at_mean_rate = after * length / (count + length)
    return max(share * max(after - before, at_mean_rate), 1e-300)

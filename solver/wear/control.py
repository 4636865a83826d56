"""Lengths of the steps on the slow time scale: given, by the largest depth, growing, or by the local error.

`one_step` takes a step as long as the plan and the branch of the vibration allow. Where no step is found, it tries in
this order, each once: an Euler step, an Euler step in parts, a longer step across corners of the branch (adaptive steps
only), and a jump to a state behind the end of the branch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.continuation.natural import SMOOTH_CHANGE, follow_naturally
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import Failure, State, final_history, vibration_change
from solver.march.steps import Lengths, take_step
from solver.model import FloatArray
from solver.newton.iteration import SHORTEST_STEP
from solver.outcome import Outcome
from solver.settings import Scheme
from solver.wear.jump import jump
from solver.wear.rate_slope import too_long
from solver.wear.state import Reached, WearState
from solver.wear.step import Step, attempt_step
from solver.wear.wearing_joint import WearingJoint

SECOND_ORDER = Lengths(2)
"""Lengths of steps of second order, from their local errors."""

FOLD_RESOLUTION = 0.01
"""Accuracy of the end of a branch, as a fraction of the cycle count."""

STEP_ERROR_FRACTION = 0.25
"""Allowed error of a step over its wear, or over its wear at the mean rate so far if larger, as a fraction of rtol.
Dovetail, 16 pairs, nine harmonics, 212.42 to 213 Hz, `rtol` 1e-2: errors of the worn volume up to 0.21 %. With 0.5 a
quarter to a third less steps, up to 0.5 %, and 5.9 % at 212.5 Hz, where a pair that only just slips then sticks."""

FIRST_STEP, FIRST_DEPTH = 0.05, 0.01
"""Length of the first adaptive step, whose error is not known, as a fraction of the explicit step limit, and its
largest wear, as a fraction of the largest relative motion."""

SHORTEST_SLOW_STEP = 1e-4
"""Shortest adaptive step, as a fraction of the first step."""

DOUBLINGS_ACROSS = 4
"""Most doublings of the shortest step to go across corners. Dovetail, mesh 2, nodal diameter 3, 213.5 Hz: four steps
across, by 3, 2, 2 and 4 doublings; without them `march_failed` after 846 cycles. Mesh 1, 212.42 Hz, `rtol` 0.05: none,
but with some BLAS kernels three were needed before pairs slid along the steps. The local errors of these steps were 0.1
to 2.7 times the allowed ones."""


@dataclass(frozen=True)
class Given:
    """Euler steps of one length, of which the last one ends at the count `end`.

    scheme: "explicit" or "implicit".
    length: h, cycles.
    """

    work: WearingJoint
    scheme: Scheme
    length: float
    end: float

    bounded = True

    def begin(self, state: WearState) -> WearState:
        """The unworn state with the length of its first step."""
        return replace(state, first_length=self.length)

    def wanted(self, state: WearState) -> tuple[float, float]:
        """Length of the next step by the plan alone, and of the shortest one, cycles."""
        length = self._wanted(state)
        return length, SHORTEST_STEP * length if self.work.where.follows else length

    def _wanted(self, _: WearState) -> float:
        return self.length

    def attempt(self, state: WearState, length: float) -> Step | None:
        """As in Line."""
        return euler_step(self.work, state, length, self.scheme)

    def judge(self, _: WearState, __: Step, ___: float) -> float:
        """As in Line: a step counts whatever its error."""
        return 0.0

    def rescue(self, state: WearState, length: float) -> Step | Failure:
        """As in Line: a step to the end of the branch, and a jump from there."""
        step, known_to = step_in_parts(self.work, state, length, self.scheme), SHORTEST_STEP * length
        if step is not None and step.state.cycle - state.cycle > 2.0 * known_to:
            return step
        return step_behind(self, state if step is None else step.state, 2.0 * known_to)


@dataclass(frozen=True)
class LargestDepth(Given):
    """Euler steps in which the fastest pair wears `depth`, m, at the rate of the start, Eq. (22)."""

    depth: float

    def _wanted(self, state: WearState) -> float:
        return self.depth / float(self.work.rate(state.point.evaluation).max())


@dataclass(frozen=True)
class Growing(Given):
    """Euler steps each of which wears about as much as the first one, for a history to the end of wear."""

    def _wanted(self, state: WearState) -> float:
        return self.length * float(state.largest_rates[-1] / state.rates[-1])


@dataclass(frozen=True)
class Adaptive:
    """BDF2 steps with a relative error of the worn volume near `rtol`.

    The steps depend neither on the last cycle count, which is interpolated, nor on the wear coefficient alone, but on
    `k_w h`. So histories that differ in k_w only take equal steps in `k_w h`.

    end: cycle count beyond which no step goes; inf for steps that go beyond the last count. At least two steps lead
        there, where the first one has its usual length.
    first: length of the first step over its usual length.
    bounded: whether a step or a jump that moves many times the normal forces is a failure.
    """

    work: WearingJoint
    rtol: float
    end: float = np.inf
    first: float = 1.0
    bounded: bool = True

    def begin(self, state: WearState) -> WearState:
        """As in Given."""
        at = state.point.evaluation
        fastest, length = float(self.work.rate(at).max(initial=0.0)), 1.0
        if fastest > 0.0:
            moved = float(np.abs(at.displacement_h[:, :, 1:]).max())
            # the limit is no bound where almost nothing slips
            length = self.first * min(FIRST_STEP * state.step_limit, FIRST_DEPTH * moved / fastest, 0.5 * self.end)
        return replace(state, length=length, first_length=length)

    def wanted(self, state: WearState) -> tuple[float, float]:
        """As in Given. The shortest step is half of the accuracy to which the end of a branch is located."""
        return state.length, max(0.5 * FOLD_RESOLUTION * state.cycle, SHORTEST_SLOW_STEP * state.first_length)

    def attempt(self, state: WearState, length: float) -> Step | None:
        """As in Line."""
        return attempt_step(self.work, state, length, "adaptive")

    def judge(self, state: WearState, step: Step, length: float) -> float:
        """As in Line. The shortest step is a corner of the wear rate where the vibration changes little."""
        before, after = (float(at.depth @ self.work.area) for at in (state, step.state))
        allowed = allowed_error(STEP_ERROR_FRACTION * self.rtol, before, after, state.cycle, length)
        ratio = step.volume_error(self.work.area) / allowed
        return min(ratio, 1.0) if length <= self.wanted(state)[1] and is_smooth(state, step) else ratio

    def rescue(self, state: WearState, length: float) -> Step | Failure:
        """As in Line, where the vibration changes much over the shortest step, or its end is not found."""
        euler = euler_step(self.work, state, length, "implicit")
        parts = None if euler else step_in_parts(self.work, state, length, "implicit")
        if parts is not None and parts.state.cycle >= (state.cycle + length) * (1.0 - 1e-12):
            euler = parts
        last = state if parts is None else parts.state
        return euler or step_across(self.work, state, length, self.end) or step_behind(self, last, length)


Steps = Given | Adaptive


def one_step(steps: Steps, state: WearState) -> Step | Failure:
    """One step from a state, or why there is none; the new state has the largest length of the next one.

    Raises OutOfTimeError, LinAlgError.
    """
    length, shortest = steps.wanted(state)
    length = length if state.previous is None else min(length, state.length)
    # no extra step for a remainder below the round-off of the count
    if state.cycle + length >= steps.end * (1.0 - 1e-12):
        length = steps.end - state.cycle
    shortest = min(shortest, length)
    taken = take_step(steps, state, length, replace(SECOND_ORDER, shortest=shortest, rescue=shortest))
    if isinstance(taken, Failure):
        return taken
    step, ahead = taken
    failure = refused(steps, state, step.state.depth, step.state.cycle - state.cycle)
    return failure or replace(step, state=replace(step.state, length=ahead))


def euler_step(work: WearingJoint, state: WearState, length: float, scheme: Scheme) -> Step | None:
    """An Euler step to a stable state; None where it is not found.

    A followed resonance may be unstable at constant frequency.
    """
    step = attempt_step(work, state, length, scheme)
    if step is None or work.where.follows or work.is_stable(work.at(state), step.state.point.evaluation):
        return step
    return None


def step_in_parts(work: WearingJoint, state: WearState, length: float, scheme: Scheme) -> Step | None:
    """An Euler step by shorter and shorter parts, at the tangential history of its start, as far as its branch goes.

    None where no part or no stable state is found.
    """
    if work.where.follows:
        return None
    joint, depth, start = work.at(state), state.depth, state.point
    rate, gain = work.rate(start.evaluation), work.gain(length)

    def balance_at(fraction: float, history: FloatArray) -> Balance:
        if scheme == "explicit":
            return Balance(joint, history, depth + fraction * length * rate)
        return Balance(joint, history, depth, fraction * gain, work.wearing)

    begin = replace(start, parameter=0.0)
    last, _ = follow_naturally(balance_at, begin, 1.0, work.run, keep_history=True)
    if last.parameter <= 0.0 or not work.is_stable(joint, last.evaluation):
        return None
    point = State(last.evaluation, final_history(balance_at(last.parameter, start.history), last.evaluation))
    ahead = last.parameter * length
    after = work.accepted(state, Reached(point, state.omega, state.lag, state.half_width), ahead)
    return Step(after, 0.5 * ahead * (work.rate(point.evaluation) - rate))


def step_behind(steps: Steps, state: WearState, beyond: float) -> Step | Failure:
    """A jump over so many cycles as a step, at the frequency that is followed."""
    work, beyond = steps.work, min(beyond, steps.end - state.cycle)
    worn = state.depth + beyond * work.rate(state.point.evaluation)
    if (failure := refused(steps, state, worn, beyond)) is not None:
        return failure
    behind = jump(work, state, worn, state.cycle + beyond)
    if isinstance(behind, Failure):
        return work.where.lost(state) or behind
    behind = work.at_followed(behind)
    return behind if isinstance(behind, Failure) else Step(behind, np.zeros_like(behind.depth))


def refused(steps: Steps, state: WearState, wear_depth: FloatArray, length: float) -> Failure | None:
    """Why a step or a jump to depths (n_contact,), m, after so many cycles is no result; None if it is."""
    if not steps.bounded:
        return None
    joint = steps.work.at(state)
    said = too_long(joint, state.point.evaluation, wear_depth, state.cycle, length)
    return None if said is None else Failure(Outcome.STEP_TOO_LONG, said)


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

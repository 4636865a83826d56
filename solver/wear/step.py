"""A step on the slow time scale as one balance: explicit or implicit Euler, or BDF2; its length, and its rescues.

- explicit, Eqs. (20), (23): W_(n+1) = W_n + h g(W_n), a given depth;
- implicit, Eqs. (24) to (26): W_(n+1) = W_n + h g(W_(n+1));
- adaptive: backward differences of second order (BDF2). With w = h_n / h_(n-1), the ratio of two steps,

    W_(n+1) = W_n + w^2 / (1 + 2 w) (W_n - W_(n-1)) + (1 + w) / (1 + 2 w) h_n g(W_(n+1)),

  an implicit Euler step from a depth that is already worn and with a shorter h. It is zero-stable for w < 1 + sqrt(2);
  both factors are positive, so that wear never falls. The local error follows from the difference to an explicit
  formula of the same order (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, III.5):

    P = W_n + (1 + w) h_n g_n - w^2 (W_n - W_(n-1)),      e = c / (c + c_P) (W_(n+1) - P),
    c = (1 + w)^2 / (6 w (1 + 2 w)),      c_P = (1 + 1 / w) / 6.

  The first step, also after a jump, is an implicit Euler step. Its error is the difference to the trapezoidal rule.

The wear of other pairs changes the force of a pair, which slides a little in each cycle at its friction limit. Where it
ends depends on the path of the force. One slide for the whole path is an error of first order in the step (dovetail, 16
pairs, 212.6 Hz, `rtol` 1e-2: 1.8 % of the worn volume, with the path divided 0.4 %). So the law is applied at points of
a straight line from the predicted force towards the extrapolated one, at each until the period repeats. The last part
is left to the balance: with the whole line, pairs may keep the history of a path that the joint did not take (48 pairs,
211.5 Hz: 1.667 mm3, another branch, for 2.284 mm3; 2.261 by time integration).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from solver.contact.coulomb import STICK
from solver.contact.law import Marched
from solver.continuation.natural import SMOOTH_CHANGE, Lengths, take_step
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import Failure, vibration_change
from solver.model import FloatArray
from solver.newton.run import SHORTEST_STEP
from solver.outcome import Outcome
from solver.settings import ROUND_OFF, Scheme
from solver.structure.joint import Joint
from solver.wear.jump import jump
from solver.wear.rate_slope import explicit_step_limit, too_long
from solver.wear.wearing_joint import LastStep, WearingJoint, WearState

PARTS_OF_STEP = 32
"""Parts of a step in each of which the pairs slide at their friction limit. Dovetail, 16 pairs, 212.6 Hz, 1e5 cycles:
1.795, 1.813, 1.819, 1.819 mm3 with 1, 8, 32, 128 parts (`rtol` 2e-4: 1.823). A tenth of the time of a history."""

FOLD_RESOLUTION = 0.005
"""Shortest adaptive step, as a fraction of the cycle count."""

STEP_ERROR_FRACTION = 0.25
"""Allowed error of a step over its wear, or over its wear at the mean rate so far if larger, as a fraction of rtol.
Dovetail, 16 pairs, 212.42 to 213 Hz, `rtol` 1e-2: errors of the worn volume up to 0.21 %. With 0.5 a quarter to a third
less steps, up to 0.5 %, and 5.9 % at 212.5 Hz, where a pair that only just slips then sticks."""

FIRST_STEP, FIRST_DEPTH = 0.05, 0.01
"""Length of the first adaptive step, whose error is not known, as a fraction of the explicit step limit, and its
largest wear, as a fraction of the largest relative motion."""

SHORTEST_SLOW_STEP = 1e-4
"""Shortest adaptive step at the start, as a fraction of the first step."""

DOUBLINGS_ACROSS = 4
"""Most doublings of the shortest step to go across corners. Dovetail, mesh 2, nodal diameter 3, 213.5 Hz: four steps
across, by 3, 2, 2 and 4 doublings, errors 0.1 to 2.7 times the allowed ones; else `march_failed` at 846 cycles."""


@dataclass(frozen=True)
class Given:
    """Euler steps of `length` cycles, which end at its multiples also after a shorter step: equal steps in `k_w h` of
    histories that differ in k_w only. To the end of wear, each step wears about as much as the first one.

    depth: in place of the length, wear of the fastest pair at the rate of the start of a step, m, Eq. (22).
    """

    length: float
    scheme: Scheme = "implicit"
    depth: float | None = None


@dataclass(frozen=True)
class Adaptive:
    """BDF2 steps with a relative error of the worn volume near `rtol`. The last cycle count is interpolated.

    first: length of the first step, cycles; 0: by the explicit step limit.
    """

    rtol: float
    first: float = 0.0
    scheme: ClassVar[Scheme] = "adaptive"


Steps = Given | Adaptive


def steps_of(scheme: str, length: float, rtol: float, largest_depth: float | None = None) -> Steps:
    """The steps of a scheme by its name, "final" included; largest_depth: in place of the length of explicit steps."""
    if scheme in ("adaptive", "final"):
        return Adaptive(rtol)
    return Given(length, "explicit", largest_depth) if scheme == "explicit" else Given(length)


@dataclass(frozen=True)
class Step:
    """A step: its end, and its estimated local error as worn volume, m3."""

    state: WearState
    error: float = 0.0


@dataclass(frozen=True)
class WearLine:
    """A joint along its cycles: the line of `take_step`.

    end: cycle count beyond which no step goes; inf for none.
    bounded: whether a step or a jump that moves many times the normal forces is a failure.
    """

    setup: WearingJoint
    steps: Steps
    end: float
    bounded: bool = True

    def begin(self, state: WearState) -> WearState:
        """The first state with its step limit, and the length of an adaptive step; at least two lead to `end`."""
        steps, length = self.steps, 1.0
        if isinstance(steps, Adaptive) and steps.first > 0.0:
            length = steps.first
        elif state.wears:
            state = replace(state, step_limit=explicit_step_limit(self.setup, state))
            moved, fastest = np.abs(state.at.displacement_h[:, :, 1:]).max(), self.setup.rate(state.at).max()
            # the limit is no bound where almost nothing slips
            length = min(FIRST_STEP * state.step_limit, float(FIRST_DEPTH * moved / fastest), 0.5 * self.end)
        return replace(state, length=length, first_length=length)

    def step(self, state: WearState) -> Step | Failure:
        """One step from a state, or why there is none; the new state has the largest length of the next one."""
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
        if steps.depth is not None:
            return steps.depth / float(self.setup.rate(state.at).max())
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
            return attempt_step(self.setup, state, length, "adaptive")
        return self._euler_step(state, length, self.steps.scheme)

    def ratio(self, state: WearState, step: Step, length: float) -> float:
        """As in Line: an Euler step counts whatever its error, the shortest adaptive step where the vibration changes
        little: at a corner of the wear rate.
        """
        if not isinstance(self.steps, Adaptive):
            return 0.0
        before, after = (float(each.depth @ self.setup.area) for each in (state, step.state))
        allowed = allowed_error(STEP_ERROR_FRACTION * self.steps.rtol, before, after, state.cycle, length)
        ratio = step.error / allowed
        return min(ratio, 1.0) if length <= self._shortest(state, length) and is_smooth(state, step) else ratio

    def rescue(self, state: WearState, length: float) -> Step | Failure:
        """As in Line. In this order: an Euler step, a longer step across corners (both adaptive only), and a jump."""
        setup = self.setup
        if isinstance(self.steps, Adaptive):
            found = self._euler_step(state, length, "implicit") or self._step_across(state, length)
            if found is not None:
                return found
        worn = state.depth + length * setup.rate(state.at)
        if (failure := self._refused(state, worn, length)) is not None:
            return failure
        beyond = jump(setup, state, worn, state.cycle + length)
        if isinstance(beyond, Failure):
            return setup.lost(state, beyond)
        beyond = setup.at_followed(beyond)
        return beyond if isinstance(beyond, Failure) else Step(beyond)

    def _euler_step(self, state: WearState, length: float, scheme: Scheme) -> Step | None:
        """An Euler step to a stable state, or None. A followed resonance may be unstable at constant frequency."""
        step = attempt_step(self.setup, state, length, scheme)
        return step if step is None or self.setup.follow is not None or self.setup.is_stable(step.state) else None

    def _step_across(self, state: WearState, shortest: float) -> Step | None:
        """A step longer than the shortest one, cycles, across corners of the branch; None where it is not found.

        Where the last pairs that stick come loose one by one, no step ends between the small folds, however short.
        """
        # a search without success leaves no trace: where a joint begins to slide, round-off decides what is found next
        kept = self.setup.run
        self.setup.drop_factor()
        for doubling in range(1, DOUBLINGS_ACROSS + 1):
            length = 2.0**doubling * shortest
            if state.cycle + length > self.end:
                break
            tried = attempt_step(self.setup, state, length, "adaptive")
            if tried is not None and is_smooth(state, tried):
                return tried
        self.setup.run = kept
        return None

    def _refused(self, state: WearState, wear_depth: FloatArray, length: float) -> Failure | None:
        """Why a step or a jump to depths (n_contact,), m, after so many cycles is no result; None if it is."""
        said = too_long(self.setup, state, wear_depth, length) if self.bounded else None
        return None if said is None else Failure(Outcome.STEP_TOO_LONG, said)


def attempt_step(setup: WearingJoint, state: WearState, length: float, scheme: Scheme) -> Step | None:
    """A step of `length` cycles by one balance; None where its end is not found."""
    depth, rate = state.depth, setup.rate(state.at)
    worn_before, implicit_cycles = (depth + length * rate, 0.0) if scheme == "explicit" else (depth, length)
    w, grown = 0.0, np.zeros_like(depth)
    if scheme == "adaptive" and state.previous is not None:
        w, grown = length / state.previous.length, depth - state.previous.depth
        worn_before = depth + w**2 / (1.0 + 2.0 * w) * grown
        implicit_cycles = (1.0 + w) / (1.0 + 2.0 * w) * length
    gain = setup.gain(implicit_cycles)
    balance = Balance(setup.joint_of(state), state.point.history, worn_before, gain, setup.wearing)
    start, balance = first_guess(setup, state, balance, length)
    end = setup.solve(balance, start, state)
    if end is None:
        return None
    error = 0.5 * length * (setup.rate(end.at) - rate)
    if w > 0.0:
        explicit_depth = depth + (1.0 + w) * length * rate - w**2 * grown
        own, other = (1.0 + w) ** 2 / (6.0 * w * (1.0 + 2.0 * w)), (1.0 + 1.0 / w) / 6.0
        error = own / (own + other) * (end.depth - explicit_depth)
    last = LastStep(length, depth, state.at.predicted_h, state.omega, state.resolution)
    end = setup.with_rates(replace(end, cycle=state.cycle + length, previous=last))
    return Step(end, float(np.abs(error) @ setup.area))


def first_guess(setup: WearingJoint, state: WearState, balance: Balance, length: float) -> tuple[FloatArray, Balance]:
    """First predicted force of a step (n_rel, 2H+1), N, and the balance with its first frequency and its history:
    extrapolated from the last step, or those of the state where this residual is lower.
    """
    now, last = state.at.predicted_h, state.previous
    if last is None or last.resolution != state.resolution:
        return now, balance
    further, there = length / last.length, balance
    ahead = now + further * (now - last.predicted_h)
    if setup.follow is not None:
        omega = state.omega + further * (state.omega - last.omega)
        there = replace(balance, joint=setup.case_and_joint(state)[0].joint(omega, setup.excitation_amplitude))
    found = there.evaluate(ahead)
    if found.scaled_residual() > balance.evaluate(now).scaled_residual():
        return now, balance
    return ahead, replace(there, history=history_along(there.joint, state, found))


def history_along(joint: Joint, state: WearState, ahead: Marched) -> FloatArray:
    """Tangential history (n_contact, 2), m, for the balance at the end of a step; ahead: this end, extrapolated."""
    before = state.at
    # a pair that sticks with one history at both ends sticks everywhere between: its force lies on a straight line
    sticks = (before.status_t == STICK).all(axis=1) & (ahead.status_t == STICK).all(axis=1) & (ahead.periods == 1)
    parts = np.linspace(0.0, 1.0, PARTS_OF_STEP + 1)[1:-1]
    return joint.law.history_along(state.point.history, ~sticks, before.predicted_t, ahead.predicted_t, parts)


def is_smooth(state: WearState, step: Step) -> bool:
    """Whether the vibration changes so little over a step that the branch does not end within the step."""
    return vibration_change(state.at, step.state.at) < SMOOTH_CHANGE


def allowed_error(share: float, before: float, after: float, count: float, length: float) -> float:
    """Allowed error of an adaptive step, m3: a share of its wear, or of its wear at the mean rate so far if more.

    before, after: worn volumes, m3. count, length: cycles or missions at its start, and of the step.
    """
    return max(share * max(after - before, after * length / (count + length)), 1e-300)

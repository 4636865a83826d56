"""One step on the slow time scale: explicit or implicit Euler, or BDF2 with steps of any length.

- explicit, Eqs. (20), (23): W_(n+1) = W_n + h g(W_n);
- implicit, Eqs. (24) to (26): W_(n+1) = W_n + h g(W_(n+1));
- adaptive: backward differences of second order (BDF2). With w = h_n / h_(n-1), the ratio of two steps,

    W_(n+1) = W_n + w^2 / (1 + 2 w) (W_n - W_(n-1)) + (1 + w) / (1 + 2 w) h_n g(W_(n+1)),

  which is an implicit Euler step from a depth that is already worn and with a shorter h, so that a step costs one
  balance like any other. It is L-stable for equal steps and zero-stable as long as w < 1 + sqrt(2); both factors are
  positive, so that wear never falls. The local error follows from the difference to an explicit formula of the same
  order (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, III.5; Gresho, Lee, Sani 1980):

    P = W_n + (1 + w) h_n g_n - w^2 (W_n - W_(n-1)),      e = c / (c + c_P) (W_(n+1) - P),
    c = (1 + w)^2 / (6 w (1 + 2 w)),      c_P = (1 + 1 / w) / 6.

  The first step, and the first step behind a jump, is an implicit Euler step. The error of an Euler step is its
  difference to the trapezoidal rule.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.accuracy.error_estimate import euler_error
from solver.continuation.natural import follow_naturally
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import BalanceAt, State, final_history
from solver.model import FloatArray
from solver.newton.iteration import SHORTEST_STEP
from solver.settings import Scheme
from solver.structure.joint import Joint
from solver.wear.options import WEAR
from solver.wear.state import Reached, WearState
from solver.wear.wearing_joint import WearingJoint


@dataclass(frozen=True)
class Step:
    """Result of a step.

    state: at the end of the step, or the last one before the end of the branch of the vibration.
    error (n_contact,): estimated local error of the depth with its sign, m.
    length: length of the attempted step, cycles.
    arrived: False where the branch ends within the step.
    end_known_to: accuracy of the end of the branch, cycles.
    """

    state: WearState
    error: FloatArray
    length: float
    arrived: bool = True
    end_known_to: float = 0.0

    def volume_error(self, area: FloatArray) -> float:
        """Estimated local error, as worn volume, m3; area (n_contact,): m2."""
        return float(np.abs(self.error) @ area)


def held_wear(joint: Joint, before: FloatArray, after: FloatArray) -> BalanceAt:
    """Balance at given depths (n_contact,), m, linear from `before` to `after` over a fraction from 0 to 1."""

    def balance_at(fraction: float, history: FloatArray) -> Balance:
        return Balance(joint, history, before + fraction * (after - before))

    return balance_at


def attempt_step(work: WearingJoint, state: WearState, length: float, scheme: Scheme) -> Step | None:
    """A step of `length` cycles by one balance; None where its end is not found."""
    depth, rate = state.depth, work.rate(state.point.evaluation)
    base, factor, grown, ratio = depth, 1.0, np.zeros_like(depth), 0.0
    second_order = scheme == "adaptive" and state.previous is not None
    if second_order and state.previous is not None:
        ratio = length / state.previous[0]
        grown = depth - state.previous[1]
        base = depth + ratio**2 / (1.0 + 2.0 * ratio) * grown
        factor = (1.0 + ratio) / (1.0 + 2.0 * ratio)
    if scheme == "explicit":
        balance = Balance(work.at(state), state.point.history, depth + length * rate)
    else:
        balance = Balance(work.at(state), state.point.history, base, work.gain(factor * length), work.wearing)
    end = work.solved(state, *work.predicted(state, balance, length))
    if end is None:
        return None
    new = end.point.evaluation
    error = euler_error(length, work.rate(new) - rate)
    if second_order:
        explicit = depth + (1.0 + ratio) * length * rate - ratio**2 * grown
        own, other = (1.0 + ratio) ** 2 / (6.0 * ratio * (1.0 + 2.0 * ratio)), (1.0 + 1.0 / ratio) / 6.0
        error = own / (own + other) * (new.wear_depth - explicit)
    return Step(work.accepted(state, end, length), error, length)


def end_of_branch(work: WearingJoint, state: WearState, length: float, scheme: Scheme) -> Step:
    """The last stable state of an Euler step whose end `attempt_step` does not find, by shorter and shorter steps.

    The end of the branch is located with the accuracy `fold_resolution`. The step arrives where shorter steps do.
    """
    # accuracy of the end of a branch: a fraction of the count, or of the step in the first step
    resolution = WEAR.fold_resolution * (state.cycle if state.cycle > 0.0 else length) / length
    shortest = min(resolution, SHORTEST_STEP)
    lost = Step(state, np.zeros_like(state.depth), length, arrived=False, end_known_to=shortest * length)
    if work.follow is not None:
        # at the frequency that is followed: halved until its end is found
        fraction = 0.5
        while fraction >= shortest and not work.run.budget.exhausted:
            step = attempt_step(work, state, fraction * length, "explicit" if scheme == "explicit" else "implicit")
            if step is not None:
                return step
            fraction *= 0.5
        return lost
    joint, base = work.at(state), replace(state.point, parameter=0.0)
    rate, gain = work.rate(base.evaluation), work.gain(length)
    balance_at = held_wear(joint, state.depth, state.depth + length * rate)
    if scheme != "explicit":

        def balance_at(fraction: float, history: FloatArray) -> Balance:
            return Balance(joint, history, state.depth, fraction * gain, work.wearing)

    last, arrived = follow_naturally(balance_at, base, 1.0, work.run, keep_history=True, shortest=shortest)
    if not work.is_stable(state, last.evaluation):
        # the place of the loss of stability is not known: the jump begins at the start of the step
        return lost
    if last.parameter <= 0.0:
        return lost
    point = State(last.evaluation, final_history(balance_at(last.parameter, base.history), last.evaluation))
    ahead = last.parameter * length
    after = work.accepted(state, Reached(point, state.omega, state.lag, state.half_width), ahead)
    error = euler_error(ahead, work.rate(point.evaluation) - rate)
    return replace(lost, state=after, error=error, arrived=arrived)

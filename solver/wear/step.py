"""A step on the slow time scale as one balance: explicit or implicit Euler, or BDF2.

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

from dataclasses import replace

import numpy as np

from solver.contact.coulomb import STICK
from solver.contact.law import Marched
from solver.harmonic_balance.dlft import Balance
from solver.model import FloatArray
from solver.settings import Scheme
from solver.structure.joint import Joint
from solver.wear.wearing_joint import LastStep, WearingJoint, WearState

PARTS_OF_STEP = 32
"""Parts of a step in each of which the pairs slide at their friction limit. Dovetail, 16 pairs, 212.6 Hz, 1e5 cycles:
1.795, 1.813, 1.819, 1.819 mm3 with 1, 8, 32, 128 parts (`rtol` 2e-4: 1.823). A tenth of the time of a history."""


def attempt_step(setup: WearingJoint, state: WearState, length: float, scheme: Scheme) -> WearState | None:
    """The state after a step of `length` cycles by one balance; None where it is not found."""
    depth, rate = state.depth, setup.rate(state.at)
    worn_before, implicit_cycles = (depth + length * rate, 0.0) if scheme == "explicit" else (depth, length)
    w, grown = 0.0, np.zeros_like(depth)
    if scheme == "adaptive" and state.previous is not None:
        w, grown = length / state.previous.length, depth - state.previous.depth
        worn_before = depth + w**2 / (1.0 + 2.0 * w) * grown
        implicit_cycles = (1.0 + w) / (1.0 + 2.0 * w) * length
    gain = setup.gain(implicit_cycles)
    balance = Balance(setup.joint_of(state), state.point.history, worn_before, gain, setup.wearing)
    end = setup.solve(*first_guess(setup, state, balance, length), state)
    if end is None:
        return None
    error = 0.5 * length * (setup.rate(end.at) - rate)
    if w > 0.0:
        explicit_depth = depth + (1.0 + w) * length * rate - w**2 * grown
        own, other = (1.0 + w) ** 2 / (6.0 * w * (1.0 + 2.0 * w)), (1.0 + 1.0 / w) / 6.0
        error = own / (own + other) * (end.depth - explicit_depth)
    last = LastStep(length, depth, state.at.predicted_h, state.omega, state.resolution)
    volume = float(np.abs(error) @ setup.area)
    return setup.with_rates(replace(end, cycle=state.cycle + length, previous=last, error=volume))


def first_guess(setup: WearingJoint, state: WearState, balance: Balance, length: float) -> tuple[Balance, FloatArray]:
    """The balance of a step with its first frequency and its history, and the first predicted force (n_rel, 2H+1), N:
    extrapolated from the last step, or those of the state where this residual is lower.
    """
    now, last = state.at.predicted_h, state.previous
    if last is None or last.resolution != state.resolution:
        return balance, now
    further, there = length / last.length, balance
    ahead = now + further * (now - last.predicted_h)
    if setup.follow is not None:
        omega = state.omega + further * (state.omega - last.omega)
        there = replace(balance, joint=setup.case_and_joint(state)[0].joint(omega, setup.excitation_amplitude))
    found = there.evaluate(ahead)
    if found.scaled_residual() > balance.evaluate(now).scaled_residual():
        return balance, now
    return replace(there, history=history_along(there.joint, state, found)), ahead


def history_along(joint: Joint, state: WearState, ahead: Marched) -> FloatArray:
    """Tangential history (n_contact, 2), m, for the balance at the end of a step; ahead: this end, extrapolated."""
    before = state.at
    # a pair that sticks with one history at both ends sticks everywhere between: its force lies on a straight line
    sticks = (before.status_t == STICK).all(axis=1) & (ahead.status_t == STICK).all(axis=1) & (ahead.periods == 1)
    parts = np.linspace(0.0, 1.0, PARTS_OF_STEP + 1)[1:-1]
    return joint.law.history_along(state.point.history, ~sticks, before.predicted_t, ahead.predicted_t, parts)


def allowed_error(share: float, before: float, after: float, count: float, length: float) -> float:
    """Allowed error of an adaptive step, m3: a share of its wear, or of its wear at the mean rate so far if more.

    before, after: worn volumes, m3. count, length: cycles or missions at its start, and of the step.
    """
    return max(share * max(after - before, after * length / (count + length)), 1e-300)

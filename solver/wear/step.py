"""One step on the slow time scale: explicit or implicit Euler, or BDF2 with steps of any length, as one balance.

- explicit, Eqs. (20), (23): W_(n+1) = W_n + h g(W_n), a given depth;
- implicit, Eqs. (24) to (26): W_(n+1) = W_n + h g(W_(n+1));
- adaptive: backward differences of second order (BDF2). With w = h_n / h_(n-1), the ratio of two steps,

    W_(n+1) = W_n + w^2 / (1 + 2 w) (W_n - W_(n-1)) + (1 + w) / (1 + 2 w) h_n g(W_(n+1)),

  an implicit Euler step from a depth that is already worn and with a shorter h. It is L-stable for equal steps and
  zero-stable for w < 1 + sqrt(2); both factors are positive, so that wear never falls. The local error follows from the
  difference to an explicit formula of the same order (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations
  I, III.5; Gresho, Lee, Sani 1980):

    P = W_n + (1 + w) h_n g_n - w^2 (W_n - W_(n-1)),      e = c / (c + c_P) (W_(n+1) - P),
    c = (1 + w)^2 / (6 w (1 + 2 w)),      c_P = (1 + 1 / w) / 6.

  The first step, and the first step behind a jump, is an implicit Euler step. The error of an Euler step is its
  difference to the trapezoidal rule.

Friction on the slow time scale: the wear of other pairs changes the force of a pair, which slides a little in each
cycle at its friction limit, to a place that depends on the way. A balance alone takes one slide for the whole way, an
error of first order in the step that the local error does not show (dovetail, 16 pairs, 212.6 Hz, `rtol` 1e-2: 1.8 %
of the worn volume, with the way in parts 0.4 %). So the law is applied at parts of a straight line from the predicted
force towards the extrapolated one, at each until the period repeats. The last part is left to the balance: with the
whole line, pairs may keep the history of a way that the joint did not go (48 pairs, 211.5 Hz: 1.667 mm3, another
branch, for 2.284 mm3; 2.261 by time integration).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.contact.coulomb import STICK
from solver.contact.law import Marched
from solver.harmonic_balance.dlft import Balance
from solver.model import FloatArray
from solver.settings import Scheme
from solver.structure.joint import Joint
from solver.wear.state import WearState
from solver.wear.wearing_joint import WearingJoint

PARTS_OF_STEP = 32
"""Parts of a step in each of which the pairs slide at their friction limit. Dovetail, 16 pairs, 212.6 Hz, 1e5 cycles,
nine harmonics, `rtol` 1e-2: 1.795, 1.813, 1.819, 1.819, 1.822 mm3 with 1, 8, 32, 128, 512 parts (`rtol` 2e-4: 1.823).
32 parts take a tenth of the time of a history."""


@dataclass(frozen=True)
class Step:
    """A step: its end, and its estimated local error as worn volume, m3."""

    state: WearState
    error: float = 0.0


def attempt_step(work: WearingJoint, state: WearState, length: float, scheme: Scheme) -> Step | None:
    """A step of `length` cycles by one balance; None where its end is not found."""
    depth, rate, joint = state.depth, work.rate(state.point.evaluation), work.at(state)
    base, implicit = (depth + length * rate, 0.0) if scheme == "explicit" else (depth, length)
    w, grown = 0.0, np.zeros_like(depth)
    if scheme == "adaptive" and state.previous is not None:
        w, grown = length / state.previous.length, depth - state.previous.depth
        base = depth + w**2 / (1.0 + 2.0 * w) * grown
        implicit = (1.0 + w) / (1.0 + 2.0 * w) * length
    balance = Balance(joint, state.point.history, base, work.gain(implicit), work.wearing)
    start, balance = predicted(work, state, balance, length)
    end = work.where.solve(work.case, balance, start, state, work.run)
    if end is None:
        return None
    error = 0.5 * length * (work.rate(end.point.evaluation) - rate)
    if w > 0.0:
        explicit = depth + (1.0 + w) * length * rate - w**2 * grown
        own, other = (1.0 + w) ** 2 / (6.0 * w * (1.0 + 2.0 * w)), (1.0 + 1.0 / w) / 6.0
        error = own / (own + other) * (end.depth - explicit)
    return Step(work.accepted(state, end, length), float(np.abs(error) @ work.area))


def predicted(work: WearingJoint, state: WearState, balance: Balance, length: float) -> tuple[FloatArray, Balance]:
    """First predicted force of a step (n_rel, 2H+1), N, and the balance with its first frequency and its history.

    Extrapolated from the last step; those of the state where this residual is lower.
    """
    now, last = state.point.evaluation.predicted_h, state.previous
    if last is None or last.resolution != state.resolution:
        return now, balance
    further, there = length / last.length, balance
    ahead = now + further * (now - last.predicted_h)
    if work.where.follows:
        omega = state.omega + further * (state.omega - last.omega)
        there = replace(balance, joint=work.case.joint(omega, work.excitation_amplitude))
    found = there.evaluate(ahead)
    if found.scaled_residual() > balance.evaluate(now).scaled_residual():
        return now, balance
    return ahead, replace(there, history=history_along(there.joint, state, found))


def history_along(joint: Joint, state: WearState, ahead: Marched) -> FloatArray:
    """Tangential history (n_contact, 2), m, for the balance at the end of a step.

    state: at the start of the step. ahead: at its end, extrapolated, from the history that `state` leaves.
    """
    before = state.point.evaluation
    # a pair that sticks with one history at both ends sticks everywhere between: its force lies on a straight line
    sticks = (before.status_t == STICK).all(axis=1) & (ahead.status_t == STICK).all(axis=1) & (ahead.periods == 1)
    parts = np.linspace(0.0, 1.0, PARTS_OF_STEP + 1)[1:-1]
    return joint.law.history_along(state.point.history, ~sticks, before.predicted_t, ahead.predicted_t, parts)

"""Error-controlled steps on the slow time scale: backward differences of second order with steps of any length (BDF2).

With w = h_n / h_(n-1), the ratio of two steps, and the wear rate g = dW/dt of Eqs. (7), (21)

    W_(n+1) = W_n + w^2 / (1 + 2 w) (W_n - W_(n-1)) + (1 + w) / (1 + 2 w) h_n g(W_(n+1)),

which is an implicit Euler step from a depth that is already worn and with a shorter h, so that a step costs one balance
like any other, Eq. (24). It is L-stable for equal steps and zero-stable as long as w < 1 + sqrt(2); both factors are
positive, so that wear never falls. The local error follows from the difference to an explicit formula of the same order
(Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, III.5; Gresho, Lee, Sani 1980):

    P = W_n + (1 + w) h_n g_n - w^2 (W_n - W_(n-1)),      e = c / (c + c_P) (W_(n+1) - P),
    c = (1 + w)^2 / (6 w (1 + 2 w)),      c_P = (1 + 1 / w) / 6.

The first step, and the first step behind a jump, is an implicit Euler step. Its error is its difference to the
trapezoidal rule.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.accuracy.error_estimate import euler_error
from solver.harmonic_balance.dlft import Balance
from solver.model import FloatArray
from solver.wear.state import Reached, WearState
from solver.wear.wearing_joint import WearingJoint


@dataclass(frozen=True)
class Attempt:
    """A BDF2 step that was solved.

    end: end of the step.
    error (n_contact,): local error of the depth with its sign, m.
    """

    end: Reached
    error: FloatArray


def bdf2_attempt(work: WearingJoint, state: WearState, length: float) -> Attempt | None:
    """One BDF2 step of `length` cycles; None where its end is not found."""
    joint, depth, rate = work.at(state), state.depth, work.rate(state.point.evaluation)
    base, factor, grown, ratio = depth, 1.0, np.zeros_like(depth), 0.0
    if state.previous is not None:
        ratio = length / state.previous[0]
        grown = depth - state.previous[1]
        base = depth + ratio**2 / (1.0 + 2.0 * ratio) * grown
        factor = (1.0 + ratio) / (1.0 + 2.0 * ratio)
    balance = Balance(joint, state.point.history, base, work.gain(factor * length), work.wearing)
    end = work.solved(state, *work.predicted(state, balance, length))
    if end is None:
        return None
    new = end.point.evaluation
    if state.previous is None:
        error = euler_error(length, work.rate(new) - rate)
    else:
        explicit = depth + (1.0 + ratio) * length * rate - ratio**2 * grown
        own, other = (1.0 + ratio) ** 2 / (6.0 * ratio * (1.0 + 2.0 * ratio)), (1.0 + 1.0 / ratio) / 6.0
        error = own / (own + other) * (new.wear_depth - explicit)
    return Attempt(end, error)

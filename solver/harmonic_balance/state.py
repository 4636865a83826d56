"""A converged state with the tangential history that it leaves to the next state, or the reason why there is none."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.model import FloatArray
from solver.outcome import Outcome
from solver.packing import packable
from solver.structure.joint import Joint

BalanceAt = Callable[[float, FloatArray], Balance]
"""The balance at a value of a parameter for a tangential history (n_contact, 2), m."""


@packable
@dataclass(frozen=True)
class State:
    """A converged periodic state; the next one depends on it alone.

    evaluation: of the balance, with the worn depth.
    history (n_contact, 2): tangential history for the next state, m.
    parameter: of the path on which the state lies; NaN where there is none.
    """

    evaluation: Evaluation
    history: FloatArray
    parameter: float = math.nan


@packable
@dataclass(frozen=True)
class Failure:
    """Why there is no state, or why a history ends. message: addition to the outcome, for the user."""

    outcome: Outcome
    message: str = ""


def final_history(balance: Balance, evaluation: Evaluation) -> FloatArray:
    """Tangential history (n_contact, 2), m, for the next state.

    Elastic pairs: the corrected slip X_T at the end of the period. Inertial pairs: the mean position.
    """
    return balance.joint.law.final_history(evaluation, evaluation.displacement_h)


def history_at_rest(joint: Joint, state: State) -> FloatArray:
    """Tangential history (n_contact, 2), m, for a next state in which pairs that slip now may stick.

    When the range of slip of a pair shrinks to zero, the pair comes to stick in the middle of the range. So the history
    of a slipping pair is the middle of its slip in the closed samples. A pair that goes on slipping does not remember
    its history. Behind the resonance of the dovetail the motion after a sweep is 0.5 % wrong with the middle, and 2.3 %
    with `final_history`, for an equal number of states.
    """
    return joint.law.middle_history(state.evaluation, state.history)


def vibration_change(before: Evaluation, after: Evaluation) -> float:
    """Norm of the change of the vibrating part of the predicted force, over its norm in the state `before`."""
    return float(np.linalg.norm(after.predicted_h[:, 1:] - before.predicted_h[:, 1:])) / vibration_size(before)


def vibration_size(evaluation: Evaluation) -> float:
    """Norm of the vibrating part of the predicted force, N, above zero."""
    return max(float(np.linalg.norm(evaluation.predicted_h[:, 1:])), 1e-300)

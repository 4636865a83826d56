"""A converged state, and what it leaves behind for the next one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.model import FloatArray
from solver.packing import packable

BalanceAt = Callable[[float, FloatArray], Balance]
"""The balance at a value of a parameter, of pairs with a history (n_contact, 2), m."""


@packable
@dataclass(frozen=True)
class PathPoint:
    """A converged state at a value of the parameter; `history` (n_contact, 2), m: what the next state starts from."""

    parameter: float
    evaluation: Evaluation
    history: FloatArray


def final_history(balance: Balance, evaluation: Evaluation) -> FloatArray:
    """Tangential history (n_contact, 2), m, for the next state: the corrected slip X_T at the end of the period, the
    mean position of inertial pairs.
    """
    joint = balance.joint
    at_end = evaluation.state_t[:, :, -1] / joint.state_stiffness[:, None]
    return np.where(joint.penalty.inertial[:, None], evaluation.displacement_h[:, 1:, 0], at_end)


def vibration_change(before: Evaluation, after: Evaluation) -> float:
    """Change of the vibrating part of the predicted force over its size, of two states."""
    change = float(np.linalg.norm(after.predicted_h[:, 1:] - before.predicted_h[:, 1:]))
    return change / max(float(np.linalg.norm(before.predicted_h[:, 1:])), 1e-300)

"""Masses on sliders brought to rest: their mean position has to repeat from one period to the next.

A stiffness next to nothing holds the mean position of a marched mass (`penalty.mean`), and drag its mean velocity.
Where the vibration lets such a mass slip on to another mean position than that of its history, the march goes on by

    2 pi / omega (p_0 - lambda_0) / c = 2 pi / omega penalty.mean (u_0 - history) / c

a period while the series stay where they are. That is no periodic motion: its slip is counted as wear, its work is not
in the balance of energy, and where little slips both are little else than this. The joint itself has left the way
behind: with the mean position reached as the new history the creep is a fraction of what it was. In the end the mass
goes to and fro, or sticks, as one does that vibration has shaken down.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.continuation.natural import follow_naturally
from solver.harmonic_balance.converged import PathPoint, final_history
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.model import FloatArray
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Effort
from solver.structure.joint import Joint

MOST_RESTS = 30  # each takes away about two thirds of the creep or more, as measured, in one to six iterations


def creep_work(joint: Joint, evaluation: Evaluation) -> float:
    """Normal force times creep over a period, N m: the part of the slip work that no periodic motion has."""
    on = joint.penalty.inertial
    moved_on = evaluation.state_t[on, :, -1] - evaluation.state_t[on, :, 0]
    return float(np.abs(evaluation.force_h[on, 0, 0]) @ np.hypot(moved_on[:, 0], moved_on[:, 1]))


def creeps(joint: Joint, evaluation: Evaluation, share: float) -> bool:
    """Whether creep takes more than a share of the slip work."""
    return creep_work(joint, evaluation) > share * float(evaluation.slip_work.sum())


def rest_masses(joint: Joint, point: PathPoint, share: float, tolerance: float, effort: Effort) -> PathPoint:
    """The state that a state goes over into while its masses creep to rest, at the same wear depth.

    share: of the slip work; less creep is left alone. Returns the last state found where they do not come to rest.
    """
    solver = JacobianSolver()
    worn = point.evaluation.wear_depth
    for _ in range(MOST_RESTS):
        if not creeps(joint, point.evaluation, share):
            break
        held = _Moving(joint, worn, point.evaluation.history, _way(joint, point))
        start = PathPoint(0.0, point.evaluation, point.evaluation.history)
        rested, arrived = follow_naturally(held.at, start, 1.0, solver, tolerance, effort, keep_history=True)
        if not arrived:
            break
        history = final_history(held.at(1.0, start.history), rested.evaluation)
        point = PathPoint(point.parameter, rested.evaluation, history)
    return point


def _way(joint: Joint, point: PathPoint) -> FloatArray:
    """From the mean positions that marched masses are held at to those they have reached (n_contact, 2), m."""
    way = point.evaluation.displacement_h[:, 1:, 0] - point.evaluation.history
    return np.where(joint.penalty.inertial[:, None], way, 0.0)


@dataclass(frozen=True)
class _Moving:
    """Balances on the way from one history to another, both (n_contact, 2), m."""

    joint: Joint
    wear_depth: FloatArray
    history: FloatArray
    way: FloatArray

    def at(self, share: float, _: FloatArray) -> Balance:
        """Balance at a share of the way."""
        moved = self.history + share * self.way
        return Balance.frozen(self.joint, moved, self.wear_depth)

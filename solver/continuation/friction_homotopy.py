"""A static state under much friction, reached from one under less.

Newton's method finds a joint that slips at once from nothing: where a pair slips its force is bound to the normal one.
With a friction coefficient of 2 and more most pairs stick, and which of them slip, and which way, is told by none of
the first iterations: they go round among sets of slipping pairs, or end in one of several states that there are then.
With less friction the joint has one state, found in a few iterations. From there the friction coefficient is raised in
steps of its logarithm: pairs stop slipping one by one, and the limit is the structure with its closed pairs glued.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.continuation.natural import follow_naturally
from solver.harmonic_balance.converged import PathPoint
from solver.harmonic_balance.dlft import Balance
from solver.model import FloatArray
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Effort, solve_balance

MODERATE = 1.0  # friction coefficient up to which one state was found for all joints and starts
LESS = 0.5  # of the friction coefficient tried before
MOST_ATTEMPTS = 5
COLD_ITERATIONS = 60


def solve_from_less_friction(
    balance: Balance, start: FloatArray, solver: JacobianSolver, tolerance: float, effort: Effort
) -> PathPoint | None:
    """State of a balance, by way of less friction where there is much or Newton's method fails; None where that ends.

    start (n_rel, m): N, predicted force to begin with. The history of the balance holds all the way: the states on it
    are no states of the joint. The parameter of the point is the friction coefficient.
    """
    target = balance.joint.friction_coefficient

    def balance_at(logarithm: float, _: FloatArray) -> Balance:
        friction = target if logarithm == 0.0 else target * float(np.exp(logarithm))
        return replace(balance, joint=replace(balance.joint, friction_coefficient=friction))

    friction = min(target, MODERATE)
    for _ in range(MOST_ATTEMPTS):
        logarithm = float(np.log(friction / target)) if friction < target else 0.0
        less = balance_at(logarithm, balance.history)
        result = solve_balance(less, start, solver, tolerance, effort, COLD_ITERATIONS)
        if result.converged:
            lower = PathPoint(logarithm, result.evaluation, balance.history)
            point, arrived = follow_naturally(balance_at, lower, 0.0, solver, tolerance, effort, keep_history=True)
            if arrived:
                return PathPoint(target, point.evaluation, point.history)
        friction *= LESS
    return None

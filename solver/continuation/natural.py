"""Natural continuation of a converged state along one parameter; `arc_length` continues where it fails.

The parameter may be the frequency, the excitation amplitude, a homotopy parameter or the fraction of a step on the slow
time scale; the caller supplies the balance at a value of it. The work is bounded by the
shortest step and the number of failures.
"""

from __future__ import annotations

import numpy as np

from solver.contact.coulomb import STICK
from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.converged import BalanceAt, PathPoint, final_history, vibration_change
from solver.harmonic_balance.dlft import Evaluation
from solver.newton.linear_solver import JacobianSolver
from solver.newton.options import NEWTON
from solver.newton.solve_balance import Budget, solve_balance


def follow_naturally(
    balance_at: BalanceAt,
    start: PathPoint,
    target: float,
    solver: JacobianSolver,
    tolerance: float,
    budget: Budget,
    keep_history: bool = False,
    fine: float = np.inf,
    shortest: float | None = None,
) -> tuple[PathPoint, bool]:
    """Step the parameter to the target; steps are halved where Newton's method needs many iterations.

    The first Newton iteration from the last state is the tangent predictor (for wear: Eq. (19)), so no other is needed.

    Parameters
    ----------
    balance_at : callable
        Balance at a value of the parameter, of pairs with a history (n_contact, 2), m.
    start : PathPoint
        State to begin with.
    target : float
        Value of the parameter.
    solver, tolerance, budget
        As in `solve_balance`.
    keep_history : bool
        The history stays that of the start: the intermediate states are no states of the joint.
    fine : float
        Length, in the unit of the parameter, above which a step is accepted only if the vibration changes little over
        it: where each step leaves a history to the next, the state at the target depends on the steps.
    shortest : float, optional
        Fraction of the range down to which steps are halved, `CONTINUATION.shortest_fraction` by default; a quarter of
        `fine` if that is shorter.

    Returns
    -------
    point : PathPoint
        Last state.
    arrived : bool
        Whether it is at the target.
    """
    point = start
    whole = target - start.parameter
    shortest = CONTINUATION.shortest_fraction if shortest is None else shortest
    if np.isfinite(fine) and whole != 0.0:
        shortest = min(shortest, 0.25 * fine / abs(whole))
    fraction, failures = 1.0, 0
    while point.parameter != target:
        reach = point.parameter + fraction * whole
        if (target - reach) * whole <= CONTINUATION.target_round_off * whole * whole:
            reach = target
        balance = balance_at(reach, point.history)
        most = NEWTON.iterations if fraction <= 2.0 * shortest else CONTINUATION.near_iterations
        result = solve_balance(balance, point.evaluation.predicted_h, solver, tolerance, budget, most)
        smooth = abs(reach - point.parameter) <= fine or _is_smooth(point.evaluation, result.evaluation)
        if result.converged and smooth:
            history = point.history if keep_history else final_history(balance, result.evaluation)
            point = PathPoint(reach, result.evaluation, history)
            fraction = min(2.0 * fraction, 1.0)
        else:
            fraction *= 0.5
            failures += not result.converged
            if fraction < shortest or failures > CONTINUATION.natural_failures or budget.exhausted:
                return point, False
    return point, True


def _is_smooth(before: Evaluation, after: Evaluation) -> bool:
    """Whether two states differ so little that no step between them is needed."""
    linear = bool((before.status_t == STICK).all() and (after.status_t == STICK).all())
    return vibration_change(before, after) <= (CONTINUATION.linear_change if linear else CONTINUATION.smooth_change)

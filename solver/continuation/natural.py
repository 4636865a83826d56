"""A converged state followed along one parameter in natural steps; `arc_length` goes on where they fail.

The parameter may be the frequency, the excitation amplitude or the share of a slow step; the caller says which balance
belongs to a value of it. The work is bounded: `MOST_STEPS` steps, `MOST_FAILURES` of which may fail.
"""

from __future__ import annotations

import numpy as np

from solver.contact.coulomb import STICK
from solver.harmonic_balance.converged import BalanceAt, PathPoint, final_history, vibration_change
from solver.harmonic_balance.dlft import Evaluation
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Effort, solve_balance

EASY = 10  # Newton iterations of a step that is not divided
SMALLEST_SHARE = 1.0 / 64.0  # of the way to a target: below it the branch is taken to fold
CALM = 0.2  # relative change of the vibration over a step that need not be divided
LINEAR_CALM = 1.0  # the same where nothing slips or opens at both ends: less than the turn of phase at a resonance
MOST_STEPS = 600
MOST_FAILURES = 25  # steps that did not converge: a branch with many corners is left to arc length


def follow_naturally(
    balance_at: BalanceAt,
    start: PathPoint,
    target: float,
    solver: JacobianSolver,
    tolerance: float,
    effort: Effort,
    keep_history: bool = False,
    fine: float = np.inf,
    shortest: float = SMALLEST_SHARE,
) -> tuple[PathPoint, bool]:
    """Step the parameter to the target, the step halved where Newton labours; the last point and whether it got there.

    Where steps leave a history behind, what is found depends on them: a step longer than `fine` is taken only where the
    vibration changes little over it. The first Newton iteration from the last state is the tangent predictor (for wear:
    Eq. (19)), so no other is needed. With `keep_history` the history stays that of the start: the intermediate states
    are no states of the joint. shortest: share of the way down to which steps are halved; with a finite `fine` it is a
    quarter of that if this is shorter.
    """
    point = start
    whole = target - start.parameter
    if np.isfinite(fine) and whole != 0.0:
        shortest = min(shortest, 0.25 * fine / abs(whole))
    share, failures = 1.0, 0
    for _ in range(MOST_STEPS):
        if point.parameter == target:
            break
        reach = point.parameter + share * whole
        if (target - reach) * whole <= 1e-9 * whole * whole:
            reach = target
        balance = balance_at(reach, point.history)
        most = 30 if share <= 2.0 * shortest else EASY
        result = solve_balance(balance, point.evaluation.predicted_h, solver, tolerance, effort, most)
        calm = abs(reach - point.parameter) <= fine or _is_calm(point.evaluation, result.evaluation)
        if result.converged and calm:
            history = point.history if keep_history else final_history(balance, result.evaluation)
            point = PathPoint(reach, result.evaluation, history)
            share = min(2.0 * share, 1.0)
        else:
            share *= 0.5
            failures += not result.converged
            if share < shortest or failures > MOST_FAILURES or effort.exhausted:
                return point, False
    return point, point.parameter == target


def _is_calm(before: Evaluation, after: Evaluation) -> bool:
    """Whether so little happens between two states that no step between them is needed."""
    linear = bool((before.status_t == STICK).all() and (after.status_t == STICK).all())
    return vibration_change(before, after) <= (LINEAR_CALM if linear else CALM)

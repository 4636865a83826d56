"""A converged state followed along one parameter in natural steps; `arc` goes on where they fail.

The parameter may be the frequency, the excitation amplitude or the share of a slow step; the caller says which balance
belongs to a value of it. The work is bounded: `MOST_STEPS` steps, `MOST_FAILURES` of which may fail.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from solver.balance import Balance, Evaluation
from solver.clock import computing_time
from solver.kernels import STICK
from solver.linear import JacobianSolver
from solver.model import FloatArray
from solver.newton import NewtonResult, solve_newton

BalanceAt = Callable[[float, FloatArray], Balance]

EASY = 10  # Newton iterations of a step that is not divided
SMALLEST_SHARE = 1.0 / 64.0  # of the way to a target: below it the branch is taken to fold
CALM = 0.2  # relative change of the vibration over a step that need not be divided
LINEAR_CALM = 1.0  # the same where nothing slips or opens at both ends: less than the turn of phase at a resonance
MOST_STEPS = 600
MOST_FAILURES = 25  # steps that did not converge: a branch with many corners is left to arc length


@dataclass(frozen=True)
class PathPoint:
    """A converged state at a value of the parameter; `history` (n_contact, 2), m: what the next state starts from."""

    parameter: float
    evaluation: Evaluation
    history: FloatArray


@dataclass
class Effort:
    """Newton iterations spent; shared by the parts of one computation. limit: after which a branch is given up.
    deadline: CPU time of the thread, s, after which the whole computation is.
    """

    iterations: int = 0
    limit: float = np.inf
    deadline: float = np.inf

    @property
    def exhausted(self) -> bool:
        """Whether no more steps are to be begun."""
        return self.iterations > self.limit

    def check_time(self) -> None:
        """Raises OutOfTimeError behind the deadline."""
        if self.deadline < np.inf and computing_time() > self.deadline:
            raise OutOfTimeError


class OutOfTimeError(Exception):
    """A computation has taken the CPU time that it may take; those who began it say so in an outcome."""


def final_history(balance: Balance, evaluation: Evaluation) -> FloatArray:
    """Tangential history (n_contact, 2), m, for the next state: the corrected slip X_T at the end of the period, the
    mean position of inertial pairs.
    """
    joint = balance.joint
    at_end = evaluation.state_t[:, :, -1] / joint.state_stiffness[:, None]
    return np.where(joint.penalty.inertial[:, None], evaluation.displacement_h[:, 1:, 0], at_end)


def solve_balance(
    balance: Balance, start: FloatArray, solver: JacobianSolver, tolerance: float, effort: Effort, most: int = 30
) -> NewtonResult[Evaluation]:
    """Newton on one balance from a predicted force (n_rel, 2H+1), N. Raises OutOfTimeError."""

    def direction(at: Evaluation) -> FloatArray:
        effort.check_time()
        return solver.solve(balance.linearise(at), -at.residual)

    result = solve_newton(
        balance.evaluate,
        direction,
        start,
        tolerance,
        most,
    )
    effort.iterations += result.iterations
    return result


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


def vibration_change(before: Evaluation, after: Evaluation) -> float:
    """Change of the vibrating part of the predicted force over its size, of two states."""
    change = float(np.linalg.norm(after.predicted_h[:, 1:] - before.predicted_h[:, 1:]))
    return change / max(float(np.linalg.norm(before.predicted_h[:, 1:])), 1e-300)


def _is_calm(before: Evaluation, after: Evaluation) -> bool:
    """Whether so little happens between two states that no step between them is needed."""
    linear = bool((before.status_t == STICK).all() and (after.status_t == STICK).all())
    return vibration_change(before, after) <= (LINEAR_CALM if linear else CALM)

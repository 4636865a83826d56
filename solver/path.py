"""A converged state followed along one parameter: natural steps where they serve, arc length through folds.

The parameter may be the frequency, the excitation amplitude or the share of a slow step; the caller says which balance
belongs to a value of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from solver.balance import Balance, Evaluation
from solver.linear import JacobianSolver
from solver.model import FloatArray
from solver.newton import NewtonResult, solve_newton

BalanceAt = Callable[[float, FloatArray], Balance]

EASY = 10  # Newton iterations of a step that is not divided
SMALLEST_SHARE = 1.0 / 64.0  # of the way to a target: below it the branch is taken to fold
CALM = 0.2  # relative change of the vibration over a step that need not be divided
ARC_STEPS = 400
FARTHEST_BACK = 10.0  # natural lengths of the parameter
ARC_ITERATIONS = 8


@dataclass(frozen=True)
class PathPoint:
    """A converged state at a value of the parameter; `history` (n_contact, 2), m: what the next state starts from."""

    parameter: float
    evaluation: Evaluation
    history: FloatArray


@dataclass
class Effort:
    """Newton iterations spent; shared by the parts of one computation."""

    iterations: int = 0


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
    """Newton on one balance from a predicted force (n_rel, 2H+1), N."""
    result = solve_newton(
        balance.evaluate,
        lambda at: solver.solve(balance.linearise(at), -at.residual),
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
) -> tuple[PathPoint, bool]:
    """Step the parameter to the target, the step halved where Newton labours; the last point and whether it got there.

    Where steps leave a history behind, what is found depends on them: a step longer than `fine` is taken only where the
    vibration changes little over it. The first Newton iteration from the last state is the tangent predictor (for wear:
    Eq. (19)), so no other is needed. With `keep_history` the history stays that of the start: the intermediate states
    are no states of the joint.
    """
    point = start
    whole = target - start.parameter
    share = 1.0
    while point.parameter != target:
        reach = point.parameter + share * whole
        if (target - reach) * whole <= 1e-9 * whole * whole:
            reach = target
        balance = balance_at(reach, point.history)
        most = 30 if share <= 2.0 * SMALLEST_SHARE else EASY
        result = solve_balance(balance, point.evaluation.predicted_h, solver, tolerance, effort, most)
        calm = abs(reach - point.parameter) <= fine or _change(point.evaluation, result.evaluation) <= CALM
        if result.converged and calm:
            history = point.history if keep_history else final_history(balance, result.evaluation)
            point = PathPoint(reach, result.evaluation, history)
            share = min(2.0 * share, 1.0)
        else:
            share *= 0.5
            if share < SMALLEST_SHARE and (not result.converged or share * abs(whole) < 0.25 * fine):
                return point, False
    return point, True


def _change(before: Evaluation, after: Evaluation) -> float:
    """Change of the vibrating part of the predicted force over its size, of two states."""
    change = float(np.linalg.norm(after.predicted_h[:, 1:] - before.predicted_h[:, 1:]))
    return change / max(float(np.linalg.norm(before.predicted_h[:, 1:])), 1e-300)


def follow_arc(
    balance_at: BalanceAt,
    start: PathPoint,
    target: float,
    span: float,
    tolerance: float,
    effort: Effort,
) -> PathPoint | None:
    """Follow the branch by arc length, through folds, until it reaches the target; None where it does not.

    span: natural length of the parameter. The history is held at that of the start. The search ends, too, where the
    branch has gone back too far.
    """
    arc = _Arc(balance_at, start.history, max(float(np.linalg.norm(start.evaluation.predicted_h)), 1e-300), span)
    toward = float(np.sign(target - start.parameter))
    point = start
    direction = np.zeros(start.evaluation.predicted_h.size + 1)
    direction[-1] = toward
    length = 0.02
    for _ in range(ARC_STEPS):
        tangent = arc.tangent(point.parameter, point.evaluation)
        if tangent is None:
            return None
        tangent = tangent * (np.sign(tangent @ direction) or 1.0)
        reached = None
        while reached is None and length > 1e-4:
            reached = arc.step(point, tangent, length, tolerance, effort)
            length *= 1.6 if reached is not None else 0.5
        reached = reached or arc.step_over_kink(point, tangent, tolerance, effort)
        if reached is None:
            return None
        length = min(max(length, 1e-3), 0.2)
        if (reached.parameter - target) * toward >= 0.0:
            landed = solve_balance(
                balance_at(target, start.history), reached.evaluation.predicted_h, JacobianSolver(), tolerance, effort
            )
            return PathPoint(target, landed.evaluation, start.history) if landed.converged else None
        if (start.parameter - reached.parameter) * toward > FARTHEST_BACK * abs(span):
            return None
        direction = arc.place(reached.parameter, reached.evaluation) - arc.place(point.parameter, point.evaluation)
        point = reached
    return None


@dataclass(frozen=True)
class _Arc:
    """Arc-length steps in the scaled unknowns (p / size, parameter / span); the history is held."""

    balance_at: BalanceAt
    history: FloatArray
    size: float
    span: float

    def place(self, parameter: float, evaluation: Evaluation) -> FloatArray:
        """Scaled unknowns of a point."""
        return np.append(evaluation.predicted_h.ravel() / self.size, parameter / self.span)

    def bordered(self, balance: Balance, parameter: float, evaluation: Evaluation, last_row: FloatArray) -> FloatArray:
        """Jacobian of the residual over `size` and the scaled unknowns, bordered by `last_row`.

        The column of the parameter is a difference: it only steers the corrector, whose residual is exact.
        """
        jacobian = balance.linearise(evaluation).dense(np.arange(balance.joint.contact.n_contact))
        delta = 1e-7 * self.span
        ahead = self.balance_at(parameter + delta, self.history).evaluate(evaluation.predicted_h)
        n = jacobian.shape[0]
        matrix = np.empty((n + 1, n + 1))
        matrix[:n, :n] = jacobian
        matrix[:n, n] = (ahead.residual - evaluation.residual).ravel() / delta * (self.span / self.size)
        matrix[n] = last_row
        return matrix

    def tangent(self, parameter: float, evaluation: Evaluation) -> FloatArray | None:
        """Unit tangent of the branch, of either sign; None where it is not defined."""
        n = evaluation.predicted_h.size
        row = np.append(np.full(n, 1e-3 / np.sqrt(n)), 1.0)
        try:
            matrix = self.bordered(self.balance_at(parameter, self.history), parameter, evaluation, row)
            tangent = np.linalg.solve(matrix, np.append(np.zeros(n), 1.0))
        except np.linalg.LinAlgError:
            return None
        return tangent / np.linalg.norm(tangent) if np.all(np.isfinite(tangent)) else None

    def step(
        self, point: PathPoint, tangent: FloatArray, length: float, tolerance: float, effort: Effort
    ) -> PathPoint | None:
        """Point of the branch at the given length along the tangent; None where the corrector does not converge."""
        shape = point.evaluation.predicted_h.shape
        base = self.place(point.parameter, point.evaluation)
        unknown = base + length * tangent
        for _ in range(ARC_ITERATIONS):
            parameter = float(unknown[-1] * self.span)
            balance = self.balance_at(parameter, self.history)
            evaluation = balance.evaluate(unknown[:-1].reshape(shape) * self.size)
            ahead = float(tangent @ (unknown - base)) - length
            norm = evaluation.scaled_residual()
            if norm <= tolerance and abs(ahead) < 1e-3 * length:
                return PathPoint(parameter, evaluation, self.history)
            if not np.isfinite(norm) or np.linalg.norm(unknown - base) > 4.0 * length:
                return None
            matrix = self.bordered(balance, parameter, evaluation, tangent)
            try:
                unknown = unknown - np.linalg.solve(matrix, np.append(evaluation.residual.ravel() / self.size, ahead))
            except np.linalg.LinAlgError:
                return None
            effort.iterations += 1
        return None

    def step_over_kink(
        self, point: PathPoint, tangent: FloatArray, tolerance: float, effort: Effort
    ) -> PathPoint | None:
        """Point behind a corner of the branch, where a contact sample changes its state and the branch may turn back.

        The plane across the old tangent need not meet the branch behind the corner. The tangent of the piece behind it
        is taken a little ahead of the point, and both of its signs are tried; a solution back on the old piece is
        refused.
        """
        shape = point.evaluation.predicted_h.shape
        base = self.place(point.parameter, point.evaluation)
        for length in (1e-2, 1e-3, 1e-4):
            ahead = base + length * tangent
            parameter = float(ahead[-1] * self.span)
            behind = self.balance_at(parameter, self.history).evaluate(ahead[:-1].reshape(shape) * self.size)
            turned = self.tangent(parameter, behind)
            if turned is None:
                continue
            for sign in (np.sign(turned @ tangent) or 1.0, -np.sign(turned @ tangent) or -1.0):
                reached = self.step(point, sign * turned, length, tolerance, effort)
                if reached is None:
                    continue
                way = self.place(reached.parameter, reached.evaluation) - base
                if way @ tangent > -0.99 * np.linalg.norm(way):
                    return reached
        return None

"""A branch followed by arc length through its folds, until a stable state at the target is reached.

Each step solves the bordered system by block elimination with the solver of the plain Jacobian: two right sides, one
kept factorisation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from solver.harmonic_balance.converged import BalanceAt, PathPoint, vibration_change
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.model import FloatArray
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Effort, solve_balance

ARC_STEPS = 250
ARC_FAILURES = 80  # correctors that did not converge, in all
FARTHEST = 10.0  # natural lengths of the parameter from the start or behind the target
ARC_ITERATIONS = 8
LONGEST = 0.2  # scaled length of a step
JUMP = 0.2  # relative change of the vibration at a fold that is more than a corner of the branch
REFINEMENTS = 3  # points added around a fold


@dataclass(frozen=True)
class ArcResult:
    """point: state at the target, None where it was not reached. folds: values of the parameter where it turned.

    jumps: those of the folds that a slow change of the parameter jumps at: where the arc has come back to their value,
    the vibration is another one.
    """

    point: PathPoint | None
    folds: tuple[float, ...]
    jumps: tuple[float, ...]


def follow_arc(
    balance_at: BalanceAt,
    start: PathPoint,
    target: float,
    span: float,
    solver: JacobianSolver,
    tolerance: float,
    effort: Effort,
    accept: Callable[[PathPoint], bool] = lambda _: True,
    toward: float = 0.0,
) -> ArcResult:
    """Follow the branch by arc length, through folds, until it crosses the target in a state that is accepted.

    span: natural length of the parameter. The history is held at that of the start. The search ends, too, where the
    branch has gone `FARTHEST` from start and target, and after `ARC_STEPS` steps. toward: sign of the parameter's first
    step where that is not towards the target; the target may then be the start.
    """
    toward = toward or float(np.sign(target - start.parameter)) or 1.0
    arc = _Arc(
        balance_at, start.history, solver, max(float(np.linalg.norm(start.evaluation.predicted_h)), 1e-300), span
    )
    path = [arc.place(start.parameter, start.evaluation)]
    points = [start]
    direction = np.zeros(path[0].size)
    direction[-1] = toward
    folds: list[float] = []
    turns: list[int] = []
    length, failures = 0.02, 0
    low = min(start.parameter, target) - FARTHEST * abs(span)
    high = max(start.parameter, target) + FARTHEST * abs(span)
    for _ in range(ARC_STEPS):
        if effort.exhausted:
            break
        point = points[-1]
        tangent = arc.tangent(point.parameter, point.evaluation)
        if tangent is None:
            break
        tangent = tangent * (np.sign(tangent @ direction) or 1.0)
        reached = None
        while reached is None and length > 1e-4 and failures < ARC_FAILURES:
            reached = arc.step(point, tangent, length, tolerance, effort)
            failures += reached is None
            length *= 1.6 if reached is not None else 0.5
        if reached is None and failures < ARC_FAILURES:
            reached = arc.step_over_kink(point, tangent, tolerance, effort)
        if reached is None:
            break
        if len(points) == 1 and (reached.parameter - point.parameter) * toward < 0.0:
            # the start lies so near to a fold that the first step goes round it
            if length > 4e-4 and failures < ARC_FAILURES:
                length *= 0.25
                failures += 1
                continue
            folds.append(point.parameter)
            turns.append(0)
        length = min(max(length, 1e-3), LONGEST)
        points.append(reached)
        path.append(arc.place(reached.parameter, reached.evaluation))
        if len(points) > 2 and (path[-1][-1] - path[-2][-1]) * (path[-2][-1] - path[-3][-1]) < 0.0:
            folds.append(arc.fold(points[-3:], tolerance, effort))
            turns.append(len(points) - 2)
        if (reached.parameter - target) * (point.parameter - target) <= 0.0 and point.parameter != target:
            landed = arc.land(point, reached, target, tolerance, effort)
            if landed is not None and accept(landed):
                return ArcResult(landed, tuple(folds), _jumps(folds, turns, [*points, landed], toward))
        if not low <= reached.parameter <= high:
            break
        direction = path[-1] - path[-2]
    return ArcResult(None, tuple(folds), ())


def _jumps(folds: list[float], turns: list[int], points: list[PathPoint], toward: float) -> tuple[float, ...]:
    """Folds at which the branch turns back and comes again as another one; turns: the places of the folds."""
    jumps: list[float] = []
    free = 0  # folds on the way round another one are none of their own
    for fold, turn in zip(folds, turns, strict=True):
        if turn < free:
            continue
        beyond = [place for place in range(turn + 1, len(points)) if (points[place].parameter - fold) * toward > 0.0]
        again = beyond[0] if beyond else len(points) - 1
        one, other = points[turn].evaluation, points[again].evaluation
        if max(vibration_change(one, other), vibration_change(other, one)) > JUMP:
            jumps.append(fold)
        free = again
    return tuple(jumps)


@dataclass
class _Arc:
    """Arc-length steps in the scaled unknowns (p / size, parameter / span); the history is held."""

    balance_at: BalanceAt
    history: FloatArray
    solver: JacobianSolver
    size: float
    span: float

    def place(self, parameter: float, evaluation: Evaluation) -> FloatArray:
        """Scaled unknowns of a point."""
        return np.append(evaluation.predicted_h.ravel() / self.size, parameter / self.span)

    def slope(self, parameter: float, evaluation: Evaluation) -> FloatArray:
        """Derivative (n_rel, m) of the residual to parameter / span.

        A difference: it only steers the corrector, whose residual is exact.
        """
        ahead = self.balance_at(parameter + 1e-7 * self.span, self.history).evaluate(evaluation.predicted_h)
        return (ahead.residual - evaluation.residual) / 1e-7

    def tangent(self, parameter: float, evaluation: Evaluation) -> FloatArray | None:
        """Unit tangent of the branch, of either sign; None where it is not defined."""
        balance = self.balance_at(parameter, self.history)
        step = self.solver.solve(balance.linearise(evaluation), -self.slope(parameter, evaluation)) / self.size
        tangent = np.append(step.ravel(), 1.0)
        largest = float(np.abs(tangent).max())
        if not np.isfinite(largest):
            return None
        # at a fold the step is far too long to be squared, and yet it is the direction
        tangent /= largest
        return np.asarray(tangent / np.linalg.norm(tangent))

    def step(
        self, point: PathPoint, tangent: FloatArray, length: float, tolerance: float, effort: Effort
    ) -> PathPoint | None:
        """Point of the branch at the given length along the tangent; None where the corrector does not converge."""
        shape = point.evaluation.predicted_h.shape
        base = self.place(point.parameter, point.evaluation)
        unknown = base + length * tangent
        slope: FloatArray | None = None
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
            if slope is None:
                slope = self.slope(parameter, evaluation)
            # [J slope; tangent] by blocks: the step with the parameter held, and what a change of it brings
            held, moved = self.solver.solve_two(balance.linearise(evaluation), evaluation.residual, slope)
            held, moved = held.ravel() / self.size, moved.ravel() / self.size
            pivot = tangent[-1] - tangent[:-1] @ moved
            if pivot == 0.0 or not np.isfinite(pivot):
                return None
            change = (ahead - tangent[:-1] @ held) / pivot
            unknown = unknown - np.append(held - change * moved, change)
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

    def land(
        self, before: PathPoint, after: PathPoint, target: float, tolerance: float, effort: Effort
    ) -> PathPoint | None:
        """State at the target between two points of the branch; None where Newton's method leaves them."""
        share = (target - before.parameter) / (after.parameter - before.parameter)
        one, other = before.evaluation.predicted_h, after.evaluation.predicted_h
        start = one + share * (other - one)
        balance: Balance = self.balance_at(target, self.history)
        result = solve_balance(balance, start, self.solver, tolerance, effort, 15)
        found = result.evaluation.predicted_h
        near = np.linalg.norm(found - start) <= 2.0 * np.linalg.norm(other - one) + 1e-6 * self.size
        return PathPoint(target, result.evaluation, self.history) if result.converged and near else None

    def fold(self, points: list[PathPoint], tolerance: float, effort: Effort) -> float:
        """Extreme value of the parameter among three points around a fold.

        The vertex of the parabola through the parameter over the chord length; a point of the branch is added there and
        takes the place of one of the outer ones, a few times.
        """
        top = points[1].parameter > points[0].parameter
        for _ in range(REFINEMENTS):
            places = [self.place(point.parameter, point.evaluation) for point in points]
            at = np.array([-np.linalg.norm(places[1] - places[0]), 0.0, np.linalg.norm(places[2] - places[1])])
            square, slope, _ = np.polyfit(at, [place[-1] for place in places], 2)
            vertex = float(np.clip(-0.5 * slope / square, 0.9 * at[0], 0.9 * at[2])) if square != 0.0 else 0.0
            if abs(vertex) < 1e-3 * (at[2] - at[0]):
                vertex = 0.1 * (at[2] if at[2] > -at[0] else at[0])
            other = places[2] if vertex > 0.0 else places[0]
            way = (other - places[1]) / np.linalg.norm(other - places[1])
            added = self.step(points[1], way, abs(vertex), tolerance, effort)
            if added is None:
                break
            new = [points[0], points[1], added, points[2]] if vertex > 0.0 else [points[0], added, *points[1:]]
            inner = [point.parameter for point in new[1:3]]
            best = 1 + int(np.argmax(inner) if top else np.argmin(inner))
            points = new[best - 1 : best + 2]
        places = [self.place(point.parameter, point.evaluation) for point in points]
        at = np.array([-np.linalg.norm(places[1] - places[0]), 0.0, np.linalg.norm(places[2] - places[1])])
        square, slope, height = np.polyfit(at, [place[-1] for place in places], 2)
        vertex = -0.5 * slope / square if square != 0.0 else 0.0
        # at a corner of the branch the parabola means nothing: no farther than the neighbours
        inside = at[0] < vertex < at[2] and abs(0.5 * slope * vertex) < max(
            abs(places[1][-1] - places[0][-1]), abs(places[2][-1] - places[1][-1])
        )
        return float((height + 0.5 * slope * vertex if inside else places[1][-1]) * self.span)

"""Pseudo-arc-length continuation of a branch through its folds to an accepted state at a target.

Each step solves the bordered system by block elimination. The solver of the plain Jacobian gives the solutions for two
right-hand sides from one factorisation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.converged import BalanceAt, PathPoint, vibration_change
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.model import FloatArray
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Budget, solve_balance, solve_linearised
from solver.packing import packable

# step of a finite difference in natural lengths: a round-off of 1e-16 gives the difference an error of 1e-9
_DIFFERENCE = 1e-7


@dataclass(frozen=True)
class ArcResult:
    """Result of a continuation by arc length.

    - point: state at the target; None where the target was not reached.
    - folds: values of the parameter at which the branch turns back.
    - jumps: the folds at which the state jumps when the parameter changes slowly. Where the branch returns to the
      parameter of such a fold, the vibration is a different one.
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
    budget: Budget,
    accept: Callable[[PathPoint], bool] = lambda _: True,
    toward: float = 0.0,
    beyond: bool = True,
) -> ArcResult:
    """Follow the branch by arc length, through folds, to an accepted state at the target.

    The tangential history of the start is held. The search also ends at a distance of `CONTINUATION.farthest` from
    start and target, and after `CONTINUATION.arc_correctors` correctors.

    Parameters
    ----------
    balance_at : callable
        Balance at a value of the parameter for a tangential history (n_contact, 2), m.
    start : PathPoint
        First state of the branch.
    target, span : float
        Target of the parameter, and the natural length of the parameter, which scales the arc.
    solver, tolerance, budget
        As in `solve_balance`.
    accept : callable
        Whether a state at the target ends the search.
    toward : float
        Sign of the first change of the parameter; by default towards the target. Needed where the target is the start.
    beyond : bool
        False ends the search where the branch reaches the target before any fold in a state that is not accepted. The
        branch has then lost its stability otherwise than at a fold, and no slow change leads to its later states.
    """
    toward = toward or float(np.sign(target - start.parameter)) or 1.0
    arc = Arc(balance_at, start.history, solver, max(float(np.linalg.norm(start.evaluation.predicted_h)), 1e-300), span)
    path = [arc.place(start.parameter, start.evaluation)]
    points = [start]
    direction = np.zeros(path[0].size)
    direction[-1] = toward
    folds: list[float] = []
    turns: list[int] = []
    length, left = CONTINUATION.longest_arc / 10.0, CONTINUATION.arc_correctors
    low = min(start.parameter, target) - CONTINUATION.farthest * abs(span)
    high = max(start.parameter, target) + CONTINUATION.farthest * abs(span)
    while left > 0 and not budget.exhausted:
        point = points[-1]
        tangent = arc.tangent(point.parameter, point.evaluation, budget)
        if tangent is None:
            break
        tangent = tangent * (np.sign(tangent @ direction) or 1.0)
        reached, length, left = arc.advance(point, tangent, length, tolerance, budget, left)
        if reached is None:
            break
        if len(points) == 1 and (reached.parameter - point.parameter) * toward < 0.0:
            # the start lies so near to a fold that the first step passes the fold
            if 0.25 * length > CONTINUATION.shortest_arc:
                length *= 0.25
                continue
            folds.append(point.parameter)
            turns.append(0)
        length = max(length, CONTINUATION.corner_arc)
        points.append(reached)
        path.append(arc.place(reached.parameter, reached.evaluation))
        if len(points) > 2 and (path[-1][-1] - path[-2][-1]) * (path[-2][-1] - path[-3][-1]) < 0.0:
            folds.append(arc.fold(points[-3:], tolerance, budget))
            turns.append(len(points) - 2)
        if (reached.parameter - target) * (point.parameter - target) <= 0.0 and point.parameter != target:
            found = arc.state_at(point, reached, target, tolerance, budget)
            if found is not None and accept(found):
                return ArcResult(found, tuple(folds), _jumps(folds, turns, [*points, found], toward))
            if found is not None and not folds and not beyond:
                break
        if not low <= reached.parameter <= high:
            break
        direction = path[-1] - path[-2]
    return ArcResult(None, tuple(folds), ())


def _jumps(folds: list[float], turns: list[int], points: list[PathPoint], toward: float) -> tuple[float, ...]:
    """Folds behind which the branch returns with a different vibration. turns: indices of the folds in `points`."""
    jumps: list[float] = []
    free = 0  # folds between an earlier fold and the return of the branch do not count
    for fold, turn in zip(folds, turns, strict=True):
        if turn < free:
            continue
        beyond = [place for place in range(turn + 1, len(points)) if (points[place].parameter - fold) * toward > 0.0]
        again = beyond[0] if beyond else len(points) - 1
        one, other = points[turn].evaluation, points[again].evaluation
        if max(vibration_change(one, other), vibration_change(other, one)) > CONTINUATION.smooth_change:
            jumps.append(fold)
        free = again
    return tuple(jumps)


@packable
@dataclass(frozen=True)
class _Corrected:
    """End of the corrector of an arc-length step. unknown: scaled unknowns, dimensionless."""

    converged: bool
    unknown: FloatArray
    iterations: int


@dataclass
class Arc:
    """Arc-length steps in the scaled unknowns (p / size, parameter / span). The tangential history is held."""

    balance_at: BalanceAt
    history: FloatArray
    solver: JacobianSolver
    size: float
    span: float

    def place(self, parameter: float, evaluation: Evaluation) -> FloatArray:
        """Scaled unknowns of a point."""
        return np.append(evaluation.predicted_h.ravel() / self.size, parameter / self.span)

    def slope(self, parameter: float, evaluation: Evaluation) -> FloatArray:
        """Derivative (n_rel, m), N, of the residual with respect to parameter / span.

        A finite difference is enough: the slope only gives directions to the corrector, whose residual is exact.
        """
        step = _DIFFERENCE
        ahead = self.balance_at(parameter + step * self.span, self.history).evaluate(evaluation.predicted_h)
        return (ahead.residual - evaluation.residual) / step

    def tangent(self, parameter: float, evaluation: Evaluation, budget: Budget) -> FloatArray | None:
        """Unit tangent of the branch, of either sign; None where the tangent is not defined."""
        balance, slope = self.balance_at(parameter, self.history), self.slope(parameter, evaluation)
        step = solve_linearised(balance, evaluation, -slope, self.solver, budget) / self.size
        tangent = np.append(step.ravel(), 1.0)
        largest = float(np.abs(tangent).max())
        if not np.isfinite(largest):
            return None
        # near a fold the square of the step may overflow, although its direction is right
        tangent /= largest
        return np.asarray(tangent / np.linalg.norm(tangent))

    def advance(
        self, point: PathPoint, tangent: FloatArray, length: float, tolerance: float, budget: Budget, left: int
    ) -> tuple[PathPoint | None, float, int]:
        """The next point, None where none is found; the length of the step after it; correctors left of `left`."""
        reached = None
        while reached is None and length > CONTINUATION.shortest_arc and left > 0:
            reached = self.step(point, tangent, length, tolerance, budget)
            left -= 1
            length = min(2.0 * length, CONTINUATION.longest_arc) if reached is not None else 0.5 * length
        if reached is None:
            reached = self.step_over_corner(point, tangent, tolerance, budget)
        return reached, length, left

    def step(
        self, point: PathPoint, tangent: FloatArray, length: float, tolerance: float, budget: Budget
    ) -> PathPoint | None:
        """Point of the branch at the given length along the tangent; None where the corrector does not converge."""
        corrected = budget.once(
            self.solver,
            lambda: self._corrected(point, tangent, length, tolerance),
            lambda known: isinstance(known, _Corrected) and known.unknown.shape == tangent.shape,
        )
        budget.iterations += corrected.iterations
        if not corrected.converged:
            return None
        parameter = float(corrected.unknown[-1] * self.span)
        predicted_h = corrected.unknown[:-1].reshape(point.evaluation.predicted_h.shape) * self.size
        return PathPoint(parameter, self.balance_at(parameter, self.history).evaluate(predicted_h), self.history)

    def _corrected(self, point: PathPoint, tangent: FloatArray, length: float, tolerance: float) -> _Corrected:
        """The scaled unknowns of `step`."""
        shape = point.evaluation.predicted_h.shape
        base = self.place(point.parameter, point.evaluation)
        unknown = base + length * tangent
        slope: FloatArray | None = None
        for iteration in range(CONTINUATION.near_iterations):
            parameter = float(unknown[-1] * self.span)
            balance = self.balance_at(parameter, self.history)
            evaluation = balance.evaluate(unknown[:-1].reshape(shape) * self.size)
            # zero but for round-off: every iterate lies in the plane across the tangent
            ahead = float(tangent @ (unknown - base)) - length
            norm = evaluation.scaled_residual()
            if norm <= tolerance:
                return _Corrected(True, unknown, iteration)
            if not np.isfinite(norm) or np.linalg.norm(unknown - base) > CONTINUATION.arc_wander * length:
                return _Corrected(False, unknown, iteration)
            if slope is None:
                slope = self.slope(parameter, evaluation)
            # [J slope; tangent] by blocks: the step with the parameter held, and the step per change of the parameter
            held, moved = self.solver.solve_all(balance.linearise(evaluation), (evaluation.residual, slope))
            held, moved = held.ravel() / self.size, moved.ravel() / self.size
            pivot = tangent[-1] - tangent[:-1] @ moved
            if pivot == 0.0 or not np.isfinite(pivot):
                return _Corrected(False, unknown, iteration)
            change = (ahead - tangent[:-1] @ held) / pivot
            unknown = unknown - np.append(held - change * moved, change)
        return _Corrected(False, unknown, CONTINUATION.near_iterations)

    def step_over_corner(
        self, point: PathPoint, tangent: FloatArray, tolerance: float, budget: Budget
    ) -> PathPoint | None:
        """Point behind a corner of the branch; None where no point is found.

        At a corner a contact sample changes its status, and the branch may turn back. The plane across the old tangent
        may not meet the branch behind the corner. So the tangent behind the corner is taken a little ahead of the
        point, and both signs of this tangent are tried. A solution on the branch before the corner is refused.
        """
        shape = point.evaluation.predicted_h.shape
        base = self.place(point.parameter, point.evaluation)
        length = CONTINUATION.corner_arc
        ahead = base + length * tangent
        parameter = float(ahead[-1] * self.span)
        behind = self.balance_at(parameter, self.history).evaluate(ahead[:-1].reshape(shape) * self.size)
        turned = self.tangent(parameter, behind, budget)
        if turned is None:
            return None
        for sign in (np.sign(turned @ tangent) or 1.0, -np.sign(turned @ tangent) or -1.0):
            reached = self.step(point, sign * turned, length, tolerance, budget)
            if reached is None:
                continue
            chord = self.place(reached.parameter, reached.evaluation) - base
            if chord @ tangent > -CONTINUATION.backward_cosine * np.linalg.norm(chord):
                return reached
        return None

    def state_at(
        self, before: PathPoint, after: PathPoint, target: float, tolerance: float, budget: Budget
    ) -> PathPoint | None:
        """State at the target between two points of the branch; None where Newton's method fails."""
        fraction = (target - before.parameter) / (after.parameter - before.parameter)
        one, other = before.evaluation.predicted_h, after.evaluation.predicted_h
        start = one + fraction * (other - one)
        balance: Balance = self.balance_at(target, self.history)
        result = solve_balance(balance, start, self.solver, tolerance, budget, CONTINUATION.near_iterations)
        return PathPoint(target, result.evaluation, self.history) if result.converged else None

    def fold(self, points: list[PathPoint], tolerance: float, budget: Budget) -> float:
        """Extreme value of the parameter at a fold, from three points around the fold.

        The value is the vertex of the parabola of the parameter over the chord length. Before, a few points of the
        branch are added, each between the middle point and its neighbour on the side of the vertex.
        """
        top = points[1].parameter > points[0].parameter
        for _ in range(CONTINUATION.fold_points):
            places, vertex, _ = self._vertex(points)
            chord = (places[2] if vertex > 0.0 else places[0]) - places[1]
            length = float(np.linalg.norm(chord))
            added = self.step(points[1], chord / length, 0.5 * length, tolerance, budget)
            if added is None:
                break
            new = [points[0], points[1], added, points[2]] if vertex > 0.0 else [points[0], added, *points[1:]]
            inner = [point.parameter for point in new[1:3]]
            best = 1 + int(np.argmax(inner) if top else np.argmin(inner))
            points = new[best - 1 : best + 2]
        (before, middle, after), vertex, above = self._vertex(points)
        # at a corner of the branch the parabola has no meaning: the vertex must lie between the neighbours
        inside = -np.linalg.norm(before - middle) < vertex < np.linalg.norm(after - middle)
        inside &= abs(above) < max(abs(middle[-1] - before[-1]), abs(after[-1] - middle[-1]))
        return float((middle[-1] + above if inside else middle[-1]) * self.span)

    def _vertex(self, points: list[PathPoint]) -> tuple[list[FloatArray], float, float]:
        """Three points in scaled unknowns, and the vertex of the parabola through them, seen from the middle point.

        The vertex has its distance along the chords, and the scaled parameter above that of the middle point.
        """
        places = [self.place(point.parameter, point.evaluation) for point in points]
        back, ahead = (float(np.linalg.norm(places[1] - places[k])) for k in (0, 2))
        before, after = ((places[k][-1] - places[1][-1]) for k in (0, 2))
        square = (before / back + after / ahead) / (back + ahead)
        slope = after / ahead - square * ahead
        vertex = -0.5 * slope / square if square != 0.0 else 0.0
        return places, vertex, 0.5 * slope * vertex

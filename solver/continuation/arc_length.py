"""Pseudo-arc-length continuation of a branch through its folds to an accepted state at a target.

Each step solves the bordered system by block elimination. The solver of the plain Jacobian gives the solutions for two
right-hand sides from one factorisation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.converged import BalanceAt, PathPoint, vibration_change
from solver.harmonic_balance.dlft import Evaluation
from solver.model import FloatArray
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Budget, solve_balance, solve_linearised
from solver.options import COMMON
from solver.packing import packable


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
    arc: Arc,
    target: float,
    accept: Callable[[PathPoint], bool] = lambda _: True,
    toward: float = 0.0,
    beyond: bool = True,
) -> ArcResult:
    """Follow the branch by arc length, through folds, to an accepted state at the target.

    The search also ends at a distance of `CONTINUATION.farthest` from start and target, and after
    `CONTINUATION.arc_correctors` correctors.

    Parameters
    ----------
    arc : Arc
        The branch and its first state.
    target : float
        Target of the parameter.
    accept : callable
        Whether a state at the target ends the search.
    toward : float
        Sign of the first change of the parameter; by default towards the target. Needed where the target is the start.
    beyond : bool
        False ends the search where the branch reaches the target before any fold in a state that is not accepted. The
        branch has then lost its stability otherwise than at a fold, and no slow change leads to its later states.
    """
    begin = arc.start.parameter
    toward = toward or float(np.sign(target - begin)) or 1.0
    far = CONTINUATION.farthest * abs(arc.span)
    points, turns = [arc.start], list[int]()
    for before, reached, fold in arc.steps(toward, CONTINUATION.arc_correctors):
        add_fold(points, turns, fold, reached)
        points.append(reached)
        if (reached.parameter - target) * (before.parameter - target) <= 0.0 and before.parameter != target:
            found = arc.state_at(before, reached, target)
            if found is not None and accept(found):
                folds = tuple(points[turn].parameter for turn in turns)
                return ArcResult(found, folds, _jumps(turns, [*points, found], toward))
            if found is not None and not turns and not beyond:
                break
        if not min(begin, target) - far <= reached.parameter <= max(begin, target) + far:
            break
    return ArcResult(None, tuple(points[turn].parameter for turn in turns), ())


def add_fold(points: list[PathPoint], turns: list[int], fold: PathPoint | None, reached: PathPoint) -> None:
    """Add the fold of a step to the points before its end, and the index of the fold to `turns`."""
    if fold is None:
        return
    if fold is not points[-1] and fold is not reached:
        points.append(fold)
    turns.append(len(points) - (fold is not reached))


def _jumps(turns: list[int], points: list[PathPoint], toward: float) -> tuple[float, ...]:
    """Folds behind which the branch returns with a different vibration. turns: indices of the folds in `points`."""
    jumps: list[float] = []
    free = 0  # folds between an earlier fold and the return of the branch do not count
    for turn in turns:
        if turn < free:
            continue
        fold = points[turn].parameter
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
    """A branch and its arc-length steps in the scaled unknowns (p / size, parameter / span).

    The tangential history of the start is held.

    - balance_at: balance at a value of the parameter for a tangential history (n_contact, 2), m.
    - start: first state.
    - span: natural length of the parameter, which scales the arc.
    - solver, tolerance, budget: as in `solve_balance`.
    """

    balance_at: BalanceAt
    start: PathPoint
    span: float
    solver: JacobianSolver
    tolerance: float
    budget: Budget
    size: float = field(init=False)

    def __post_init__(self) -> None:
        self.size = max(float(np.linalg.norm(self.start.evaluation.predicted_h)), 1e-300)

    def steps(
        self, toward: float, correctors: float = np.inf
    ) -> Iterator[tuple[PathPoint, PathPoint, PathPoint | None]]:
        """Steps along the branch: start and end of a step, and the state at the fold between both, None if none.

        toward: sign of the first change of the parameter. correctors: most correctors of all steps.
        """
        point, length, left = self.start, CONTINUATION.smooth_change / 10.0, correctors
        along = np.zeros(point.evaluation.predicted_h.size + 1)
        along[-1] = toward
        tangent = self.tangent(point.parameter, point.evaluation, along)
        while tangent is not None and left > 0 and not self.budget.exhausted:
            reached, length, left = self._advance(point, tangent, length, left)
            if reached is None:
                return
            back = point is self.start and (reached.parameter - point.parameter) * toward < 0.0
            if back and 0.25 * length > CONTINUATION.shortest_arc:
                # the start lies so near to a fold that the first step passes the fold
                length *= 0.25
                continue
            chord = self.place(reached.parameter, reached.evaluation) - self.place(point.parameter, point.evaluation)
            ahead = self.tangent(reached.parameter, reached.evaluation, chord)
            turns = ahead is not None and ahead[-1] * tangent[-1] < 0.0
            yield point, reached, point if back else self._fold(point, tangent, reached) if turns else None
            point, tangent, length = reached, ahead, max(length, CONTINUATION.corner_arc)

    def place(self, parameter: float, evaluation: Evaluation) -> FloatArray:
        """Scaled unknowns of a point."""
        return np.append(evaluation.predicted_h.ravel() / self.size, parameter / self.span)

    def slope(self, parameter: float, evaluation: Evaluation) -> FloatArray:
        """Derivative (n_rel, m), N, of the residual with respect to parameter / span.

        A finite difference is enough: the slope only gives directions to the corrector, whose residual is exact.
        """
        step = COMMON.difference
        ahead = self.balance_at(parameter + step * self.span, self.start.history).evaluate(evaluation.predicted_h)
        return (ahead.residual - evaluation.residual) / step

    def tangent(self, parameter: float, evaluation: Evaluation, along: FloatArray) -> FloatArray | None:
        """Unit tangent of the branch, of the sign of a direction `along`; None where the tangent is not defined."""
        balance, slope = self.balance_at(parameter, self.start.history), self.slope(parameter, evaluation)
        step = solve_linearised(balance, evaluation, -slope, self.solver, self.budget) / self.size
        tangent = np.append(step.ravel(), 1.0)
        largest = float(np.abs(tangent).max())
        if not np.isfinite(largest):
            return None
        # near a fold the square of the step may overflow, although its direction is right
        tangent /= largest
        tangent /= np.linalg.norm(tangent)
        return np.asarray(tangent * (np.sign(tangent @ along) or 1.0))

    def _advance(
        self, point: PathPoint, tangent: FloatArray, length: float, left: float
    ) -> tuple[PathPoint | None, float, float]:
        """The next point, None where none is found; the length of the step after it; correctors left of `left`."""
        reached = None
        while reached is None and length > CONTINUATION.shortest_arc and left > 0:
            reached = self.step(point, tangent, length)
            left -= 1
            length = min(2.0 * length, CONTINUATION.smooth_change) if reached is not None else 0.5 * length
        if reached is None:
            reached = self._step_over_corner(point, tangent)
        return reached, length, left

    def step(self, point: PathPoint, tangent: FloatArray, length: float) -> PathPoint | None:
        """Point of the branch at the given length along the tangent; None where the corrector does not converge."""
        corrected = self.budget.once(
            self.solver,
            lambda: self._corrected(point, tangent, length),
            lambda known: isinstance(known, _Corrected) and known.unknown.shape == tangent.shape,
        )
        self.budget.iterations += corrected.iterations
        if not corrected.converged:
            return None
        parameter = float(corrected.unknown[-1] * self.span)
        predicted_h = corrected.unknown[:-1].reshape(point.evaluation.predicted_h.shape) * self.size
        history = self.start.history
        return PathPoint(parameter, self.balance_at(parameter, history).evaluate(predicted_h), history)

    def _corrected(self, point: PathPoint, tangent: FloatArray, length: float) -> _Corrected:
        """The scaled unknowns of `step`."""
        shape = point.evaluation.predicted_h.shape
        base = self.place(point.parameter, point.evaluation)
        unknown = base + length * tangent
        slope: FloatArray | None = None
        for iteration in range(CONTINUATION.near_iterations):
            parameter = float(unknown[-1] * self.span)
            balance = self.balance_at(parameter, self.start.history)
            evaluation = balance.evaluate(unknown[:-1].reshape(shape) * self.size)
            # zero but for round-off: every iterate lies in the plane across the tangent
            ahead = float(tangent @ (unknown - base)) - length
            norm = evaluation.scaled_residual()
            if norm <= self.tolerance:
                return _Corrected(True, unknown, iteration)
            if not np.isfinite(norm) or np.linalg.norm(unknown - base) > CONTINUATION.arc_wander * abs(length):
                return _Corrected(False, unknown, iteration)
            if slope is None:
                slope = self.slope(parameter, evaluation)
            # [J slope; tangent] by blocks: the step with the parameter held, and the step per change of the parameter
            held, moved = self.solver.solve_two(balance.linearise(evaluation), evaluation.residual, slope)
            held, moved = held.ravel() / self.size, moved.ravel() / self.size
            pivot = tangent[-1] - tangent[:-1] @ moved
            if pivot == 0.0 or not np.isfinite(pivot):
                return _Corrected(False, unknown, iteration)
            change = (ahead - tangent[:-1] @ held) / pivot
            unknown = unknown - np.append(held - change * moved, change)
        return _Corrected(False, unknown, CONTINUATION.near_iterations)

    def _step_over_corner(self, point: PathPoint, tangent: FloatArray) -> PathPoint | None:
        """Point behind a corner of the branch; None where no point is found.

        At a corner a contact sample changes its status, and the branch may turn back. The plane across the old tangent
        may not meet the branch behind the corner. So the tangent behind the corner is taken a little ahead of the
        point, and both signs of this tangent are tried. A solution on the branch before the corner is refused.
        """
        base = self.place(point.parameter, point.evaluation)
        length = CONTINUATION.corner_arc
        ahead = base + length * tangent
        parameter, predicted_h = float(ahead[-1] * self.span), ahead[:-1].reshape(point.evaluation.predicted_h.shape)
        behind = self.balance_at(parameter, self.start.history).evaluate(predicted_h * self.size)
        turned = self.tangent(parameter, behind, tangent)
        if turned is None:
            return None
        for sign in (1.0, -1.0):
            reached = self.step(point, sign * turned, length)
            if reached is None:
                continue
            chord = self.place(reached.parameter, reached.evaluation) - base
            # a chord within 8 degrees of the backward tangent lies on the branch before the corner
            if chord @ tangent > -0.99 * np.linalg.norm(chord):
                return reached
        return None

    def state_at(self, before: PathPoint, after: PathPoint, target: float) -> PathPoint | None:
        """State at the target between two points of the branch; None where Newton's method fails."""
        fraction = (target - before.parameter) / (after.parameter - before.parameter)
        one, other = before.evaluation.predicted_h, after.evaluation.predicted_h
        balance, most = self.balance_at(target, self.start.history), CONTINUATION.near_iterations
        start = one + fraction * (other - one)
        result = solve_balance(balance, start, self.solver, self.tolerance, self.budget, most)
        return PathPoint(target, result.evaluation, self.start.history) if result.converged else None

    def _fold(self, point: PathPoint, tangent: FloatArray, after: PathPoint) -> PathPoint:
        """State at the fold between two points, or the one of them that lies nearest to it; tangent: at the first.

        The fold is where the tangent of the branch has no part along the parameter: regula falsi (Illinois) on this
        part. At a corner of the branch the part jumps, and the search closes in on the corner. Of the states on the
        way, the one with the extreme parameter is the fold.
        """
        base = self.place(point.parameter, point.evaluation)
        low, high = 0.0, float(tangent @ (self.place(after.parameter, after.evaluation) - base))
        at_low, at_high = float(tangent[-1]), -float(tangent[-1])
        sign = np.sign(tangent[-1])
        best = max(point, after, key=lambda each: sign * each.parameter)
        for step in range(CONTINUATION.near_iterations):
            # the part behind the fold is known after the first steps: halve until then
            place = 0.5 * (low + high) if step < 2 else low + (high - low) * at_low / (at_low - at_high)
            found = self.step(point, tangent, place)
            ahead = None if found is None else self.tangent(found.parameter, found.evaluation, tangent)
            if found is None or ahead is None:
                break
            part = float(ahead[-1])
            if (found.parameter - best.parameter) * sign > 0.0:
                best = found
            # the parameter is off by the square of the part
            if part**2 < COMMON.negligible:
                break
            if part * at_low > 0.0:
                low, at_low, at_high = place, part, 0.5 * at_high
            else:
                high, at_high, at_low = place, part, 0.5 * at_low
        return best

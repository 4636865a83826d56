"""A whole branch of periodic states by arc length: every point, the folds among them, unstable parts included."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.continuation.arc_length import Arc
from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.converged import BalanceAt, PathPoint
from solver.model import FloatArray
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Budget
from solver.options import COMMON

_FOLD_STEPS = 12  # of the secant search of a fold: halves a bracket to less than a thousandth at worst


@dataclass(frozen=True)
class Branch:
    """Points of a branch in the order of the arc.

    - points: the converged states.
    - folds: indices of the points at which the parameter turns.
    - arrived: whether the last point is at the last value of the parameter.
    - returned: whether the branch has come back to the limit behind its start.
    """

    points: tuple[PathPoint, ...]
    folds: tuple[int, ...]
    arrived: bool = False
    returned: bool = False


def follow_branch_whole(
    balance_at: BalanceAt,
    start: PathPoint,
    last: float,
    back: float,
    span: float,
    tolerance: float,
    budget: Budget,
    most: int,
) -> Branch:
    """Follow a branch until its parameter passes `last`, or the limit `back` on the other side of the start.

    The tangential history of the start is held.

    Parameters
    ----------
    balance_at, start, tolerance, budget
        As in `arc_length.follow_arc`.
    last, back
        Last value of the parameter, and the limit behind the start.
    span
        Natural length of the parameter, which scales the arc.
    most
        Largest number of points.
    """
    size = max(float(np.linalg.norm(start.evaluation.predicted_h)), 1e-300)
    arc = Arc(balance_at, start.history, JacobianSolver(), size, span)
    toward = float(np.sign(last - start.parameter))
    points = [start]
    folds: list[int] = []
    direction = np.zeros(start.evaluation.predicted_h.size + 1)
    direction[-1] = toward
    length, before = CONTINUATION.longest_arc / 10.0, None
    while len(points) < most and not budget.exhausted:
        point = points[-1]
        tangent = arc.tangent(point.parameter, point.evaluation, budget)
        if tangent is None:
            break
        tangent = tangent * (np.sign(tangent @ direction) or 1.0)
        if before is not None and tangent[-1] * before[-1] < 0.0:
            turn = _find_fold(arc, points[-2], before, point, tolerance, budget)
            points[-1:] = [point] if turn is points[-2] or turn is point else [turn, point]
            folds.append(next(index for index, each in enumerate(points) if each is turn))
        reached, length, _ = arc.advance(point, tangent, length, tolerance, budget, CONTINUATION.arc_correctors)
        if reached is None:
            break
        for value in (last, back):
            if (reached.parameter - value) * (point.parameter - value) <= 0.0:
                end = arc.state_at(point, reached, value, tolerance, budget)
                return Branch(
                    tuple(points) if end is None else (*points, end),
                    tuple(folds),
                    end is not None and value == last,
                    value == back,
                )
        length = max(length, CONTINUATION.corner_arc)
        direction = arc.place(reached.parameter, reached.evaluation) - arc.place(point.parameter, point.evaluation)
        points.append(reached)
        before = tangent
    return Branch(tuple(points), tuple(folds))


def _find_fold(
    arc: Arc, point: PathPoint, tangent: FloatArray, after: PathPoint, tolerance: float, budget: Budget
) -> PathPoint:
    """State at the fold between two points, or the one of them that lies nearest to the fold; tangent: at the first.

    The fold is where the tangent of the branch has no part along the parameter: regula falsi (Illinois) on this part.
    At a corner of the branch the part jumps, and the search closes in on the corner. Of the states on the way, the one
    with the extreme parameter is the fold.
    """
    base = arc.place(point.parameter, point.evaluation)
    low, high = 0.0, float(tangent @ (arc.place(after.parameter, after.evaluation) - base))
    at_low, at_high = float(tangent[-1]), -float(tangent[-1])
    sign = np.sign(tangent[-1])
    best = max(point, after, key=lambda each: sign * each.parameter)
    for step in range(_FOLD_STEPS):
        # the part behind the fold is known after the first steps: halve until then
        place = 0.5 * (low + high) if step < 2 else low + (high - low) * at_low / (at_low - at_high)
        found = arc.step(point, tangent, place, tolerance, budget)
        ahead = None if found is None else arc.tangent(found.parameter, found.evaluation, budget)
        if found is None or ahead is None:
            break
        part = float(ahead[-1] * (np.sign(ahead @ tangent) or 1.0))
        if (found.parameter - best.parameter) * sign > 0.0:
            best = found
        # the parameter is off by the square of its part of the tangent
        if abs(part) < COMMON.negligible:
            break
        if part * at_low > 0.0:
            low, at_low, at_high = place, part, 0.5 * at_high
        else:
            high, at_high, at_low = place, part, 0.5 * at_low
    return best

"""A whole branch of periodic states by arc length: every point, the folds among them, unstable parts included."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.continuation.arc_length import Arc, add_fold
from solver.harmonic_balance.state import State


@dataclass(frozen=True)
class Branch:
    """Points of a branch in the order of the arc.

    - points: the converged states.
    - folds: indices of the points at which the parameter turns.
    - arrived: whether the last point is at the last value of the parameter.
    - returned: whether the branch has come back to the limit behind its start.
    """

    points: tuple[State, ...]
    folds: tuple[int, ...]
    arrived: bool = False
    returned: bool = False


def follow_branch_whole(arc: Arc, last: float, back: float, most: int) -> Branch:
    """Follow a branch until its parameter passes `last`, or the limit `back` on the other side of the start.

    most: largest number of points.
    """
    points, folds = [arc.start], list[int]()
    for before, reached, fold in arc.steps(float(np.sign(last - arc.start.parameter))):
        add_fold(points, folds, fold, reached)
        for value in (last, back):
            if (reached.parameter - value) * (before.parameter - value) <= 0.0:
                end = arc.state_at(before, reached, value)
                return Branch(
                    tuple(points) if end is None else (*points, end),
                    tuple(folds),
                    end is not None and value == last,
                    value == back,
                )
        points.append(reached)
        if len(points) >= most:
            break
    return Branch(tuple(points), tuple(folds))

"""Globalised semismooth Newton's method, without any knowledge of contact."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from solver.model import FloatArray

MOST_ITERATIONS = 30
"""Most iterations of one solve. Prototypes took 2 to 5 from a warm start, up to 40 from a cold one near a resonance."""

FULL_STEPS = 6
"""Full steps in a row without a new lowest residual before steps are halved. Twice as many find equal states; with
three, too, the static states of the dovetail are equal."""

SHORTEST_STEP = 1.0 / 128.0
"""Shortest step as a fraction of the full step: seven halvings. With six a random scene (seed 53 of
`tests/random_scenes.py`) gets no accurate state. Also the shortest natural step over the range to the target
(where a shorter one is needed, the branch is assumed to fold), and the shortest relaxation step in periods."""


class HasResidual(Protocol):
    """What the iteration asks of an evaluation."""

    @property
    def scale(self) -> tuple[float, float]:
        """Scales of the residual."""

    def scaled_residual(self, scale: tuple[float, float] | None = None) -> float:
        """Norm of the residual over its own or given scales."""


EvaluationT = TypeVar("EvaluationT", bound=HasResidual)


@dataclass(frozen=True)
class NewtonResult(Generic[EvaluationT]):
    """End of an iteration: whether it has met the tolerance, its last unknown and evaluation, number of iterations.

    Where it has not converged, unknown and evaluation are those of the lowest norm.
    """

    converged: bool
    unknown: FloatArray
    evaluation: EvaluationT
    iterations: int


def solve_newton(
    evaluate: Callable[[FloatArray], EvaluationT],
    direction: Callable[[EvaluationT], FloatArray],
    start: FloatArray,
    tolerance: float,
    most_iterations: int | None = None,
) -> NewtonResult[EvaluationT]:
    """Iterate `x <- x + t direction(x)` from `start` until the scaled residual is at most the tolerance.

    The residual is piecewise smooth. A full step that raises the residual often ends in the piece with the solution,
    while a line search takes very short steps at every kink. So full steps come first, as long as the lowest norm is
    improved once in `FULL_STEPS` iterations. Then the iteration returns to the best point and halves its steps
    until the norm decreases.

    direction: Newton step, of the shape of the unknown. most_iterations: `MOST_ITERATIONS` by default.
    """
    most = MOST_ITERATIONS if most_iterations is None else most_iterations
    unknown, current = start, evaluate(start)
    best, best_norm, since_best = (unknown, current), np.inf, 0
    cutting = False
    for iteration in range(most + 1):
        norm = current.scaled_residual()
        if norm <= tolerance:
            return NewtonResult(True, unknown, current, iteration)
        if norm < best_norm:
            best, best_norm, since_best = (unknown, current), norm, 0
        else:
            since_best += 1
        if iteration == most:
            break
        if not cutting and (not np.isfinite(norm) or since_best > FULL_STEPS):
            cutting = True
            unknown, current = best
        step = direction(current)
        if not np.all(np.isfinite(step)):
            break
        length, trial = 1.0, evaluate(unknown + step)
        while cutting and not trial.scaled_residual(current.scale) < current.scaled_residual():
            length *= 0.5
            if length <= SHORTEST_STEP:
                return NewtonResult(False, *best, most)
            trial = evaluate(unknown + length * step)
        unknown, current = unknown + length * step, trial
    return NewtonResult(False, *best, most)

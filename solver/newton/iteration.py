"""Globalised semismooth Newton. Knows nothing of contact."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from solver.model import FloatArray

PATIENCE = 6  # full steps that may go by without a new lowest residual
SHORTEST = 1.0 / 128.0


class HasResidual(Protocol):
    """What an evaluation must offer: its residual norm, over scales that may be held fixed, and those scales."""

    @property
    def scale(self) -> tuple[float, float]:
        """Scales of the residual, in its unit."""

    def scaled_residual(self, scale: tuple[float, float] | None = None) -> float:
        """Norm of the residual, dimensionless."""


EvaluationT = TypeVar("EvaluationT", bound=HasResidual)


@dataclass(frozen=True)
class NewtonResult(Generic[EvaluationT]):
    """End of an iteration: the last unknown and its evaluation, whether the tolerance was met, and the iterations."""

    converged: bool
    unknown: FloatArray
    evaluation: EvaluationT
    iterations: int


def solve_newton(
    evaluate: Callable[[FloatArray], EvaluationT],
    direction: Callable[[EvaluationT], FloatArray],
    start: FloatArray,
    tolerance: float,
    most_iterations: int = 30,
) -> NewtonResult[EvaluationT]:
    """Iterate `x <- x + t direction(x)` until the scaled residual is below the tolerance.

    The residual is piecewise smooth: a full step that raises it often lands in the right piece, and a step that is cut
    back at every kink crawls. So full steps come first, as long as the lowest norm so far is improved once in
    `PATIENCE` iterations; then the iteration goes back to the best point and cuts its steps until the norm falls.
    """
    unknown, current = start, evaluate(start)
    best, best_norm, since_best = (unknown, current), np.inf, 0
    cutting = False
    for iteration in range(most_iterations + 1):
        norm = current.scaled_residual()
        if norm <= tolerance:
            return NewtonResult(True, unknown, current, iteration)
        if norm < best_norm:
            best, best_norm, since_best = (unknown, current), norm, 0
        else:
            since_best += 1
        if iteration == most_iterations:
            break
        lost = not np.isfinite(norm) or norm > 1e6 * best_norm
        if not cutting and (lost or since_best > PATIENCE):
            cutting = True
            unknown, current = best
        step = direction(current)
        if not np.all(np.isfinite(step)):
            break
        length, trial = 1.0, evaluate(unknown + step)
        while cutting and not trial.scaled_residual(current.scale) < current.scaled_residual() and length > SHORTEST:
            length *= 0.5
            trial = evaluate(unknown + length * step)
        if cutting and length <= SHORTEST:
            break
        unknown, current = unknown + length * step, trial
    return NewtonResult(False, *best, most_iterations)

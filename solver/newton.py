"""Globalised semismooth Newton. Knows nothing of contact."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from solver.model import FloatArray


class HasResidual(Protocol):
    """What an evaluation must offer: its residual norm, over scales that may be held fixed, and those scales."""

    scale: tuple[float, float]

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

    The residual has kinks where a contact sample changes its state, so a full step may raise it for a moment: a step is
    accepted when it does not exceed the largest of the last three norms, and halved otherwise.
    """
    unknown = start
    current = evaluate(unknown)
    recent: list[float] = []
    for iteration in range(most_iterations + 1):
        scale = current.scale
        norm = current.scaled_residual()
        if norm <= tolerance:
            return NewtonResult(True, unknown, current, iteration)
        if iteration == most_iterations or not np.isfinite(norm):
            break
        recent = [*recent[-2:], norm]
        step = direction(current)
        if not np.all(np.isfinite(step)):
            break
        length = 1.0
        best: tuple[float, FloatArray, EvaluationT] | None = None
        while length > 1e-3:
            trial = evaluate(unknown + length * step)
            trial_norm = trial.scaled_residual(scale)
            if best is None or trial_norm < best[0]:
                best = (trial_norm, unknown + length * step, trial)
            if trial_norm <= (1.0 - 1e-4 * length) * max(recent):
                break
            length *= 0.5
        if best is None or not best[0] < 10.0 * max(recent):
            return NewtonResult(False, unknown, current, iteration)
        _, unknown, current = best
    return NewtonResult(False, unknown, current, most_iterations)

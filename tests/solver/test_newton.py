"""Newton's method on small piecewise examples that know nothing of contact."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from solver.newton.run import solve_newton


@dataclass(frozen=True)
class Example:
    """Evaluation of a plain function."""

    point: np.ndarray
    residual: np.ndarray
    scale: tuple[float, float] = (1.0, 1.0)

    def scaled_residual(self, scale=None):
        return float(np.linalg.norm(self.residual)) / (scale or self.scale)[0]


@dataclass
class Problem:
    """A function with its (generalised) derivative, and how often it was evaluated."""

    function: Any
    derivative: Any
    calls: list[np.ndarray] = field(default_factory=list)

    def evaluate(self, point):
        self.calls.append(point)
        return Example(point, self.function(point))

    def direction(self, at):
        return np.linalg.solve(self.derivative(at.point), -at.residual)

    def solve(self, start, tolerance=1e-10, direction=None):
        return solve_newton(self.evaluate, direction or self.direction, np.asarray(start, float), tolerance)


def test_convergence_is_quadratic_on_a_smooth_function():
    problem = Problem(lambda x: np.exp(x) - 2.0, lambda x: np.diag(np.exp(x)))
    result = problem.solve([1.5], 1e-14)
    assert result.converged
    assert result.iterations <= 6
    errors = [abs(float(point[0]) - np.log(2.0)) for point in problem.calls]
    assert errors[3] < errors[2] ** 2


@pytest.mark.parametrize("size", [1, 3])
def test_a_cycle_of_plain_newton_is_broken(size):
    # slopes 1, 5, 1 between kinks at -1 and 1, so that the tangent of either outer piece leads to the other one
    problem = Problem(
        lambda x: 5 * np.clip(x, -1, 1) + (x - np.clip(x, -1, 1)),
        lambda x: np.diag(np.where(np.abs(x) < 1, 5.0, 1.0)),
    )
    point = np.linspace(2.0, 3.0, size)
    for expected in (-4.0, 4.0, -4.0):
        point = point + problem.direction(problem.evaluate(point))
        assert point == pytest.approx(expected * np.ones(size))
    result = problem.solve(np.linspace(2.0, 3.0, size))
    assert result.converged
    assert result.unknown == pytest.approx(np.zeros(size), abs=1e-10)


def test_no_solution_is_a_value():
    problem = Problem(lambda x: x**2 + 1.0, lambda x: np.diag(2 * x))
    result = problem.solve([1.3])
    assert not result.converged
    assert np.array_equal(result.evaluation.point, result.unknown)
    # the best point so far, not the last one
    assert result.evaluation.scaled_residual() == min(np.linalg.norm(x**2 + 1) for x in problem.calls)


def test_a_residual_that_is_not_finite_sends_the_iteration_back():
    # the full step leads to where the logarithm is undefined
    problem = Problem(lambda x: np.log(x) if x[0] > 0 else np.full(1, np.nan), lambda x: np.diag(1 / x))
    result = problem.solve([10.0], 1e-12)
    assert np.isnan(problem.evaluate(problem.calls[1]).scaled_residual())
    assert result.converged
    assert result.unknown[0] == pytest.approx(1.0, rel=1e-10, abs=0.0)

"""Bordering: a harmonic balance with k further unknowns q and k further equations.

    R(p, q) = 0,      e(p, q) = 0.

Newton's method eliminates p. With the Jacobian J = dR/dp, the steps a and B of p for the residual and for each of the
further unknowns,

    J a = -R,      J B = -dR/dq,

leave k equations for the change of q,

    (de/dq + de/dp B) dq = -e - de/dp a,      dp = a + B dq.

The solver of the plain Jacobian does all the work (Govaerts, Numerical Methods for Bifurcations of Dynamical
Equilibria, 2000, section 3.6). The balance of an arc-length step and that at a given phase lag have one further
unknown, that of a nonlinear mode three.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from solver.harmonic_balance.dlft import Balance, Evaluation, Linearisation
from solver.model import FloatArray
from solver.newton.linear_solver import JacobianSolver


@dataclass(frozen=True)
class Bordered:
    """Evaluation of a balance with further equations.

    balance, at: the harmonic balance at the values of the further unknowns, and its evaluation.
    values, errors (k,): further unknowns, and residuals of the further equations, dimensionless.
    reduced (k, k): derivative of the errors by the values with p eliminated, of the last Newton step; None without one.
    extra: what the problem needs again for its derivatives.
    """

    balance: Balance
    at: Evaluation
    values: FloatArray
    errors: FloatArray
    reduced: FloatArray | None = None
    extra: Any = field(default=None, repr=False)

    @property
    def scale(self) -> tuple[float, float]:
        """As in Evaluation."""
        return self.at.scale

    def scaled_residual(self, scale: tuple[float, float] | None = None) -> float:
        """Norm of all residuals, dimensionless."""
        return float(np.hypot(self.at.scaled_residual(scale), np.linalg.norm(self.errors)))


class BorderedProblem(Protocol):
    """A balance with further unknowns and equations."""

    def evaluate(self, predicted_h: FloatArray, values: FloatArray) -> Bordered:
        """Both residuals at a predicted force (n_rel, m), N, and values (k,)."""

    def by_values(self, here: Bordered) -> tuple[list[FloatArray], FloatArray]:
        """Derivatives by the values at a fixed predicted force: k times (n_rel, m) of the residual, N; (k, k)."""

    def by_step(self, here: Bordered, tangent: Linearisation, step: FloatArray) -> FloatArray:
        """Change (k,) of the errors with a step (n_rel, m), N, of the predicted force."""

    def fraction(self, here: Bordered, step: FloatArray, change: FloatArray) -> float:
        """Fraction of a Newton step that is taken: 1 for a usual one, NaN to give up."""


def bordered_step(
    problem: BorderedProblem, here: Bordered, solver: JacobianSolver, rtol: float
) -> tuple[FloatArray, FloatArray]:
    """Newton step of all unknowns (n_rel m + k,), and the derivative `reduced` (k, k) as in `Bordered`.

    rtol: relative residual of the linear solves.
    """
    tangent = here.balance.linearise(here.at)
    slopes, by_values = problem.by_values(here)
    rights = np.array([-here.at.residual, *(-slope for slope in slopes)])
    steps = solver.solve_all(tangent, rights, rtol)
    own, *others = (problem.by_step(here, tangent, step) for step in steps)
    reduced = by_values + np.stack(others, axis=1)
    if not np.isfinite(reduced).all():
        return np.full(here.at.residual.size + len(here.values), np.nan), reduced
    change = np.asarray(np.linalg.lstsq(reduced, -here.errors - own)[0])
    step, right = (np.tensordot(np.append(1.0, change), parts, 1) for parts in (steps, rights))
    # the steps may cancel each other, not so their errors
    left = right - tangent.apply(step)
    if np.linalg.norm(left) > rtol * np.linalg.norm(here.at.residual):
        step = step + solver.solve(tangent, left)
    return problem.fraction(here, step, change) * np.concatenate([step.ravel(), change]), reduced

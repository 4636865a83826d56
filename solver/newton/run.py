"""A computation: its tolerance, its limits, and `solve`, the one way to a state of a harmonic balance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from solver.clock import computing_time
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.harmonic_balance.prolongation import transfer
from solver.harmonic_balance.state import State, final_history
from solver.model import FloatArray
from solver.newton.bordering import Bordered, BorderedProblem, bordered_step
from solver.newton.iteration import NewtonResult, solve_newton
from solver.newton.linear_solver import FORCING, JacobianSolver
from solver.structure.joint import Case, Joint


class OutOfTimeError(Exception):
    """A computation has used up its CPU time; the caller turns this error into an outcome."""


def _silent(_: str) -> None:
    """Report no progress."""


@dataclass
class Budget:
    """Limits of one computation with all its parts, and the iterations that it has taken.

    iterations: Newton iterations so far.
    limit: iterations after which no new step of a search begins.
    deadline: CPU time of the thread, s, after which the whole computation ends.
    report: called with a description of the progress, in words, at every change.
    """

    iterations: int = 0
    limit: float = np.inf
    deadline: float = np.inf
    report: Callable[[str], None] = _silent

    @property
    def exhausted(self) -> bool:
        """Whether the limit is passed and no new step may begin."""
        return self.iterations > self.limit

    def check_time(self) -> None:
        """Raise OutOfTimeError after the deadline."""
        if self.deadline < np.inf and computing_time() > self.deadline:
            raise OutOfTimeError


@dataclass
class Run:
    """Solves of one computation, one after the other. Each raises OutOfTimeError after the deadline of the budget.

    tolerance: of the scaled residual, dimensionless.
    budget: shared by all parts of the computation.
    solver: keeps a factorisation from solve to solve, which saves time and changes the last bits only.
    """

    tolerance: float
    budget: Budget = field(default_factory=Budget)
    solver: JacobianSolver = field(default_factory=JacobianSolver, repr=False)

    def fresh(self) -> Run:
        """A part of the computation whose results do not depend on the factorisation kept so far."""
        return Run(self.tolerance, self.budget)

    def to(self, tolerance: float) -> Run:
        """The same run with another tolerance."""
        return replace(self, tolerance=tolerance)

    def solve(self, balance: Balance, start: FloatArray, most: int | None = None) -> NewtonResult[Evaluation]:
        """Solve Eq. (8), with an implicit step Eq. (26), by Newton's method on the exact Jacobian, Eq. (16).

        start (n_rel, 2H+1): first predicted force, N. most: iterations, `MOST_ITERATIONS` by default.
        """

        def direction(at: Evaluation) -> FloatArray:
            self.budget.check_time()
            return self.step(balance, at, -at.residual, self._forcing(at.scaled_residual()))

        end = solve_newton(balance.evaluate, direction, start, self.tolerance, most)
        self.budget.iterations += end.iterations
        return end

    def state(
        self, balance: Balance, start: FloatArray, parameter: float = np.nan, most: int | None = None
    ) -> State | None:
        """The state of a balance, as `solve`; None where Newton's method fails."""
        end = self.solve(balance, start, most)
        return State(end.evaluation, final_history(balance, end.evaluation), parameter) if end.converged else None

    def solve_bordered(
        self, problem: BorderedProblem, start: FloatArray, values: FloatArray, most: int | None = None
    ) -> Bordered | None:
        """Solve a balance with k further unknowns and equations, as `solve`; None where Newton's method fails.

        values (k,): first values of the further unknowns.
        """
        size, last = start.size, None

        def evaluate(unknown: FloatArray) -> Bordered:
            return problem.evaluate(unknown[:size].reshape(start.shape), unknown[size:])

        def direction(here: Bordered) -> FloatArray:
            nonlocal last
            self.budget.check_time()
            step, last = bordered_step(problem, here, self.solver, self._forcing(here.scaled_residual()))
            return step

        end = solve_newton(evaluate, direction, np.concatenate([start.ravel(), values]), self.tolerance, most)
        self.budget.iterations += end.iterations
        return replace(end.evaluation, reduced=last) if end.converged else None

    def step(self, balance: Balance, at: Evaluation, right: FloatArray, rtol: float = FORCING) -> FloatArray:
        """Step (n_rel, m), N, with Jacobian times step = right (n_rel, m), N, in a state, to a relative residual."""
        return self.solver.solve(balance.linearise(at), right, rtol)

    def move(self, old: Case, joint: Joint, state: State) -> State | None:
        """The state of a case with the harmonics and samples of another joint; None where it is not found."""
        balance, start = transfer(old, joint, state.evaluation)
        return self.fresh().state(balance, start, state.parameter)

    def _forcing(self, residual: float) -> float:
        """Relative residual of a direction: no more accurate than the tolerance needs."""
        return max(FORCING, 0.1 * self.tolerance / max(residual, self.tolerance))

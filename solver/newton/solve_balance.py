"""Newton's method on a harmonic balance, and the budget of a computation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from solver.clock import computing_time
from solver.harmonic_balance.converged import PathPoint, final_history
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.harmonic_balance.prolongation import transfer
from solver.model import FloatArray
from solver.newton.iteration import NewtonResult, solve_newton
from solver.newton.journal import Journal
from solver.newton.linear_solver import JacobianSolver
from solver.newton.options import NEWTON
from solver.packing import packable
from solver.structure.joint import Case, Joint

T = TypeVar("T")


def _silent(_: str) -> None:
    """Report no progress."""


@dataclass
class Budget:
    """Budget of one computation with all its parts.

    iterations: Newton iterations so far.
    limit: iterations after which the search along a branch ends.
    deadline: CPU time of the thread, s, after which the whole computation ends.
    tell: called with a description of the progress, in words, at every change.
    journal: results of the computation for a later run, where the computation can be interrupted.
    """

    iterations: int = 0
    limit: float = np.inf
    deadline: float = np.inf
    tell: Callable[[str], None] = _silent
    journal: Journal | None = None

    @property
    def exhausted(self) -> bool:
        """Whether the limit is passed and no new step may begin."""
        return self.iterations > self.limit

    def check_time(self) -> None:
        """Raise OutOfTimeError after the deadline."""
        if self.deadline < np.inf and computing_time() > self.deadline:
            raise OutOfTimeError

    def once(self, solver: JacobianSolver, compute: Callable[[], T], fits: Callable[[object], bool]) -> T:
        """Result of a computation with a solver, as `Journal.once`."""
        return compute() if self.journal is None else self.journal.once(solver, compute, fits)


@packable
@dataclass(frozen=True)
class _Solved:
    """A `NewtonResult` without its evaluation, as a journal holds it."""

    converged: bool
    unknown: FloatArray
    iterations: int


class OutOfTimeError(Exception):
    """A computation has used up its CPU time; the caller turns this error into an outcome."""


def solve_balance(
    balance: Balance,
    start: FloatArray,
    solver: JacobianSolver,
    tolerance: float,
    budget: Budget,
    most: int | None = None,
) -> NewtonResult[Evaluation]:
    """Solve Eq. (8) of one balance, with an implicit step Eq. (26), by Newton's method on the exact Jacobian, Eq. (16).

    Parameters
    ----------
    balance : Balance
        The problem.
    start : array (n_rel, 2H+1)
        First predicted force, N.
    solver : JacobianSolver
        Keeps its factorisation from one solve to the next.
    tolerance : float
        Tolerance of the scaled residual, dimensionless.
    budget : Budget
        Counts the iterations.
    most : int, optional
        Most iterations, `NEWTON.iterations` by default.

    Raises
    ------
    OutOfTimeError
        After the deadline of the budget.
    """

    def direction(at: Evaluation) -> FloatArray:
        budget.check_time()
        # a direction no more accurate than the tolerance needs
        rtol = max(NEWTON.forcing, 0.1 * tolerance / max(at.scaled_residual(), tolerance))
        return solver.solve(balance.linearise(at), -at.residual, rtol)

    ends: list[NewtonResult[Evaluation]] = []

    def newton() -> _Solved:
        end = solve_newton(balance.evaluate, direction, start, tolerance, most)
        if not end.unknown.flags.c_contiguous:
            # evaluated from the memory layout that an unknown from a journal has
            unknown = np.ascontiguousarray(end.unknown)
            end = replace(end, unknown=unknown, evaluation=balance.evaluate(unknown))
        ends.append(end)
        return _Solved(end.converged, end.unknown, end.iterations)

    def solves(known: object) -> bool:
        if not isinstance(known, _Solved) or known.unknown.shape != start.shape:
            return False
        ends.append(NewtonResult(known.converged, known.unknown, balance.evaluate(known.unknown), known.iterations))
        return not known.converged or ends[-1].evaluation.scaled_residual() <= 2.0 * tolerance

    budget.iterations += budget.once(solver, newton, solves).iterations
    return ends[-1]


def solve_linearised(
    balance: Balance, at: Evaluation, right: FloatArray, solver: JacobianSolver, budget: Budget
) -> FloatArray:
    """Step (n_rel, m), N, with Jacobian times step = right (n_rel, m), N, in a state of a balance."""

    def step() -> FloatArray:
        return np.ascontiguousarray(solver.solve(balance.linearise(at), right))

    return budget.once(solver, step, lambda known: isinstance(known, np.ndarray) and known.shape == right.shape)


def move_point(old: Case, case: Case, joint: Joint, point: PathPoint, budget: Budget) -> PathPoint | None:
    """The state with the harmonics and samples of another case; joint: of this case. None where not found."""
    balance, start = transfer(old, joint, point.evaluation)
    result = solve_balance(balance, start, JacobianSolver(), case.settings.tolerance, budget)
    if not result.converged:
        return None
    return PathPoint(point.parameter, result.evaluation, final_history(balance, result.evaluation))

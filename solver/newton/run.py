"""Newton's method, and a computation with its tolerance and limits: `Run`, the one way to a state of a balance.

A balance may have k further unknowns q and k further equations, R(p, q) = 0 and e(p, q) = 0 (`Bordered`): the parameter
of an arc-length step, the frequency at a given phase lag, frequency, damping and drive of a nonlinear mode.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, TypeVar

import numpy as np

from solver.clock import computing_time
from solver.harmonic_balance.dlft import Balance, Evaluation, Linearisation
from solver.harmonic_balance.state import Failure, State, state_of, transfer
from solver.model import FloatArray
from solver.newton.linear_solver import FORCING, JacobianSolver
from solver.outcome import Outcome, describe_error, is_machine_fault
from solver.settings import Resolution
from solver.structure.fourier import build_basis
from solver.structure.joint import Case, Joint
from solver.structure.schur import SingularStructureError

MOST_ITERATIONS = 30
"""Most iterations of one solve: 2 to 5 are needed from a near state. With 20 and 60 slider, blocks, waves and impacts
are equal."""

FULL_STEPS = 6
"""Full steps in a row without a new lowest residual before steps are halved. Half and twice as many: equal states, and
up to 20 % more iterations with impacts."""

SHORTEST_STEP = 1.0 / 128.0
"""Shortest step as a fraction of the full step: six halvings. With five one of 60 random scenes gets no accurate
state. Also the shortest natural step over the range to the target, the shortest Euler step on the slow time over the
wanted one, the shortest relaxation step in periods, and the length to which a fold is located over its step."""

SAMPLES_OF_SIGN = 16
"""Samples over those of a state that is unstable with fewer: the sign of the determinant may turn where many pairs slip
and open. Underplatform damper of nodal diameter 2, 30 stable states from 273.7 Hz on: 128 samples find four unstable,
512 none. Dovetail, nodal diameter 3, 1.5 N: unstable with 64 to 320 samples, stable with 384 to 4096. Of 36 histories
of waves (`tests.benchmarks.error_bars --diameter 3 7`) two more are lost where fewer samples are asked alone."""


@dataclass(frozen=True)
class Bordered:
    """Balance and evaluation at values of the further unknowns (k,), with the errors (k,) of the further equations, 1.

    reduced: that of the last `bordered_step`; None without one. extra: what the problem needs again.
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


EvaluationT = TypeVar("EvaluationT", Evaluation, Bordered)
T = TypeVar("T")


def solve_newton(
    evaluate: Callable[[FloatArray], EvaluationT],
    direction: Callable[[EvaluationT], FloatArray],
    start: FloatArray,
    tolerance: float,
    most: int = MOST_ITERATIONS,
) -> tuple[EvaluationT | None, int]:
    """Iterate `x <- x + t direction(x)` from `start` until the scaled residual is at most the tolerance. Returns the
    evaluation of the solution, None where none is found, and the number of iterations, of a lost search the most.

    The residual is piecewise smooth. A full step that raises it often ends in the piece with the solution. So full
    steps come first, as long as the lowest norm is improved once in `FULL_STEPS` iterations. Then the iteration returns
    to the best point and halves its steps until the norm falls.
    """
    unknown, current = start, evaluate(start)
    best, best_norm, since_best = (unknown, current), np.inf, 0
    cutting = False
    for iteration in range(most + 1):
        norm = current.scaled_residual()
        if norm <= tolerance:
            return current, iteration
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
                return None, most
            trial = evaluate(unknown + length * step)
        unknown, current = unknown + length * step, trial
    return None, most


class BorderedProblem(Protocol):
    """A balance with further unknowns and equations."""

    def evaluate(self, predicted_h: FloatArray, values: FloatArray) -> Bordered:
        """Both residuals at a predicted force (n_rel, m), N, and values (k,)."""

    def by_values(self, here: Bordered) -> tuple[list[FloatArray], FloatArray]:
        """Derivatives by the values at a fixed predicted force: k times (n_rel, m) of the residual, N; (k, k)."""

    def by_step(self, here: Bordered, tangent: Linearisation, step: FloatArray) -> FloatArray:
        """Change (k,) of the errors with a step (n_rel, m), N, of the predicted force."""

    def fraction(self, _: Bordered, __: FloatArray, /) -> float:
        """Fraction of a Newton step, with a change (k,) of the values, that is taken: NaN to give up."""
        return 1.0


def bordered_step(
    problem: BorderedProblem, here: Bordered, solver: JacobianSolver, residual: float
) -> tuple[FloatArray, FloatArray]:
    """Newton step of all unknowns (n_rel m + k,), and the derivative (k, k) of the errors by the values, p eliminated.

    With the Jacobian J = dR/dp, J a = -R and J B = -dR/dq (Govaerts, Numerical Methods for Bifurcations of Dynamical
    Equilibria, 2000, section 3.6):

        (de/dq + de/dp B) dq = -e - de/dp a,      dp = a + B dq.

    residual: relative one of the linear solves.
    """
    tangent = here.balance.linearise(here.at)
    slopes, by_values = problem.by_values(here)
    rights = np.array([-here.at.residual, *(-slope for slope in slopes)])
    steps = solver.solve(tangent, rights, residual)
    own, *others = (problem.by_step(here, tangent, step) for step in steps)
    reduced = by_values + np.stack(others, axis=1)
    if not np.isfinite(reduced).all():
        return np.full(here.at.residual.size + len(here.values), np.nan), reduced
    change = np.asarray(np.linalg.lstsq(reduced, -here.errors - own)[0])
    step, right = (np.tensordot(np.append(1.0, change), parts, 1) for parts in (steps, rights))
    # the steps may cancel each other, not so their errors
    left = right - tangent.apply(step)
    if np.linalg.norm(left) > residual * np.linalg.norm(here.at.residual):
        step = step + solver.solve(tangent, [left])[0]
    return problem.fraction(here, change) * np.concatenate([step.ravel(), change]), reduced


class OutOfTimeError(Exception):
    """A computation has used up its CPU time."""


@dataclass
class Budget:
    """Limits of a computation: Newton iterations so far, and those after which no new step of a search begins.

    deadline: CPU time of the thread, s, after which all ends. report: called with the progress in words.
    """

    iterations: int = 0
    most_iterations: float = np.inf
    deadline: float = np.inf
    report: Callable[[str], None] = lambda _: None

    @property
    def exhausted(self) -> bool:
        """Whether no new step may begin."""
        return self.iterations > self.most_iterations


@dataclass
class Run:
    """The solves of a computation. Each raises OutOfTimeError after the deadline of the budget, which all parts share.

    tolerance: of the scaled residual. solver: keeps a factorisation.
    """

    tolerance: float
    budget: Budget = field(default_factory=Budget)
    solver: JacobianSolver = field(default_factory=JacobianSolver, repr=False)

    def fresh(self) -> "Run":
        """A part of the computation whose results do not depend on an earlier factorisation."""
        return Run(self.tolerance, self.budget)

    def with_tolerance(self, tolerance: float) -> "Run":
        """The same run with another tolerance."""
        return replace(self, tolerance=tolerance)

    def state(
        self, balance: Balance, start: FloatArray, parameter: float = np.nan, most: int = MOST_ITERATIONS
    ) -> State | None:
        """The state of a balance, Eq. (8), in an implicit step Eq. (26), by Newton's method on the exact Jacobian,
        Eq. (16); None where it fails. start (n_rel, 2H+1): first predicted force, N. most: iterations.
        """

        def direction(at: Evaluation, residual: float) -> FloatArray:
            return np.asarray(self.steps(balance, at, [-at.residual], residual)[0])

        at = self._iterate(balance.evaluate, direction, start, most)
        return None if at is None else state_of(balance.joint, at, parameter)

    def solve_bordered(
        self, problem: BorderedProblem, start: FloatArray, values: FloatArray, most: int = MOST_ITERATIONS
    ) -> Bordered | None:
        """A state with further equations, as `state`, from first values (k,) of the further unknowns."""
        last: FloatArray | None = None

        def evaluate(unknown: FloatArray) -> Bordered:
            return problem.evaluate(unknown[: start.size].reshape(start.shape), unknown[start.size :])

        def direction(here: Bordered, residual: float) -> FloatArray:
            nonlocal last
            step, last = bordered_step(problem, here, self.solver, residual)
            return step

        end = self._iterate(evaluate, direction, np.concatenate([start.ravel(), values]), most)
        return None if end is None else replace(end, reduced=last)

    def _iterate(
        self,
        evaluate: Callable[[FloatArray], EvaluationT],
        direction: Callable[[EvaluationT, float], FloatArray],
        start: FloatArray,
        most: int,
    ) -> EvaluationT | None:
        """`solve_newton` within the budget; direction: of an evaluation, and the relative residual of its solve."""

        def within_time(at: EvaluationT) -> FloatArray:
            if self.budget.deadline < np.inf and computing_time() > self.budget.deadline:
                raise OutOfTimeError
            # no more accurate than the tolerance needs
            return direction(at, max(FORCING, 0.1 * self.tolerance / max(at.scaled_residual(), self.tolerance)))

        # an iteration that diverges ends by its residual, without a warning of numpy
        with np.errstate(over="ignore", invalid="ignore"):
            found, iterations = solve_newton(evaluate, within_time, start, self.tolerance, most)
        self.budget.iterations += iterations
        return found

    def steps(
        self, balance: Balance, at: Evaluation, rights: Sequence[FloatArray] | FloatArray, residual: float = FORCING
    ) -> FloatArray:
        """Steps (k, n_rel, m), N, with Jacobian times step = right (n_rel, m), N, in a state; as `JacobianSolver`."""
        return self.solver.solve(balance.linearise(at), rights, residual)

    def is_stable(self, joint: Joint, at: Evaluation) -> bool:
        """False where a state has an odd number of real Floquet multipliers beyond +1 (`solver.stability.floquet`) at
        its wear depth, as the vibration is fast and the wear is slow; with more samples, too (`SAMPLES_OF_SIGN`).
        """
        if self.solver.determinant_sign(Balance(joint, at.start_history, energy=at.energy).linearise(at)) >= 0.0:
            return True
        # the predicted force of masses on rigid ground depends on the length of a sample
        if joint.law.rate_dependent:
            return False
        finer = replace(joint, basis=build_basis(joint.basis.orders, SAMPLES_OF_SIGN * joint.basis.n_samples))
        sampled = Balance(finer, at.start_history, at.wear_depth, energy=at.energy)
        tangent = sampled.linearise(sampled.evaluate(at.predicted_h))
        return bool(JacobianSolver().determinant_sign(tangent) >= 0.0)

    def move(self, case: Case, state: State, resolution: Resolution, *, with_tail: bool = False) -> State | None:
        """The state of a case with other harmonics and samples, as `transfer`; None where not found."""
        joint = replace(state, resolution=resolution).joint(case)
        balance, start = transfer(case, state, joint, with_tail=with_tail)
        return self.fresh().state(balance, start, state.parameter)


def guarded(compute: Callable[[], T]) -> T | Failure:
    """Result of a computation, or its error as a failure; a fault of the machine is none, and is raised."""
    try:
        return compute()
    except SingularStructureError as error:
        return Failure(Outcome.SINGULAR, str(error))
    except OutOfTimeError:
        return Failure(Outcome.TIME_LIMIT, "the CPU time of solver.time_limit is over")
    except Exception as error:
        if is_machine_fault(error):
            raise
        # an error spoils one point only: the study goes on
        return Failure(Outcome.EXCEPTION, describe_error(error))

"""The equations of a nonlinear mode, and Newton's method on these equations.

The unknowns are the predicted force p of the harmonic balance, the frequency omega, the damping ratio zeta and the
drive Q. The equations are the harmonic balance of the modal model (`modal_model`), `R(p, omega, zeta, Q) = 0`, and

    Re q = Q,      Im q = 0,      x_1^H M x_1 = a^2.

The first two say that the spring on the modal coordinate has no force, and fix the phase; the last one is the given
amplitude a. Newton's method eliminates p: the solver of the Jacobian dR/dp gives the step of p for each of the three
other unknowns, and a system of three equations remains.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.harmonic_balance.converged import PathPoint, final_history
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.harmonic_balance.prolongation import transfer
from solver.model import ComplexArray, FloatArray, ReducedModel
from solver.modes.modal_model import FirstHarmonic, LinearMode, first_harmonic, modal_model
from solver.modes.options import MODES
from solver.newton.iteration import solve_newton
from solver.newton.linear_solver import JacobianSolver
from solver.newton.options import NEWTON
from solver.newton.solve_balance import Budget
from solver.options import COMMON
from solver.settings import Resolution
from solver.structure.fourier import to_complex
from solver.structure.joint import Case, Joint


@dataclass(frozen=True)
class ModeState:
    """A point of a nonlinear mode.

    - amplitude: a, m sqrt(kg).
    - omega: rad/s. damping_ratio: zeta. drive: Q, m sqrt(kg).
    - point: periodic state of the modal model; its parameter is the amplitude.
    - shape (n,): x_1 of all displacements, m.
    """

    amplitude: float
    omega: float
    damping_ratio: float
    drive: float
    point: PathPoint
    shape: ComplexArray

    @property
    def values(self) -> FloatArray:
        """Frequency, damping ratio and drive (3,)."""
        return np.array([self.omega, self.damping_ratio, self.drive])


@dataclass(frozen=True)
class ModeEvaluation:
    """Residual of the equations of a mode.

    - at: evaluation of the harmonic balance. balance: this balance.
    - errors (3,): of the three further equations, over the amplitude, dimensionless.
    - values (3,): frequency, damping ratio and drive.
    - first: displacements of harmonic 1. shape (n,): x_1, m.
    """

    at: Evaluation
    balance: Balance
    errors: FloatArray
    values: FloatArray
    first: FirstHarmonic
    shape: ComplexArray

    @property
    def scale(self) -> tuple[float, float]:
        """As in Evaluation."""
        return self.at.scale

    def scaled_residual(self, scale: tuple[float, float] | None = None) -> float:
        """Norm of the residual, dimensionless."""
        return float(np.hypot(self.at.scaled_residual(scale), np.linalg.norm(self.errors)))


@dataclass(frozen=True)
class ModeProblem:
    """The joint whose mode is sought.

    - model: the model, without the spring on the modal coordinate.
    - mode: the linear mode from which the nonlinear one begins.
    - case: case of the modal model, with harmonics and samples; its damping is replaced.
    """

    model: ReducedModel
    mode: LinearMode
    case: Case

    def case_at(self, omega: float, damping_ratio: float) -> Case:
        """Case of the modal model at a frequency, rad/s, and a damping ratio."""
        model = modal_model(self.model, self.mode, 2.0 * damping_ratio * omega)
        return replace(self.case, model=model, _structures={})

    def joint_of(self, state: ModeState) -> Joint:
        """Joint of a state."""
        return self.case_at(state.omega, state.damping_ratio).joint(state.omega, state.drive)

    def at(self, resolution: Resolution) -> ModeProblem:
        """The problem with other harmonics and samples."""
        return replace(self, case=self.case.at(resolution))

    def evaluate(
        self, predicted_h: FloatArray, values: FloatArray, amplitude: float, history: FloatArray
    ) -> ModeEvaluation:
        """Residual at a predicted force (n_rel, 2H+1), N, and (frequency, damping ratio, drive).

        amplitude: a, m sqrt(kg). history (n_contact, 2): m.
        """
        omega, damping_ratio, drive = map(float, values)
        case = self.case_at(omega, damping_ratio)
        joint = case.joint(omega, drive)
        balance = Balance.frozen(joint, history, np.zeros(self.model.contact.n_contact))
        at = balance.evaluate(predicted_h)
        first = first_harmonic(case.model, self.mode, omega, drive)
        shape = first.shape(to_complex(joint.to_relative(at.displacement_h))[:, 0])
        coordinate = first.coordinate(shape)
        errors = np.array(
            [
                (coordinate.real - drive) / amplitude,
                coordinate.imag / amplitude,
                0.5 * ((first.amplitude(shape) / amplitude) ** 2 - 1.0),
            ]
        )
        return ModeEvaluation(at, balance, errors, values, first, shape)

    def solve(
        self,
        amplitude: float,
        predicted_h: FloatArray,
        values: FloatArray,
        history: FloatArray,
        solver: JacobianSolver,
        tolerance: float,
        budget: Budget,
        most: int | None = None,
    ) -> ModeState | None:
        """The mode at an amplitude; None where Newton's method fails.

        Parameters
        ----------
        amplitude : float
            a, m sqrt(kg).
        predicted_h, values : array (n_rel, 2H+1), array (3,)
            First predicted force, N, and first frequency, damping ratio and drive.
        history : array (n_contact, 2)
            Tangential history, m.
        solver, tolerance, budget, most
            As in `solve_balance`.
        """
        n_forces, shape = predicted_h.size, predicted_h.shape

        def evaluate(unknown: FloatArray) -> ModeEvaluation:
            return self.evaluate(unknown[:n_forces].reshape(shape), unknown[n_forces:], amplitude, history)

        def direction(at: ModeEvaluation) -> FloatArray:
            budget.check_time()
            return self._step(at, amplitude, history, solver)

        start = np.concatenate([predicted_h.ravel(), values])
        end = solve_newton(evaluate, direction, start, tolerance, most)
        budget.iterations += end.iterations
        found = end.evaluation
        omega, damping_ratio, drive = map(float, found.values)
        # zeta goes to infinity where friction stops a mass for good: with few harmonics there are further states
        if not end.converged or abs(damping_ratio) > 1.0:
            return None
        point = PathPoint(amplitude, found.at, final_history(found.balance, found.at))
        return ModeState(amplitude, omega, damping_ratio, drive, point, found.shape)

    def _step(self, here: ModeEvaluation, amplitude: float, history: FloatArray, solver: JacobianSolver) -> FloatArray:
        """Newton step of all unknowns."""
        tangent, joint = here.balance.linearise(here.at), here.balance.joint
        values = here.values
        lengths = COMMON.difference * np.array([values[0], 1.0, amplitude])
        rights, errors = [-here.at.residual], [np.zeros(3)]
        for place, length in enumerate(lengths):
            moved = values.copy()
            moved[place] += length
            ahead = self.evaluate(here.at.predicted_h, moved, amplitude, history)
            rights.append((here.at.residual - ahead.at.residual) / length)
            errors.append((ahead.errors - here.errors) / length)
        steps = [solver.solve(tangent, right) for right in rights]
        changes = []
        for step, own in zip(steps, errors, strict=True):
            motion = joint.to_relative(tangent.transmit(step)[0])
            turned = here.first.motion @ to_complex(motion)[:, 0]
            coordinate = here.first.coordinate(turned)
            grown = float(np.real(np.vdot(here.shape, here.first.mass @ turned))) / amplitude
            changes.append(own + np.array([coordinate.real, coordinate.imag, grown]) / amplitude)
        matrix = np.stack(changes[1:], axis=1)
        change = np.linalg.lstsq(matrix, -here.errors - changes[0])[0]
        largest = max(abs(change[0]) / values[0], abs(change[1]))
        weights = np.append(1.0, change)
        predicted, right = (np.tensordot(weights, np.array(parts), 1) for parts in (steps, rights))
        # the steps may cancel each other, not so their errors
        left = right - tangent.apply(predicted)
        if np.linalg.norm(left) > NEWTON.forcing * np.linalg.norm(here.at.residual):
            predicted = predicted + solver.solve(tangent, left)
        step = np.concatenate([predicted.ravel(), change])
        return np.asarray(step * min(1.0, MODES.largest_change / max(largest, 1e-300)))

    def move(self, state: ModeState, other: ModeProblem, budget: Budget, tolerance: float) -> ModeState | None:
        """The mode with the harmonics and samples of another problem; None where it is not found."""
        joint = other.case_at(state.omega, state.damping_ratio).joint(state.omega, state.drive)
        balance, start = transfer(self.case, joint, state.point.evaluation)
        return other.solve(state.amplitude, start, state.values, balance.history, JacobianSolver(), tolerance, budget)

"""The equations of a nonlinear mode: a harmonic balance with three further unknowns and equations.

The further unknowns (`solver.newton.bordering`) are the frequency omega, the damping ratio zeta and the drive Q of the
modal model (`modal_model`), the further equations

    Re q = Q,      Im q = 0,      x_1^H M x_1 = a^2.

The first two say that the spring on the modal coordinate has no force, and fix the phase; the last one is the given
amplitude a.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.harmonic_balance.dlft import Balance, Linearisation
from solver.harmonic_balance.prolongation import transfer
from solver.harmonic_balance.state import State, final_history
from solver.model import ComplexArray, FloatArray, ReducedModel
from solver.modes.modal_model import FirstHarmonic, LinearMode, first_harmonic, modal_model
from solver.modes.options import MODES
from solver.newton.bordering import Bordered
from solver.newton.run import Run
from solver.packing import packable
from solver.settings import DIFFERENCE, Resolution
from solver.structure.fourier import to_complex
from solver.structure.joint import Case, Joint


@packable
@dataclass(frozen=True)
class ModeState:
    """A point of a nonlinear mode.

    - parameter: amplitude a, m sqrt(kg).
    - omega: rad/s. damping_ratio: zeta. drive: Q, m sqrt(kg).
    - state: periodic state of the modal model.
    - shape (n,): x_1 of all displacements, m.
    """

    parameter: float
    omega: float
    damping_ratio: float
    drive: float
    state: State
    shape: ComplexArray

    @property
    def values(self) -> FloatArray:
        """Frequency, damping ratio and drive (3,)."""
        return np.array([self.omega, self.damping_ratio, self.drive])


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

    def joint_of(self, at: ModeState) -> Joint:
        """Joint of a point."""
        return self.case_at(at.omega, at.damping_ratio).joint(at.omega, at.drive)

    def at(self, resolution: Resolution) -> ModeProblem:
        """The problem with other harmonics and samples."""
        return replace(self, case=self.case.at(resolution))

    def solve(
        self,
        amplitude: float,
        start: FloatArray,
        values: FloatArray,
        history: FloatArray,
        run: Run,
        most: int | None = None,
    ) -> ModeState | None:
        """The mode at an amplitude; None where Newton's method fails.

        Parameters
        ----------
        amplitude : float
            a, m sqrt(kg).
        start, values : array (n_rel, 2H+1), array (3,)
            First predicted force, N, and first frequency, damping ratio and drive.
        history : array (n_contact, 2)
            Tangential history, m.
        run, most
            As in `Run.solve`.
        """
        found = run.solve_bordered(_AtAmplitude(self, amplitude, history), start, values, most)
        # zeta goes to infinity where friction stops a mass for good: with few harmonics there are further states
        if found is None or abs(found.values[1]) > 1.0:
            return None
        omega, damping_ratio, drive = map(float, found.values)
        state = State(found.at, final_history(found.balance, found.at), amplitude)
        return ModeState(amplitude, omega, damping_ratio, drive, state, found.extra.shape)

    def move(self, at: ModeState, other: ModeProblem, run: Run) -> ModeState | None:
        """The mode with the harmonics and samples of another problem; None where it is not found."""
        joint = other.case_at(at.omega, at.damping_ratio).joint(at.omega, at.drive)
        balance, start = transfer(self.case, joint, at.state.evaluation)
        return other.solve(at.parameter, start, at.values, balance.history, run.fresh())


@dataclass(frozen=True)
class _First:
    """Displacements of harmonic 1 at an evaluation. shape (n,): x_1, m."""

    harmonic: FirstHarmonic
    shape: ComplexArray


@dataclass(frozen=True)
class _AtAmplitude:
    """The equations at an amplitude, m sqrt(kg), with a tangential history (n_contact, 2), m. Errors over the
    amplitude.
    """

    problem: ModeProblem
    amplitude: float
    history: FloatArray

    def evaluate(self, predicted_h: FloatArray, values: FloatArray) -> Bordered:
        """As in BorderedProblem; values: frequency, damping ratio and drive."""
        omega, damping_ratio, drive = map(float, values)
        case = self.problem.case_at(omega, damping_ratio)
        joint = case.joint(omega, drive)
        balance = Balance(joint, self.history, np.zeros(self.problem.model.contact.n_contact))
        at = balance.evaluate(predicted_h)
        first = first_harmonic(case.model, self.problem.mode, omega, drive)
        shape = first.shape(to_complex(joint.to_relative(at.displacement_h))[:, 0])
        coordinate = first.coordinate(shape) / self.amplitude
        grown = 0.5 * ((first.amplitude(shape) / self.amplitude) ** 2 - 1.0)
        errors = np.array([coordinate.real - drive / self.amplitude, coordinate.imag, grown])
        return Bordered(balance, at, values, errors, extra=_First(first, shape))

    def by_values(self, here: Bordered) -> tuple[list[FloatArray], FloatArray]:
        """As in BorderedProblem, by differences."""
        slopes, errors = [], []
        lengths = DIFFERENCE * np.array([here.values[0], 1.0, self.amplitude])
        for step, length in zip(np.diag(lengths), lengths, strict=True):
            ahead = self.evaluate(here.at.predicted_h, here.values + step)
            slopes.append((ahead.at.residual - here.at.residual) / length)
            errors.append((ahead.errors - here.errors) / length)
        return slopes, np.stack(errors, axis=1)

    def by_step(self, here: Bordered, tangent: Linearisation, step: FloatArray) -> FloatArray:
        """As in BorderedProblem."""
        first: _First = here.extra
        motion = here.balance.joint.to_relative(tangent.transmit(step)[0])
        turned = first.harmonic.motion @ to_complex(motion)[:, 0]
        coordinate = first.harmonic.coordinate(turned)
        grown = float(np.real(np.vdot(first.shape, first.harmonic.mass @ turned))) / self.amplitude
        return np.array([coordinate.real, coordinate.imag, grown]) / self.amplitude

    def fraction(self, here: Bordered, _: FloatArray, change: FloatArray) -> float:
        """Frequency and damping ratio change by a limited amount."""
        largest = max(abs(change[0]) / here.values[0], abs(change[1]))
        return float(min(1.0, MODES.largest_change / max(largest, 1e-300)))

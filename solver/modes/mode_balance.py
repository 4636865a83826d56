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
from solver.model import ComplexArray, FloatArray, LinearModel, ReducedModel
from solver.modes.modal_model import LinearMode, modal_model
from solver.newton.bordering import Bordered
from solver.newton.run import Run
from solver.packing import packable
from solver.settings import DIFFERENCE, Resolution
from solver.structure.condensation import relative_indices, whole_motion
from solver.structure.fourier import to_complex
from solver.structure.joint import Case, Joint

LARGEST_CHANGE = 0.3
"""Largest change of the frequency (relative) and of the damping ratio in one iteration. With 0.1 and with 1 the modes
of dovetail and foot are equal."""


@packable
@dataclass(frozen=True)
class ModeState:
    """A point of a nonlinear mode.

    - parameter: amplitude a, m sqrt(kg).
    - values (3,): frequency omega, rad/s, damping ratio zeta, and drive Q, m sqrt(kg).
    - state: periodic state of the modal model.
    - shape (n,): x_1 of all displacements, m.
    """

    parameter: float
    values: FloatArray
    state: State
    shape: ComplexArray

    @property
    def omega(self) -> float:
        """Natural frequency, rad/s."""
        return float(self.values[0])

    @property
    def damping_ratio(self) -> float:
        """Damping ratio zeta."""
        return float(self.values[1])


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

    def case_of(self, values: FloatArray) -> Case:
        """Case of the modal model at a frequency, rad/s, and a damping ratio, the first two values."""
        model = modal_model(self.model, self.mode, 2.0 * float(values[1]) * float(values[0]))
        return replace(self.case, model=model, _structures={})

    def joint_of(self, values: FloatArray) -> Joint:
        """Joint of the modal model at some values (3,)."""
        return self.case_of(values).joint(float(values[0]), float(values[2]))

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
        """The mode at an amplitude a, m sqrt(kg); None where Newton's method fails.

        start (n_rel, 2H+1), N, and values (3,): first predicted force, and first frequency, damping ratio and drive.
        history (n_contact, 2): tangential history, m. run, most: as in `Run.solve`.
        """
        found = run.solve_bordered(_AtAmplitude(self, amplitude, history), start, values, most)
        # zeta goes to infinity where friction stops a mass for good: with few harmonics there are further states
        if found is None or abs(found.values[1]) > 1.0:
            return None
        state = State(found.at, final_history(found.balance, found.at), amplitude)
        return ModeState(amplitude, found.values, state, found.extra)

    def move(self, at: ModeState, other: ModeProblem, run: Run) -> ModeState | None:
        """The mode with the harmonics and samples of another problem; None where it is not found."""
        balance, start = transfer(self.case, other.joint_of(at.values), at.state.evaluation)
        return other.solve(at.parameter, start, at.values, balance.history, run.fresh())


@dataclass(frozen=True)
class _AtAmplitude:
    """The equations at an amplitude, m sqrt(kg), with a tangential history (n_contact, 2), m. Errors over the
    amplitude.
    """

    problem: ModeProblem
    amplitude: float
    history: FloatArray

    def evaluate(self, predicted_h: FloatArray, values: FloatArray) -> Bordered:
        """As in BorderedProblem; values: frequency, damping ratio and drive. extra: x_1 (n,), m."""
        joint = self.problem.joint_of(values)
        balance = Balance(joint, self.history, np.zeros(self.problem.model.contact.n_contact))
        at = balance.evaluate(predicted_h)
        shape = self._shape(joint, at.displacement_h, float(values[2]))
        coordinate, drive = self._coordinate(shape), float(values[2]) / self.amplitude
        size = float(np.real(np.vdot(shape, self._linear(joint).mass @ shape)))
        errors = np.array([coordinate.real - drive, coordinate.imag, 0.5 * (size / self.amplitude**2 - 1.0)])
        return Bordered(balance, at, values, errors, extra=shape)

    def _linear(self, joint: Joint) -> LinearModel:
        return joint.model.harmonic_structure(1)

    def _shape(self, joint: Joint, displacement_h: FloatArray, drive: float) -> ComplexArray:
        """x_1 (n,), m, of relative displacements and a drive, m sqrt(kg)."""
        linear, (relative, _) = self._linear(joint), relative_indices(joint.model.contact)
        moved = to_complex(joint.to_relative(displacement_h))[:, 0]
        return whole_motion(linear, 1j * joint.omega, relative, drive * linear.load_harmonic, moved)

    def _coordinate(self, shape: ComplexArray) -> complex:
        """Modal coordinate q of x_1 over the amplitude."""
        mode, linear = self.problem.mode, self.problem.model.harmonic_structure(1)
        return complex(np.vdot(mode.shape, linear.mass @ shape)) / self.amplitude

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
        joint = here.balance.joint
        turned = self._shape(joint, tangent.transmit(step)[0], 0.0)
        grown = float(np.real(np.vdot(here.extra, self._linear(joint).mass @ turned))) / self.amplitude**2
        coordinate = self._coordinate(turned)
        return np.array([coordinate.real, coordinate.imag, grown])

    def fraction(self, here: Bordered, _: FloatArray, change: FloatArray) -> float:
        """Frequency and damping ratio change by a limited amount."""
        largest = max(abs(change[0]) / here.values[0], abs(change[1]))
        return float(min(1.0, LARGEST_CHANGE / max(largest, 1e-300)))

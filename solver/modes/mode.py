"""A nonlinear mode: its equations at an amplitude, its way along the amplitude, and where it begins.

A harmonic balance with three further unknowns (`solver.newton.run`), the frequency omega, the damping ratio zeta and
the drive Q of the modal model (`modal_model`), and with the further equations

    Re q = Q,      Im q = 0,      x_1^H M x_1 = a^2:

the spring on the modal coordinate has no force, which also fixes the phase; and the amplitude a is given.
"""

import math
from dataclasses import dataclass, replace
from typing import ClassVar, Self, cast

import numpy as np

from solver.accuracy.refinement import refine
from solver.accuracy.resolved_state import NOTHING, Estimate, ResolvedState, shifted
from solver.contact.coulomb import SEPARATED, STICK, friction_limit
from solver.continuation.first_state import RELIEF, state_at_rest
from solver.continuation.natural import FINE_STEP, LARGEST_STEP_RATIO, NEAR_ITERATIONS
from solver.harmonic_balance.dlft import Balance, Linearisation
from solver.harmonic_balance.state import Failure, State, state_of
from solver.loading_history.path import Path
from solver.model import ComplexArray, FloatArray, ReducedModel
from solver.modes.modal_model import LinearMode, linear_mode, modal_model
from solver.newton.run import MOST_ITERATIONS, Bordered, BorderedProblem, Run
from solver.outcome import Outcome
from solver.packing import packable
from solver.results.state_report import first_motion
from solver.settings import DIFFERENCE, Resolution, SolverSettings
from solver.structure.fourier import from_complex
from solver.structure.joint import Case, Joint, build_case

FIRST_AMPLITUDE = 1e-6
"""First amplitude of a joint without static normal forces, m sqrt(kg). With 1e-3 the mode of an oscillator with a wall
is equal and takes 2 % more iterations."""

TOP_BASE = LARGEST_STEP_RATIO**2
"""Amplitudes are lowered from a power of this number, at least twice the amplitude of the point: all points with one
such power have one way. With 8 the mode of the foot is equal to 1e-8, that of the slider to 1e-13."""


@packable
@dataclass(frozen=True, kw_only=True)
class ModeState(State):
    """A point of a nonlinear mode: a periodic state of the modal model, with the amplitude a, m sqrt(kg), as parameter.

    - values (3,): frequency omega, rad/s, damping ratio zeta, and drive Q, m sqrt(kg).
    - shape (n,): x_1 of all displacements, m.
    """

    values: FloatArray
    shape: ComplexArray

    @property
    def damping_ratio(self) -> float:
        """The second of the values."""
        return float(self.values[1])


@dataclass(frozen=True)
class NonlinearMode(Path[ModeState]):
    """A mode of a joint as a path along its amplitude; lengths of steps are logarithms of the ratio of two amplitudes.

    - case: case of the modal model, with harmonics and samples; its damping is replaced.
    - model: the model, without the spring on the modal coordinate.
    - linear: the linear mode from which the nonlinear one begins.
    """

    model: ReducedModel
    linear: LinearMode
    # where a smaller ratio is needed the mode is lost; with a tenth of it modes are equal
    shortest: ClassVar[float] = FINE_STEP
    longest: ClassVar[float] = math.log(LARGEST_STEP_RATIO)

    def case_of(self, values: FloatArray) -> Case:
        """Case of the modal model at a frequency, rad/s, and a damping ratio, the first two values."""
        model = modal_model(self.model, self.linear, 2.0 * float(values[1]) * float(values[0]))
        return replace(self.case, model=model)

    def joint_with(self, values: FloatArray) -> Joint:
        """Joint of the modal model at some values (3,)."""
        return self.case_of(values).joint(float(values[0]), float(values[2]))

    def joint_of(self, state: ModeState) -> Joint:  # noqa: D102
        return self.joint_with(state.values)

    def find(
        self,
        amplitude: float,
        start: tuple[FloatArray, FloatArray],
        history: FloatArray,
        run: Run,
        most: int = MOST_ITERATIONS,
        before_t: FloatArray | None = None,
    ) -> ModeState | None:
        """The mode at an amplitude a, m sqrt(kg); None where Newton's method fails.

        start: first predicted force (n_rel, 2H+1), N, and values (3,). history, before_t: as in `Balance`.
        most: iterations.
        """
        found = run.solve_bordered(_AtAmplitude(self, amplitude, history, before_t), *start, most)
        # zeta goes to infinity where friction stops a mass for good: with few harmonics there are further states; below
        # frequency 0 there is the mode once more, backwards
        if found is None or abs(found.values[1]) > 1.0 or found.values[0] <= 0.0:
            return None
        state = state_of(found.balance.joint, found.at, amplitude)
        return ModeState(**vars(state), values=found.values, shape=found.extra)

    def ahead(self, parameter: float, length: float) -> float:  # noqa: D102
        return parameter * math.exp(length)

    def solve(self, states: tuple[ModeState, ...], target: float, run: Run) -> ModeState | None:
        """As in Path: Newton's method starts on the line through both states, or from the last one in proportion.

        Nodes, too, are solved to the tolerance of results: otherwise the dovetail comes to another branch.
        """
        here, run = states[-1], run.with_tolerance(self.case.settings.tolerance)
        history, before_t = here.next_history, here.evaluation.predicted_t
        last = here.evaluation.predicted_h
        growth = target / here.parameter
        grown = np.concatenate([last[:, :1], growth * last[:, 1:]], axis=1)
        starts = [(grown, here.values * np.array([1.0, 1.0, growth]))]
        if len(states) > 1:
            ratio = (target - here.parameter) / (here.parameter - states[-2].parameter)
            change = last - states[-2].evaluation.predicted_h
            starts.insert(0, (last + ratio * change, here.values + ratio * (here.values - states[-2].values)))
        found = (self.find(target, start, history, run, NEAR_ITERATIONS, before_t) for start in starts)
        return next((state for state in found if state is not None), None)

    def change(self, before: ModeState, after: ModeState) -> float:  # noqa: D102
        sticks = all((state.evaluation.status_t == STICK).all() for state in (before, after))
        return self.differs(before, after) / (1.0 if sticks else self.largest_change())

    def differs(self, before: ModeState, after: ModeState) -> float:
        """As in Path: of the vibrating predicted force per amplitude."""
        one, other = (state.evaluation.predicted_h[:, 1:] / state.parameter for state in (before, after))
        return float(np.linalg.norm(other - one)) / max(float(np.linalg.norm(one)), 1e-300)

    def near(self, state: ModeState, predicted_h: FloatArray, history: FloatArray, run: Run) -> ModeState | None:  # noqa: D102
        return self.find(state.parameter, (predicted_h, state.values), history, run)

    def choose(self, state: ModeState, run: Run) -> tuple[ModeState, Estimate]:  # noqa: D102
        # the error of the first response is judged in a sweep of the frequency only
        return self.refined(state, run, node=True), NOTHING

    def refined(self, state: ModeState, run: Run, *, node: bool = False, part: float = 1.0) -> ModeState:
        """The state with the harmonics that it needs for a part of rtol. node: as in `refine`."""
        settings = replace(self.case.settings, rtol=part * self.case.settings.rtol)
        chosen = refine(_resolved(replace(self, case=replace(self.case, settings=settings)), state), run, node=node)
        return cast("ModeState", chosen.point)

    def describe(self, state: ModeState) -> str:  # noqa: D102
        return f"at the modal amplitude {state.parameter:.4g} m sqrt(kg)"


@dataclass(frozen=True, kw_only=True)
class ResolvedMode(ResolvedState):
    """A point of a mode: with other harmonics at the same amplitude. As a forced state its Jacobian is nearly singular,
    for the damping of the structure is that of the mode.
    """

    mode: NonlinearMode

    def solve_at(self, resolution: Resolution, run: Run, *, with_tail: bool = False) -> "ResolvedMode | None":
        """As in ResolvedState; a mode has no start with a tail, and the other one would fail again."""
        other = self.mode.at(resolution)
        found = None if with_tail else other.moved(cast("ModeState", self.point), run)
        return None if found is None else _resolved(other, found)

    def steps_to(self, _: Resolution, run: Run) -> tuple[list[ResolvedState], bool]:
        """As in ResolvedState, by a solution two levels up: without damping the first steps towards more harmonics go
        too far.
        """
        found = self.solve_at(shifted(self.case.resolution, 2), run)
        return ([], False) if found is None else ([found], True)

    def at_rest(self, _: Run) -> Self:
        """As in ResolvedState: the mode itself says where its masses rest."""
        return self


def _resolved(mode: NonlinearMode, state: ModeState) -> ResolvedMode:
    return ResolvedMode(case=mode.case_of(state.values), point=state, mode=mode)


@dataclass(frozen=True)
class _AtAmplitude(BorderedProblem):
    """As BorderedProblem: the equations at an amplitude over the amplitude. Values: frequency, damping ratio and drive.
    Extra: x_1 (n,), m.
    """

    mode: NonlinearMode
    amplitude: float
    history: FloatArray
    before_t: FloatArray | None

    def evaluate(self, predicted_h: FloatArray, values: FloatArray) -> Bordered:
        balance = Balance(self.mode.joint_with(values), self.history, before_t=self.before_t)
        at = balance.evaluate(predicted_h)
        shape = first_motion(balance.joint, balance.joint.motion(at), float(values[2]))
        real, imaginary, square = self._products(shape, shape)
        errors = np.array([real - values[2] / self.amplitude, imaginary, 0.5 * (square - 1.0)])
        return Bordered(balance, at, values, errors, extra=shape)

    def _products(self, x: ComplexArray, other: ComplexArray) -> FloatArray:
        """Re q and Im q of x_1 `other`, m, over the amplitude, and Re x^H M other over its square."""
        moved = self.mode.model.harmonic_structure(1).mass @ other / self.amplitude
        coordinate = complex(np.vdot(self.mode.linear.shape, moved))
        return np.array([coordinate.real, coordinate.imag, np.vdot(x, moved).real / self.amplitude])

    def by_values(self, here: Bordered) -> tuple[list[FloatArray], FloatArray]:
        slopes, errors = [], []
        lengths = DIFFERENCE * np.array([here.values[0], 1.0, self.amplitude])
        for step, length in zip(np.diag(lengths), lengths, strict=True):
            ahead = self.evaluate(here.at.predicted_h, here.values + step)
            slopes.append((ahead.at.residual - here.at.residual) / length)
            errors.append((ahead.errors - here.errors) / length)
        return slopes, np.stack(errors, axis=1)

    def by_step(self, here: Bordered, tangent: Linearisation, step: FloatArray) -> FloatArray:
        return self._products(here.extra, first_motion(here.balance.joint, tangent.rest_and_motion(step)[1], 0.0))


# --- where a mode begins ---


@dataclass(frozen=True)
class Rest:
    """The joint at rest under its static load, and its mode.

    glued: whether the closed pairs of its linear mode stick; else they slide. state: with the harmonics of the mode.
    """

    mode: NonlinearMode
    glued: bool
    state: State

    @property
    def first_amplitude(self) -> float:
        """Amplitude, m sqrt(kg), of the first node: the vibration is far too small for slip or separation."""
        case, normal_force = self.mode.case, self.state.evaluation.force_h[:, 0, 0]
        limit = np.linalg.norm(friction_limit(case.model.contact.friction, normal_force))
        force = np.linalg.norm(case.joint(self.mode.linear.omega, 1.0).structure.force_h[:, 1:])
        return float(FINE_STEP * limit / force) if limit > 0.0 and force > 0.0 else FIRST_AMPLITUDE

    def raised(self, amplitude: float, run: Run) -> ModeState | None:
        """The mode at a small amplitude, m sqrt(kg), from rest or from smaller static friction forces; None if none."""
        linear = self.mode.linear
        joint = self.mode.case.joint(linear.omega, amplitude)
        start = self.state.evaluation.predicted_h.copy()
        start[:, 1:] = joint.structure.force_h[:, 1:]
        values = np.array([linear.omega, linear.damping_ratio, amplitude])
        rest, friction = self.state.next_history, self.state.evaluation.force_h[:, 1:, 0]
        histories = (joint.law.relieved(rest, fraction * friction) for fraction in (0.0, RELIEF))
        found = (self.mode.find(amplitude, (start, values), history, run.fresh()) for history in histories)
        return next((node for node in found if node is not None), None)

    def sliding(self, amplitude: float, run: Run) -> ModeState | None:
        """The mode at a large amplitude, at which the joint slides as in its linear mode; None where not found."""
        linear, dofs = self.mode.linear, self.mode.model.contact.dofs
        # the slider may need the second one
        for size in (amplitude, TOP_BASE * amplitude):
            joint = self.mode.case.joint(linear.omega, size)
            amplitudes = np.zeros((dofs.size, len(joint.basis.orders)), complex)
            amplitudes[:, 0] = np.where(dofs.ravel() >= 0, size * linear.shape[dofs.ravel()], 0.0)
            motion = from_complex(np.zeros(dofs.size), amplitudes).reshape(*dofs.shape, -1)
            start = self.state.evaluation.predicted_h + joint.to_relative(joint.law.force(motion))
            values = np.array([linear.omega, linear.damping_ratio, size])
            if found := self.mode.find(size, (start, values), self.state.next_history, run.fresh()):
                return found
        return None


def find_rest(model: ReducedModel, number: int, settings: SolverSettings, run: Run) -> Rest | Failure:
    """The joint at rest and its linear mode, or why there is none.

    number: among the linear modes with sticking pairs; of a joint with fewer such modes, among those with sliding ones.
    """
    closed, omega = np.ones(model.contact.n_contact, bool), None
    # first with all pairs closed, then with those that the static load closes
    while True:
        glued = linear_mode(model, closed, number=number)
        linear = glued or linear_mode(model, closed, sticking=False, number=number)
        if linear is None:
            return Failure(Outcome.START_FAILED, f"mode = {number}: the loaded joint has fewer linear modes")
        # without the spring on the modal coordinate the held structure is singular at its own frequency
        case = build_case(modal_model(model, linear, 0.0), omega or linear.omega, settings)
        rest = state_at_rest(case, linear.omega, run)
        if isinstance(rest, Failure):
            return rest
        if omega is not None:
            return Rest(NonlinearMode(case, model, linear), glued is not None, rest)
        closed, omega = rest.evaluation.status_t[:, 0] != SEPARATED, linear.omega

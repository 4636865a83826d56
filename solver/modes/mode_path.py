"""A nonlinear mode along its amplitude, which is raised slowly from zero, or lowered, and where the mode begins."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from solver.contact.coulomb import SEPARATED, STICK, friction_limit
from solver.continuation.first_state import RELIEF, relieved_history
from solver.continuation.natural import NEAR_ITERATIONS
from solver.continuation.static_state import predicted_at_rest, solve_static_state
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import Failure, State, history_at_rest
from solver.loading_history.path import FREE_STEP, choose_resolution, largest_change
from solver.loading_history.sweep import Step
from solver.march.steps import LARGEST_STEP_RATIO
from solver.model import FloatArray, ReducedModel
from solver.modes.modal_model import linear_mode, modal_model
from solver.modes.mode_balance import ModeProblem, ModeState
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import Resolution, SolverSettings
from solver.structure.fourier import from_complex
from solver.structure.joint import Case, build_case, friction_of_pairs

FIRST_AMPLITUDE = 1e-6
"""First amplitude of a joint without static normal forces, m sqrt(kg)."""

TOP_BASE = 4.0
"""Amplitudes are lowered from a power of this number, at least twice the amplitude of the point. All points with one
such power have one way. With 8 the mode of the foot is equal to 1e-8."""

SLIDING_STARTS = 4
"""Attempts to find a mode of a sliding joint, each at an amplitude higher by `TOP_BASE`. The slider needs two where the
amplitude is below the smallest one of its mode."""


@dataclass(frozen=True)
class ModePath:
    """The mode of a problem along its amplitude; lengths of steps are logarithms of the ratio of two amplitudes."""

    problem: ModeProblem

    @property
    def case(self) -> Case:
        """As in Path."""
        return self.problem.case

    @property
    def steps(self) -> tuple[float, float, float]:
        """As in Path: where a smaller ratio is needed the mode is lost; with a tenth of the step modes are equal."""
        shortest = math.log1p(FREE_STEP)
        return shortest, math.log(LARGEST_STEP_RATIO), shortest

    @property
    def node_tolerance(self) -> float:
        """As in Path."""
        return self.case.settings.tolerance

    def ahead(self, parameter: float, length: float) -> float:
        """As in Path."""
        return parameter * math.exp(length)

    def solve(self, states: tuple[ModeState, ...], target: float, run: Run) -> ModeState | None:
        """As in Path: Newton's method starts on the line through both states, or from the last one in proportion."""
        here, problem = states[-1], self.problem
        history, last = history_at_rest(problem.joint_of(here.values), here.state), here.state.evaluation.predicted_h
        growth = target / here.parameter
        grown = np.concatenate([last[:, :1], growth * last[:, 1:]], axis=1)
        starts = [(grown, here.values * np.array([1.0, 1.0, growth]))]
        if len(states) > 1:
            ratio = (target - here.parameter) / (here.parameter - states[-2].parameter)
            change = last - states[-2].state.evaluation.predicted_h
            starts.insert(0, (last + ratio * change, here.values + ratio * (here.values - states[-2].values)))
        for start, values in starts:
            found = problem.solve(target, start, values, history, run, NEAR_ITERATIONS)
            if found is not None:
                return found
        return None

    def rescue(self, _: ModeState, __: float, ___: Run) -> Step[ModeState] | Outcome:
        """As in Path: a mode that turns back is not followed."""
        return Outcome.BRANCH_LOST

    def change(self, before: ModeState, after: ModeState, wider: float) -> float:
        """As in Path."""
        sticks = all(bool((at.state.evaluation.status_t == STICK).all()) for at in (before, after))
        return self.differs(before, after) / largest_change(self.case.settings.rtol, wider, sticks=sticks)

    def rests(self, _: ModeState) -> bool:
        """As in Path: a mode has a reference sweep from its first amplitude on."""
        return False

    def forgets(self, _: ModeState) -> bool:
        """As in Path."""
        return False

    def differs(self, before: ModeState, after: ModeState) -> float:
        """As in Path: of the vibrating predicted force per amplitude."""
        one, other = (at.state.evaluation.predicted_h[:, 1:] / at.parameter for at in (before, after))
        return float(np.linalg.norm(other - one)) / max(float(np.linalg.norm(one)), 1e-300)

    def at(self, resolution: Resolution) -> ModePath:
        """As in Path."""
        return ModePath(self.problem.at(resolution))

    def move(self, state: ModeState, other: ModePath, run: Run) -> ModeState | None:
        """As in Path."""
        return self.problem.move(state, other.problem, run)

    def choose(self, state: ModeState, run: Run) -> tuple[ModePath, ModeState, bool, float]:
        """As in Path."""
        joint = self.problem.joint_of(state.values)
        chosen = choose_resolution(self.problem.case_of(state.values), joint, state.state, run)
        other = self.at(chosen.case.resolution)
        moved = state if chosen.case.resolution == self.case.resolution else self.move(state, other, run)
        # the error of the first response is judged in a sweep of the frequency only
        return (self, state, False, 0.0) if moved is None else (other, moved, chosen.accurate, 0.0)

    def suffices(self, _: ModeState, __: bool, ___: Run) -> bool:
        """As in Path: harmonics are chosen anew."""
        return False

    def describe(self, state: ModeState) -> str:
        """As in Path."""
        return f"at the modal amplitude {state.parameter:.4g} m sqrt(kg)"


@dataclass(frozen=True)
class Rest:
    """The joint at rest under its static load.

    - problem: the joint with the linear mode. glued: whether the closed pairs of this mode stick; else they slide.
    - state: static state with the harmonics of the problem.
    """

    problem: ModeProblem
    glued: bool
    state: State

    @property
    def first_amplitude(self) -> float:
        """Amplitude, m sqrt(kg), of the first node: the vibration is far too small for slip or separation."""
        case, normal_force = self.problem.case, self.state.evaluation.force_h[:, 0, 0]
        limit = np.linalg.norm(friction_limit(case.friction_coefficient, normal_force))
        force = np.linalg.norm(case.joint(self.problem.mode.omega, 1.0).structure.force_h()[:, 1:])
        return float(FREE_STEP * limit / force) if limit > 0.0 and force > 0.0 else FIRST_AMPLITUDE

    def raised(self, amplitude: float, run: Run) -> ModeState | None:
        """The mode at a small amplitude, m sqrt(kg), from rest; None where it is not found.

        Pairs that the static load leaves at their friction limit slip under the smallest vibration: further attempts
        begin with smaller static friction forces, as those of `first_state`.
        """
        problem, mode = self.problem, self.problem.mode
        joint = problem.case.joint(mode.omega, amplitude)
        start = self.state.evaluation.predicted_h.copy()
        start[:, 1:] = joint.structure.force_h()[:, 1:]
        values = np.array([mode.omega, mode.damping_ratio, amplitude])
        for fraction in (0.0, *RELIEF):
            history = relieved_history(joint, self.state, fraction)
            found = problem.solve(amplitude, start, values, history, run.fresh())
            if found is not None:
                return found
        return None

    def sliding(self, amplitude: float, run: Run) -> ModeState | None:
        """The mode at a large amplitude, at which the joint slides as in its linear mode; None where not found."""
        problem, mode = self.problem, self.problem.mode
        dofs = problem.model.contact.dofs
        for attempt in range(SLIDING_STARTS):
            size = amplitude * TOP_BASE**attempt
            joint = problem.case.joint(mode.omega, size)
            amplitudes = np.zeros((dofs.size, joint.basis.n_harmonics), complex)
            amplitudes[:, 0] = np.where(dofs.ravel() >= 0, size * mode.shape[dofs.ravel()], 0.0)
            motion = from_complex(np.zeros(dofs.size), amplitudes).reshape(*dofs.shape, -1)
            start = self.state.evaluation.predicted_h + joint.to_relative(joint.law.force(motion))
            values = np.array([mode.omega, mode.damping_ratio, size])
            found = problem.solve(size, start, values, self.state.history, run.fresh())
            if found is not None:
                return found
        return None


def find_rest(
    model: ReducedModel,
    friction_coefficient: float | FloatArray | None,
    number: int,
    settings: SolverSettings,
    run: Run,
) -> Rest | Failure:
    """The joint at rest and its linear mode, or why there is none.

    number: of the mode, from 1 on, among the linear modes of the joint whose closed pairs stick. A joint that has fewer
    such modes, as a mass on a rigid slider, has the mode of this number among those with sliding pairs.
    """
    friction = friction_of_pairs(model, friction_coefficient)
    closed = np.ones(model.contact.n_contact, bool)
    first = linear_mode(model, closed, friction, number=number) or linear_mode(
        model, closed, 0.0 * friction, number=number
    )
    if first is None:
        return Failure(Outcome.START_FAILED, f"mode = {number}: the joint has fewer linear modes")
    # with the spring on the modal coordinate: without the spring the held structure is singular at its own frequency
    case = build_case(modal_model(model, first, 0.0), friction_coefficient, first.omega, settings)
    static = solve_static_state(case.joint(first.omega, 0.0), np.zeros(closed.size), run)
    if isinstance(static, Outcome):
        return Failure(static)
    closed = static.evaluation.status_t[:, 0] != SEPARATED
    glued = linear_mode(model, closed, friction, number=number)
    mode = glued or linear_mode(model, closed, 0.0 * friction, number=number)
    if mode is None:
        return Failure(Outcome.START_FAILED, f"mode = {number}: under its static load the joint has fewer linear modes")
    case = build_case(modal_model(model, mode, 0.0), friction_coefficient, first.omega, settings)
    state = _at_rest(case, mode.omega, run)
    if isinstance(state, Outcome):
        return Failure(state)
    return Rest(ModeProblem(model, mode, case), glued is not None, state)


def _at_rest(case: Case, omega: float, run: Run) -> State | Outcome:
    """The static state with the harmonics of a case, or why there is none."""
    quiet, idle = case.joint(omega, 0.0), np.zeros(case.model.contact.n_contact)
    static = solve_static_state(quiet, idle, run)
    if isinstance(static, Outcome):
        return static
    start = predicted_at_rest(case, quiet, static, idle)
    return run.fresh().state(Balance(quiet, static.history, idle), start, 0.0) or Outcome.STATIC_FAILED

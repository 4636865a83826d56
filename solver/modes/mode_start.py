"""Where a nonlinear mode begins: the joint at rest under its static load, and the first point of its mode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.contact.coulomb import SEPARATED, friction_limit
from solver.continuation.first_state import relieved_history
from solver.continuation.options import CONTINUATION
from solver.continuation.static_state import predicted_at_rest, solve_static_state
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import State
from solver.loading_history.options import LOADING
from solver.model import FloatArray, ReducedModel
from solver.modes.modal_model import LinearMode, linear_mode, modal_model
from solver.modes.mode_balance import ModeProblem, ModeState
from solver.modes.options import MODES
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import SolverSettings
from solver.structure.fourier import from_complex
from solver.structure.joint import Case, build_case, friction_of_pairs


@dataclass(frozen=True)
class Rest:
    """The joint at rest under its static load.

    - problem: the joint with the linear mode. glued: whether the closed pairs of this mode stick; else they slide.
    - state: static state with the harmonics of the problem.
    """

    problem: ModeProblem
    glued: bool
    state: State


def find_rest(
    model: ReducedModel,
    friction_coefficient: float | FloatArray | None,
    number: int,
    settings: SolverSettings,
    run: Run,
) -> Rest | tuple[Outcome, str]:
    """The joint at rest and its linear mode, or the outcome and a sentence where there is none.

    number: of the mode, from 1 on, among the linear modes of the joint whose closed pairs stick. A joint that has fewer
    such modes, as a mass on a rigid slider, has the mode of this number among those with sliding pairs.
    """
    friction = friction_of_pairs(model, friction_coefficient)
    closed = np.ones(model.contact.n_contact, bool)
    first = linear_mode(model, number, closed, friction) or linear_mode(model, number, closed, 0.0 * friction)
    if first is None:
        return Outcome.START_FAILED, f"mode = {number}: the joint has fewer linear modes"
    # with the spring on the modal coordinate: without the spring the held structure is singular at its own frequency
    case = build_case(modal_model(model, first, 0.0), friction_coefficient, first.omega, settings)
    static = solve_static_state(case.joint(first.omega, 0.0), np.zeros(closed.size), run)
    if isinstance(static, Outcome):
        return static, ""
    closed = static.evaluation.status_t[:, 0] != SEPARATED
    mode, glued = linear_mode(model, number, closed, friction), True
    if mode is None:
        mode, glued = linear_mode(model, number, closed, 0.0 * friction), False
    if mode is None:
        return Outcome.START_FAILED, f"mode = {number}: under its static load the joint has fewer linear modes"
    case = build_case(modal_model(model, mode, 0.0), friction_coefficient, first.omega, settings)
    problem = ModeProblem(model, mode, case)
    state = _at_rest(case, mode, run)
    return (state, "") if isinstance(state, Outcome) else Rest(problem, glued, state)


def _at_rest(case: Case, mode: LinearMode, run: Run) -> State | Outcome:
    """The static state with the harmonics of a case, or why there is none."""
    quiet, idle = case.joint(mode.omega, 0.0), np.zeros(case.model.contact.n_contact)
    static = solve_static_state(quiet, idle, run)
    if isinstance(static, Outcome):
        return static
    still, start = Balance(quiet, static.history, idle), predicted_at_rest(case, quiet, static, idle)
    return run.fresh().state(still, start, 0.0) or Outcome.STATIC_FAILED


def first_amplitude(rest: Rest) -> float:
    """Amplitude, m sqrt(kg), of the first node: the vibration is far too small for slip or separation."""
    problem, at = rest.problem, rest.state.evaluation
    limit = np.linalg.norm(friction_limit(problem.case.friction_coefficient, at.force_h[:, 0, 0]))
    unit = problem.case.joint(problem.mode.omega, 1.0).structure.force_h()[:, 1:]
    force = np.linalg.norm(unit)
    return float(LOADING.free_step * limit / force) if limit > 0.0 and force > 0.0 else MODES.first_amplitude


def first_node(rest: Rest, amplitude: float, run: Run) -> ModeState | None:
    """The mode at a small amplitude, from rest; None where it is not found.

    Pairs that the static load leaves at their friction limit slip under the smallest vibration: further attempts begin
    with smaller static friction forces, as those of `first_state`.
    """
    problem, mode = rest.problem, rest.problem.mode
    joint = problem.case.joint(mode.omega, amplitude)
    start = rest.state.evaluation.predicted_h.copy()
    start[:, 1:] = joint.structure.force_h()[:, 1:]
    values = np.array([mode.omega, mode.damping_ratio, amplitude])
    for fraction in (0.0, *CONTINUATION.relief):
        history = relieved_history(joint, rest.state, fraction)
        found = problem.solve(amplitude, start, values, history, run.fresh())
        if found is not None:
            return found
    return None


def sliding_node(rest: Rest, amplitude: float, run: Run) -> ModeState | None:
    """The mode at a large amplitude, at which the joint slides as in its linear mode; None where not found."""
    problem, mode = rest.problem, rest.problem.mode
    dofs = problem.model.contact.dofs
    for attempt in range(MODES.sliding_starts):
        size = amplitude * MODES.top_base**attempt
        joint = problem.case.joint(mode.omega, size)
        shape = size * mode.shape
        amplitudes = np.zeros((dofs.size, joint.basis.n_harmonics), complex)
        amplitudes[:, 0] = np.where(dofs.ravel() >= 0, shape[dofs.ravel()], 0.0)
        motion = from_complex(np.zeros(dofs.size), amplitudes).reshape(*dofs.shape, -1)
        start = rest.state.evaluation.predicted_h + joint.to_relative(joint.law.force(motion))
        values = np.array([mode.omega, mode.damping_ratio, size])
        found = problem.solve(size, start, values, rest.state.history, run.fresh())
        if found is not None:
            return found
    return None

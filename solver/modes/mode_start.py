"""Where a nonlinear mode begins: at the joint at rest under its static load, or at a joint that slides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.contact.coulomb import SEPARATED, friction_limit
from solver.continuation.first_state import RELIEF, predicted_at_rest, relieved_history, solve_static_state
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import Failure, State
from solver.loading_history.path import FREE_STEP
from solver.model import FloatArray, ReducedModel
from solver.modes.modal_model import linear_mode, modal_model
from solver.modes.mode import ModeState, NonlinearMode
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import SolverSettings
from solver.structure.fourier import from_complex
from solver.structure.joint import build_case, friction_of_pairs

FIRST_AMPLITUDE = 1e-6
"""First amplitude of a joint without static normal forces, m sqrt(kg)."""

TOP_BASE = 4.0
"""Amplitudes are lowered from a power of this number, at least twice the amplitude of the point. All points with one
such power have one way. With 8 the mode of the foot is equal to 1e-8."""

SLIDING_STARTS = 4
"""Attempts to find a mode of a sliding joint, each at an amplitude higher by `TOP_BASE`. The slider needs two where the
amplitude is below the smallest one of its mode."""


@dataclass(frozen=True)
class Rest:
    """The joint at rest under its static load.

    - mode: of the joint. glued: whether the closed pairs of its linear mode stick; else they slide.
    - state: static state with the harmonics of the mode.
    """

    mode: NonlinearMode
    glued: bool
    state: State

    @property
    def first_amplitude(self) -> float:
        """Amplitude, m sqrt(kg), of the first node: the vibration is far too small for slip or separation."""
        case, normal_force = self.mode.case, self.state.evaluation.force_h[:, 0, 0]
        limit = np.linalg.norm(friction_limit(case.friction_coefficient, normal_force))
        force = np.linalg.norm(case.joint(self.mode.linear.omega, 1.0).structure.force_h()[:, 1:])
        return float(FREE_STEP * limit / force) if limit > 0.0 and force > 0.0 else FIRST_AMPLITUDE

    def raised(self, amplitude: float, run: Run) -> ModeState | None:
        """The mode at a small amplitude, m sqrt(kg), from rest; None where it is not found.

        Pairs that the static load leaves at their friction limit slip under the smallest vibration: further attempts
        begin with smaller static friction forces, as those of `first_state`.
        """
        linear = self.mode.linear
        joint = self.mode.case.joint(linear.omega, amplitude)
        start = self.state.evaluation.predicted_h.copy()
        start[:, 1:] = joint.structure.force_h()[:, 1:]
        values = np.array([linear.omega, linear.damping_ratio, amplitude])
        for fraction in (0.0, *RELIEF):
            history = relieved_history(joint, self.state, fraction)
            found = self.mode.find(amplitude, start, values, history, run.fresh())
            if found is not None:
                return found
        return None

    def sliding(self, amplitude: float, run: Run) -> ModeState | None:
        """The mode at a large amplitude, at which the joint slides as in its linear mode; None where not found."""
        linear, dofs = self.mode.linear, self.mode.model.contact.dofs
        for attempt in range(SLIDING_STARTS):
            size = amplitude * TOP_BASE**attempt
            joint = self.mode.case.joint(linear.omega, size)
            amplitudes = np.zeros((dofs.size, joint.basis.n_harmonics), complex)
            amplitudes[:, 0] = np.where(dofs.ravel() >= 0, size * linear.shape[dofs.ravel()], 0.0)
            motion = from_complex(np.zeros(dofs.size), amplitudes).reshape(*dofs.shape, -1)
            start = self.state.evaluation.predicted_h + joint.to_relative(joint.law.force(motion))
            values = np.array([linear.omega, linear.damping_ratio, size])
            found = self.mode.find(size, start, values, self.state.history, run.fresh())
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
    friction, unworn = friction_of_pairs(model, friction_coefficient), np.zeros(model.contact.n_contact)
    closed, omega = np.ones(unworn.size, bool), None
    # first with all pairs closed, then with those that the static load closes
    while True:
        glued = linear_mode(model, closed, friction, number=number)
        linear = glued or linear_mode(model, closed, unworn, number=number)
        if linear is None:
            return Failure(Outcome.START_FAILED, f"mode = {number}: the loaded joint has fewer linear modes")
        # without the spring on the modal coordinate the held structure is singular at its own frequency
        case = build_case(modal_model(model, linear, 0.0), friction_coefficient, omega or linear.omega, settings)
        quiet = case.joint(linear.omega, 0.0)
        static = solve_static_state(quiet, unworn, run)
        if isinstance(static, Outcome):
            return Failure(static)
        if omega is not None:
            break
        closed, omega = static.evaluation.status_t[:, 0] != SEPARATED, linear.omega
    start = predicted_at_rest(case, quiet, static, unworn)
    state = run.fresh().state(Balance(quiet, static.history, unworn), start, 0.0)
    if state is None:
        return Failure(Outcome.STATIC_FAILED)
    return Rest(NonlinearMode(model, linear, case), glued is not None, state)

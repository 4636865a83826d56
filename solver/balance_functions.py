"""The harmonic balance of a joint as functions of a state: residual, exact Jacobian, motion."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from solver.forced_response import check_case, check_number, worn_model
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.loading_history.start_states import follow_branch
from solver.model import FloatArray, ReducedModel
from solver.outcome import Outcome
from solver.results.history import StartState
from solver.results.state_report import PeriodicMotion, evaluated, periodic_motion
from solver.settings import Direction, SolverSettings
from solver.structure.joint import Case, build_case


@dataclass(frozen=True)
class HarmonicBalance:
    """The equations `residual(z) = 0` of the periodic states of a joint at one frequency and excitation amplitude.

    The unknown z (size,), N, has the predicted forces of the relative displacements (Eq. (10) in `solver/PHYSICS.md`),
    each with its harmonics 0, cos 1, sin 1, cos 2, ... The tangential history of the pairs is fixed.

    - frequency, excitation_amplitude: Hz, N. orders: harmonics above the static one. n_samples: samples of a period.
    - state (size,): the solution to which the sweep comes, N; NaN where none was found.
    - outcome, message: how the search for this solution ended.
    """

    frequency: float
    excitation_amplitude: float
    orders: tuple[int, ...]
    n_samples: int
    state: FloatArray
    outcome: Outcome
    message: str
    _balance: Balance = field(repr=False, compare=False)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.state.size

    def residual(self, z: ArrayLike) -> FloatArray:
        """Residual (size,), N, of Eq. (8). Raises ValueError where z has another shape, or is not finite."""
        return self._evaluate(z).residual.ravel()

    def jacobian(self, z: ArrayLike) -> FloatArray:
        """Derivative (size, size) of the residual, dimensionless, Eq. (16); errors as in `residual`.

        Exact away from states in which a sample just changes its status.
        """
        pairs = np.arange(self._balance.joint.contact.n_contact)
        return self._balance.linearise(self._evaluate(z)).dense(pairs)

    def motion(self, z: ArrayLike | None = None) -> PeriodicMotion:
        """Fourier coefficients and time signals of z, of `state` if not given; errors as in `residual`."""
        return periodic_motion(self._balance.joint, self._evaluate(self.state if z is None else z))

    def _evaluate(self, z: ArrayLike) -> Evaluation:
        given = np.array(z, np.float64)
        if given.shape != self.state.shape or not np.isfinite(given).all():
            raise ValueError(f"z: give {self.size} finite numbers in shape ({self.size},), not shape {given.shape}")
        return self._balance.evaluate(given.reshape(-1, self._balance.joint.basis.synthesis.shape[0]))


def balance_of(
    model: ReducedModel,
    frequency: float,
    excitation_amplitude: float,
    friction_coefficient: ArrayLike | None,
    *,
    sweep: Direction = "up",
    settings: SolverSettings | None = None,
    wear_depth: ArrayLike | None = None,
) -> HarmonicBalance:
    """The harmonic balance of a joint at one frequency, Hz, with its residual and exact Jacobian as functions.

    A sweep gives the harmonics where the settings leave them open, the tangential history and a solution. Where the
    sweep finds no solution, the functions are there all the same, without history.

    All other parameters and errors as in `frequency_response`.
    """
    settings = SolverSettings() if settings is None else settings
    wanted = check_number("frequency", frequency, above=0.0)
    load, friction = check_case(model, excitation_amplitude, friction_coefficient, sweep, settings)
    start, case = start_of(worn_model(model, wear_depth), friction, load, wanted, sweep, settings)
    balance, at = balance_at_start(case, start, 2.0 * np.pi * wanted, load)
    unknown = np.full((balance.joint.component_index.size, len(balance.joint.basis.synthesis)), np.nan)
    return functions_of(balance, unknown if at is None else at.predicted_h, start.outcome, start.message)


def functions_of(balance: Balance, predicted_h: FloatArray, outcome: Outcome, message: str) -> HarmonicBalance:
    """The functions of a balance, and a state of predicted forces (n_rel, 2H+1), N."""
    joint = balance.joint
    return HarmonicBalance(
        frequency=joint.omega / (2.0 * np.pi),
        excitation_amplitude=joint.excitation_amplitude,
        orders=joint.basis.orders,
        n_samples=joint.basis.n_samples,
        state=predicted_h.ravel(),
        outcome=outcome,
        message=message or ("" if outcome is Outcome.CONVERGED else outcome.sentence),
        _balance=balance,
    )


def start_of(
    model: ReducedModel,
    friction: float | FloatArray | None,
    load: float,
    frequency: float,
    sweep: Direction,
    settings: SolverSettings,
) -> tuple[StartState, Case]:
    """State to which a sweep comes at a frequency, Hz, and the case with the harmonics and samples of the state."""
    ((_, start),) = follow_branch(model, friction, load, np.array([frequency]), sweep, settings)
    fixed = replace(settings, harmonics=start.resolution.highest, samples=start.resolution.samples)
    return start, build_case(model, friction, start.penalty_omega, fixed, start.resolution)


def balance_at_start(
    case: Case, start: StartState, omega: float, excitation_amplitude: float
) -> tuple[Balance, Evaluation | None]:
    """The balance at a start state, and its evaluation; where there is no state, None and a balance without history."""
    joint, n_contact = case.joint(omega, excitation_amplitude), case.model.contact.n_contact
    if start.state is None:
        return Balance(joint, np.zeros((n_contact, 2)), np.zeros(n_contact)), None
    return evaluated(joint, start.state)

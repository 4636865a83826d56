"""Periodic states of a joint that is excited: over frequency, and one of them as equations with their Jacobian."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from solver.arguments import Progress, check_case, check_number, check_numbers, lines_to, worn_model
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.harmonic_balance.state import State, first_response, largest_responses
from solver.loading_history.start_states import FrequencySweep
from solver.model import ComplexArray, FloatArray, IntArray, ReducedModel
from solver.outcome import Ended, Outcome, check, is_known_to
from solver.presentation import Presented
from solver.results.gradient import Gradient, gradient_of
from solver.results.history import StartState, describe_cut_off, first_cut_off
from solver.results.state_report import PeriodicMotion, evaluated, periodic_motion
from solver.settings import Direction, SolverSettings
from solver.structure.joint import Case, build_case


@dataclass(frozen=True, repr=False)
class FrequencyResponse(Presented):
    """Periodic states over frequency, at `n_frequency` points, of an unworn joint or at a fixed wear depth.

    - frequency (n_frequency,): Hz, as given.
    - response (n_frequency, n_response): complex first harmonic, m; the response is Re(value exp(i omega t)).
    - response_peak (n_frequency, n_response): largest magnitude over a period, m.
    - response_error (n_frequency,): estimated relative error. NaN as the responses where no state was found.
    - outcome, message: how the computation of each point ended, and details.
    - branch, fold_frequency (n_frequency,): number of folds at which the sweep has jumped before it reached the point,
      and frequency of the last of them, Hz; NaN if there is none.
    """

    OVER = ("frequency", "frequency")
    SHOWN = ("response", "response_error", "fold_frequency")
    DRAWN = ("response",)

    frequency: FloatArray
    response: ComplexArray
    response_peak: FloatArray
    response_error: FloatArray
    outcome: tuple[Outcome, ...]
    message: tuple[str, ...]
    branch: IntArray
    fold_frequency: FloatArray


@dataclass(frozen=True)
class HarmonicBalance(Ended):
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

    def gradient(
        self, response: int = 0, *, wear_coefficient: float | None = None, contact_stiffness: ArrayLike = math.inf
    ) -> Gradient:
        """How the amplitude of a response changes with all parameters along `state`; or, where a wear coefficient is
        given, 1/Pa, the wear rate of Archard's law.

        contact_stiffness: that of the model, N/m3, one number or (n_contact,); inf for a rigid contact.
        Raises ValueError where there is no state, or a number is out of its range; numpy.linalg.LinAlgError at a fold.
        """
        n_responses, joint = len(self._balance.joint.model.response_names), self._balance.joint
        check("response", 0 <= response < n_responses, f"give 0 to {n_responses - 1}")
        if wear_coefficient is not None:
            wear_coefficient = check_number("wear_coefficient", wear_coefficient, least=0.0)
        stiffness = np.asarray(contact_stiffness, np.float64)
        right = stiffness.shape in ((), (joint.contact.n_contact,)) and bool((stiffness > 0.0).all())
        check("contact_stiffness", right, "give a number above 0, N/m3, or one of each pair")
        return gradient_of(self._balance, self._evaluate(self.state), response, wear_coefficient, stiffness)

    def _evaluate(self, z: ArrayLike) -> Evaluation:
        given = np.array(z, np.float64)
        right = given.shape == self.state.shape and np.isfinite(given).all()
        check("z", right, f"give {self.size} finite numbers in shape ({self.size},), not shape {given.shape}")
        return self._balance.evaluate(given.reshape(-1, self._balance.joint.basis.synthesis.shape[0]))


def frequency_response(
    model: ReducedModel,
    frequency: ArrayLike,
    excitation_amplitude: float,
    friction_coefficient: ArrayLike | None,
    *,
    sweep: Direction = "up",
    settings: SolverSettings | None = None,
    wear_depth: ArrayLike | None = None,
    progress: Progress | None = None,
) -> FrequencyResponse:
    """Frequency response of a joint at fixed wear depth.

    Where a point fails, its `outcome` and `message` say why. The other points are computed all the same.

    model: from `build_model`, `studies.build_scene` or `studies.read_scene`.
    frequency: (n_frequency,) or one number, Hz, in any order. The state at a frequency does not depend on the others.
    excitation_amplitude: N, multiplies the unit harmonic load of the model.
    friction_coefficient: one number for all pairs, or (n_contact,). None for a model with its own.
    sweep: way to a state: "up" or "down" along the frequency, "ramp" with rising excitation at one frequency.
    wear_depth: (n_contact,), m, of a worn joint: opens the pairs as a gap does. Unworn if not given.
    progress: called with a line from time to time, as `print`.

    Raises ValueError where a number is out of its range, where the model lacks nodal diameters that the harmonics need,
    and where friction coefficients are given twice, not at all, or not to each pair.
    """
    wanted = check_numbers("frequency", frequency, above=0.0)
    model, load, settings = check_case(model, excitation_amplitude, friction_coefficient, sweep, settings)
    model = worn_model(model, wear_depth)
    ascending, place = np.unique(wanted, return_inverse=True)
    found = dict(FrequencySweep(model, load, sweep, settings, lines_to(progress)).states(ascending))
    starts = [found[index] for index in place.tolist()]
    response, peak, outcome, message = zip(*(_read(model, settings, start) for start in starts), strict=True)
    return FrequencyResponse(
        frequency=wanted,
        response=np.array(response),
        response_peak=np.array(peak),
        response_error=np.array([math.nan if start.state is None else start.response_error for start in starts]),
        outcome=outcome,
        message=message,
        branch=np.array([start.branch for start in starts], np.int64),
        fold_frequency=np.array([start.fold_frequency for start in starts]),
    )


def _read(
    model: ReducedModel, settings: SolverSettings, start: StartState
) -> tuple[ComplexArray, FloatArray, Outcome, str]:
    """Response, peak, outcome and message of a point, as in `FrequencyResponse`."""
    state, outcome, message = start.state, start.outcome, start.message
    if state is None:
        nothing = np.full(len(model.response_names), np.nan)
        return nothing.astype(np.complex128), nothing, outcome, message
    case = build_case(model, start.penalty_omega, settings, start.resolution)
    found = evaluated(case, state)
    joint, at = found.joint(case), found.evaluation
    pressure = state.contact_force_h[:, 0, 0] / model.contact.area
    if not math.isnan(first_cut_off(model.contact, np.zeros(1), pressure[None], np.zeros_like(pressure[None]))):
        outcome, message = Outcome.CONTACT_CUT_OFF, describe_cut_off(0.0)
    elif start.unjudged:
        outcome, message = Outcome.INACCURATE, "; ".join(filter(None, (message, start.unjudged)))
    elif outcome is Outcome.CONVERGED and settings.automatic and start.response_error > settings.rtol:
        # the harmonics suffice, but not the steps of the sweep
        outcome, message = Outcome.INACCURATE, f"the response {is_known_to(start.response_error, settings.rtol)}"
    return first_response(joint, at), largest_responses(joint, at), outcome, message


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
    wanted = check_number("frequency", frequency, above=0.0)
    model, load, settings = check_case(model, excitation_amplitude, friction_coefficient, sweep, settings)
    start, _, balance, found = balance_at_start(worn_model(model, wear_depth), load, wanted, sweep, settings)
    unknown = np.full((balance.joint.component_index.size, len(balance.joint.basis.synthesis)), np.nan)
    predicted_h = unknown if found is None else found.evaluation.predicted_h
    return functions_of(balance, predicted_h, start.outcome, start.message)


def balance_at_start(
    model: ReducedModel, load: float, frequency: float, sweep: Direction, settings: SolverSettings
) -> tuple[StartState, Case, Balance, State | None]:
    """State to which a sweep comes at a frequency, Hz, as a result, and as a state of a case, with its balance. Where
    there is none, the state is None, and the balance has no history.
    """
    ((_, start),) = FrequencySweep(model, load, sweep, settings).states(np.array([frequency]))
    fixed = replace(settings, harmonics=start.resolution.highest, samples=start.resolution.samples)
    case = build_case(model, start.penalty_omega, fixed, start.resolution)
    joint = case.joint(2.0 * np.pi * frequency, load)
    if start.state is None:
        return start, case, Balance(joint, np.zeros((model.contact.n_contact, joint.law.n_history))), None
    return start, case, Balance(joint, start.state.start_history), evaluated(case, start.state)


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
        message=message,
        _balance=balance,
    )

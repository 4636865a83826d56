"""States of the textbook scenes that are known exactly, and the errors of automatic ones against them."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np

from solver.accuracy.error_estimate import Estimate
from solver.accuracy.refinement import refine
from solver.continuation.arc_length import Arc
from solver.continuation.first_state import solve_first_state
from solver.continuation.natural import follow_naturally
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import State
from solver.model import ReducedModel
from solver.newton.run import Budget, Run
from solver.settings import SolverSettings
from solver.structure.fourier import to_complex
from solver.structure.joint import Case, build_case
from tests import references
from tests.solver.models import crossings, scene

SLIDING = ("forward", "backward")
SWEEP_STEP = 0.01  # rad/s
NATURAL = float(np.sqrt(1.6e6))  # rad/s, of the slider


@dataclass(frozen=True)
class ExactState:
    """A scene at a frequency, with its exact complex first harmonics (n_response,), m, and slip work, N m a period.

    begin: rad/s, where a sweep up that reaches the state begins; None where the state is found from nothing.
    """

    model: ReducedModel
    friction: float
    amplitude: float
    omega: float
    response: np.ndarray
    slip_work: float
    begin: float | None = None


@lru_cache
def slider(force: float, ratio: float) -> ExactState:
    """Mass on a slider under 10 N, friction coefficient 0.5; frequency over the natural one."""
    orbit = references.slider_orbit(0.1, 0.0, 1.6e5, force, 5.0, ratio * NATURAL)
    model = scene("sdof_slider", normal_stiffness=0.0)
    work = 10.0 * orbit.path(0, _moving(orbit))
    return ExactState(model, 0.5, force, ratio * NATURAL, np.array([orbit.harmonic(0)]), work)


@lru_cache
def two_masses(omega: float) -> ExactState:
    """Two masses, 7.2 N of friction on the second."""
    orbit = references.coulomb_orbit(
        np.eye(2), [[0.04, -0.02], [-0.02, 0.02]], [[2.0, -1.0], [-1.0, 1.0]], [20.0, 0.0], 1, 7.2, omega
    )
    response = np.array([orbit.harmonic(0), orbit.harmonic(1)])
    work = 14.4 * orbit.path(1, _moving(orbit))
    return ExactState(scene("two_masses"), 0.5, 20.0, omega, response, work)


@lru_cache
def vibro_impact(omega: float, begin: float | None) -> ExactState:
    """Mass that meets an elastic wall: upper branch where a sweep begins lower down, else the one without contact."""
    orbit = references.vibro_impact_orbit(
        1.0, 0.05, 1.0, 0.02, 100.0, 0.1, omega, sweep="down" if begin is None else "up", sweep_start=begin
    )
    response = np.array([orbit.harmonic(0)])
    return ExactState(scene("vibro_impact"), 0.0, 0.02, omega, response, 0.0, begin)


def _moving(orbit: references.Orbit) -> list[str]:
    return [name for name in orbit.system.phases if name in SLIDING]


@dataclass(frozen=True)
class Errors:
    """Relative errors of a state: of the amplitude and of the complex first harmonic, of the slip work; what was
    estimated of the last two; and what it took.
    """

    amplitude: float
    response: float
    wear: float
    estimate: Estimate
    accurate: bool
    orders: tuple[int, ...]
    samples: int
    iterations: int

    @property
    def safe(self) -> bool:
        """Whether the estimate is at least half of the error."""
        # what is exact but for round-off has the estimate zero
        response, wear = 0.5 * self.response - 1e-10, 0.5 * self.wear - 1e-10
        return self.estimate.response >= response and self.estimate.wear_rate >= wear


def first_found(exact: ExactState, case: Case, budget: Budget) -> State:
    """State at the frequency, by the sweep that the branch asks for."""
    begin = exact.omega if exact.begin is None else exact.begin
    idle = np.zeros(exact.model.contact.n_contact)
    point = solve_first_state(case, begin, exact.amplitude, idle, Run(case.settings.tolerance, budget))
    assert isinstance(point, State)
    if exact.begin is None:
        return point

    def balance_at(omega: float, history: np.ndarray) -> Balance:
        return Balance(case.joint(omega, exact.amplitude), history, idle)

    run = Run(case.settings.tolerance, budget)
    at = State(point.evaluation, point.history, begin)
    for target in np.append(np.arange(begin + SWEEP_STEP, exact.omega, SWEEP_STEP), exact.omega):
        at, arrived = follow_naturally(balance_at, at, float(target), run)
        at = at if arrived else next(crossings(Arc(balance_at, at, SWEEP_STEP, run), float(target)))
    return at


def errors_of(exact: ExactState, settings: SolverSettings) -> Errors:
    """Refine a state as the settings say and compare it with the exact one."""
    budget = Budget()
    case = build_case(exact.model, exact.friction, exact.omega, settings)
    point = first_found(exact, case, budget)
    refined = refine(case, exact.omega, exact.amplitude, point, Run(case.settings.tolerance, budget))
    joint = refined.case.joint(exact.omega, exact.amplitude)
    evaluation = refined.point.evaluation
    found = to_complex(joint.structure.response_h(joint.to_relative(evaluation.displacement_h)))[:, 0]
    size = np.linalg.norm(exact.response)
    slip_work = float(evaluation.slip_work.sum())
    return Errors(
        amplitude=float(np.linalg.norm(np.abs(found) - np.abs(exact.response)) / size),
        response=float(np.linalg.norm(found - exact.response) / size),
        wear=abs(slip_work / exact.slip_work - 1.0) if exact.slip_work else abs(slip_work),
        estimate=refined.estimate,
        accurate=refined.accurate,
        orders=refined.case.resolution.orders,
        samples=refined.case.resolution.samples,
        iterations=budget.iterations,
    )


SLIDERS = (
    *((10.0, 0.5), (10.0, 0.6), (10.0, 0.9), (10.0, 1.1), (10.0, 1.4)),
    *((7.0, 0.8), (7.0, 1.25), (5.5, 0.6), (5.5, 0.8), (5.5, 1.25)),
)
"""Force, N, against 5 N of friction; frequency ratio."""
IMPACTS: tuple[tuple[float, float | None], ...] = ((0.95, 0.7), (1.05, 0.7), (1.2, 0.85), (1.5, 0.85), (1.2, None))
"""rad/s; where a sweep up begins that finds the upper branch."""


TWO_MASSES = (0.3, 0.4, 0.5, 0.6, 0.7, 1.3, 1.6, 1.8)  # rad/s


def states() -> dict[str, Callable[[], ExactState]]:
    """All of them by name, to be computed when called."""
    found: dict[str, Callable[[], ExactState]] = {}
    for force, ratio in SLIDERS:
        found[f"slider {force} N {ratio}"] = partial(slider, force, ratio)
    for omega in TWO_MASSES:
        found[f"two masses {omega}"] = partial(two_masses, omega)
    for omega, begin in IMPACTS:
        found[f"vibro-impact {omega} {'open' if begin is None else 'upper'}"] = partial(vibro_impact, omega, begin)
    return found

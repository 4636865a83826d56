"""States of the textbook scenes that are known exactly, and the errors of automatic ones against them."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np

from solver.accuracy.error_estimate import Estimate
from solver.model import ReducedModel
from solver.outcome import Outcome
from solver.results.history import StartState
from solver.settings import SolverSettings
from tests import references
from tests.cantilever import FRICTION, Cantilever
from tests.solver.models import branch_states, march_wear, scene

SLIDING = ("forward", "backward")
NATURAL = float(np.sqrt(1.6e6))  # rad/s, of the slider


@dataclass(frozen=True)
class ExactState:
    """A scene at a frequency, with its exact complex first harmonics (n_response,), m, and slip work, N m a period.

    sweep: direction that leads to the state.
    """

    model: ReducedModel
    friction: float
    amplitude: float
    omega: float
    response: np.ndarray
    slip_work: float
    sweep: str = "up"


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
def vibro_impact(omega: float, sweep: str) -> ExactState:
    """Mass that meets an elastic wall: upper branch by a sweep up, else the one without contact."""
    begin = {"sweep_start": 0.7 if omega < 1.15 else 0.85} if sweep == "up" else {}
    orbit = references.vibro_impact_orbit(1.0, 0.05, 1.0, 0.02, 100.0, 0.1, omega, sweep=sweep, **begin)
    response = np.array([orbit.harmonic(0)])
    return ExactState(scene("vibro_impact"), 0.0, 0.02, omega, response, 0.0, sweep)


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


def errors_of(exact: ExactState, settings: SolverSettings) -> Errors:
    """The start state of a sweep, and its wear rate, compared with the exact one."""
    given = exact.model, exact.friction
    (start,) = branch_states(*given, exact.amplitude, [exact.omega], settings, exact.sweep)
    # the wear rate is the slip work
    state = march_wear(*given, start, 1.0, 1.0, "implicit", np.zeros(1), settings)
    found, slip_work, size = state.response[0], float(state.wear_rate[0]), np.linalg.norm(exact.response)
    return Errors(
        amplitude=float(np.linalg.norm(np.abs(found) - np.abs(exact.response)) / size),
        response=float(np.linalg.norm(found - exact.response) / size),
        wear=abs(slip_work / exact.slip_work - 1.0) if exact.slip_work else abs(slip_work),
        estimate=Estimate(float(state.response_error[0]), float(state.wear_rate_error[0])),
        accurate=start.outcome is state.outcome is Outcome.CONVERGED,
        orders=start.resolution.orders,
        samples=start.resolution.samples,
        iterations=start.newton_iterations,
    )


SLIDERS = (
    *((10.0, 0.5), (10.0, 0.6), (10.0, 0.9), (10.0, 1.1), (10.0, 1.4)),
    *((7.0, 0.8), (7.0, 1.25), (5.5, 0.6), (5.5, 0.8), (5.5, 1.25)),
)
"""Force, N, against 5 N of friction; frequency ratio."""
TWO_MASSES = (0.3, 0.4, 0.5, 0.6, 0.7, 1.3, 1.6, 1.8)  # rad/s
IMPACTS = ((1.05, "up"), (1.1, "up"), (1.2, "up"), (1.5, "up"), (1.2, "down"))  # rad/s, sweep


def states() -> dict[str, Callable[[], ExactState]]:
    """All of them by name, to be computed when called."""
    found: dict[str, Callable[[], ExactState]] = {}
    found |= {f"slider {force} N {ratio}": partial(slider, force, ratio) for force, ratio in SLIDERS}
    found |= {f"two masses {omega}": partial(two_masses, omega) for omega in TWO_MASSES}
    words = {"up": "upper", "down": "open"}
    return found | {
        f"vibro-impact {omega} {words[sweep]}": partial(vibro_impact, omega, sweep) for omega, sweep in IMPACTS
    }


# --- a cantilever with rigid friction at its tip ---

SPRINGS = {"rigid": np.inf, "soft spring": 20.0, "stiff spring": 200.0}  # N/m


@lru_cache
def exact_tip(name: str, force: float, omega: float) -> tuple[complex, float]:
    """First harmonic and largest displacement of the tip, m."""
    beam = Cantilever(spring=SPRINGS[name])
    orbit, tip = beam.orbit(force, omega), beam.tip_of_orbit()
    first = sum(share * orbit.harmonic(dof) for dof, share in enumerate(tip))
    return complex(first), float(np.abs(tip @ orbit.sample(4096)[: tip.size]).max())


def reported_tip(model: ReducedModel, start: StartState, settings: SolverSettings) -> tuple[complex, float]:
    """The same as reported of an unworn state."""
    history = march_wear(model, FRICTION, start, 0.0, 1.0, "explicit", np.zeros(1), settings)
    return complex(history.response[0, 0]), float(history.response_peak[0, 0])

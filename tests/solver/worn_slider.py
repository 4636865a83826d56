"""The textbook slider under a spring that presses: its wear histories, and the differential equation of its wear."""

from functools import lru_cache

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from solver.model import FloatArray, ReducedModel
from solver.outcome import Outcome
from solver.results.history import StartState, WearHistory
from solver.settings import Scheme, SolverSettings
from solver.structure.joint import build_case
from solver.wear.wearing_joint import WearingJoint, WearState
from tests.references import slider_amplitude, slider_wear_depth
from tests.solver.models import branch_states, march_wear, scene

OMEGA = 2 * np.pi * 160.0
FRICTION = 0.5
FORCE = 10.0
WEAR = 1.1e-11  # 1/Pa
AREA = 1e-4
END = 8e4
COARSE = SolverSettings(harmonics=5, samples=64, tolerance=1e-11)
CYCLES = np.linspace(0.0, END, 9)


@lru_cache
def slider_start(settings: SolverSettings) -> tuple[ReducedModel, StartState]:
    model = scene("sdof_slider", settings.harmonics)
    (start,) = branch_states(model, FRICTION, FORCE, [OMEGA], settings)
    assert start.outcome is Outcome.CONVERGED
    return model, start


def march(
    step: float,
    scheme: Scheme,
    cycles: FloatArray = CYCLES,
    settings: SolverSettings = COARSE,
    wear: float = WEAR,
    **asked: object,
) -> WearHistory:
    """The history of the slider; asked: as of `models.march_wear`."""
    model, start = slider_start(settings)
    return march_wear(model, FRICTION, start, wear, step, scheme, cycles, settings, **asked)


def begun(wear: float = WEAR) -> tuple[WearingJoint, WearState]:
    """The wearing slider and its unworn state."""
    model, start = slider_start(COARSE)
    case = build_case(model, FRICTION, start.penalty_omega, COARSE, start.resolution)
    work = WearingJoint(case, start, wear)
    return work, work.begin()


def exact_depths_of_motion(cycles: FloatArray, wear: float = WEAR) -> FloatArray:
    """Depths (n,), m, for the exact motion, by Den Hartog."""
    return slider_wear_depth(
        cycles,
        wear_coefficient=wear,
        area=AREA,
        friction_coefficient=FRICTION,
        normal_load=10.0,
        normal_stiffness=1e5,
        amplitude=lambda limit: slider_amplitude(0.1, 0.0, 1.6e5, FORCE, limit, OMEGA),
    )


@lru_cache
def rate_of_depth(settings: SolverSettings = COARSE) -> CubicSpline:
    """Wear rate, m per cycle, of a depth, m.

    The wear rate is a function of the depth alone: it is tabulated from the states of a history, each of which is a
    state at its own depth whatever the step.
    """
    fine = march(250.0, "implicit", np.linspace(0.0, 1.25 * END, 401), settings)
    return CubicSpline(fine.wear_depth[:, 0], fine.wear_rate / AREA)


def exact_depths(cycles: FloatArray, settings: SolverSettings = COARSE) -> FloatArray:
    """Depths (n,), m, for the motion of so many harmonics and samples: what is off is off by the integration."""
    rate = rate_of_depth(settings)
    found = solve_ivp(lambda _, w: rate(w), (0.0, END), [0.0], "DOP853", cycles, rtol=1e-11, atol=1e-20)
    return np.asarray(found.y[0])

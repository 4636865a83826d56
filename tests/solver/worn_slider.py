"""The textbook slider under a spring that presses: its wear histories, and the differential equation of its wear."""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from solver.model import FloatArray, ReducedModel
from solver.outcome import Outcome
from solver.results.history import StartState, WearHistory
from solver.settings import Scheme, SolverSettings
from solver.structure.joint import Case
from solver.wear.problem import WearProblem
from solver.wear.wearing_joint import Given, WearRequest
from tests.references import slider_amplitude, slider_wear_depth
from tests.solver.models import march_wear, scene, state_at

OMEGA = 2 * np.pi * 160.0
FRICTION = 0.5
FORCE = 10.0
WEAR = 1.1e-11  # 1/Pa
AREA = 1e-4
END = 8e4
COARSE = SolverSettings(harmonics=5, samples=64, tolerance=1e-11)
CYCLES = np.linspace(0.0, END, 9)


@lru_cache
def slider_start() -> tuple[ReducedModel, StartState, Case]:
    model = scene("sdof_slider", COARSE.harmonics)
    start, case, _ = state_at(model, FRICTION, FORCE, OMEGA, COARSE)
    assert start.outcome is Outcome.CONVERGED
    return model, start, case


def march(
    step: float, scheme: Scheme, cycles: FloatArray = CYCLES, *, wear: float = WEAR, rtol: float = 1e-2, **asked: object
) -> WearHistory:
    """The history of the slider; asked: as of `models.march_wear`."""
    model, start, _ = slider_start()
    return march_wear(model, FRICTION, start, wear, step, scheme, cycles, replace(COARSE, rtol=rtol), **asked)


def problem(steps: Given | None = None, rtol: float = 1e-2) -> WearProblem:
    """The wearing slider up to the last cycle count."""
    _, start, case = slider_start()
    return WearProblem(
        replace(case, settings=replace(COARSE, rtol=rtol)), start, WearRequest(WEAR, steps, np.array([0.0, END]))
    )


def depths_of_motion(cycles: FloatArray, wear: float = WEAR) -> FloatArray:
    """Depths (n,), m, for the exact motion, by Den Hartog."""
    return slider_wear_depth(cycles, lambda limit: slider_amplitude(0.1, 0.0, 1.6e5, FORCE, limit, OMEGA), wear=wear)


@lru_cache
def by_depth() -> tuple[CubicSpline, CubicSpline]:
    """Slip work, N m, and pressure, Pa, as functions of the depth, m: of it alone they depend, whatever wore it."""
    fine = march(250.0, "implicit", np.linspace(0.0, 1.25 * END, 401))
    depth = fine.wear_depth[:, 0]
    return CubicSpline(depth, fine.wear_rate / WEAR), CubicSpline(depth, fine.mean_pressure[:, 0])


def exact_depths(
    cycles: FloatArray, wearing: Callable[[float, float, float], float] = lambda work, _, __: work
) -> FloatArray:
    """Depths (n,), m, for the motion of these harmonics and samples: what is off is off by the integration.

    wearing: the work that wears, N m, from slip work, pressure and depth.
    """
    work, pressure = by_depth()

    def rate(_: float, depth: FloatArray) -> list[float]:
        w = float(depth[0])
        return [WEAR / AREA * wearing(float(work(w)), float(pressure(w)), w)]

    found = solve_ivp(rate, (0.0, END), [0.0], "DOP853", cycles, rtol=1e-10, atol=1e-18, max_step=1000.0)
    return np.asarray(found.y[0])

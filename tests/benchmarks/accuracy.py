"""Errors against the exact references, at 21 harmonics.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.accuracy

Prints the deviation in the first harmonic of the displacement, in per cent, over frequency, for the textbook scenes.
"""

from __future__ import annotations

import math

import numpy as np

from solver.continuation import follow_branch
from solver.harmonics import to_complex
from solver.joint import build_case
from solver.model import ReducedModel
from solver.settings import SolverSettings
from studies.scenes import build_scene, scene_parameters
from tests import references
from tests.event_driven import NoPeriodicMotionError

SETTINGS = SolverSettings(harmonics=21, samples=256)


def first_harmonics(
    model: ReducedModel, friction: float, amplitude: float, omegas: list[float]
) -> dict[float, np.ndarray]:
    """Amplitudes of all responses, m, along a sweep upwards; NaN where there is no state."""
    frequencies = np.array(omegas) / (2.0 * math.pi)
    found = {}
    for index, start in follow_branch(model, friction, amplitude, frequencies, "up", SETTINGS):
        values = np.full(len(model.response_names), np.nan)
        if start.state is not None:
            joint = build_case(model, friction, start.penalty_omega, SETTINGS).joint(start.state.omega, amplitude)
            response_h = joint.structure.response_h(joint.to_relative(start.state.displacement_h))
            values = np.abs(to_complex(response_h))[:, 0]
        found[omegas[index]] = values
    return found


def report(title: str, found: dict[float, np.ndarray], exact: dict[float, np.ndarray]) -> None:
    """One line a frequency."""
    print(title)
    for omega, values in found.items():
        errors = 100.0 * (values / exact[omega] - 1.0)
        print(f"  omega {omega:10.4f} rad/s: " + "  ".join(f"{error:+.3f} %" for error in errors))


def slider() -> None:
    """Slider with constant normal load, against the event-driven motion (Den Hartog's where it holds)."""
    parameters = scene_parameters("sdof_slider")(normal_stiffness=0.0)
    model = build_scene("sdof_slider", parameters, SETTINGS.harmonics)
    natural = math.sqrt(1.6e5 / 0.1)
    for force in (10.0, 7.0, 5.5):
        exact = {}
        for ratio in (0.6, 0.8, 0.9, 1.1, 1.25, 1.4):
            try:
                orbit = references.slider_orbit(0.1, 0.0, 1.6e5, force, 5.0, ratio * natural)
            except NoPeriodicMotionError:
                continue
            exact[ratio * natural] = np.array([abs(orbit.harmonic(0))])
        report(
            f"sdof_slider, {force} N against 5 N of friction", first_harmonics(model, 0.5, force, list(exact)), exact
        )


def two_masses() -> None:
    """Two masses, against the event-driven motion."""
    model = build_scene("two_masses", scene_parameters("two_masses")(), SETTINGS.harmonics)
    damping, stiffness = [[0.04, -0.02], [-0.02, 0.02]], [[2.0, -1.0], [-1.0, 1.0]]
    exact = {}
    for omega in (0.3, 0.4, 0.5, 0.6, 0.7, 1.0, 1.3, 1.6, 1.8):
        orbit = references.coulomb_orbit(np.eye(2), damping, stiffness, [20.0, 0.0], 1, 7.2, omega)
        exact[omega] = np.abs([orbit.harmonic(0), orbit.harmonic(1)])
    report("two_masses, 20 N against 7.2 N of friction", first_harmonics(model, 0.5, 20.0, list(exact)), exact)


def vibro_impact() -> None:
    """Vibro-impact, upper branch, against the event-driven motion."""
    model = build_scene("vibro_impact", scene_parameters("vibro_impact")(), SETTINGS.harmonics)
    exact = {}
    for omega in (0.95, 1.1, 1.2, 1.3, 1.4, 1.5, 1.55):
        orbit = references.vibro_impact_orbit(1.0, 0.05, 1.0, 0.02, 100.0, 0.1, omega, sweep_start=0.85)
        exact[omega] = np.array([abs(orbit.harmonic(0))])
    report("vibro_impact, upper branch", first_harmonics(model, 0.0, 0.02, list(exact)), exact)


if __name__ == "__main__":
    slider()
    two_masses()
    vibro_impact()

"""Wear held against what others derived and measured: `python -m tests.benchmarks.validation [A] [B] [C]`.

A: a cylinder in partial slip, worn to the end (Ciavarella and Hills). B: a sphere, the same (method of dimensionality
reduction). C: a cylinder in gross slip, measured and computed by McColl, Ding and Leen, Wear 256 (2004) 1114.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass

import numpy as np

from solver import march_wear
from solver.contact.wear_law import WearLaw
from solver.model import FloatArray, ReducedModel
from solver.outcome import Outcome
from solver.results.history import WearHistory
from solver.settings import SolverSettings
from studies import build_scene
from studies.scenes.closed_forms.hertz import (
    line_half_width,
    line_stick_width,
    line_worn_depth,
    point_radius,
    point_stick_radius,
    point_worn_depth,
)
from studies.scenes.half_space.influence import composite_modulus
from tests.studies.half_space_twin import limit_depth

MODULUS = composite_modulus(200e9, 0.3)
MU, SHARE = 0.6, 0.5
MCCOLL = {1000: (0.378, 0.373, 0.0526), 5000: (1.131, 1.125, 0.2610), 10_000: (1.815, 1.808, 0.5215)} | {
    18_000: (2.713, 2.705, 0.9382)
}
"""Cycles: depth of the flat, um, of two finite-element codes, and its worn area, 1e-3 mm2."""
FLAT, CYLINDER = 2.9e-14, 1.9e-14  # 1/Pa


@dataclass(frozen=True)
class WornOut:
    """What partial slip has worn in the end, against the limit state of the same pairs and against the continuum.

    discrete: largest difference of depths over the largest depth. depth, volume: relative differences of the largest
    depth and of the volume. seconds: of the start state and the march.
    """

    discrete: float
    depth: float
    volume: float
    seconds: float


def wear_out(model: ReducedModel, settings: SolverSettings) -> tuple[WearHistory, FloatArray, float]:
    """History to 1e7 cycles at 1e-13 1/Pa, some hundred times what it takes; the depths of the limit state, m."""
    began = time.process_time()
    history = march_wear(model, 20.0, 1.0, MU, 1e-13, [0.0, 1e7], sweep="ramp", settings=settings)
    assert history.outcome is Outcome.CONVERGED, history.message
    return history, limit_depth(model, history.slip_range[0] == 0.0), time.process_time() - began


def compare(model: ReducedModel, settings: SolverSettings, deepest: float, volume: float) -> WornOut:
    """Wear a joint out and compare with the largest depth, m, and the volume, m3, of the continuum."""
    history, limit, seconds = wear_out(model, settings)
    discrete = float(np.abs(history.wear_depth[-1] - limit).max() / limit.max())
    depth = float(history.wear_depth[-1].max()) / deepest - 1.0
    return WornOut(discrete, depth, float(history.worn_volume[-1]) / volume - 1.0, seconds)


def truth_a(strips: int, settings: SolverSettings) -> WornOut:
    """Cylinder, 120 N/mm, half of the force that slides."""
    model = build_scene("cylinder_on_flat", strips=strips)
    a = line_half_width(1.2e5, 6e-3, MODULUS)
    c = line_stick_width(a, SHARE)
    x = np.linspace(c, 2.0 * a, 40001)
    depth = line_worn_depth(x, 6e-3, a, c)
    return compare(model, settings, float(depth.max()), 2.0 * float(np.trapezoid(depth, x)) * 0.01)


def truth_b(patches: int, settings: SolverSettings) -> WornOut:
    """Sphere, 100 N, half of the force that slides; `patches` in both directions of the whole contact."""
    model = build_scene("sphere_on_flat", patches=patches // 2)
    a = point_radius(100.0, 10e-3, MODULUS)
    c = point_stick_radius(a, SHARE)
    r = np.linspace(c, 2.0 * a, 40001)
    depth = point_worn_depth(r, 10e-3, a, c)
    return compare(model, settings, float(depth.max()), float(np.trapezoid(2.0 * np.pi * r * depth, r)))


def truth_c(strips: int, settings: SolverSettings) -> tuple[WearHistory, FloatArray, FloatArray, float]:
    """Cylinder, 18.5 N/mm, +-25 um: history, depth, m, and area, m2, of the flat at McColl's counts, CPU seconds."""
    model = build_scene("cylinder_on_flat", strips=strips, P=18.5e3, stroke=25e-6, half_width=0.3e-3)
    law = WearLaw(surfaces=(("flat", 1.0), ("cylinder", CYLINDER / FLAT)))
    began = time.process_time()
    history = march_wear(model, 20.0, 1.0, 0.9, FLAT, list(MCCOLL), sweep="ramp", settings=settings, law=law)
    seconds = time.process_time() - began
    share = FLAT / (FLAT + CYLINDER)
    return history, share * history.wear_depth[1:].max(axis=1), share * history.worn_volume[1:] / 0.01, seconds


def main(chosen: list[str]) -> None:
    """Print a row for each case."""
    if "A" in chosen:
        for strips in (50, 100, 200):
            found = truth_a(strips, SolverSettings(harmonics=9, samples=128, rtol=1e-2))
            print(f"A, {strips} strips: {found}", flush=True)
    if "B" in chosen:
        for patches in (10, 20, 40):
            found = truth_b(patches, SolverSettings(harmonics=3, samples=64, rtol=1e-2))
            print(f"B, {patches} x {patches} patches: {found}", flush=True)
    if "C" in chosen:
        history, depth, area, seconds = truth_c(100, SolverSettings(harmonics=5, samples=64, rtol=1e-2))
        print(f"C, {history.outcome.name}, {seconds:.0f} s, error {history.error_estimate:.2g}")
        for place, (cycles, (one, _, published)) in enumerate(MCCOLL.items()):
            print(
                f"C, {cycles} cycles: depth {1e6 * depth[place]:.3f} um ({depth[place] / one * 1e6 - 1:+.1%}), "
                f"area {1e9 * area[place]:.4f}e-3 mm2 ({area[place] / published * 1e9 - 1:+.2%})",
                flush=True,
            )


if __name__ == "__main__":
    main(sys.argv[1:] or ["A", "B", "C"])

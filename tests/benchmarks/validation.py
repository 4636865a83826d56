"""Wear held against what others derived and measured: `python -m tests.benchmarks.validation [A] [B] [C] [E]`.

A: a cylinder in partial slip, worn to the end (Ciavarella and Hills). B: a sphere, the same (method of dimensionality
reduction). C: a cylinder in gross slip, measured and computed by McColl, Ding and Leen, Wear 256 (2004) 1114.
"""

import sys
import time
from dataclasses import dataclass, replace

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
from tests.studies.half_space_twin import limit_depth, pressed

MODULUS = composite_modulus(200e9, 0.3)
MU, SHARE, WEAR = 0.6, 0.5, 1e-13
MCCOLL = {1000: (0.378, 0.373, 0.0526), 5000: (1.131, 1.125, 0.2610), 10_000: (1.815, 1.808, 0.5215)} | {
    18_000: (2.713, 2.705, 0.9382)
}
"""Cycles: depth of the flat, um, of two finite-element codes, and its worn area, 1e-3 mm2."""
FLAT, CYLINDER = 2.9e-14, 1.9e-14  # 1/Pa


Continuum = tuple[float, float]
"""Largest depth, m, and volume, m3, that the closed form has."""


@dataclass(frozen=True)
class WornOut:
    """What partial slip wears in the end. Relative differences, and CPU seconds.

    discrete: of a march to the end to the limit state of the same pairs, at most, over the largest depth. depth,
    volume: of the march to the continuum. rest: wear rate of the limit state over that of the unworn one.
    """

    discrete: float
    depth: float
    volume: float
    rest: float
    seconds: float


def cylinder(strips: int) -> tuple[ReducedModel, Continuum]:
    """120 N/mm, half of the force that slides."""
    a = line_half_width(1.2e5, 6e-3, MODULUS)
    c = line_stick_width(a, SHARE)
    x = np.linspace(c, 2.0 * a, 40001)
    depth = line_worn_depth(x, 6e-3, a, c)
    model = build_scene("cylinder_on_flat", strips=strips)
    return model, (float(depth.max()), 2.0 * float(np.trapezoid(depth, x)) * 0.01)


def sphere(patches: int) -> tuple[ReducedModel, Continuum]:
    """100 N, half of the force that slides; patches along each side of the square around the whole contact."""
    a = point_radius(100.0, 10e-3, MODULUS)
    c = point_stick_radius(a, SHARE)
    r = np.linspace(c, 2.0 * a, 40001)
    depth = point_worn_depth(r, 10e-3, a, c)
    model = build_scene("sphere_on_flat", patches=patches // 2)
    return model, (float(depth.max()), float(np.trapezoid(2.0 * np.pi * r * depth, r)))


def wear_rate(model: ReducedModel, gap: FloatArray, settings: SolverSettings) -> WearHistory:
    """The unworn state of a joint with other gaps (n_contact,), m, alone."""
    moved = replace(model, contact=replace(model.contact, gap=gap))
    found = march_wear(moved, 20.0, 1.0, MU, WEAR, [0.0], sweep="ramp", settings=settings)
    assert found.outcome in (Outcome.CONVERGED, Outcome.INACCURATE), found.message
    return found


def limit_of(model: ReducedModel, continuum: Continuum, settings: SolverSettings) -> WornOut:
    """The limit state alone: that of the pairs that stick unworn, in which the solver is to find nothing that wears."""
    began = time.process_time()
    unworn = wear_rate(model, model.contact.gap, settings)
    limit = limit_depth(model, unworn.slip_range[0] == 0.0)
    worn = wear_rate(model, model.contact.gap + limit, settings)
    volume = float(limit @ model.contact.area)
    rest = float(worn.wear_rate[0] / unworn.wear_rate[0])
    seconds = time.process_time() - began
    return WornOut(np.nan, float(limit.max()) / continuum[0] - 1.0, volume / continuum[1] - 1.0, rest, seconds)


def limit_by_load(model: ReducedModel, continuum: Continuum) -> WornOut:
    """The limit state of the pairs that the load of the stick zone, P - Q / mu, presses: without the solver."""
    began = time.process_time()
    load = float(model.linear[0].load_static[2 * model.contact.n_contact])
    limit = limit_depth(model, pressed(model, (1.0 - SHARE) * load)[0] > 0.0)
    volume, seconds = float(limit @ model.contact.area), time.process_time() - began
    return WornOut(np.nan, float(limit.max()) / continuum[0] - 1.0, volume / continuum[1] - 1.0, np.nan, seconds)


def march_to_the_end(model: ReducedModel, continuum: Continuum, settings: SolverSettings) -> WornOut:
    """A march of 1e7 cycles, some hundred times what it takes."""
    began = time.process_time()
    found = march_wear(model, 20.0, 1.0, MU, WEAR, [0.0, 1e7], sweep="ramp", settings=settings)
    seconds = time.process_time() - began
    assert found.outcome is Outcome.CONVERGED, found.message
    limit = limit_depth(model, found.slip_range[0] == 0.0)
    discrete = float(np.abs(found.wear_depth[-1] - limit).max() / limit.max())
    depth, volume = float(found.wear_depth[-1].max()), float(found.worn_volume[-1])
    rest = float(found.wear_rate[-1] / found.wear_rate[0])
    return WornOut(discrete, depth / continuum[0] - 1.0, volume / continuum[1] - 1.0, rest, seconds)


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
    for letter, joint, sizes in (("A", cylinder, (50, 100, 200)), ("B", sphere, (10, 20))):
        if letter not in chosen:
            continue
        settings = SolverSettings(harmonics=9, samples=128, rtol=1e-4)
        print(f"{letter}, {sizes[0]}, marched:", march_to_the_end(*joint(sizes[0]), settings), flush=True)
        settings = SolverSettings(harmonics=7, samples=64, rtol=1e-2)
        for size in sizes:
            print(f"{letter}, {size}, limit state:", limit_of(*joint(size), settings), flush=True)
        finest = 2 * sizes[-1]
        print(f"{letter}, {finest}, limit state by the load:", limit_by_load(*joint(finest)), flush=True)
    if "C" in chosen:
        history, depth, area, seconds = truth_c(60, SolverSettings(harmonics=11, samples=64, rtol=1e-2))
        print(f"C, {history.outcome.name}, {seconds:.0f} s, error {history.error_estimate:.2g}")
        for place, (cycles, (one, _, published)) in enumerate(MCCOLL.items()):
            print(
                f"C, {cycles} cycles: depth {1e6 * depth[place]:.3f} um ({depth[place] / one * 1e6 - 1:+.1%}), "
                f"area {1e9 * area[place]:.4f}e-3 mm2 ({area[place] / published * 1e9 - 1:+.2%})",
                flush=True,
            )


if __name__ == "__main__":
    main(sys.argv[1:] or ["A", "B", "C", "E"])

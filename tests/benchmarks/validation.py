"""Wear against what others derived and measured: `python -m tests.benchmarks.validation [A] [B] [C]`.

A: a cylinder in partial slip, worn to the end (Ciavarella and Hills). B: a sphere, the same (method of dimensionality
reduction). C: a cylinder in gross slip, measured and computed by McColl, Ding and Leen, Wear 256 (2004) 1114.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from solver import march_wear
from solver.contact.wear_law import WearLaw
from solver.model import ReducedModel
from solver.results.history import WearHistory
from solver.settings import SolverSettings
from studies import build_scene
from studies.scenes.cylinder_on_flat import line_worn_depth
from studies.scenes.half_space import composite_modulus
from studies.scenes.sphere_on_flat import point_worn_depth
from tests.benchmarks.frame import Table, arguments, measure
from tests.studies.half_space_twin import limit_depth, pressed

MODULUS = composite_modulus(200e9, 0.3)
MU, SHARE, WEAR = 0.6, 0.5, 1e-13
SETTINGS = SolverSettings(harmonics=7, samples=64)
MCCOLL = {1000: (0.378, 0.0526), 5000: (1.131, 0.2610), 10_000: (1.815, 0.5215), 18_000: (2.713, 0.9382)}
"""Cycles: depth of the flat, um, of a finite-element code (another one has 0.2 to 1.3 % less), and its worn area, 1e-3
mm2."""
FLAT, CYLINDER = 2.9e-14, 1.9e-14  # 1/Pa
Continuum = tuple[float, float]
"""Largest depth, m, and volume, m3, of the closed form."""


def cylinder(strips: int) -> tuple[ReducedModel, Continuum]:
    """120 N/mm, half of the force that slides."""
    a = float(np.sqrt(4.0 * 1.2e5 * 6e-3 / (np.pi * MODULUS)))
    c = a * np.sqrt(1.0 - SHARE)
    x = np.linspace(c, 2.0 * a, 40001)
    depth = line_worn_depth(x, 6e-3, a, c)
    model = build_scene("cylinder_on_flat", strips=strips)
    return model, (float(depth.max()), 2.0 * float(np.trapezoid(depth, x)) * 0.01)


def sphere(patches: int) -> tuple[ReducedModel, Continuum]:
    """100 N, half of the force that slides; patches along each side of the square around the whole contact."""
    a = float(np.cbrt(0.75 * 100.0 * 10e-3 / MODULUS))
    c = a * np.cbrt(1.0 - SHARE)
    r = np.linspace(c, 2.0 * a, 40001)
    depth = point_worn_depth(r, 10e-3, a, c)
    model = build_scene("sphere_on_flat", patches=patches // 2)
    return model, (float(depth.max()), float(np.trapezoid(2.0 * np.pi * r * depth, r)))


def ramped(model: ReducedModel) -> WearHistory:
    """The unworn state, reached by a ramp of the excitation."""
    found = march_wear(model, 20.0, 1.0, MU, WEAR, [0.0], sweep="ramp", settings=SETTINGS)
    assert found.outcome.complete, found.message
    return found


def limits(letter: str, joint: Callable[[int], tuple[ReducedModel, Continuum]], sizes: tuple[int, ...]) -> None:
    """Worn depth and volume in the end over those of the continuum, and what still wears there over the unworn joint.

    By the limit state of the pairs that stick unworn, in which the solver is to find nothing that wears; for twice the
    last size by that of the pairs which the load of the stick zone, P - Q / mu, presses, without the solver.
    """
    table = Table(f"{letter}, limit state", "depth", "volume", "still wears", "CPU s")
    for size in (*sizes, 2 * sizes[-1]):
        model, (deepest, volume) = joint(size)
        rest, seconds = None, 0.0
        if size in sizes:
            unworn = measure(lambda: ramped(model))  # noqa: B023
            depth = limit_depth(model, unworn.result.slip_range[0] == 0.0)
            there = replace(model, contact=replace(model.contact, gap=model.contact.gap + depth))
            worn = measure(lambda: ramped(there))  # noqa: B023
            rest = float(worn.result.wear_rate[0] / unworn.result.wear_rate[0])
            seconds = unworn.seconds + worn.seconds
        else:
            load = float(model.linear[0].load_static[2 * model.contact.n_contact])
            depth = limit_depth(model, pressed(model, (1.0 - SHARE) * load)[0] > 0.0)
        table.row(str(size), float(depth.max() / deepest), float(depth @ model.contact.area / volume), rest, seconds)


def gross_slip(strips: int = 60) -> None:
    """Cylinder, 18.5 N/mm, +-25 um, at McColl's counts."""
    model = build_scene("cylinder_on_flat", strips=strips, P=18.5e3, stroke=25e-6, half_width=0.3e-3)
    law, settings = WearLaw(surfaces=(("flat", 1.0), ("cylinder", CYLINDER / FLAT))), SolverSettings(11, 64)
    asked = {"sweep": "ramp", "settings": settings, "law": law}
    history = march_wear(model, 20.0, 1.0, 0.9, FLAT, list(MCCOLL), **asked)
    share = FLAT / (FLAT + CYLINDER)
    table = Table("C, cycles", "depth, um", "of theirs", "area", "of theirs", "error")
    for place, (cycles, (depth, area)) in enumerate(MCCOLL.items(), 1):
        own = 1e6 * share * float(history.wear_depth[place].max())
        worn = 1e9 * share * float(history.worn_volume[place]) / 0.01
        table.row(f"{cycles}", own, own / depth, worn, worn / area, float(history.worn_volume_error[place]))


def main() -> None:
    chosen = arguments(__doc__, ("A", "B", "C")).chosen
    if "A" in chosen:
        limits("A", cylinder, (50, 100, 200))
    if "B" in chosen:
        limits("B", sphere, (10, 20))
    if "C" in chosen:
        gross_slip()


if __name__ == "__main__":
    main()

"""Wear of the dovetail root under travelling waves: every point over the resonances, and how it ends.

`python -m tests.benchmarks.travelling_waves` takes mesh 2, nodal diameters 3, 7 and 20, and 0.5 and 2 N; `--mesh 1`,
`--diameters 3`, `--amplitudes 0.5` and `--offsets 0 0.25` take less.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.linalg import eigh

from solver.loading_history.start_states import follow_branch
from solver.model import ReducedModel
from solver.settings import SolverSettings
from studies.scenes import build_scene, scene_parameters
from tests.solver.models import march_wear

HARMONICS = 21  # whose nodal diameters the scene holds
FRICTION = 0.5
WEAR = 1.1e-11  # 1/Pa
OFFSETS = (-1.5, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 1.0)  # Hz from the resonance of the glued structure
CYCLES = np.linspace(0.0, 1e5, 101)


def glued_resonance(model: ReducedModel) -> float:
    """First natural frequency with the joint held, Hz."""
    linear = model.linear[model.nodal_diameter]
    inner = np.setdiff1d(np.arange(linear.mass.shape[0]), model.contact.dofs.ravel())
    values = eigh(linear.stiffness[np.ix_(inner, inner)], linear.mass[np.ix_(inner, inner)], eigvals_only=True)
    return float(np.sqrt(values[0]) / (2.0 * np.pi))


def rows(mesh: int, nodal_diameter: int, amplitude: float, offsets: Sequence[float], limit: float) -> Iterator[str]:
    """One line a frequency. amplitude: N. offsets: Hz. limit: CPU seconds of a state or a march."""
    parameters = scene_parameters("dovetail_sector")(mesh=mesh, nodal_diameter=nodal_diameter)
    model = build_scene("dovetail_sector", parameters, HARMONICS)
    settings = SolverSettings(time_limit=limit)
    frequencies = glued_resonance(model) + np.array(offsets)
    for index, start in follow_branch(model, FRICTION, amplitude, frequencies, "up", settings):
        begun = time.perf_counter()
        history = march_wear(model, FRICTION, start, WEAR, 1000.0, "adaptive", CYCLES, settings)
        spent = start.run_time + time.perf_counter() - begun
        known = history.worn_volume[np.isfinite(history.worn_volume)]
        volume = 1e9 * float(known[-1]) if known.size else float("nan")
        yield (
            f"{nodal_diameter:4d} {amplitude:6g} {frequencies[index]:10.3f} {history.outcome.meaning:>19}"
            f" {history.last_cycle:10.6g} {volume:10.4g} {history.error_estimate:10.2g} {spent:8.1f}"
        )


def main() -> None:
    """Print the table, row by row."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mesh", type=int, default=2)
    parser.add_argument("--diameters", type=int, nargs="+", default=[3, 7, 20])
    parser.add_argument("--amplitudes", type=float, nargs="+", default=[0.5, 2.0], help="N")
    parser.add_argument("--offsets", type=float, nargs="+", default=list(OFFSETS), help="Hz")
    parser.add_argument("--limit", type=float, default=600.0, help="CPU seconds of a state or a march")
    chosen = parser.parse_args()
    print("   d      N         Hz             outcome last cycle  worn, mm3      error  time, s")
    for nodal_diameter in chosen.diameters:
        for amplitude in chosen.amplitudes:
            for row in rows(chosen.mesh, nodal_diameter, amplitude, chosen.offsets, chosen.limit):
                print(row, flush=True)


if __name__ == "__main__":
    main()

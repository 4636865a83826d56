"""Whether worn volumes agree within their error bars on other machines: BLAS kernels of other processors, and noise.

    python -m tests.benchmarks.machines --mesh 2 --noise 3

Every variant runs in a process of its own. OpenBLAS takes its kernels by OPENBLAS_CORETYPE; symmetric noise of relative
size 1e-13 is put on the matrices of the scene. Printed are the outcomes of all points, and the largest difference to
the first variant over the sum of both errors: at most 1 is wanted.
"""

import json
import os
import subprocess
import sys
from collections import Counter
from dataclasses import replace

import numpy as np

from solver.settings import SolverSettings
from tests.benchmarks.error_bars import FREQUENCIES, WEAR
from tests.benchmarks.frame import Table, arguments
from tests.solver.models import branch_states, march_wear, scene

CORES = ("", "Haswell", "Zen", "Nehalem", "SandyBridge")
SCHEMES = ("adaptive", "implicit", "explicit")
NOISE = 1e-13


def compute_variant(mesh: int, seed: int, frequencies: list[float]) -> list[tuple[str, str, float, float]]:
    """Label, outcome, volume and its error, m3, of all points. seed: of the noise, 0 for none."""
    model, random, settings = scene("dovetail_sector", 13, mesh=mesh), np.random.default_rng(seed), SolverSettings()

    def shaken(matrix: np.ndarray) -> np.ndarray:
        noise = (NOISE if seed else 0.0) * random.normal(size=matrix.shape)
        return matrix * (1.0 + 0.5 * (noise + noise.T))

    (linear,), found = model.linear.values(), []
    linear = replace(linear, **{name: shaken(getattr(linear, name)) for name in ("mass", "stiffness", "damping")})
    model, cycles = replace(model, linear={0: linear}), np.linspace(0.0, 1e5, 101)
    omegas = [2.0 * np.pi * frequency for frequency in frequencies]
    for frequency, start in zip(frequencies, branch_states(model, 0.5, 0.5, omegas, settings), strict=True):
        for scheme in SCHEMES:
            history = march_wear(model, 0.5, start, WEAR, 1000.0, scheme, cycles, settings)
            volume = float(history.worn_volume[-1])
            error = volume * history.error_estimate
            found.append((f"{frequency} Hz, {scheme}", history.outcome.meaning, volume, error))
    return found


def main() -> None:
    given = arguments(__doc__, mesh=1, noise=20, frequency=[0.0], one=-1)
    frequencies = given.frequency if any(given.frequency) else list(FREQUENCIES[given.mesh])
    if given.one >= 0:
        print(json.dumps(compute_variant(given.mesh, given.one, frequencies)))
        return
    table, first = Table("kernels", "noise", "apart", "where", "outcomes"), None
    for core, seed in [(core, 0) for core in CORES] + [("", seed) for seed in range(1, given.noise + 1)]:
        command = [sys.executable, "-m", "tests.benchmarks.machines", *sys.argv[1:], "--one", str(seed)]
        environment = {**os.environ, **({"OPENBLAS_CORETYPE": core} if core else {})}
        points = json.loads(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)
        first = first or points
        apart = [
            (abs(volume - its) / (error + its_error) if volume != its else 0.0, label)
            for (label, _, volume, error), (_, _, its, its_error) in zip(points, first, strict=True)
        ]
        table.row(core or "own", seed, *max(apart), dict(Counter(point[1] for point in points)))


if __name__ == "__main__":
    main()

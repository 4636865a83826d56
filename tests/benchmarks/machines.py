"""Whether worn volumes agree within their error bars on other machines: BLAS kernels of other processors, and noise.

    python -m tests.benchmarks.machines --mesh 2 --noise 3

Every variant runs in a process of its own. OpenBLAS takes its kernels by OPENBLAS_CORETYPE; symmetric noise of relative
size 1e-13 is put on the matrices of the scene. Printed are the outcome of every point and the largest difference to the
first variant over the sum of both errors: at most 1 is wanted.
"""

import argparse
import json
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np

CORES = ("", "Haswell", "Zen", "Nehalem", "SandyBridge")
FREQUENCIES = {1: [212.5, 212.75, 213.0, 213.25], 2: [211.0, 211.25, 211.5, 211.75, 212.0, 212.25, 212.5]}
SCHEMES = ("adaptive", "implicit", "explicit")
NOISE = 1e-13


def one_variant(mesh: int, seed: int) -> None:
    """Computes all points and prints them as JSON. seed: of the noise, 0 for none."""
    from solver.loading_history.start_states import follow_branch
    from solver.model import LinearModel
    from solver.settings import SolverSettings
    from tests.solver.models import march_wear, scene

    model = scene("dovetail_sector", 13, mesh=mesh)
    if seed:
        random = np.random.default_rng(seed)

        def shaken(matrix: np.ndarray) -> np.ndarray:
            noise = NOISE * random.normal(size=matrix.shape)
            return matrix * (1.0 + 0.5 * (noise + noise.T))

        def shake(linear: LinearModel) -> LinearModel:
            return replace(linear, **{name: shaken(getattr(linear, name)) for name in ("mass", "stiffness", "damping")})

        model = replace(model, linear={k: shake(linear) for k, linear in model.linear.items()})
    settings, cycles = SolverSettings(), np.linspace(0.0, 1e5, 101)
    found = []
    frequencies = FREQUENCIES[mesh]
    for place, start in follow_branch(model, 0.5, 0.5, np.array(frequencies), "up", settings):
        for scheme in SCHEMES:
            history = march_wear(model, 0.5, start, 1.1e-11, 1000.0, scheme, cycles, settings)
            volume = float(history.worn_volume[-1])
            found.append(
                (f"{frequencies[place]} Hz, {scheme}", history.outcome.meaning, volume, volume * history.error_estimate)
            )
    print(json.dumps(found))


def main() -> None:
    """All variants, one after the other."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--mesh", type=int, default=1)
    parser.add_argument("--noise", type=int, default=20)
    parser.add_argument("--one", type=int, default=None)
    given = parser.parse_args()
    if given.one is not None:
        one_variant(given.mesh, given.one)
        return
    first: list[tuple[str, str, float, float]] | None = None
    variants = [(core or "unset", core, 0) for core in CORES]
    variants += [(f"noise {seed}", "", seed) for seed in range(1, given.noise + 1)]
    for name, core, seed in variants:
        command = [sys.executable, "-m", "tests.benchmarks.machines", "--mesh", str(given.mesh), "--one", str(seed)]
        environment = {**os.environ, **({"OPENBLAS_CORETYPE": core} if core else {})}
        ended = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
        points = json.loads(ended.stdout)
        first = first or points
        worst, where = 0.0, "nowhere"
        for (label, _, volume, error), (_, _, its, its_error) in zip(points, first, strict=True):
            ratio = abs(volume - its) / (error + its_error) if volume != its else 0.0
            if not ratio <= worst:
                worst, where = ratio, label
        outcomes = {outcome: sum(point[1] == outcome for point in points) for outcome in {point[1] for point in points}}
        print(f"{name:<12} {outcomes}  largest difference over both errors {worst:.2f} at {where}", flush=True)


if __name__ == "__main__":
    main()

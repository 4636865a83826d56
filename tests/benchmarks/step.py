"""What a Newton iteration and a slow-time step cost, over one dense solve of as many unknowns, in one process.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.step

The bundled dovetail sector near its resonance, 48 pairs, 5 harmonics, 128 samples: 1584 unknowns.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from solver.balance import Balance
from solver.continuation import follow_branch
from solver.joint import build_case
from solver.linear import JacobianSolver
from solver.march import march_wear
from solver.settings import SolverSettings
from studies.scenes import build_scene, scene_parameters

FREQUENCY = 211.75
AMPLITUDE = 0.5
FRICTION = 0.5
STEP = 1000.0
N_STEPS = 30
REPEATS = 7


def median_time(run: Callable[[], object]) -> float:
    """Median wall time of several runs after one that is not counted, s."""
    run()
    times = []
    for _ in range(REPEATS):
        started = time.perf_counter()
        run()
        times.append(time.perf_counter() - started)
    return float(np.median(times))


def main() -> None:
    """Prints the table."""
    settings = SolverSettings(harmonics=5, samples=128)
    model = build_scene("dovetail_sector", scene_parameters("dovetail_sector")(), 5)
    ((_, start),) = follow_branch(model, FRICTION, AMPLITUDE, np.array([FREQUENCY]), "up", settings)
    if start.state is None:
        raise RuntimeError(start.outcome.sentence)
    state = start.state
    joint = build_case(model, FRICTION, start.penalty_omega, settings).joint(state.omega, AMPLITUDE)
    balance = Balance(joint, state.start_history, state.wear_depth, np.zeros(model.contact.n_contact))
    predicted = balance.predict(state.displacement_h, state.contact_force_h)
    n = predicted.size
    matrix, right = np.random.default_rng(0).standard_normal((n, n)), np.ones(n)
    solver = JacobianSolver()

    def iteration() -> None:
        evaluation = balance.evaluate(predicted)
        solver.solve(balance.linearise(evaluation), -evaluation.residual + 1e-3)

    dense = median_time(lambda: np.linalg.solve(matrix, right))
    newton = median_time(iteration)
    cycles = np.array([0.0, N_STEPS * STEP])
    print(f"{n} unknowns; unit: one numpy.linalg.solve of as many, {1e3 * dense:.0f} ms here")
    print(f"one Newton iteration, factorisation kept: {newton / dense:.2f}")
    for scheme in ("implicit", "explicit"):
        march_wear(model, FRICTION, start, 1.1e-11, STEP, scheme, cycles[:1], settings)
        started = time.perf_counter()
        history = march_wear(model, FRICTION, start, 1.1e-11, STEP, scheme, cycles, settings)
        spent = time.perf_counter() - started
        iterations = history.newton_iterations - start.newton_iterations
        print(
            f"one {scheme} step: {spent / N_STEPS / dense:.2f}, {iterations / N_STEPS:.1f} iterations"
            f" ({history.outcome.meaning})"
        )


if __name__ == "__main__":
    main()

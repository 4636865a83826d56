"""Measured times of the ways to solve a Jacobian over their predicted costs (`solver.newton.cost`).

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.solve_costs

Joints of 1 to 48 pairs under a random predicted force, at which nearly all pairs slip and open. Each line has the
number of unknowns and of directions of slip, and for each way the time in ms and the predicted cost over this time, in
1e9 operations a second. Equal numbers in all columns are a perfect prediction.
"""

import time
from collections.abc import Callable

import numpy as np

from solver.harmonic_balance.dlft import Balance
from solver.model import ReducedModel
from solver.newton import cost
from solver.newton.options import NEWTON
from solver.newton.period_preconditioner import build_period_factor, resonances
from solver.newton.slip_preconditioner import build_slip_factor, find_slip_space
from solver.settings import SolverSettings, samples_for
from solver.structure.joint import build_case
from tests.solver.models import random_model, scene

REPEATS = 3


def shortest(run: Callable[[], object]) -> float:
    """Shortest time of a few runs, s of this thread."""
    run()
    times = []
    for _ in range(REPEATS):
        begun = time.thread_time()
        run()
        times.append(time.thread_time() - begun)
    return min(times)


def measure(name: str, model: ReducedModel, omega: float, amplitude: float, harmonics: int) -> None:
    """One line of the table."""
    settings = SolverSettings(harmonics, samples_for(harmonics))
    joint = build_case(model, 0.5, omega, settings).joint(omega, amplitude)
    n_pairs = model.contact.n_contact
    balance = Balance.frozen(joint, np.zeros((n_pairs, 2)), np.zeros(n_pairs))
    predicted = joint.structure.force_h()
    m = predicted.shape[1]
    noise = np.random.default_rng(0).normal(size=predicted.shape) / (1.0 + np.arange(m))
    evaluation = balance.evaluate(predicted + 0.3 * np.abs(predicted).max() * noise)
    tangent, right = balance.linearise(evaluation), -evaluation.residual
    pairs = tangent.active()
    n_rel = joint.rows_of(pairs).size
    space = find_slip_space(tangent, 10**9)
    every, factor, march = space, build_slip_factor(tangent, space), build_period_factor(tangent)
    d, k = len(resonances(joint)[0]), space.size
    ways: list[tuple[str, Callable[[], object], float]] = [
        (
            "slip",
            lambda: build_slip_factor(tangent, find_slip_space(tangent, k) or every),
            cost.slip_cost(n_pairs, m, k),
        ),
        ("product", lambda: (tangent.apply_roughly(right), factor.solve(right)), cost.product_cost(k)),
    ]
    if n_rel * m < 2500:
        dense = shortest(lambda: np.linalg.solve(tangent.dense(pairs), np.ones(n_rel * m)))
        ways.append(("dense", lambda: None, cost.dense_cost(n_rel * m, n_rel)))
    if march is not None:

        def run() -> None:
            build_period_factor(tangent)
            for _ in range(NEWTON.usual_products):
                tangent.apply_roughly(march.solve(right))

        ways.append(("march", run, cost.march_cost(tangent, d)))
    line = f"{name:12s} H {harmonics:3d} n {n_rel * m:5d} k {k:5d} d {d:4d}"
    for way, run_way, predicted_cost in ways:
        spent = dense if way == "dense" else shortest(run_way)
        line += f" | {way} {1e3 * spent:8.2f} {1e-9 * predicted_cost / spent:5.1f}"
    print(line, flush=True)


def main() -> None:
    """All joints."""
    for mesh, harmonics in ((1, (1, 3, 5, 9)), (2, (3, 5, 9))):
        for highest in harmonics:
            measure(f"dovetail {mesh}", scene("dovetail_sector", 13, mesh=mesh), 2.0 * np.pi * 211.75, 0.5, highest)
    for n_pairs, highest in ((1, 20), (1, 40), (2, 20), (3, 13), (4, 9), (4, 40), (6, 60), (8, 100), (12, 60)):
        measure(f"{n_pairs} pairs", random_model(3, ("3d",) * n_pairs), 95.0, 90.0, highest)


if __name__ == "__main__":
    main()

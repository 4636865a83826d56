"""How many random points of the bundled dovetail sector have a wear history with a value, and what becomes of the rest.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.random_sector --mesh 1 [--count 200] [--first 0] [--records FILE]

Each point: nodal diameter 0 to 23, friction coefficient 0.1 to 0.8, 0.1 to 3 N, 0.98 to 1.02 times the first natural
frequency of its stuck joint, 1e5 cycles with the default settings. A value is a complete outcome, or an end that is
physics: the vibration doubles its period, or the root drifts. Prints the outcomes and the points without a value.
"""

import argparse
import json
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from solver.outcome import Outcome
from solver.settings import SolverSettings
from solver.wear_history import march_wear
from tests.random_scenes import SALT, log_uniform
from tests.solver.models import glued_frequency, scene

WEAR = 1.1e-11  # 1/Pa
CYCLES = np.linspace(0.0, 1e5, 101)
VALUES = {outcome.meaning for outcome in Outcome if outcome.complete} | {"period_doubled", "adrift"}


def run_point(seed: int, mesh: int, bound: float) -> dict[str, Any]:
    """What became of the point of a seed. bound: CPU seconds for sweep and history."""
    random = np.random.default_rng([SALT, seed])
    diameter, friction = int(random.integers(0, 24)), float(random.uniform(0.1, 0.8))
    amplitude, ratio = log_uniform(random, 0.1, 3.0), float(random.uniform(0.98, 1.02))
    model = scene("dovetail_sector", mesh=mesh, nodal_diameter=diameter)
    frequency, started = ratio * glued_frequency(model), time.process_time()
    settings = SolverSettings(time_limit=bound)
    history = march_wear(model, frequency, amplitude, friction, WEAR, CYCLES, settings=settings)
    return {
        "seed": seed,
        "facts": f"mesh {mesh}, d {diameter}, mu {friction:.3f}, {amplitude:.3f} N, {frequency:.3f} Hz",
        "outcome": history.outcome.meaning,
        "message": history.message,
        "last_cycle": history.last_cycle,
        "worn": 1e9 * float(history.worn_volume[-1]),
        "error": history.error_estimate,
        "iterations": history.newton_iterations,
        "time": time.process_time() - started,
    }


def main() -> None:
    """Runs the points and prints the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--mesh", type=int, default=1)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--bound", type=float, default=120.0, help="CPU seconds of a point")
    parser.add_argument("--records", type=Path)
    given = parser.parse_args()
    records = []
    for seed in range(given.first, given.first + given.count):
        records.append(run_point(seed, given.mesh, given.bound))
        if given.records is not None:
            with given.records.open("a") as file:
                file.write(json.dumps(records[-1]) + "\n")
    failed = [record for record in records if record["outcome"] not in VALUES]
    worn = sum(record["worn"] > 0.0 for record in records)
    spent = sum(record["time"] for record in records)
    print(f"{len(records) - len(failed)} of {len(records)} points with a value, {worn} worn, {spent:.0f} CPU s")
    print("outcomes:", dict(Counter(record["outcome"] for record in records)))
    for record in failed:
        print(*(record[name] for name in ("seed", "facts", "outcome", "last_cycle", "message")), sep=" | ")


if __name__ == "__main__":
    main()

"""How many random points of the bundled dovetail sector have a wear history with a value, and what becomes of the rest.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.random_sector --mesh 1 [--count 200] [--first 0] [--records FILE]

Each point: nodal diameter 0 to 23, friction coefficient 0.1 to 0.8, 0.1 to 3 N, 0.98 to 1.02 times the first natural
frequency of its stuck joint, 1e5 cycles with the default settings. A value is a complete outcome, or an end that is
physics: the vibration doubles its period, or the root drifts. Prints all points, and how many have a value.
"""

import numpy as np

from solver import march_wear
from solver.outcome import COMPLETE, Outcome
from solver.settings import SolverSettings
from tests.benchmarks.frame import Table, arguments, measure
from tests.random_scenes import SALT, log_uniform
from tests.solver.models import glued_frequency, scene

VALUES = {*COMPLETE, Outcome.PERIOD_DOUBLED, Outcome.ADRIFT}


def main() -> None:
    """Runs the points and prints the table."""
    given = arguments(__doc__, mesh=1, count=200, first=0, bound=120.0, records=None)
    table = Table("point", "outcome", "cycles", "mm3", "error", "iterations", "CPU s", "message", file=given.records)
    n_values, n_worn, spent = 0, 0, 0.0
    for seed in range(given.first, given.first + given.count):
        random = np.random.default_rng([SALT, seed])
        diameter, friction = int(random.integers(0, 24)), float(random.uniform(0.1, 0.8))
        amplitude, ratio = log_uniform(random, 0.1, 3.0), float(random.uniform(0.98, 1.02))
        model = scene("dovetail_sector", mesh=given.mesh, nodal_diameter=diameter)
        point, settings = (ratio * glued_frequency(model), amplitude, friction), SolverSettings(time_limit=given.bound)
        found = measure(lambda model=model, point=point: march_wear(model, *point, 1.1e-11, 1e5, settings=settings))  # noqa: B023
        history, facts = found.result, f"{seed}: d {diameter}, {point[0]:.2f} Hz, {amplitude:.3f} N, mu {friction:.3f}"
        worn = 1e9 * float(history.worn_volume[-1])
        ended = (history.outcome, history.last_cycle, worn, history.error_estimate)
        table.row(facts, *ended, found.iterations, found.seconds, history.message)
        n_values, n_worn, spent = n_values + (history.outcome in VALUES), n_worn + (worn > 0.0), spent + found.seconds
    print(f"{n_values} of {given.count} points with a value, {n_worn} worn, {spent:.0f} CPU s")


if __name__ == "__main__":
    main()

"""Automatic states of random scenes against their exact motions.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.campaign [SCENES_OF_A_KIND [FIRST_SEED]]

For each kind of scene and rtol 1e-2 and 1e-3 a line of counts: states that converge; those with an error above rtol;
those with an error above twice its estimate; shares of errors that are estimated more than five times too large; states
without a reference (no motion with the period of the force); the outcomes of the others. Then the largest error over
rtol, the smallest estimate over error, and the seeds of what went wrong.
"""

import sys
from collections import Counter

import numpy as np

from solver.outcome import Outcome
from tests.event_driven import NoPeriodicMotionError
from tests.solver.random_orbits import KINDS, Found, drawn, find

ROUND_OFF = 1e-10


def ratios(found: Found) -> list[float]:
    """Estimate over error, of response and wear rate, where there is an error."""
    both = (found.response_estimate, found.response), (found.wear_rate_estimate, found.wear_rate)
    return [estimate / error for estimate, error in both if error > ROUND_OFF]


def line(kind: str, rtol: float, seeds: range) -> str:
    """Counts of one kind."""
    counts: Counter[str] = Counter()
    others: Counter[str] = Counter()
    largest, smallest, wrong = 0.0, np.inf, []
    for seed in seeds:
        try:
            found = find(drawn(kind, seed), rtol, "up" if seed % 2 else "down")
        except NoPeriodicMotionError:
            counts["without"] += 1
            continue
        if found.outcome is not Outcome.CONVERGED:
            others[found.outcome.meaning] += 1
            wrong.append(seed)
            continue
        counts["converged"] += 1
        error, low, high = max(found.response, found.wear_rate), *(f(ratios(found) or [1.0]) for f in (min, max))
        counts["wrong"] += error > rtol
        counts["unsafe"] += low < 0.5
        counts["cautious"] += high > 5.0
        largest, smallest = max(largest, error / rtol), min(smallest, low)
        wrong += [seed] if error > rtol or low < 0.5 else []
    numbers = " ".join(f"{counts[name]:5d}" for name in ("converged", "wrong", "unsafe", "cautious", "without"))
    return f"{kind:16s} {rtol:g} {numbers}  {largest:5.2f} {smallest:5.2f}  {dict(others) or ''} {wrong or ''}"


def main() -> None:
    """Prints the table."""
    many, first = ([int(argument) for argument in sys.argv[1:]] + [20, 0][len(sys.argv) - 1 :])[:2]
    print("kind             rtol  conv wrong unsafe cautious without  error/rtol estimate/error")
    for kind in KINDS:
        for rtol in (1e-2, 1e-3):
            print(line(kind, rtol, range(first, first + many)), flush=True)


if __name__ == "__main__":
    main()

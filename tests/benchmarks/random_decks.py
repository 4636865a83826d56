"""How many random models of elastic blocks get a static state, against whether there is one.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.random_decks [--count 200] [--first 0]

A linear programme says whether contact forces can balance the static load at all. Each state that is found is checked
against every law of contact. Prints outcomes, the largest error of each law, iterations, and the models for which
solver and linear programme disagree.
"""

import argparse
from collections import Counter

import numpy as np

from solver.continuation.static_state import solve_static_state
from solver.newton.run import Budget, Run
from solver.outcome import Outcome
from solver.settings import SolverSettings
from solver.structure.joint import build_case
from tests.random_decks import RandomDeck, equilibrium_possible, law_errors, random_deck

SETTINGS = SolverSettings()
OMEGA = 2.0 * np.pi * 1000.0  # rad/s; the penalty alone depends on it
EXISTS = {True: "possible", False: "impossible", None: "at the limit"}
NAMED = (Outcome.STATIC_SLIDING, Outcome.STATIC_OPEN)


def run_deck(deck: RandomDeck) -> tuple[str, Outcome, dict[str, float], int]:
    """Whether there is a static state, what the solver says, errors of the laws, iterations."""
    joint = build_case(deck.model, deck.friction, OMEGA, SETTINGS).joint(OMEGA, 0.0)
    structure, budget = joint.structure, Budget()
    exists = EXISTS[equilibrium_possible(structure.static_stiffness, structure.static_force, deck.friction)]
    point = solve_static_state(joint, np.zeros(joint.contact.n_contact), Run(SETTINGS.tolerance, budget))
    if isinstance(point, Outcome):
        return exists, point, {}, budget.iterations
    return exists, Outcome.CONVERGED, law_errors(joint, point), budget.iterations


def main() -> None:
    """Runs the models and prints the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    counts, iterations, worst = Counter[tuple[str, str]](), [], dict[str, float]()
    for seed in range(given.first, given.first + given.count):
        deck = random_deck(seed)
        exists, outcome, errors, taken = run_deck(deck)
        counts[exists, outcome.meaning] += 1
        iterations.append(taken)
        for law, error in errors.items():
            worst[law] = max(worst.get(law, 0.0), error)
        expected = {"possible": (Outcome.CONVERGED,), "impossible": NAMED}.get(exists, (Outcome.CONVERGED, *NAMED))
        if outcome not in expected:
            print(f"seed {seed}, static state {exists}: {outcome.meaning}; {deck.facts}")
    for (exists, meaning), count in sorted(counts.items()):
        print(f"static state {exists:12} {meaning:14} {count}")
    print("largest errors:", ", ".join(f"{law} {error:.1e}" for law, error in worst.items()))
    quantiles = ", ".join(f"{share}: {np.quantile(iterations, share):.0f}" for share in (0.5, 0.9, 1.0))
    print(f"iterations: {quantiles}")


if __name__ == "__main__":
    main()

"""How many random models of elastic blocks get a static state, against whether there is one.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.random_decks [--count 200] [--first 0]

A linear programme says whether contact forces can balance the static load at all. Each state that is found is checked
against every law of contact. Prints outcomes, the largest error of each law, iterations, and the models for which
solver and linear programme disagree.
"""

from collections import Counter

import numpy as np

from solver.continuation.first_state import solve_static_state
from solver.newton.run import Budget, Run
from solver.outcome import Outcome
from solver.settings import SolverSettings
from solver.structure.joint import build_case
from tests.benchmarks.frame import Table, arguments
from tests.random_decks import RandomDeck, equilibrium_possible, law_errors, random_deck

SETTINGS = SolverSettings()
OMEGA = 2.0 * np.pi * 1000.0  # rad/s; the penalty alone depends on it
EXISTS = {True: "possible", False: "impossible", None: "at the limit"}
NAMED = (Outcome.STATIC_SLIDING, Outcome.STATIC_OPEN)
EXPECTED = {"possible": (Outcome.CONVERGED,), "impossible": NAMED, "at the limit": (Outcome.CONVERGED, *NAMED)}


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
    given = arguments(__doc__, count=200, first=0)
    counts, iterations, worst = Counter[tuple[str, str]](), [], dict[str, float]()
    others = Table("solver and linear programme disagree", "seed", "state", "outcome")
    for seed in range(given.first, given.first + given.count):
        deck = random_deck(seed)
        exists, outcome, errors, taken = run_deck(deck)
        counts[exists, outcome.meaning] += 1
        iterations.append(taken)
        worst |= {law: max(worst.get(law, 0.0), error) for law, error in errors.items()}
        if outcome not in EXPECTED[exists]:
            others.row(deck.facts, seed, exists, outcome)
    table = Table("static state", "outcome", "number")
    for (exists, meaning), count in sorted(counts.items()):
        table.row(exists, meaning, count)
    print("largest errors:", ", ".join(f"{law} {error:.1e}" for law, error in worst.items()))
    print("iterations, median, 90 % and all:", *np.quantile(iterations, (0.5, 0.9, 1.0)))


if __name__ == "__main__":
    main()

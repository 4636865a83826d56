"""Errors of automatic states against the exact references, with what was estimated of them.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.accuracy [exact] [cantilevers] [--rtol 1e-2 1e-3]

A row for each state of the textbook scenes and each tolerance: error of the amplitude and of the complex first harmonic
with its estimate; the same for the wear rate; highest harmonic, samples in a period and Newton iterations. Then, for
minutes, response and peak of the cantilever with rigid friction at its tip, and the estimate of both. "no" marks an
error above the tolerance or above twice its estimate.
"""

from solver.outcome import Outcome
from solver.settings import SolverSettings
from tests.benchmarks.frame import Table, arguments
from tests.solver.exact_scenes import SPRINGS, find, textbook_scenes, tip_errors

CANTILEVERS = [  # spring, force, N, frequency, rad/s
    *((name, *at) for name in ("rigid", "stiff spring") for at in ((3.0, 0.7), (3.0, 0.96), (6.0, 0.85))),
    *((name, 6.0, 1.2) for name in SPRINGS),
]


def exact_states(rtol: float) -> None:
    columns = ("response", "estimate", "wear rate", "estimate", "harmonics", "samples", "iterations")
    table = Table(f"rtol {rtol:g}", *columns, "good")
    for name, (scene, sweep) in textbook_scenes().items():
        found = find(scene, SolverSettings(rtol=rtol), sweep)
        (response, wear_rate), history = found.told, found.history
        good = history.outcome is Outcome.CONVERGED and found.safe and max(found.response, found.wear_rate) <= rtol
        costs = history.harmonics_used[0], history.samples_used[0], history.newton_iterations
        table.row(name, found.response, response, found.wear_rate, wear_rate, *costs, "yes" if good else "no")


def cantilevers(rtol: float) -> None:
    table = Table(f"rtol {rtol:g}", "N", "rad/s", "response", "peak", "estimate", "good")
    for name, force, omega in CANTILEVERS:
        start, errors = tip_errors(name, force, omega, SolverSettings(rtol=rtol))
        good = 0.5 * max(errors) < start.response_error <= rtol and max(errors) < rtol
        table.row(name, force, omega, *errors, start.response_error, "yes" if good else "no")


def main() -> None:
    given = arguments(__doc__, ("exact", "cantilevers"), rtol=[1e-2, 1e-3])
    for rtol in given.rtol:
        for word, show in (("exact", exact_states), ("cantilevers", cantilevers)):
            if word in given.chosen:
                show(rtol)


if __name__ == "__main__":
    main()

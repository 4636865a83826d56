"""Errors of automatic states against the exact references, with what was estimated of them.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.accuracy [RTOL ...]

Prints a line for each state of the textbook scenes and each relative tolerance (by default 1e-2 and 1e-3): the error of
the amplitude and of the complex first harmonic, its estimate and the ratio of the two; the same for the wear rate; the
highest harmonic, with `odd` where the even ones were left out, the samples in a period and the Newton iterations. Stars
mark an error above the tolerance or above twice its estimate.
"""

from __future__ import annotations

import sys

from solver.settings import SolverSettings
from tests.event_driven import NoPeriodicMotionError
from tests.solver.exact import ExactState, errors_of, states

HEAD = (
    f"{'state':26s} {'amplitude':>10s} {'response':>10s} {'estimate':>10s} {'ratio':>6s}"
    f" {'wear rate':>10s} {'estimate':>10s} {'ratio':>6s} {'H':>6s} {'N':>5s} {'Newton':>6s}"
)


def ratio(estimate: float, error: float) -> str:
    """Estimate over error; nothing where the state is exact."""
    return f"{estimate / error:6.1f}" if error > 1e-10 else f"{'-':>6s}"


def line(name: str, exact: ExactState, rtol: float) -> str:
    """A line of the table."""
    errors = errors_of(exact, SolverSettings(rtol=rtol))
    odd = len(errors.orders) > 1 and all(order % 2 for order in errors.orders)
    good = errors.accurate and errors.safe and max(errors.response, errors.wear) <= rtol
    return (
        f"{name:26s} {errors.amplitude:10.1e} {errors.response:10.1e} {errors.estimate.response:10.1e}"
        f" {ratio(errors.estimate.response, errors.response)} {errors.wear:10.1e} {errors.estimate.wear_rate:10.1e}"
        f" {ratio(errors.estimate.wear_rate, errors.wear)} {f'{errors.orders[-1]}' + ('odd' if odd else ''):>6s}"
        f" {errors.samples:5d} {errors.iterations:6d}{'' if good else ' ***'}"
    )


def main() -> None:
    """Prints the tables."""
    for rtol in [float(argument) for argument in sys.argv[1:]] or [1e-2, 1e-3]:
        print(f"rtol {rtol:g}")
        print(HEAD)
        for name, state in states().items():
            try:
                print(line(name, state(), rtol))
            except NoPeriodicMotionError:
                print(f"{name:26s} has no periodic motion")


if __name__ == "__main__":
    main()

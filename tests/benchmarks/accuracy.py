"""Errors of automatic states against the exact references, with what was estimated of them.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.accuracy [RTOL ...]

Prints a line for each state of the textbook scenes and each relative tolerance (by default 1e-2 and 1e-3): the error of
the amplitude and of the complex first harmonic, its estimate and the ratio of the two; the same for the wear rate; the
highest harmonic, with `odd` where the even ones were left out, the samples in a period and the Newton iterations. Stars
mark an error above the tolerance or above twice its estimate. At last, for minutes, the response and the peak of the
cantilever with rigid friction at its tip, each over rtol, and the estimate of both.
"""

import sys

from solver.settings import SolverSettings
from tests.cantilever import FRICTION, Cantilever
from tests.event_driven import NoPeriodicMotionError
from tests.solver.exact import ExactState, errors_of, states
from tests.solver.models import branch_states
from tests.solver.test_rigid import SPRINGS, exact, reported

CANTILEVERS = [  # spring, force, N, frequency, rad/s
    *(
        (name, force, omega)
        for name in ("rigid", "stiff spring")
        for force, omega in ((3.0, 0.7), (3.0, 0.96), (6.0, 0.85))
    ),
    *((name, 6.0, 1.2) for name in SPRINGS),
]

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


def cantilever_line(name: str, force: float, omega: float, rtol: float) -> str:
    """A line of the last table."""
    model, settings = Cantilever(spring=SPRINGS[name]).model(), SolverSettings(rtol=rtol)
    (start,) = branch_states(model, FRICTION, force, [omega], settings)
    found = zip(reported(model, FRICTION, start, settings), exact(name, force, omega), strict=True)
    errors = [abs(own / true - 1.0) for own, true in found]
    good = 0.5 * max(errors) < start.response_error <= rtol and max(errors) < rtol
    words = f"{name:14s} {force:4.1f} N {omega:5.2f} rad/s {errors[0] / rtol:8.2f} {errors[1] / rtol:8.2f}"
    return f"{words} {start.response_error / rtol:8.2f}{'' if good else ' ***'}"


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
        for case in CANTILEVERS:
            print(cantilever_line(*case, rtol), flush=True)


if __name__ == "__main__":
    main()

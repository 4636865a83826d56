"""Error of the worn volume against run time across methods: the schemes of the solver and a plain time integration.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.methods [slider] [dovetail] [--picture FILE]

Two scenes, 1e5 cycles each: a mass on a rigid slider, whose truth is its differential equation (closed form of Den
Hartog), and the bundled dovetail root with mesh 1 at 212.42 Hz, whose truth is the time integration, extrapolated from
the two smallest numbers of cycles of a period. Times are CPU seconds with the way to the unworn state, without the
compilation of kernels.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from solver import march_wear
from solver.model import ReducedModel
from solver.settings import Scheme, SolverSettings
from tests.benchmarks import time_integration
from tests.benchmarks.frame import Table, arguments, measure
from tests.references import slider_amplitude, slider_wear_depth
from tests.solver.models import scene

FRICTION, WEAR, CYCLES = 0.5, 1.1e-11, 1e5
HARMONICS = 21
TARGETS = (0.05, 0.01, 0.001)
INTEGRATION = "time integration"
Run = tuple[str, str, float, float]
"""Method and setting in words, CPU seconds, worn volume, m3."""


@dataclass(frozen=True)
class Case:
    """A scene at one frequency, Hz, and amplitude, N, and the settings that are compared.

    rtols: of the adaptive scheme. steps: of Euler schemes, cycles. each: cycles of a period of the time integration.
    periods: of its run-up; 0 to settle from rest. n_steps: in a period. truth: m3; None for the extrapolated one.
    """

    model: ReducedModel
    frequency: float
    amplitude: float
    rtols: tuple[float, ...]
    steps: tuple[float, ...]
    each: tuple[float, ...]
    periods: int
    n_steps: int
    truth: float | None = None


def wear_histories(case: Case) -> Iterator[Run]:
    """All runs of the solver."""
    runs: list[tuple[Scheme, float, float]] = [("adaptive", 1e3, rtol) for rtol in case.rtols]
    runs += [(scheme, step, 1e-2) for scheme in ("implicit", "explicit") for step in case.steps]
    point = (case.model, case.frequency, case.amplitude, FRICTION, WEAR, CYCLES)
    for scheme, step, rtol in runs:
        asked = {"settings": SolverSettings(rtol=rtol), "scheme": scheme}
        asked |= {} if scheme == "adaptive" else {"step": step}
        found = measure(lambda: march_wear(*point, **asked))  # noqa: B023
        setting = f"rtol {rtol:g}" if scheme == "adaptive" else f"step {step:g}"
        yield scheme, setting, found.seconds, float(found.result.worn_volume[-1])


def integrations(case: Case) -> Iterator[Run]:
    """All runs of the time integration, from the same unworn motion."""
    model, gap = case.model, case.model.contact.gap

    def unworn() -> tuple[time_integration.Structure, time_integration.Motion]:
        if case.periods:
            course = time_integration.run_up(case.frequency, case.amplitude, case.periods)
            return time_integration.loaded(model, FRICTION, course, case.n_steps)
        structure = time_integration.build(model, FRICTION, case.frequency, case.amplitude, case.n_steps)
        rest = time_integration.at_rest(model, structure, gap)
        return structure, time_integration.settle(structure, rest, gap, work_change=5e-3)[0]

    begun = measure(unworn)
    for each in case.each:
        worn = measure(lambda: [*time_integration.wear(model, *begun.result, WEAR, each, CYCLES)][-1])  # noqa: B023
        volume = float(worn.result[1] @ model.contact.area)
        yield INTEGRATION, f"{each:g} cycles a period", begun.seconds + worn.seconds, volume


def slider() -> Case:
    """A mass on a rigid slider, and its exact worn volume."""
    depth = slider_wear_depth(
        np.array([0.0, CYCLES]),
        wear_coefficient=WEAR,
        area=1e-4,
        friction_coefficient=FRICTION,
        normal_load=10.0,
        normal_stiffness=1e5,
        amplitude=lambda limit: slider_amplitude(0.1, 8.0, 1.6e5, 10.0, limit, 2.0 * np.pi * 160.0),
    )
    compared = ((1e-1, 1e-2, 1e-3), (1e4, 2500.0, 500.0, 100.0), (6e3, 2e3, 600.0))
    model = scene("sdof_slider", HARMONICS, damping=8.0)
    return Case(model, 160.0, 10.0, *compared, 0, 400, float(depth[-1]) * 1e-4)


def dovetail() -> Case:
    """The dovetail root with 16 pairs."""
    compared = ((5e-2, 1e-2, 3e-3), (2000.0, 1000.0, 500.0), (160.0, 80.0, 40.0))
    return Case(scene("dovetail_sector", HARMONICS, mesh=1), 212.42, 0.5, *compared, 400, 250)


def least_time(runs: list[Run], truth: float, target: float) -> float | None:
    """Least CPU time of a run whose error, and that of all dearer ones, is below the target."""
    dearest_first = sorted(runs, key=lambda run: -run[2])
    exact = [abs(volume / truth - 1.0) <= target for *_, volume in dearest_first]
    n_exact = exact.index(False) if False in exact else len(exact)
    return dearest_first[n_exact - 1][2] if n_exact else None


def main() -> None:
    """For each scene all runs, and what an error costs with each method."""
    given = arguments(__doc__, ("slider", "dovetail"), picture=None)
    for name in given.chosen:
        case = {"slider": slider, "dovetail": dovetail}[name]()
        # kernels are compiled and loaded before anything is timed
        list(integrations(replace(case, each=(CYCLES / 2,), periods=0)))
        next(wear_histories(case))
        runs = [*wear_histories(case), *integrations(case)]
        coarse, fine = (volume for *_, volume in runs[-2:])
        truth = case.truth or fine + (fine - coarse) / 3.0
        table = Table(f"{name}, truth {1e9 * truth:.5g} mm3", "CPU s", "error, %")
        for method, setting, seconds, volume in runs:
            table.row(f"{method}, {setting}", seconds, 100.0 * abs(volume / truth - 1.0))
        table.draw(given.picture, "CPU s", "error, %", "log")
        costs = Table("CPU s for an error of", *(f"{target:.1%}" for target in TARGETS))
        for method in dict.fromkeys(run[0] for run in runs):
            own = [run for run in runs if run[0] == method]
            costs.row(method, *(least_time(own, truth, target) for target in TARGETS))


if __name__ == "__main__":
    main()

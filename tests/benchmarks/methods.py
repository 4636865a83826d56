"""Error of the worn volume against run time across methods: the schemes of the solver and a plain time integration.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.methods [slider] [dovetail]

Two scenes, 1e5 cycles each: a mass on a rigid slider, whose truth is its differential equation (closed form of Den
Hartog), and the bundled dovetail root with mesh 1 at 212.42 Hz, whose truth is the time integration, extrapolated from
the two smallest numbers of cycles of a period. Times are CPU seconds with the way to the unworn state, without the
compilation of kernels.
"""

from collections.abc import Iterator

import numpy as np

from solver import march_wear
from solver.model import ReducedModel
from solver.settings import SolverSettings
from tests.benchmarks import time_integration
from tests.benchmarks.frame import Table, arguments, measure
from tests.references import slider_amplitude, slider_wear_depth
from tests.solver.models import scene

FRICTION, WEAR, CYCLES = 0.5, 1.1e-11, 1e5
HARMONICS = 21
TARGETS = (0.05, 0.01, 0.001)
CASES = {
    "slider": ("sdof_slider", {"damping": 8.0}, (160.0, 10.0), (1e-1, 1e-2, 1e-3), (1e4, 2500.0, 500.0, 100.0)),
    "dovetail": ("dovetail_sector", {"mesh": 1}, (212.42, 0.5), (5e-2, 1e-2, 3e-3), (2000.0, 1000.0, 500.0)),
}
"""Scene and its parameters; Hz and N; tolerances of the adaptive scheme; steps of the Euler schemes, cycles."""
IN_TIME = {"slider": (400, 0, (6e3, 2e3, 600.0)), "dovetail": (250, 400, (160.0, 80.0, 40.0))}
"""Of the time integration: steps of a period, periods of its run-up (0: settled from rest), cycles of a period."""
Row = tuple[str, str, float, float]
"""Method and setting in words, CPU seconds, worn volume, m3."""


def wear_histories(
    model: ReducedModel, at: tuple[float, float], rtols: tuple[float, ...], steps: tuple[float, ...]
) -> Iterator[Row]:
    asked = [(f"rtol {rtol:g}", {"settings": SolverSettings(rtol=rtol)}) for rtol in rtols]
    for scheme in ("implicit", "explicit"):
        asked += [(f"step {step:g}", {"scheme": scheme, "step": step}) for step in steps]
    for setting, given in asked:
        found = measure(lambda: march_wear(model, *at, FRICTION, WEAR, CYCLES, **given))  # noqa: B023
        yield str(given.get("scheme", "adaptive")), setting, found.seconds, float(found.result.worn_volume[-1])


def integrations(
    model: ReducedModel, at: tuple[float, float], n_steps: int, periods: int, each: tuple[float, ...]
) -> Iterator[Row]:
    """All runs of the time integration, from the same unworn motion."""

    def unworn() -> tuple[time_integration.Structure, time_integration.Motion]:
        if periods:
            return time_integration.loaded(model, FRICTION, time_integration.run_up(*at, periods), n_steps)
        structure, gap = time_integration.build(model, FRICTION, *at, n_steps), model.contact.gap
        rest = time_integration.at_rest(model, structure, gap)
        return structure, time_integration.settle(structure, rest, gap, work_change=5e-3)

    begun = measure(unworn)
    for length in each:
        worn = measure(lambda: [*time_integration.wear(model, *begun.result, WEAR, length, CYCLES)][-1])  # noqa: B023
        volume = float(worn.result[1] @ model.contact.area)
        yield "time integration", f"{length:g} cycles a period", begun.seconds + worn.seconds, volume


def slider_volume() -> float:
    """Exact worn volume of the slider, m3."""
    omega = 2.0 * np.pi * 160.0
    depth = slider_wear_depth([0.0, CYCLES], lambda limit: slider_amplitude(0.1, 8.0, 1.6e5, 10.0, limit, omega))
    return float(depth[-1]) * 1e-4


def least_time(runs: list[Row], truth: float, target: float) -> float | None:
    """Least CPU time of a run whose error, and that of all dearer ones, is below the target."""
    least = None
    for *_, seconds, volume in sorted(runs, key=lambda run: -run[2]):
        if abs(volume / truth - 1.0) > target:
            break
        least = seconds
    return least


def main() -> None:
    given = arguments(__doc__, tuple(CASES))
    for name in given.chosen:
        (kind, values, *case), (n_steps, periods, each) = CASES[name], IN_TIME[name]
        model = scene(kind, HARMONICS, **values)
        # kernels are compiled and loaded before anything is timed
        list(integrations(model, case[0], n_steps, 0, (CYCLES / 2,)))
        next(wear_histories(model, *case))
        runs = [*wear_histories(model, *case), *integrations(model, case[0], n_steps, periods, each)]
        coarse, fine = (volume for *_, volume in runs[-2:])
        truth = slider_volume() if name == "slider" else fine + (fine - coarse) / 3.0
        table = Table(f"{name}, truth {1e9 * truth:.5g} mm3", "CPU s", "error, %")
        for method, setting, seconds, volume in runs:
            table.row(f"{method}, {setting}", seconds, 100.0 * abs(volume / truth - 1.0))
        costs = Table("CPU s for an error of", *(f"{target:.1%}" for target in TARGETS))
        for method in dict.fromkeys(run[0] for run in runs):
            own = [run for run in runs if run[0] == method]
            costs.row(method, *(least_time(own, truth, target) for target in TARGETS))


if __name__ == "__main__":
    main()

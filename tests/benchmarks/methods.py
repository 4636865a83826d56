"""Error of the worn volume against run time across methods: the schemes of the solver and a plain time integration.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.methods

A mass on a rigid slider, 1e5 cycles, whose truth is its differential equation (closed form of Den Hartog). Times are
CPU seconds with the way to the unworn state, without the compilation of kernels.
"""

from collections.abc import Iterator

import numpy as np

from solver import march_wear
from solver.model import ReducedModel
from solver.settings import SolverSettings
from tests.benchmarks import time_integration
from tests.benchmarks.frame import Table, measure
from tests.references import slider_amplitude, slider_wear_depth
from tests.solver.models import scene

FRICTION, WEAR, CYCLES = 0.5, 1.1e-11, 1e5
AT = (160.0, 10.0)  # Hz, N
DAMPING = 8.0  # N s/m
TARGETS = (0.05, 0.01, 0.001)
RTOLS, STEPS = (1e-1, 1e-2, 1e-3), (1e4, 2500.0, 500.0, 100.0)
EACH, STEPS_A_PERIOD = (6e3, 2e3, 600.0), 400  # of the time integration: cycles for which a period stands
Row = tuple[str, str, float, float]
"""Method and setting in words, CPU seconds, worn volume, m3."""


def wear_histories(model: ReducedModel) -> Iterator[Row]:
    asked = [(f"rtol {rtol:g}", {"settings": SolverSettings(rtol=rtol)}) for rtol in RTOLS]
    for scheme in ("implicit", "explicit"):
        asked += [(f"step {step:g}", {"scheme": scheme, "step": step}) for step in STEPS]
    for setting, given in asked:
        found = measure(lambda: march_wear(model, *AT, FRICTION, WEAR, CYCLES, **given))  # noqa: B023
        yield str(given.get("scheme", "adaptive")), setting, found.seconds, float(found.result.worn_volume[-1])


def integrations(model: ReducedModel) -> Iterator[Row]:
    """All runs of the time integration, from the same unworn motion."""
    gap = model.contact.gap

    def unworn() -> tuple[time_integration.Structure, time_integration.Motion]:
        structure = time_integration.build(model, FRICTION, *AT, STEPS_A_PERIOD)
        rest = time_integration.at_rest(model, structure, gap)
        return structure, time_integration.settle(structure, rest, gap, work_change=5e-3)

    begun = measure(unworn)
    for length in EACH:
        worn = measure(lambda: [*time_integration.wear(model, *begun.result, WEAR, length, CYCLES)][-1])  # noqa: B023
        volume = float(worn.result[1] @ model.contact.area)
        yield "time integration", f"{length:g} cycles a period", begun.seconds + worn.seconds, volume


def least_time(runs: list[Row], truth: float, target: float) -> float | None:
    """Least CPU time of a run whose error, and that of all dearer ones, is below the target."""
    least = None
    for *_, seconds, volume in sorted(runs, key=lambda run: -run[2]):
        if abs(volume / truth - 1.0) > target:
            break
        least = seconds
    return least


def main() -> None:
    model, omega = scene("sdof_slider", damping=DAMPING), 2.0 * np.pi * AT[0]
    # kernels are compiled and loaded before anything is timed
    next(integrations(model))
    next(wear_histories(model))
    runs = [*wear_histories(model), *integrations(model)]
    depth = slider_wear_depth([0.0, CYCLES], lambda limit: slider_amplitude(0.1, DAMPING, 1.6e5, AT[1], limit, omega))
    truth = float(depth[-1]) * 1e-4
    table = Table(f"slider, truth {1e9 * truth:.5g} mm3", "CPU s", "error, %")
    for method, setting, seconds, volume in runs:
        table.row(f"{method}, {setting}", seconds, 100.0 * abs(volume / truth - 1.0))
    costs = Table("CPU s for an error of", *(f"{target:.1%}" for target in TARGETS))
    for method in dict.fromkeys(run[0] for run in runs):
        own = [run for run in runs if run[0] == method]
        costs.row(method, *(least_time(own, truth, target) for target in TARGETS))


if __name__ == "__main__":
    main()

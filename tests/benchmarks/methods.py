"""Error of the worn volume against run time across methods: the schemes of the solver and a plain time integration.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.methods [slider] [dovetail] [--picture methods.png]

Two scenes, 1e5 cycles each: a mass on a rigid slider, whose truth is its differential equation (closed form of Den
Hartog), and the bundled dovetail root with mesh 1 at 212.42 Hz, whose truth is the time integration, extrapolated from
the two smallest numbers of cycles of a period. Times are CPU seconds with the way to the unworn state, without the
compilation of kernels.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator

from solver.loading_history.start_states import follow_branch
from solver.model import ReducedModel
from solver.settings import Scheme, SolverSettings
from tests.benchmarks import time_integration
from tests.references import slider_amplitude, slider_wear_depth
from tests.solver.models import march_wear, scene

FRICTION, WEAR, CYCLES = 0.5, 1.1e-11, 1e5
HARMONICS = 21
TARGETS = (0.05, 0.01, 0.001)
INTEGRATION = "time integration"


@dataclass(frozen=True)
class Run:
    """One computation: its method and setting in words, CPU seconds, worn volume, m3."""

    method: str
    setting: str
    seconds: float
    volume: float


@dataclass(frozen=True)
class Case:
    """A scene at one frequency, Hz, and amplitude, N, and the settings that are compared.

    rtols: of the adaptive scheme. steps: of Euler schemes, cycles. each: cycles of a period of the time integration.
    periods: of its run-up; 0 to settle from rest. n_steps: in a period.
    """

    title: str
    model: ReducedModel
    frequency: float
    amplitude: float
    rtols: tuple[float, ...]
    steps: tuple[float, ...]
    each: tuple[float, ...]
    periods: int
    n_steps: int


def wear_histories(case: Case) -> Iterator[Run]:
    """All runs of the solver."""
    runs: list[tuple[Scheme, float, float]] = [("adaptive", 1e3, rtol) for rtol in case.rtols]
    runs += [(scheme, step, 1e-2) for scheme in ("implicit", "explicit") for step in case.steps]
    for scheme, step, rtol in runs:
        settings = SolverSettings(rtol=rtol)
        began = time.thread_time()
        frequencies = np.array([case.frequency])
        ((_, start),) = follow_branch(case.model, FRICTION, case.amplitude, frequencies, "up", settings)
        counts = np.array([0.0, CYCLES])
        history = march_wear(case.model, FRICTION, start, WEAR, step, scheme, counts, settings)
        setting = f"rtol {rtol:g}" if scheme == "adaptive" else f"step {step:g}"
        yield Run(scheme, setting, time.thread_time() - began, float(history.worn_volume[-1]))


def integrations(case: Case) -> Iterator[Run]:
    """All runs of the time integration, from the same unworn motion."""
    began = time.thread_time()
    model, gap = case.model, case.model.contact.gap
    if case.periods:
        course = time_integration.run_up(case.frequency, case.amplitude, case.periods)
        structure, motion = time_integration.loaded(model, FRICTION, course, case.n_steps)
    else:
        structure = time_integration.build(model, FRICTION, case.frequency, case.amplitude, case.n_steps)
        rest = time_integration.at_rest(model, structure, gap)
        motion, _ = time_integration.settle(structure, rest, gap, work_change=5e-3)
    unworn = time.thread_time() - began
    for each in case.each:
        began = time.thread_time()
        *_, (_, depth, _) = time_integration.wear(model, structure, motion, WEAR, each, CYCLES)
        volume = float(depth @ model.contact.area)
        yield Run(INTEGRATION, f"{each:g} cycles a period", unworn + time.thread_time() - began, volume)


def slider() -> tuple[Case, Callable[[list[Run]], float]]:
    """A mass on a rigid slider, and its exact worn volume."""
    model = scene("sdof_slider", HARMONICS, damping=8.0)
    depth = slider_wear_depth(
        np.array([0.0, CYCLES]),
        wear_coefficient=WEAR,
        area=1e-4,
        friction_coefficient=FRICTION,
        normal_load=10.0,
        normal_stiffness=1e5,
        amplitude=lambda limit: slider_amplitude(0.1, 8.0, 1.6e5, 10.0, limit, 2.0 * np.pi * 160.0),
    )
    case = Case(
        "sliding mass, 160 Hz; truth: exact motion", model, 160.0, 10.0, (1e-1, 1e-2, 1e-3),
        (1e4, 2500.0, 500.0, 100.0), (6e3, 2e3, 600.0), 0, 400,
    )  # fmt: skip
    return case, lambda _: float(depth[-1]) * 1e-4


def dovetail() -> tuple[Case, Callable[[list[Run]], float]]:
    """The dovetail root with 16 pairs, whose truth is the time integration of twice as small steps in slow time."""
    case = Case(
        "dovetail root, mesh 1, 212.42 Hz; truth: time integration, extrapolated",
        scene("dovetail_sector", HARMONICS, mesh=1), 212.42, 0.5, (5e-2, 1e-2, 3e-3), (2000.0, 1000.0, 500.0),
        (160.0, 80.0, 40.0), 400, 250,
    )  # fmt: skip

    def truth(runs: list[Run]) -> float:
        coarse, fine = [run.volume for run in runs if run.method == INTEGRATION][-2:]
        return fine + (fine - coarse) / 3.0

    return case, truth


def cheapest(runs: list[Run], truth: float, target: float) -> Run | None:
    """The run with the least time out of those whose error, and that of all dearer ones of the method, is below."""
    exact = [
        run
        for run in runs
        if all(
            abs(other.volume / truth - 1.0) <= target
            for other in runs
            if other.method == run.method and other.seconds >= run.seconds
        )
    ]
    return min(exact, key=lambda run: run.seconds, default=None)


def draw(panel: Axes, title: str, runs: list[Run], truth: float) -> None:
    """Error over CPU time, a line for each method."""
    for method, marker in zip(dict.fromkeys(run.method for run in runs), "os^D", strict=True):
        own = [run for run in runs if run.method == method]
        errors = [max(100.0 * abs(run.volume / truth - 1.0), 1e-3) for run in own]
        panel.loglog([run.seconds for run in own], errors, marker=marker, label=method)
    panel.axhline(1.0, color="0.6", linewidth=0.8)
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_formatter("{x:g}")
        axis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
        axis.set_minor_formatter("{x:g}")
    panel.set(title=title.replace("; ", "\n"), xlabel="CPU time (s)", ylabel="error of the worn volume (%)")


def main() -> None:
    """A table for each scene, what an error costs with each method, and the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", choices=["slider", "dovetail"], default=["slider", "dovetail"])
    parser.add_argument("--picture", type=Path)
    given = parser.parse_args()
    figure, axes = plt.subplots(1, len(given.scenes), figsize=(5.5 * len(given.scenes), 4), squeeze=False)
    for name, panel in zip(given.scenes, axes[0], strict=True):
        case, truth_of = {"slider": slider, "dovetail": dovetail}[name]()
        # kernels are compiled and loaded before anything is timed
        list(integrations(Case(**{**vars(case), "each": (CYCLES / 2,), "periods": 0})))
        next(wear_histories(case))
        runs = [*wear_histories(case), *integrations(case)]
        truth = truth_of(runs)
        print(f"{case.title}: {1e9 * truth:.5g} mm3")
        methods = list(dict.fromkeys(run.method for run in runs))
        for run in runs:
            error = abs(run.volume / truth - 1.0)
            print(f"  {run.method:<17} {run.setting:<20} {run.seconds:8.2f} s {error:8.2%}", flush=True)
        for target in TARGETS:
            found = {
                method: cheapest([run for run in runs if run.method == method], truth, target) for method in methods
            }
            words = (
                f"{method} {run.seconds:.2g} s" if run else f"{method} not reached" for method, run in found.items()
            )
            print(f"  {target:.1%} costs: {', '.join(words)}", flush=True)
        draw(panel, case.title, runs, truth)
    axes[0, 0].legend()
    figure.tight_layout()
    if given.picture:
        figure.savefig(given.picture, dpi=110)


if __name__ == "__main__":
    main()

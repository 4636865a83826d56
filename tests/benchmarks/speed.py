"""What a Newton iteration, a slow-time step, a whole history and a larger joint cost, as ratios in one process.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.speed [steps] [adaptive] [slider] [pairs] [sizes] [real] ...

Without arguments all rows of the table (`ROWS`). The bundled dovetail sector near its resonance: 48 pairs, 5 harmonics,
128 samples, 1584 unknowns; the unit is one `numpy.linalg.solve` of as many. Medians over repeats that take turns. How
busy simulated ranks are says `tests.benchmarks.scheduling`.
"""

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from solver.harmonic_balance.dlft import Balance
from solver.loading_history.start_states import follow_branch
from solver.model import ReducedModel
from solver.newton.linear_solver import JacobianSolver
from solver.outcome import Outcome
from solver.results.history import StartState
from solver.settings import Scheme, SolverSettings
from solver.structure.joint import build_case
from studies.scenes import build_scene, scene_parameters
from tests.benchmarks import ranks
from tests.solver.models import march_wear

FREQUENCY, AMPLITUDE, FRICTION, WEAR = 211.75, 0.5, 0.5, 1.1e-11
SETTINGS = SolverSettings(harmonics=5, samples=128)
STEP, N_STEPS, CYCLES = 1000.0, 30, 1e5
REPEATS = 7
EULER_STEPS = (800.0, 640.0, 500.0, 400.0, 320.0, 250.0, 200.0, 160.0)
REFERENCE_STEP = 62.5


def in_turns(*runs: Callable[[], object], repeats: int = REPEATS) -> list[float]:
    """Median times of several things that take turns, after one round that is not counted, s of this thread."""
    times: list[list[float]] = [[] for _ in runs]
    for turn in range(repeats + 1):
        for run, spent in zip(runs, times, strict=True):
            started = time.thread_time()
            run()
            if turn:
                spent.append(time.thread_time() - started)
    return [float(np.median(spent)) for spent in times]


def dense_solve(n: int) -> Callable[[], object]:
    """The unit for n unknowns."""
    matrix, right = np.random.default_rng(0).standard_normal((n, n)), np.ones(n)
    return lambda: np.linalg.solve(matrix, right)


def start_at(model: ReducedModel, frequencies: list[float], amplitude: float, settings: SolverSettings) -> StartState:
    """The start state with the largest motion among those along a branch."""
    branch = follow_branch(model, FRICTION, amplitude, np.array(frequencies), "up", settings)
    found = [start for _, start in branch if start.state is not None]
    return max(found, key=lambda start: float(np.abs(start.state.displacement_h[:, :, 1:]).max()) if start.state else 0)


def iteration_at(model: ReducedModel, start: StartState, settings: SolverSettings, kept: bool) -> Callable[[], object]:
    """One Newton iteration at a state, with a kept factorisation or with one of its own."""
    state = start.state
    case = build_case(model, FRICTION, start.penalty_omega, settings)
    joint = case.joint(state.omega, state.excitation_amplitude)
    balance = Balance(joint, state.start_history, state.wear_depth)
    predicted = balance.predict(state.displacement_h, state.contact_force_h)
    solver = JacobianSolver()

    def run() -> None:
        evaluation = balance.evaluate(predicted)
        (solver if kept else JacobianSolver()).solve(balance.linearise(evaluation), -evaluation.residual + 1e-3)

    return run


def march(
    model: ReducedModel, start: StartState, step: float, scheme: Scheme, cycles: float, rtol: float = 1e-2
) -> tuple[float, float]:
    """Worn volume, m3, and iterations of a march."""
    settings = replace(SETTINGS, rtol=rtol)
    history = march_wear(model, FRICTION, start, WEAR, step, scheme, np.array([0.0, cycles]), settings)
    if history.outcome is not Outcome.CONVERGED:
        raise RuntimeError(history.outcome.sentence)
    return float(history.worn_volume[-1]), history.newton_iterations - start.newton_iterations


def dovetail(mesh: int = 2) -> ReducedModel:
    """The bundled sector."""
    return build_scene("dovetail_sector", scene_parameters("dovetail_sector")(mesh=mesh), 5)


def steps() -> None:
    """Rows 1 and 2."""
    model = dovetail()
    start = start_at(model, [FREQUENCY], AMPLITUDE, SETTINGS)
    n = 11 * 3 * model.contact.n_contact
    unit, kept, fresh = in_turns(
        dense_solve(n), *(iteration_at(model, start, SETTINGS, kept) for kept in (True, False))
    )
    print(f"{n} unknowns; unit: one numpy.linalg.solve of as many, {1e3 * unit:.0f} ms here")
    print(f"one Newton iteration: {kept / unit:.2f} with a kept factorisation, {fresh / unit:.2f} with its own (0.2)")
    schemes: tuple[Scheme, ...] = ("implicit", "explicit")
    for scheme in schemes:
        whole, begun, unit = in_turns(
            lambda scheme=scheme: march(model, start, STEP, scheme, N_STEPS * STEP),
            lambda scheme=scheme: march(model, start, STEP, scheme, STEP),
            dense_solve(n),
            repeats=3,
        )
        iterations = march(model, start, STEP, scheme, N_STEPS * STEP)[1] / N_STEPS
        print(f"one {scheme} step: {(whole - begun) / (N_STEPS - 1) / unit:.2f}, {iterations:.1f} iterations (0.5)")


def adaptive() -> None:
    """Row 3: adaptive steps over implicit Euler ones that are just short enough for 1 %."""
    model = dovetail()
    start = start_at(model, [FREQUENCY], AMPLITUDE, SETTINGS)
    # the errors of both Euler schemes are opposite to first order
    implicit, explicit = (march(model, start, REFERENCE_STEP, scheme, CYCLES)[0] for scheme in ("implicit", "explicit"))
    exact = 0.5 * (implicit + explicit)
    step = next(h for h in EULER_STEPS if abs(march(model, start, h, "implicit", CYCLES)[0] / exact - 1.0) <= 0.01)
    volume, iterations = march(model, start, 0.0, "adaptive", CYCLES)
    euler, own, unit = in_turns(
        lambda: march(model, start, step, "implicit", CYCLES),
        lambda: march(model, start, 0.0, "adaptive", CYCLES),
        dense_solve(11 * 3 * model.contact.n_contact),
        repeats=3,
    )
    print(f"adaptive at rtol 0.01: error {abs(volume / exact - 1.0):.2%}, {iterations:.0f} iterations")
    print(f"adaptive over implicit Euler with h = {step:g}, just short enough for 1 %: {own / euler:.2f} (0.5)")
    print(f"adaptive, with errors and the reference solution: {own / unit:.0f} units (30)")


def slider() -> None:
    """Row 4: what Python costs where there is next to nothing to compute."""
    settings = SolverSettings(harmonics=21, samples=256)
    model = build_scene("sdof_slider", scene_parameters("sdof_slider")(), 21)
    start = start_at(model, [160.0], 10.0, settings)
    unit, own = in_turns(dense_solve(43), iteration_at(model, start, settings, kept=True), repeats=201)
    print(f"one Newton iteration of sdof_slider, 21 harmonics: {own / unit:.0f} solves of 43 unknowns (10)")


def pairs() -> None:
    """Row 8: the exponent with which an iteration of a march grows with the number of pairs."""
    sizes, times = [], []
    for mesh in (1, 2, 3):
        model = dovetail(mesh)
        start = start_at(model, [211.0, 211.5, 212.0, 212.5], AMPLITUDE, SETTINGS)
        spent, begun = in_turns(
            lambda model=model, start=start: march(model, start, STEP, "implicit", 10 * STEP),
            lambda model=model, start=start: march(model, start, STEP, "implicit", STEP),
            repeats=3,
        )
        counts = [march(model, start, STEP, "implicit", n * STEP)[1] for n in (10, 1)]
        sizes.append(model.contact.n_contact)
        times.append((spent - begun) / (counts[0] - counts[1]))
        print(f"{sizes[-1]} pairs: {1e3 * times[-1]:.1f} ms an iteration")
    print(f"exponent {np.polyfit(np.log(sizes), np.log(times), 1)[0]:.2f} (below 2)")


def sizes() -> None:
    """What a start state and the first ten steps of joints of real size cost, with few harmonics throughout."""
    spent: dict[int, float] = {}
    for mesh, highest, wanted in ((2, 3, "0.6"), (2, 5, "0.6"), (4, 3, "-"), (4, 5, "5"), (6, 3, "15")):
        settings = SolverSettings(harmonics=highest, samples=64)
        model = build_scene("dovetail_sector", scene_parameters("dovetail_sector")(mesh=mesh), highest)
        began = time.thread_time()
        # beside the resonance, which falls a little with a finer mesh
        start = start_at(model, [FREQUENCY - (1.0 if mesh > 2 else 0.0)], AMPLITUDE, settings)
        first = time.thread_time() - began
        began = time.thread_time()
        cycles = np.array([0.0, 10 * STEP])
        history = march_wear(model, FRICTION, start, WEAR, STEP, "implicit", cycles, settings)
        step = (time.thread_time() - began) / 10
        unit = in_turns(dense_solve(1584), repeats=3)[0]
        if highest == 3:
            spent[model.contact.n_contact] = step
        print(
            f"{model.contact.n_contact} pairs, {highest} harmonics: start {first:.0f} s, {start.newton_iterations} "
            f"iterations; a step of the first ten {step / unit:.1f} units ({wanted}), "
            f"{(history.newton_iterations - start.newton_iterations) / 10:.0f} iterations",
            flush=True,
        )
    print(f"exponent of a step {np.polyfit(np.log(list(spent)), np.log(list(spent.values())), 1)[0]:.2f} (1.7)")


def real() -> None:
    """Joints of real size with all settings by default: a start state and an adaptive history to 1e5 cycles."""
    for mesh, frequency in ((2, 211.75), (4, 210.75), (6, 210.0)):
        model, settings = dovetail(mesh), SolverSettings()
        began = time.thread_time()
        start = start_at(model, [frequency], AMPLITUDE, settings)
        first = time.thread_time() - began
        began = time.thread_time()
        history = march_wear(model, FRICTION, start, WEAR, 0.0, "adaptive", np.array([0.0, CYCLES]), settings)
        print(
            f"{model.contact.n_contact} pairs, {frequency} Hz: start {first:.0f} s, history "
            f"{time.thread_time() - began:.0f} s, {1e9 * history.worn_volume[-1]:.3f} mm3 known to "
            f"{history.error_estimate:.1%}, {history.newton_iterations - start.newton_iterations} iterations",
            flush=True,
        )


def scenes() -> None:
    """Finite elements to the reduced model, each mesh in a process of its own: CPU time and largest memory."""
    build = (
        "import resource, time; from tests.benchmarks.speed import dovetail; began = time.process_time();"
        "n = dovetail({mesh}).contact.n_contact; memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20;"
        "print(f'{{n}} pairs: {{time.process_time() - began:.1f}} CPU s, {{memory:.2f}} GiB')"
    )
    for mesh in (2, 4, 6, 8):
        subprocess.run([sys.executable, "-c", build.format(mesh=mesh)], check=True)


def two_ranks() -> None:
    """Row 5."""
    with tempfile.TemporaryDirectory() as name:
        ranks.compare([], Path(name))


def start() -> None:
    """Row 7: `--plan` over the imports that nothing can do without."""
    plan = [str(ranks.RUN_STUDY), "sdof_slider", "--plan"]
    imports = [sys.executable, "-c", "import xarray, scipy.linalg"]
    times: list[list[float]] = [[], []]
    for turn in range(REPEATS + 1):
        for command, spent in zip((plan, imports), times, strict=True):
            began = time.perf_counter()
            subprocess.run(command, check=True, capture_output=True)
            if turn:
                spent.append(time.perf_counter() - began)
    ratio = np.median(times[0]) / np.median(times[1])
    print(f"run-study --plan over importing xarray and scipy.linalg: {ratio:.2f} (1.5)")


ROWS: dict[str, Callable[[], None]] = {
    "steps": steps,
    "adaptive": adaptive,
    "slider": slider,
    "pairs": pairs,
    "sizes": sizes,
    "real": real,
    "scenes": scenes,
    "ranks": two_ranks,
    "start": start,
}


def main() -> None:
    """Prints the table; behind each figure the one to reach."""
    for name in sys.argv[1:] or ROWS:
        ROWS[name]()
        sys.stdout.flush()


if __name__ == "__main__":
    main()

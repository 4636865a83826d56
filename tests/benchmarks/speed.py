"""What a first run, a history, a curve and a larger joint cost, in units of a dense solve measured in the same run.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.speed [iteration] [history] [slider] [dovetail] [large] [study]

Without arguments all rows. The unit is one `numpy.linalg.solve` of 1584 unknowns, those of the bundled dovetail with 48
pairs and 5 harmonics. A history takes its sweep and its errors with it, and a curve its errors; iterations are those
really made. `large` takes 336 pairs with their scene, some minutes; `study` is the default study in a process of its
own, on one rank and on two in turns. Other programs: `tests.benchmarks.peers`.
"""

import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from solver import frequency_response, march_wear
from solver.harmonic_balance.dlft import Balance
from solver.newton.linear_solver import JacobianSolver
from solver.settings import SolverSettings
from tests.benchmarks.frame import Table, arguments, dense_solve, measure
from tests.mpi.launching import launcher
from tests.solver.models import branch_states, case_of, scene

UNKNOWNS = 1584
FRICTION, WEAR, CYCLES = 0.5, 1.1e-11, 1e5  # 1, 1/Pa
REPEATS = 2  # of the default study on one rank and on two
UNIT = dense_solve(UNKNOWNS)
TABLE = Table("case", "CPU s", "units", "wanted", "iterations", "wanted")


def row(name: str, seconds: float, wanted: str = "", iterations: int | None = None, fewer: str = "") -> None:
    """A row: CPU s and iterations, each with what is wanted of it, in units or iterations."""
    TABLE.row(name, seconds, seconds / UNIT, wanted, iterations, fewer)


def second(name: str, compute: Callable[[], object], wanted: str, iterations: str = "") -> None:
    """A row, of the second one of two equal computations: kernels are loaded before."""
    measure(compute)
    found = measure(compute)
    row(name, found.seconds, wanted, found.iterations, iterations)


def iteration() -> None:
    """One Newton iteration of 48 pairs with 5 harmonics, with a kept factorisation and with its own."""
    settings, omega = SolverSettings(harmonics=5, samples=128), 2.0 * np.pi * 211.75
    model = scene("dovetail_sector", 5)
    (start,) = branch_states(model, FRICTION, 0.5, [omega], settings)
    joint, state = case_of(model, FRICTION, start.penalty_omega, settings).joint(omega, 0.5), start.state
    balance = Balance(joint, state.start_history, np.zeros(model.contact.n_contact))
    predicted, kept = balance.predict(state.displacement_h, state.contact_force_h), JacobianSolver()

    def once(solver: JacobianSolver) -> None:
        at = balance.evaluate(predicted)
        solver.solve(balance.linearise(at), [-at.residual + 1e-3])

    for name, solve in (("kept", lambda: once(kept)), ("own", lambda: once(JacobianSolver()))):
        spent = float(np.median([measure(solve).seconds for _ in range(8)][1:]))
        row(f"one Newton iteration, {name} factorisation", spent, "0.2")


def history() -> None:
    model = scene("dovetail_sector", 13)
    second("adaptive history, 48 pairs", lambda: march_wear(model, 211.75, 0.5, FRICTION, WEAR, CYCLES), "30", "250")


def slider() -> None:
    model, frequencies = scene("sdof_slider"), np.linspace(120.0, 250.0, 27)
    second("curve, slider, 27 frequencies", lambda: frequency_response(model, frequencies, 10.0, FRICTION), "5", "400")


def dovetail() -> None:
    model, frequencies = scene("dovetail_sector", mesh=1), np.linspace(211.0, 214.0, 25)
    second("curve, 16 pairs, 25 frequencies", lambda: frequency_response(model, frequencies, 0.5, FRICTION), "", "1000")


def large() -> None:
    """One point of 336 pairs, and of 160: its scene, and its history with sweep and errors."""
    for mesh, pairs, frequency, wanted in ((4, 160, 210.75, ""), (6, 336, 210.0, "60 s")):
        built = measure(lambda mesh=mesh: scene("dovetail_sector", mesh=mesh))
        found = measure(lambda: march_wear(built.result, frequency, 0.5, FRICTION, WEAR, CYCLES))  # noqa: B023
        row(f"scene of {pairs} pairs", built.seconds)
        row(f"the same and a history, {frequency} Hz", built.seconds + found.seconds, wanted, found.iterations)


def run(n_ranks: int, folder: Path) -> tuple[float, float]:
    """Wall and CPU seconds of the default study on so many ranks."""
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    command = [*launcher(n_ranks), Path(sys.executable).with_name("run-study"), "--fresh", "--overwrite"]
    subprocess.run([*command, "-o", folder / "out.nc"], check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.perf_counter() - began, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def study() -> None:
    with tempfile.TemporaryDirectory() as name:
        run(2, Path(name))  # fills the caches
        times = [(run(1, Path(name)), run(2, Path(name))) for _ in range(REPEATS)]
    (wall, spent), (both, _) = (min(each) for each in zip(*times, strict=True))
    row("default study, one rank", spent, "900")
    TABLE.row(f"two ranks over one, {both:.0f} over {wall:.0f} s", None, both / wall, "0.55", None, None)
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    TABLE.row("largest memory of a rank, MiB", None, peak, None, None, None)


ROWS = {row.__name__: row for row in (iteration, history, slider, dovetail, large, study)}


def main() -> None:
    for name in arguments(__doc__, tuple(ROWS)).chosen:
        ROWS[name]()


if __name__ == "__main__":
    main()

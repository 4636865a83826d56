"""Other harmonic balance programs on the same slider and the same dovetail, each in an environment of its own.

    python -m tests.benchmarks.peers [slider] [dovetail] [--folder FOLDER] [--tmdsimpy FOLDER] [--nlvib FOLDER]

Slider: one response curve of a mass of 0.1 kg on a mount (1.6e5 N/m, 20 N s/m) under 10 N, held by friction of 5 N, at
27 frequencies from 120 to 250 Hz: rigid friction, and elastic friction behind a spring of 1.6e6 N/m, against the exact
motion. Dovetail: 16 pairs, 0.5 N, friction 0.5, unworn, 25 frequencies from 211 to 214 Hz, against a start state of
this project with 25 harmonics and `rtol` 1e-4, which `time_integration` confirms. pyHarm gets the model, the first
state of the own curve as its first guess, and a penalty; no friction history.

Printed are the CPU time of the second of two equal runs (compiling is left out), the iterations really made, and the
error of the first harmonic at the frequencies that the program has chosen; the same in `peers.csv` of the folder.
Environments are built in the folder, pyHarm and JAX from the package index. `--tmdsimpy` and `--nlvib` name copies of
the repositories tmd-lab/tmdsimpy and maltekrack/NLvib. NLvib runs under Octave (`octave-cli`); it has no friction whose
normal force changes. What cannot be had is said in a sentence.
"""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
import venv
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from solver import frequency_response
from solver.compliant_contact import TANGENTIAL_RATIO
from solver.model import FloatArray, ReducedModel
from solver.settings import SolverSettings
from studies import build_scene
from tests.benchmarks.frame import Table, arguments, measure
from tests.references import slider_orbit
from tests.solver.exact_scenes import behind_spring
from tests.solver.models import branch_states

MASS, DAMPING, MOUNT, FORCE, FRICTION, SPRING = 0.1, 20.0, 1.6e5, 10.0, 5.0, 1.6e6
SLIDER = {"mass": MASS, "damping": DAMPING, "mount": MOUNT, "force": FORCE, "friction": FRICTION, "spring": SPRING}
SLIDER_FREQUENCIES, FREQUENCIES = np.linspace(120.0, 250.0, 27), np.linspace(211.0, 214.0, 25)
LOAD, MU = 0.5, 0.5  # of the dovetail: N, 1
PENALTY = 2e8  # N/m, of other programs: what the bodies resist a displacement of one pair with is 1.1e8 to 3.4e8
HARMONICS, SAMPLES = 13, 256
NEWTON = {"tolerance": 1e-6, "most": 25}  # of the residual, N, and iterations; a curve that converges takes ten
PYHARM, JAX = ("pyharm-os==1.2.2",), ("jax[cpu]", "scipy")
# One core, as the own curves. With the 32 bits that JAX takes by default Newton's method does not converge.
_SURROUNDINGS = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "JAX_ENABLE_X64": "1"}
Curve = dict[str, Any]
"""Frequency, Hz, and amplitude, m, of the points that converged; iterations, CPU seconds, attempts that failed."""
Truth = Callable[[FloatArray], FloatArray]
Program = tuple[Callable[[], list[str]], str, dict[str, str]]
"""Of a program: its command, script and further input."""


def exact(kind: str, frequency: float) -> float:
    """Amplitude of the first harmonic of the exact motion of the slider, m."""
    omega = 2.0 * np.pi * frequency
    if kind == "rigid":
        return abs(slider_orbit(MASS, DAMPING, MOUNT, FORCE, FRICTION, omega).harmonic(0))
    damping = DAMPING / np.sqrt(MOUNT * MASS)
    pair = behind_spring(SPRING / MOUNT, damping, FRICTION / FORCE, omega / np.sqrt(MOUNT / MASS))
    return float(abs(pair.response(pair.orbit_near(np.zeros(2), np.zeros(2)))).item()) * FORCE / MOUNT


def show(table: Table, name: str, harmonics: int | str, curve: Curve, truth: Truth) -> None:
    frequencies, amplitudes = np.array(curve["frequency"]), np.array(curve["amplitude"])
    numbers: list[float | None] = [None] * 6
    if frequencies.size:
        errors, largest = 100.0 * np.abs(amplitudes / truth(frequencies) - 1.0), int(np.argmax(amplitudes))
        peak = float(1e3 * amplitudes[largest]), float(frequencies[largest])
        numbers = [curve["iterations"], curve["seconds"], *peak, float(errors.max()), float(np.median(errors))]
    table.row(name, harmonics, frequencies.size, curve.get("failed", 0), *numbers)


def own_rows(table: Table, kind: str, model: ReducedModel, frequencies: FloatArray, force: float, truth: Truth) -> None:
    for harmonics in (HARMONICS, "auto"):
        settings = SolverSettings(harmonics=harmonics, samples="auto" if harmonics == "auto" else SAMPLES)
        asked = (model, frequencies, force, MU)
        runs = [measure(lambda: frequency_response(*asked, settings=settings)) for _ in range(2)]  # noqa: B023
        amplitude = np.abs(runs[1].result.response[:, 0])
        there = np.isfinite(amplitude)
        curve = {"frequency": frequencies[there], "amplitude": amplitude[there], "failed": int((~there).sum())}
        curve |= {"iterations": runs[1].iterations, "seconds": runs[1].seconds}
        show(table, f"fretwear, {kind}", harmonics, curve, truth)


def slider(table: Table, programs: dict[str, Program]) -> None:
    asked = {**SLIDER, "first": 120.0, "last": 250.0, "n_frequencies": 27, "samples": SAMPLES}
    asked["frequency"] = SLIDER_FREQUENCIES.tolist()
    for kind in ("elastic", "rigid"):
        springs = {} if kind == "rigid" else {"contact_stiffness": SPRING / (TANGENTIAL_RATIO * 1e-4)}
        model = build_scene("sdof_slider", mass=MASS, damping=DAMPING, stiffness=MOUNT, normal_stiffness=0.0, **springs)

        def truth(frequencies: FloatArray, kind: str = kind) -> FloatArray:
            return np.array([exact(kind, frequency) for frequency in frequencies])

        own_rows(table, f"slider, {kind}", model, SLIDER_FREQUENCIES, FORCE, truth)
        for name in programs if kind == "elastic" else ("pyHarm",):
            peer_row(table, f"{name}, slider, {kind}", programs[name], {**asked, "kind": kind}, truth)


def dovetail(table: Table, programs: dict[str, Program], folder: Path) -> None:
    model = build_scene("dovetail_sector", mesh=1)

    @cache
    def fine(frequencies: tuple[float, ...]) -> FloatArray:
        settings = SolverSettings(rtol=1e-4, harmonics=25, samples=512)
        return np.abs(frequency_response(model, frequencies, LOAD, MU, settings=settings).response[:, 0])

    def truth(frequencies: FloatArray) -> FloatArray:
        return fine(tuple(np.round(frequencies, 6).tolist()))

    own_rows(table, "dovetail, rigid", model, FREQUENCIES, LOAD, truth)
    file = folder / "dovetail.npz"
    write_model(file, model)
    asked = {"file": str(file), "pairs": model.contact.n_contact, "friction": MU, "penalty": PENALTY, **NEWTON}
    asked |= {"samples": SAMPLES, "frequency": FREQUENCIES.tolist()}
    peer_row(table, "pyHarm, dovetail, own rigid element", programs["pyHarm"], asked, truth)


def write_model(file: Path, model: ReducedModel) -> None:
    """Matrices, loads, response and first guess as arrays in a file; pairs first, normal before tangents.

    The first guess is the state of the own curve at the first frequency, mean and first harmonic.
    """
    linear, omega = model.linear[0], 2.0 * np.pi * FREQUENCIES[0]
    mass, damping, stiffness = (np.real(part) for part in (linear.mass, linear.damping, linear.stiffness))
    state = branch_states(model, MU, LOAD, [omega], SolverSettings())[0].state
    n, joint, cosine = len(mass), model.contact.dofs.size, LOAD * np.real(linear.load_harmonic)
    guess = np.zeros((2 * HARMONICS + 1, n))
    for order, load in ((0, linear.load_static), (1, cosine)):
        impedance = stiffness + 1j * order * omega * damping - (order * omega) ** 2 * mass
        parts = state.displacement_h
        moved = (parts[..., 1] - 1j * parts[..., 2] if order else parts[..., 0] + 0.0j).ravel()
        free = np.linalg.solve(impedance[joint:, joint:], load[joint:] - impedance[joint:, :joint] @ moved)
        whole = np.concatenate([moved, free])
        guess[order] = whole.real
        if order:
            guess[2] = -whole.imag
    arrays = {"M": mass, "C": damping, "K": stiffness, "static": linear.load_static, "cosine": cosine}
    np.savez(file, **arrays, row=np.real(linear.response[0]), start=guess.ravel())


def environment(folder: Path, packages: tuple[str, ...]) -> list[str]:
    """Interpreter of an environment with the packages. Raises CalledProcessError."""
    python = folder / "bin" / "python"
    if not python.exists():
        venv.create(folder, with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "-q", *packages], check=True, capture_output=True, text=True)
    return [str(python)]


def peer_row(table: Table, label: str, program: Program, asked: dict[str, Any], truth: Truth) -> None:
    """A row of another program, from what its script prints last; a sentence where it is not to be had."""
    try:
        command, script, more = program
        given = json.dumps({**asked, "harmonics": HARMONICS, **more})
        with tempfile.TemporaryDirectory() as folder:  # pyHarm writes where it runs
            surroundings = {**os.environ, **_SURROUNDINGS}
            words = [*command(), str(Path(__file__).with_name(script)), given]
            done = subprocess.run(words, check=True, capture_output=True, text=True, cwd=folder, env=surroundings)
    except (subprocess.CalledProcessError, FileNotFoundError) as error:
        said = (getattr(error, "stderr", None) or str(error)).strip().splitlines() or ["no message"]
        # Octave says first what is wrong, Python last
        line = next((line for line in said if line.startswith("error: ")), said[-1])
        print(f"{label} is not run here: {line}")
    else:
        show(table, label, HARMONICS, json.loads(done.stdout.splitlines()[-1]), truth)


def main() -> None:
    home = Path.home() / ".cache" / "fretwear_peers"
    given = arguments(__doc__, ("slider", "dovetail"), folder=home, tmdsimpy=None, nlvib=None)
    folder = given.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    tmdsimpy, nlvib = ({"source": str(source)} for source in (given.tmdsimpy, given.nlvib))
    programs: dict[str, Program] = {
        "pyHarm": (lambda: environment(folder / "pyharm", PYHARM), "peer_pyharm.py", {}),
        "tmdsimpy": (lambda: environment(folder / "tmdsimpy", JAX), "peer_tmdsimpy.py", tmdsimpy),
        "NLvib": (lambda: ["octave-cli", "-q"], "peer_nlvib.m", nlvib),
    }
    columns = ("program", "harmonics", "points", "failed", "iterations", "CPU s", "largest, mm", "at Hz")
    table = Table(*columns, "error, %", "median, %", file=folder / "peers.csv")
    if "slider" in given.chosen:
        slider(table, programs)
    if "dovetail" in given.chosen:
        dovetail(table, programs, folder)


if __name__ == "__main__":
    main()

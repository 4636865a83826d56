"""Other harmonic balance programs on the same slider, each in an environment of its own.

    python -m tests.benchmarks.peers [--folder ~/.cache/fretwear_peers] [--tmdsimpy FOLDER]

One response curve of a mass of 0.1 kg on a mount (1.6e5 N/m, 20 N s/m) under 10 N, held by friction of 5 N from 120 to
250 Hz: rigid friction, and elastic friction behind a spring of 1.6e6 N/m. Printed are the CPU time of the second of two
equal runs (compiling is left out), Newton iterations, and the largest error of the first harmonic against the exact
motion at the frequencies that the program has chosen.

Environments are built in the folder, pyHarm from the package index. tmdsimpy is no package: `--tmdsimpy` names a copy
of its repository, without it git fetches one. What cannot be had is said in a sentence, and the others go on. NLvib is
not run: it needs MATLAB or Octave.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
import venv
from pathlib import Path

import numpy as np

from solver import frequency_response
from solver.compliant_contact import TANGENTIAL_RATIO
from solver.loading_history.start_states import follow_branch
from solver.settings import SolverSettings
from studies import build_scene
from tests.references import slider_orbit
from tests.solver.random_orbits import behind_spring

MASS, DAMPING, MOUNT, FORCE, FRICTION, SPRING = 0.1, 20.0, 1.6e5, 10.0, 5.0, 1.6e6
FIRST, LAST, N_FREQUENCIES = 120.0, 250.0, 27
HARMONICS, SAMPLES = (5, 13), 256
SLIDER = {
    "mass": MASS,
    "damping": DAMPING,
    "mount": MOUNT,
    "force": FORCE,
    "friction": FRICTION,
    "spring": SPRING,
    "first": FIRST,
    "last": LAST,
    "n_frequencies": N_FREQUENCIES,
    "samples": SAMPLES,
}
PYHARM = "pyharm-os==1.2.2"
TMDSIMPY = "https://github.com/tmd-lab/tmdsimpy"
Curve = dict[str, list[float] | float]


def exact(kind: str, frequency: float) -> float:
    """Amplitude of the first harmonic of the exact motion, m."""
    if kind == "rigid":
        return abs(slider_orbit(MASS, DAMPING, MOUNT, FORCE, FRICTION, 2.0 * np.pi * frequency).harmonic(0))
    rate = np.sqrt(MOUNT / MASS)
    limit, damping = FRICTION / FORCE, DAMPING / np.sqrt(MOUNT * MASS)
    pair = behind_spring(SPRING / MOUNT, damping, limit, 2.0 * np.pi * frequency / rate).pair
    amplitude = pair.response(pair.orbit_near(np.zeros(2), np.zeros(2)))
    return float(abs(amplitude).item()) * FORCE / MOUNT


def own_curve(kind: str, harmonics: int | None) -> Curve:
    """The curve of this project. harmonics: None for those that the program chooses for `rtol`."""
    springs = {} if kind == "rigid" else {"contact_stiffness": SPRING / (TANGENTIAL_RATIO * 1e-4)}
    model = build_scene("sdof_slider", mass=MASS, damping=DAMPING, stiffness=MOUNT, normal_stiffness=0.0, **springs)
    settings = SolverSettings() if harmonics is None else SolverSettings(harmonics=harmonics, samples=SAMPLES)
    frequencies = np.linspace(FIRST, LAST, N_FREQUENCIES)
    began = time.process_time()
    found = frequency_response(model, frequencies, FORCE, 0.5, settings=settings)
    spent = time.process_time() - began
    there = np.isfinite(found.response[:, 0])
    starts = [start for _, start in follow_branch(model, 0.5, FORCE, frequencies, "up", settings)]
    return {
        "frequency": frequencies[there].tolist(),
        "amplitude": np.abs(found.response[there, 0]).tolist(),
        "iterations": sum(start.newton_iterations for start in starts),
        "seconds": spent,
    }


def environment(folder: Path, package: str) -> Path:
    """Interpreter of an environment with the package. Raises CalledProcessError."""
    place = folder / package.partition("=")[0]
    python = place / "bin" / "python"
    if not python.exists():
        venv.create(place, with_pip=True)
    subprocess.run([python, "-m", "pip", "install", "-q", package], check=True, capture_output=True, text=True)
    return python


def peer_curve(python: Path, script: str, source: Path | None, kind: str, harmonics: int) -> Curve:
    """The curve of another program, by its script in this folder. Raises CalledProcessError."""
    asked = {
        "source": None if source is None else str(source),
        "kind": kind,
        "harmonics": harmonics,
        **SLIDER,
    }
    command = [str(python), str(Path(__file__).with_name(script)), json.dumps(asked)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    curve: Curve = json.loads(done.stdout.splitlines()[-1])
    return curve


def show(name: str, kind: str, harmonics: int | str, curve: Curve) -> None:
    """Prints a row of the table."""
    frequencies, amplitudes = np.array(curve["frequency"]), np.array(curve["amplitude"])
    if not frequencies.size:
        print(f"| {name} | {kind} | {harmonics} | no point converged | | | |")
        return
    errors = np.abs(amplitudes / [exact(kind, frequency) for frequency in frequencies] - 1.0)
    where = frequencies[np.argmax(errors)]
    print(
        f"| {name} | {kind} | {harmonics} | {frequencies.size} | {curve['iterations']:.0f} | {curve['seconds']:.2f} s |"
        f" {100.0 * errors.max():.2f} % at {where:.0f} Hz, median {100.0 * np.median(errors):.3f} % |",
        flush=True,
    )


def tmdsimpy_copy(folder: Path, given: Path | None) -> Path:
    """A copy of the repository of tmdsimpy. Raises CalledProcessError."""
    if given is not None:
        return given
    place = folder / "tmdsimpy"
    if not place.exists():
        subprocess.run(
            ["git", "clone", "-q", "--depth", "1", TMDSIMPY, place], check=True, capture_output=True, text=True
        )
    return place


def main() -> None:
    """Builds the environments and prints the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--folder", type=Path, default=Path.home() / ".cache" / "fretwear_peers")
    parser.add_argument("--tmdsimpy", type=Path)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    print("| program | friction | harmonics | points | iterations | CPU time | error of the first harmonic |")
    print("|---|---|---|---|---|---|---|")
    for kind in ("elastic", "rigid"):
        for harmonics in (*HARMONICS, None):
            own_curve(kind, harmonics)
            show("fretwear", kind, harmonics or "auto, rtol 1 %", own_curve(kind, harmonics))
    peers = {
        "pyHarm": lambda: (environment(given.folder, PYHARM), "peer_pyharm.py", None, ("elastic", "rigid")),
        "tmdsimpy": lambda: (
            Path(sys.executable),
            "peer_tmdsimpy.py",
            tmdsimpy_copy(given.folder, given.tmdsimpy),
            ("elastic",),
        ),
    }
    for name, prepare in peers.items():
        try:
            python, script, source, kinds = prepare()
            for kind in kinds:
                for harmonics in HARMONICS:
                    show(name, kind, harmonics, peer_curve(python, script, source, kind, harmonics))
        except subprocess.CalledProcessError as error:
            said = (error.stderr or "").strip().splitlines() or ["no message"]
            print(f"{name} is not run here: {said[-1]}")
    print("NLvib is not run: it needs MATLAB or Octave.")


if __name__ == "__main__":
    main()

"""Other harmonic balance programs on the same slider and the same dovetail, each in an environment of its own.

    python -m tests.benchmarks.peers [--folder ~/.cache/fretwear_peers] [--tmdsimpy FOLDER] [--nlvib FOLDER]

One response curve of a mass of 0.1 kg on a mount (1.6e5 N/m, 20 N s/m) under 10 N, held by friction of 5 N from 120 to
250 Hz: rigid friction, and elastic friction behind a spring of 1.6e6 N/m. Printed are the CPU time of the second of two
equal runs (compiling is left out), Newton iterations, and the largest error of the first harmonic against the exact
motion at the frequencies that the program has chosen. Then one curve of the dovetail: see `peers_dovetail`.

Environments are built in the folder, pyHarm and JAX from the package index. tmdsimpy and NLvib are no packages:
`--tmdsimpy` and `--nlvib` name copies of their repositories, without them git fetches them. NLvib runs under Octave
(`octave-cli`). What cannot be had is said in a sentence, and the others go on.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from solver import frequency_response
from solver.compliant_contact import TANGENTIAL_RATIO
from solver.loading_history.start_states import follow_branch
from solver.settings import SolverSettings
from studies import build_scene
from tests.benchmarks import peers_dovetail
from tests.benchmarks.peer_runs import Curve, Run, attempt, curve_of, environment, repository
from tests.references import slider_orbit
from tests.solver.random_orbits import behind_spring

MASS, DAMPING, MOUNT, FORCE, FRICTION, SPRING = 0.1, 20.0, 1.6e5, 10.0, 5.0, 1.6e6
FIRST, LAST, N_FREQUENCIES = 120.0, 250.0, 27
HARMONICS, SAMPLES = (5, 13), 256
PYHARM, JAX = ("pyharm-os==1.2.2",), ("jax[cpu]", "scipy")
TMDSIMPY, NLVIB = "https://github.com/tmd-lab/tmdsimpy", "https://github.com/maltekrack/NLvib"
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


def peer_rows(name: str, kinds: tuple[str, ...], run: Run) -> None:
    """Prints the rows of another program. Raises CalledProcessError."""
    for kind in kinds:
        for harmonics in HARMONICS:
            show(name, kind, harmonics, run({"kind": kind, "harmonics": harmonics, **SLIDER}))


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


def slider(pyharm: Run, tmdsimpy: Run, nlvib: Run) -> None:
    """Prints the table of the slider."""
    print("| program | friction | harmonics | points | iterations | CPU time | error of the first harmonic |")
    print("|---|---|---|---|---|---|---|")
    for kind in ("elastic", "rigid"):
        for harmonics in (*HARMONICS, None):
            own_curve(kind, harmonics)
            show("fretwear", kind, harmonics or "auto, rtol 1 %", own_curve(kind, harmonics))
    attempt("pyHarm", lambda: peer_rows("pyHarm", ("elastic", "rigid"), pyharm))
    attempt("tmdsimpy", lambda: peer_rows("tmdsimpy", ("elastic",), tmdsimpy))
    attempt("NLvib", lambda: peer_rows("NLvib", ("elastic",), nlvib))


def main() -> None:
    """Builds the environments and prints the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--folder", type=Path, default=Path.home() / ".cache" / "fretwear_peers")
    parser.add_argument("--tmdsimpy", type=Path)
    parser.add_argument("--nlvib", type=Path)
    given = parser.parse_args()
    folder = given.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    tmdsimpy_copy = (given.tmdsimpy or folder / "tmdsimpy_copy").resolve()
    nlvib_copy = (given.nlvib or folder / "nlvib_copy").resolve()

    def pyharm(script: str) -> Run:
        return lambda asked: curve_of([environment(folder, "pyharm", PYHARM)], script, asked)

    def tmdsimpy(script: str) -> Run:
        return lambda asked: curve_of(
            [environment(folder, "tmdsimpy", JAX)], script, {**asked, "source": repository(tmdsimpy_copy, TMDSIMPY)}
        )

    def nlvib(asked: dict[str, object]) -> Curve:
        return curve_of(["octave-cli", "-q"], "peer_nlvib.m", {**asked, "source": repository(nlvib_copy, NLVIB)})

    slider(pyharm("peer_pyharm.py"), tmdsimpy("peer_tmdsimpy.py"), nlvib)
    dovetail = peers_dovetail.Table(folder / "dovetail.npz")
    dovetail.own_rows()
    attempt("pyHarm", lambda: dovetail.peer_rows("pyHarm", pyharm("peer_pyharm_dovetail.py")))
    attempt("tmdsimpy", lambda: dovetail.peer_rows("tmdsimpy", tmdsimpy("peer_tmdsimpy_dovetail.py")))
    print("NLvib has no friction whose normal force changes.")


if __name__ == "__main__":
    main()

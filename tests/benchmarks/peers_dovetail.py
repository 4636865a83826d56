"""The dovetail of `peers`: 16 pairs, 0.5 N, friction 0.5, unworn, 25 frequencies from 211 to 214 Hz.

The true motion is that of rigid contact: a start state of this project with 25 harmonics and `rtol` 1e-4, which the
time integration of `time_integration` confirms. Other programs get the model, the first state of the own curve as their
first guess, and the springs or penalties that are asked for; no friction history: in each period they begin with
sliders that are not displaced.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from solver import frequency_response
from solver.loading_history.start_states import follow_branch
from solver.model import FloatArray, ReducedModel
from solver.settings import SolverSettings
from studies import build_scene
from tests.benchmarks.peer_runs import Curve, Run

FORCE, FRICTION = 0.5, 0.5
FREQUENCIES = np.linspace(211.0, 214.0, 25)
STRUCTURE = 2e8  # N/m: what the bodies resist a displacement of one pair with, 1.1e8 to 3.4e8
HARMONICS, SAMPLES = (5, 13), 256
TOLERANCE, MOST_ITERATIONS = 1e-6, 25  # of the residual, N; a curve that converges takes ten


@dataclass(frozen=True)
class Case:
    """An element of another program: its name there, how the table calls it, its springs or penalty, N/m, harmonics."""

    element: str
    called: str
    stiffness: float
    harmonics: int = 5


CASES = {
    "pyHarm": (
        Case("Penalty3D", "springs", STRUCTURE),
        Case("Penalty3D", "springs", 10.0 * STRUCTURE),
        Case("DLFT3D", "rigid, as it is", STRUCTURE),
        *(Case("Rigid", "rigid, own element", STRUCTURE, harmonics) for harmonics in HARMONICS),
    ),
    "tmdsimpy": (
        Case("ElasticDryFriction3D", "springs, square limit", STRUCTURE),
        Case("CircularFriction", "springs, own element", STRUCTURE),
        Case("CircularFriction", "springs, own element", 10.0 * STRUCTURE),
    ),
}


def own_curve(model: ReducedModel, harmonics: int | None) -> Curve:
    """The curve of this project. harmonics: None for those that the program chooses for `rtol`."""
    settings = SolverSettings() if harmonics is None else SolverSettings(harmonics=harmonics, samples=SAMPLES)
    began = time.process_time()
    found = frequency_response(model, FREQUENCIES, FORCE, FRICTION, sweep="up", settings=settings)
    spent = time.process_time() - began
    there = np.isfinite(found.response[:, 0])
    starts = [start for _, start in follow_branch(model, FRICTION, FORCE, FREQUENCIES, "up", settings)]
    return {
        "frequency": FREQUENCIES[there].tolist(),
        "amplitude": np.abs(found.response[there, 0]).tolist(),
        "iterations": sum(start.newton_iterations for start in starts),
        "seconds": spent,
        "failed": int((~there).sum()),
    }


def write_model(file: Path, model: ReducedModel, case: Case) -> None:
    """Matrices, loads, response and first guess as arrays in a file; pairs first, normal before tangents.

    The first guess is the state of the own curve at the first frequency, mean and first harmonic. With springs a pair
    closes by its normal force over them.
    """
    linear, omega = model.linear[0], 2.0 * np.pi * FREQUENCIES[0]
    mass, damping, stiffness = (np.real(part) for part in (linear.mass, linear.damping, linear.stiffness))
    state = next(iter(follow_branch(model, FRICTION, FORCE, FREQUENCIES[:1], "up", SolverSettings())))[1].state
    n, joint = len(mass), model.contact.dofs.size
    cosine = FORCE * np.real(linear.load_harmonic)
    guess = np.zeros((2 * case.harmonics + 1, n))
    closing = np.array([0.0 if "rigid" in case.called else 1.0 / case.stiffness, 0.0, 0.0])
    for order, load in ((0, linear.load_static), (1, cosine)):
        impedance = stiffness + 1j * order * omega * damping - (order * omega) ** 2 * mass
        moved, force = (_of_order(part, order) for part in (state.displacement_h, state.contact_force_h))
        free = np.linalg.solve(impedance[joint:, joint:], load[joint:] - impedance[joint:, :joint] @ moved.ravel())
        whole = np.concatenate([(moved + closing * force).ravel(), free])
        guess[order] = whole.real
        if order:
            guess[2] = -whole.imag
    row = np.real(linear.response[0])
    np.savez(
        file, M=mass, C=damping, K=stiffness, static=linear.load_static, cosine=cosine, row=row, start=guess.ravel()
    )


def _of_order(harmonics: FloatArray, order: int) -> np.ndarray:
    """Complex coefficients (n_contact, 3) of order 0 or 1, of real ones (n_contact, 3, 2 H + 1)."""
    return harmonics[..., 0] + 0.0j if order == 0 else harmonics[..., 1] - 1j * harmonics[..., 2]


class Table:
    """Prints the table of the dovetail. file: where the other programs find the model."""

    def __init__(self, file: Path) -> None:
        self.file, self.model = file, build_scene("dovetail_sector", mesh=1)
        self.known: dict[float, float] = {}  # true amplitudes, m, by frequency, Hz
        print(
            "\n| program | contact | N/m | harmonics | points | failed attempts | iterations | CPU time |"
            " largest amplitude | error of the first harmonic |\n|---|---|---|---|---|---|---|---|---|---|"
        )

    def truth(self, frequencies: FloatArray) -> FloatArray:
        """Amplitudes (n,), m, of the first harmonic at the tip; frequencies (n,), Hz."""
        asked = np.round(frequencies, 6).tolist()
        if new := [frequency for frequency in asked if frequency not in self.known]:
            fine = SolverSettings(rtol=1e-4, harmonics=25, samples=512)
            found = frequency_response(self.model, new, FORCE, FRICTION, sweep="up", settings=fine)
            self.known.update(zip(new, np.abs(found.response[:, 0]).tolist(), strict=True))
        return np.array([self.known[frequency] for frequency in asked])

    def show(self, name: str, contact: str, harmonics: int | str, curve: Curve) -> None:
        """Prints a row."""
        if not curve["frequency"]:
            print(f"| {name} | {contact} | {harmonics} | 0 | {curve['failed']} | | | | |", flush=True)
            return
        frequencies, amplitudes = np.array(curve["frequency"]), np.array(curve["amplitude"])
        errors = np.abs(amplitudes / self.truth(frequencies) - 1.0)
        largest, worst, middle = int(np.argmax(amplitudes)), int(np.argmax(errors)), float(np.median(errors))
        print(
            f"| {name} | {contact} | {harmonics} | {frequencies.size}, to {frequencies.max():.1f} Hz |"
            f" {curve['failed']} | {curve['iterations']:.0f} | {curve['seconds']:.1f} s |"
            f" {1e3 * amplitudes[largest]:.3f} mm at {frequencies[largest]:.3f} Hz |"
            f" {100.0 * errors[worst]:.2f} % at {frequencies[worst]:.3f} Hz, median {100.0 * middle:.2f} % |",
            flush=True,
        )

    def own_rows(self) -> None:
        """Prints the rows of this project."""
        own_curve(self.model, 5)  # compiles
        for harmonics in (*HARMONICS, None):
            self.show("fretwear", "rigid |", harmonics or "auto, rtol 1 %", own_curve(self.model, harmonics))

    def peer_rows(self, name: str, run: Run) -> None:
        """Prints the rows of another program. Raises CalledProcessError."""
        for case in CASES[name]:
            write_model(self.file, self.model, case)
            asked = {
                "file": str(self.file),
                "pairs": self.model.contact.n_contact,
                "element": case.element,
                "stiffness": case.stiffness,
                "friction": FRICTION,
                "harmonics": case.harmonics,
                "samples": SAMPLES,
                "tolerance": TOLERANCE,
                "most": MOST_ITERATIONS,
                "frequency": FREQUENCIES.tolist(),
            }
            self.show(name, f"{case.called} | {case.stiffness:.0e}", case.harmonics, run(asked))

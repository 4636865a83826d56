"""Another resonance in the range in which an excitation follows a resonance.

The history stays at the resonance at which it is. Whether the response has another one in the range is asked of a
linear joint that moves as the present one: each displacement u of a pair has the complex stiffness lambda / u of the
first harmonics of force and motion; a pair that sticks is held. At the present frequency the linear joint has the
motion of the state. Elsewhere friction would be another one, so that frequencies are near those of the joint.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import cast

import numpy as np
import scipy.linalg

from solver.model import ComplexArray, FloatArray, ReducedModel
from solver.options import COMMON
from solver.results.history import PeriodicState
from solver.results.options import RESULTS
from solver.settings import FollowedFrequency
from solver.structure.condensation import relative_indices
from solver.structure.fourier import to_complex


@dataclass(frozen=True)
class _LinearJoint:
    """Matrices (n, n) of the displacements that are not held, harmonic load (n,), N, and first response (n,)."""

    stiffness: ComplexArray
    damping: ComplexArray
    mass: ComplexArray
    load: ComplexArray
    response: ComplexArray

    def values(self, omega: float) -> tuple[complex, complex]:
        """`F^H x`, N m, and the first response, m, in the first harmonic at a frequency, rad/s."""
        full = self.stiffness + 1j * omega * self.damping - omega**2 * self.mass
        x = np.linalg.solve(full, self.load)
        return complex(np.vdot(self.load, x)), complex(self.response @ x)

    def resonances(self, low: float, high: float) -> list[FloatArray]:
        """Frequencies, rad/s, around each resonance between two frequencies, closer than its width."""
        elastic = 0.5 * (self.stiffness + self.stiffness.conj().T)
        try:
            squares, shapes = scipy.linalg.eigh(elastic, self.mass)
        except np.linalg.LinAlgError:
            # a displacement without mass
            squares, shapes = scipy.linalg.eig(elastic, self.mass)
            squares = np.where(np.isfinite(squares), squares, 0.0).real
        frequencies = np.sqrt(np.maximum(squares, 0.0))
        around = []
        for omega, shape in zip(frequencies, shapes.T, strict=True):
            if low <= omega <= high:
                lost = self.stiffness - elastic + 1j * omega * self.damping
                inertia = np.vdot(shape, self.mass @ shape).real
                ratio = abs(np.vdot(shape, lost @ shape).imag) / (2.0 * omega**2 * inertia)
                ratio = max(ratio, COMMON.negligible)
                around.append(omega * (1.0 + ratio * np.linspace(-4.0, 4.0, 65)))
        return around


def find_other_peak(model: ReducedModel, state: PeriodicState, follow: FollowedFrequency) -> float:
    """Frequency, Hz, of the largest further resonance or peak of the response in a range; NaN where there is none.

    Only one counts whose work (resonance) or amplitude (peak) is at least `other_peak` times that of the state.
    """
    joint = _linear_joint(model, state)
    if joint is None:
        return math.nan
    low, high = 2.0 * math.pi * follow.low, 2.0 * math.pi * follow.high
    try:
        near = joint.resonances(low, high)
        places = np.unique(np.concatenate([[low, state.omega, high], *near]))
        places = places[(places >= low) & (places <= high)]
        products, responses = np.array([joint.values(float(omega)) for omega in places]).T
        here = joint.values(state.omega)
    except np.linalg.LinAlgError:
        # a displacement without mass and stiffness: no other one is known
        return math.nan
    if follow.of == "resonance":
        size, present = np.abs(products.imag), abs(here[0].imag)
        found = np.flatnonzero((products.real[:-1] > 0.0) & (products.real[1:] <= 0.0))
        # the sample next to the passage
        found += np.abs(products.real[found]) > np.abs(products.real[found + 1])
    else:
        size, present = np.abs(responses), abs(here[1])
        found = 1 + np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:]))
    own = found[np.argmin(np.abs(places[found] - state.omega))] if found.size else -1
    others = [place for place in found if place != own and size[place] >= RESULTS.other_peak * present]
    return float(places[max(others, key=lambda place: size[place])]) / (2.0 * math.pi) if others else math.nan


def _linear_joint(model: ReducedModel, state: PeriodicState) -> _LinearJoint | None:
    """The linear joint that moves as the state; None without an excitation."""
    linear = model.harmonic_structure(1)
    mass, damping, stiffness, shape, rows = (
        np.array(part, complex)
        for part in (linear.mass, linear.damping, linear.stiffness, linear.load_harmonic, linear.response)
    )
    relative, components = relative_indices(model.contact)
    moved, pushed = (
        to_complex(part.reshape(-1, part.shape[-1])[components])[:, 0]
        for part in (state.displacement_h, state.contact_force_h)
    )
    sticks = np.abs(moved) <= COMMON.negligible * np.abs(moved).max(initial=0.0)
    stiffness[relative[~sticks], relative[~sticks]] += pushed[~sticks] / moved[~sticks]
    free = np.ones(len(mass), bool)
    free[relative[sticks]] = False
    load = state.excitation_amplitude * shape[free]
    if not np.abs(load).any():
        return None
    stiffness, damping, mass = (part[np.ix_(free, free)] for part in (stiffness, damping, mass))
    return _LinearJoint(stiffness, damping, mass, cast("ComplexArray", load), cast("ComplexArray", rows[0, free]))

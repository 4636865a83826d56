"""A cantilever with friction at its tip: its model, and its exact motion from event to event.

An Euler beam of length and mass one in its first five modes, `phi_i(1)^2 = 4` with unit modal masses, under a harmonic
force inside and with constant normal load at the tip. The friction element is rigid and sits either on the tip itself
or on a massless displacement that a spring ties to it, as a reduction with residual flexibility gives it. SI units.
"""

from dataclasses import dataclass

import numpy as np

from solver import build_model
from solver.model import ReducedModel
from tests.event_driven import FloatArray, Orbit
from tests.references import coulomb_orbit

N_MODES = 5
WAVE_NUMBERS = np.array([1.8751040687119611, 4.6940911329741746, 7.8547574382376126, 10.995540734875467, 4.5 * np.pi])
NORMAL_LOAD = 1.0  # N
FRICTION = 1.0


@dataclass(frozen=True)
class Cantilever:
    """ratio: modal damping. spring: N/m, between tip and friction element; infinite where that sits on the tip.

    place: of the force along the beam, 0 to 1. With friction coefficient and normal load 1 the friction limit is 1 N.
    """

    ratio: float = 0.005
    spring: float = np.inf
    place: float = 0.6

    @property
    def natural(self) -> FloatArray:
        """Natural angular frequencies (5,) without friction, rad/s, the first 1."""
        return np.asarray((WAVE_NUMBERS / WAVE_NUMBERS[0]) ** 2)

    def shape(self, place: float) -> FloatArray:
        """Modes (5,) at a place along the beam."""
        b = WAVE_NUMBERS
        s = (np.sinh(b) - np.sin(b)) / (np.cosh(b) + np.cos(b))
        return np.asarray(np.cosh(b * place) - np.cos(b * place) - s * (np.sinh(b * place) - np.sin(b * place)))

    def matrices(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Mass, damping, stiffness (n, n), unit load (n,) and what gives the tip from the displacements (n,).

        The friction acts on displacement 0, which is the tip in place of the first mode, or the end of the spring.
        """
        tip, sprung = self.shape(1.0), np.isfinite(self.spring)
        if sprung:
            to_modes, row = np.eye(N_MODES, N_MODES + 1, 1), np.append(0.0, tip)
        else:
            to_modes, row = np.eye(N_MODES), np.eye(N_MODES)[0]
            to_modes[0] = np.append(1.0, -tip[1:]) / tip[0]
        modal = np.ones(N_MODES), 2.0 * self.ratio * self.natural, self.natural**2
        mass, damping, stiffness = (to_modes.T @ np.diag(values) @ to_modes for values in modal)
        if sprung:
            stiffness += self.spring * np.outer(np.append(1.0, -tip), np.append(1.0, -tip))
        return mass, damping, stiffness, to_modes.T @ self.shape(self.place), row

    def model(self) -> ReducedModel:
        """Scene with the tip as its response."""
        mass, damping, stiffness, load, tip = self.matrices()
        return build_model(
            *(mass, damping, stiffness, [[-1, 0, -1]], 1e-4), load_harmonic=load, response=tip[None],
            normal_load=NORMAL_LOAD, surface=("tip",), response_names=("tip",),
        )  # fmt: skip

    def tip_of_orbit(self) -> FloatArray:
        """What gives the tip from the first displacements of `orbit`, those of the masses."""
        mass, *_, tip = self.matrices()
        return tip[np.diag(mass) > 0.0]

    def orbit(self, force: float, omega: float) -> Orbit:
        """Periodic motion from rest under force cos(omega t), N. Raises NoPeriodicMotionError."""
        mass, damping, stiffness, load, _ = self.matrices()
        return coulomb_orbit(mass, damping, stiffness, force * load, 0, FRICTION * NORMAL_LOAD, omega, transient=100)

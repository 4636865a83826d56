"""A cantilever with friction at its tip: its model, and its exact motion from event to event.

An Euler beam of length and mass one in its first five modes, `phi_i(1)^2 = 4` with unit modal masses, under a harmonic
force inside and with constant normal load at the tip. The friction element is rigid and sits either on the tip itself
or on a massless displacement that a spring ties to it, as a reduction with residual flexibility gives it. SI units.
"""

from dataclasses import dataclass

import numpy as np

from solver import build_model
from solver.model import ReducedModel
from tests.event_driven import FloatArray, Orbit, Phase, PiecewiseLinear, solve_orbit
from tests.references import coulomb_orbit

N_MODES = 5
WAVE_NUMBERS = np.array([1.8751040687119611, 4.6940911329741746, 7.8547574382376126, 10.995540734875467])
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
        waves = np.append(WAVE_NUMBERS, (2 * N_MODES - 1) * np.pi / 2)
        return np.asarray((waves / waves[0]) ** 2)

    def shape(self, place: float) -> FloatArray:
        """Modes (5,) at a place along the beam."""
        b = np.append(WAVE_NUMBERS, (2 * N_MODES - 1) * np.pi / 2)
        s = (np.sinh(b) - np.sin(b)) / (np.cosh(b) + np.cos(b))
        return np.asarray(np.cosh(b * place) - np.cos(b * place) - s * (np.sinh(b * place) - np.sin(b * place)))

    def matrices(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Mass, damping, stiffness (n, n), unit load (n,) and what gives the tip from the displacements (n,).

        The friction acts on displacement 0.
        """
        tip, natural = self.shape(1.0), self.natural
        if np.isfinite(self.spring):
            tie = np.append(1.0, -tip)
            mass = np.diag(np.append(0.0, np.ones(N_MODES)))
            damping = np.diag(np.append(0.0, 2.0 * self.ratio * natural))
            stiffness = np.diag(np.append(0.0, natural**2)) + self.spring * np.outer(tie, tie)
            return mass, damping, stiffness, np.append(0.0, self.shape(self.place)), np.append(0.0, tip)
        # the tip takes the place of the first mode
        way = np.eye(N_MODES)
        way[0] = np.append(1.0, -tip[1:]) / tip[0]
        parts = (way.T @ np.diag(d) @ way for d in (np.ones(N_MODES), 2.0 * self.ratio * natural, natural**2))
        mass, damping, stiffness = parts
        return mass, damping, stiffness, way.T @ self.shape(self.place), np.eye(N_MODES)[0]

    def model(self) -> ReducedModel:
        """Scene with the tip as its response."""
        mass, damping, stiffness, load, tip = self.matrices()
        return build_model(
            *(mass, damping, stiffness, [[-1, 0, -1]], 1e-4), load_harmonic=load, response=tip[None],
            normal_load=NORMAL_LOAD, surface=("tip",), response_names=("tip",),
        )  # fmt: skip

    def tip_of_orbit(self) -> FloatArray:
        """What gives the tip from the displacements of `orbit`."""
        return np.append(self.shape(1.0), 0.0) if np.isfinite(self.spring) else np.eye(N_MODES)[0]

    def orbit(self, force: float, omega: float) -> Orbit:
        """Periodic motion from rest under force cos(omega t), N. Raises NoPeriodicMotionError."""
        mass, damping, stiffness, load, _ = self.matrices()
        limit = FRICTION * NORMAL_LOAD
        if np.isinf(self.spring):
            return coulomb_orbit(mass, damping, stiffness, force * load, 0, limit, omega, transient=100)
        return self._sprung(force * load[1:], limit, omega)

    def _sprung(self, load: FloatArray, limit: float, omega: float) -> Orbit:
        """Displacements 0 to 4 are the modes, 5 is the stretch of the spring: of the place of the element, a difference
        of larger numbers, too few digits would be left where slip turns into stick.
        """
        n, tip = N_MODES + 1, self.shape(1.0)
        flows = {}
        modes, rates = np.arange(N_MODES), np.arange(n, n + N_MODES)
        held = np.zeros(2 * n + 3)  # spring force, as a function of the state, where the element sticks
        held[n - 1] = self.spring
        for name, force in (("stick", held), ("forward", limit), ("backward", -limit)):
            flow = np.zeros((2 * n + 3, 2 * n + 3))
            flow[modes, rates] = 1.0
            flow[rates, modes] = -(self.natural**2)
            flow[rates, rates] = -2.0 * self.ratio * self.natural
            flow[rates, 2 * n] = load
            if name == "stick":
                flow[rates] -= np.outer(tip, held)
                flow[n - 1, rates] = tip
            else:
                flow[rates, -1] -= tip * force
            flow[2 * n, 2 * n + 1], flow[2 * n + 1, 2 * n] = -omega, omega
            flows[name] = flow
        one = np.eye(2 * n + 3)[-1]
        speed = np.zeros(2 * n + 3)
        speed[rates] = tip
        phases = {
            "stick": Phase(flows["stick"], np.array([limit * one - held, limit * one + held])),
            "forward": Phase(flows["forward"], speed[None]),
            "backward": Phase(flows["backward"], -speed[None]),
        }

        def next_phase(name: str, y: FloatArray) -> tuple[str, FloatArray]:
            y = y.copy()
            if name == "stick":
                y[n - 1] = np.copysign(limit / self.spring, y[n - 1])
                return ("forward" if y[n - 1] > 0 else "backward"), y
            y[rates] -= tip * (tip @ y[rates]) / (tip @ tip)
            return "stick", y

        system = PiecewiseLinear(n, omega, phases, next_phase, lambda name, _: name)
        start = system.extended(np.zeros(n), np.zeros(n))
        return solve_orbit(
            system,
            "stick",
            start,
            moving=("forward", "backward"),
            transient=100,
            fixed=lambda name: [n - 1, 2 * n - 1] if name != "stick" else [2 * n - 1],
        )

"""Den Hartog's closed form: a mass on a spring under a harmonic force with rigid Coulomb friction, without stops.

J. P. Den Hartog, "Forced vibrations with combined Coulomb and viscous friction", Trans. ASME 53 (1931), without the
viscous part. With r = omega / omega_0, V = 1 / (1 - r^2) and G = tan(pi / (2 r)) / r the amplitude is

    X = sqrt(V^2 - (F_f / F)^2 G^2) F / k.

From the turn at x = X on the friction force is F_f against the motion for half a period, so that with theta = omega t
from there, the force F cos(theta + phi), cos(phi) = X k / (F V) and sin(phi) = -(F_f / F) G / V, the first harmonic is

    x_1 = X cos(theta) + (F_f / k) (G + 4 V / pi) sin(theta).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from solver.contact.wear_law import WearingWork
from solver.model import FloatArray

_SINGULAR = 1e-9  # 1/r beside an odd number, where G has no bound
_POINTS = 4001  # in a half period, among which the slowest moment of the motion is sought
_STEPS = 64  # at least, from the first cycle to the last
_LEAST_FORCE = 1e-200  # of the first one: any number that can be divided by


@dataclass(frozen=True)
class DenHartogSlider:
    """mass, kg; stiffness, N/m; force: amplitude, N; omega: rad/s."""

    mass: float
    stiffness: float
    force: float
    omega: float

    @property
    def ratio(self) -> float:
        """r, the frequency over the natural one."""
        return float(self.omega / np.sqrt(self.stiffness / self.mass))

    @cached_property
    def _factors(self) -> tuple[float, float]:
        """V and G."""
        return 1.0 / (1.0 - self.ratio**2), float(np.tan(0.5 * np.pi / self.ratio)) / self.ratio

    def holds(self, friction_force: float) -> bool:
        """Whether the mass never stops under this friction force, N; less friction does not stop it either.

        With tau = omega_0 t from the turn x' = -r X sin(r tau) + (F_f / k) (sin(tau) + r G (cos(r tau) - cos(tau))),
        which has to stay negative until the next turn: X > S F_f / k, S the largest ratio of the two functions of tau.
        """
        singular = self.ratio == 1.0 if friction_force == 0.0 else abs((1.0 / self.ratio) % 2.0 - 1.0) < _SINGULAR
        if singular:
            return False
        if friction_force == 0.0:
            return True
        v, g = self._factors
        square = v**2 - (friction_force / self.force * g) ** 2
        return square > 0.0 and float(np.sqrt(square)) * self.force > self._needed * friction_force

    @cached_property
    def _needed(self) -> float:
        """S; at tau = 0, where spring and force have to overcome the friction, the ratio is 1 / r^2."""
        from scipy.optimize import minimize_scalar  # where it is used: it takes a while to load

        r, (_, g) = self.ratio, self._factors

        def ratio(tau: FloatArray) -> FloatArray:
            return np.asarray((np.sin(tau) + r * g * (np.cos(r * tau) - np.cos(tau))) / (r * np.sin(r * tau)))

        taus = np.linspace(0.0, np.pi / r, _POINTS)[1:-1]
        best = int(np.argmax(ratio(taus)))
        around = (taus[max(best - 1, 0)], taus[min(best + 1, len(taus) - 1)])
        inside = minimize_scalar(lambda tau: -ratio(tau), bounds=around, method="bounded", options={"xatol": 1e-12})
        return max(1.0 / r**2, -float(inside.fun))

    def amplitude(self, friction_force: FloatArray) -> FloatArray:
        """Largest displacement X, m, where the form holds."""
        v, g = self._factors
        return np.asarray(np.sqrt(v**2 - (friction_force / self.force * g) ** 2) * self.force / self.stiffness)

    def first_harmonic(self, friction_force: FloatArray) -> FloatArray:
        """Amplitude of the first harmonic of the displacement, m, where the form holds."""
        v, g = self._factors
        return np.hypot(self.amplitude(friction_force), friction_force / self.stiffness * (g + 4.0 / np.pi * v))


@dataclass(frozen=True)
class WearingSlider:
    """The slider with one pair that wears; a spring presses the pair, or a constant force.

    mu: friction coefficient. load: normal force at the start, N. normal_stiffness: k_N of the spring, N/m; 0 for a
    constant force. area: m2. work: part of the slip work that wears, of the only pair.
    """

    slider: DenHartogSlider
    mu: float
    load: float
    normal_stiffness: float
    area: float
    work: WearingWork

    def worn(self, sliding: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Depth worn since the start, m, and normal force, N, at each sliding (n,), 1/Pa, ascending from 0 or above.

        Sliding: s, wear coefficient times cycle count. The depth W follows `dW/ds = X(S, N / area, W) / area` with the
        normal force `N = load - k_N W`, the slip work of a cycle `S = 4 N X_0(mu N)`, X_0 the amplitude of the motion,
        and the wearing work X of the law (`solver.contact.wear_law`). With a spring the unknown is z = ln(N / load),
        `dz/ds = -(k_N / area) X / N`, which stays calm however much is worn.
        """
        if self.load <= 0.0:
            return np.zeros_like(sliding), np.zeros_like(sliding)
        if self.normal_stiffness <= 0.0:
            depth = _integrated(lambda w: self._rate(self.load, w) * self.load, sliding)
            return depth, np.full_like(sliding, self.load)

        def fall(z: float) -> float:
            depth = -np.expm1(z) * self.load / self.normal_stiffness
            return -self.normal_stiffness * self._rate(self.load * max(np.exp(z), _LEAST_FORCE), depth)

        z = _integrated(fall, sliding)
        return np.abs(np.expm1(z)) * self.load / self.normal_stiffness, self.load * np.exp(z)

    def _rate(self, force: float, depth: float) -> float:
        """`dW/ds` over the normal force, 1/N m: of the force, N, and the depth, m."""
        slip_work = 4.0 * force * float(self.slider.amplitude(np.array(self.mu * force)))
        worn = self.work.work(np.array([slip_work]), np.array([force]), np.array([depth]))
        return float(worn[0]) / force / self.area


def _integrated(rate: Callable[[float], float], sliding: FloatArray) -> FloatArray:
    """The solution y (n,) of `dy/ds = rate(y)`, y(0) = 0, at ascending s (n,) from 0 or above."""
    from scipy.integrate import solve_ivp  # where it is used: it takes a while to load

    found, fastest, later = np.zeros_like(sliding), abs(rate(0.0)), sliding > 0.0
    if fastest > 0.0 and later.any():
        end = float(sliding[-1])
        # between two steps the solution is interpolated, with an error that the tolerance does not bound
        limits = {"rtol": 1e-11, "atol": 1e-13 * fastest * float(sliding[later][0]), "max_step": end / _STEPS}
        wearing = solve_ivp(lambda _, y: [rate(float(y[0]))], (0.0, end), [0.0], "DOP853", sliding[later], **limits)
        found[later] = wearing.y[0]
    return found

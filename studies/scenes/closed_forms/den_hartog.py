"""Den Hartog's closed form: a mass on a spring under a harmonic force with rigid Coulomb friction, without stops.

J. P. Den Hartog, "Forced vibrations with combined Coulomb and viscous friction", Trans. ASME 53 (1931), without the
viscous part. With r = omega / omega_0, V = 1 / (1 - r^2) and G = tan(pi / (2 r)) / r the amplitude is

    X = sqrt(V^2 - (F_f / F)^2 G^2) F / k.

From the turn at x = X on the friction force is F_f against the motion for half a period, so that with theta = omega t
from there, the force F cos(theta + phi), cos(phi) = X k / (F V) and sin(phi) = -(F_f / F) G / V, the first harmonic is

    x_1 = X cos(theta) + (F_f / k) (G + 4 V / pi) sin(theta).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from solver.model import FloatArray

_SINGULAR = 1e-9  # 1/r beside an odd number, where G has no bound
_POINTS = 4001  # in a half period, among which the slowest moment of the motion is sought
_STEPS = 64  # at least, from the first cycle to the last


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


def worn_normal_force(
    slider: DenHartogSlider,
    friction_coefficient: float,
    normal_load: float,
    normal_stiffness: float,
    area: float,
    sliding: FloatArray,
) -> FloatArray:
    """Logarithm of the normal force N over `normal_load` of a slider that a spring presses, while it wears.

    sliding (n,): wear coefficient times cycle count, 1/Pa, ascending from 0 or above. The wear depth W follows
    `dW/ds = (N / area) 4 X(mu N)`, `N = N_0 - k_N W` (N, N/m), s the sliding; with z = ln(N / N_0) that is
    `dz/ds = -(4 k_N / area) X(mu N_0 exp(z))`, which stays calm however much is worn.
    """
    limit = friction_coefficient * normal_load
    from scipy.integrate import solve_ivp  # where it is used: it takes a while to load

    def rate(_: float, z: FloatArray) -> FloatArray:
        return -4.0 * normal_stiffness / area * slider.amplitude(limit * np.exp(z))

    fastest = abs(float(rate(0.0, np.zeros(1))[0]))
    worn = np.zeros_like(sliding)
    later = sliding > 0.0
    if fastest > 0.0 and later.any():
        smallest = 1e-13 * fastest * float(sliding[later][0])
        end = float(sliding[-1])
        # between two steps the solution is interpolated, with an error that the tolerance does not bound
        solution = solve_ivp(
            rate, (0.0, end), [0.0], "DOP853", sliding[later], rtol=1e-11, atol=smallest, max_step=end / _STEPS
        )
        worn[later] = solution.y[0]
    return worn

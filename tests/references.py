"""References with exact or closed answers, for tests of everything above them.

All of them are general in their parameters, in SI units, and share no code with the solver.
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

from tests.contact_pair import ContactPair
from tests.event_driven import FloatArray, Orbit


class StopsOccurError(ValueError):
    """Den Hartog's closed form does not hold: the mass stops, or its amplitude has no bound."""


def den_hartog_amplitude(mass, stiffness, force, friction_force, omega) -> float:
    """Amplitude, m, of a mass on a spring under force cos(omega t) with rigid Coulomb friction alone, without stops.

    Den Hartog (1931): `X = sqrt(V^2 - (F_f/F)^2 G^2) F/k`, `V = 1/(1 - r^2)`,
    `G = sin(pi/r) / (r (1 + cos(pi/r))) = tan(pi/(2 r)) / r`, `r = omega/omega_0`.

    From the turn at x = X on (tau = omega_0 t), the solution of `x'' + x = (F/k) cos(r tau + phi) + F_f/k` has
    `x'(tau) = -r X sin(r tau) + (F_f/k) (sin tau + r G (cos(r tau) - cos tau))`, which must stay negative until the
    next turn at tau = pi/r: `X > S F_f/k`, S the largest `(sin tau + r G (cos(r tau) - cos tau)) / (r sin(r tau))`.
    Its value 1/r^2 at tau = 0 says that the spring and the force overcome the friction at the turn.

    Raises StopsOccurError where that fails, and at r = 1, 1/3, 1/5, ..., where the closed form is singular.
    """
    r = omega / np.sqrt(stiffness / mass)
    if (friction_force > 0 and abs((1 / r) % 2 - 1) < 1e-9) or r == 1:
        raise StopsOccurError(f"Den Hartog's form is singular at a frequency ratio of {r}")
    v = 1 / (1 - r**2)
    g = np.tan(np.pi / (2 * r)) / r
    square = v**2 - (friction_force / force) ** 2 * g**2
    if square <= 0:
        raise StopsOccurError(f"no motion without stops: friction {friction_force} N, force {force} N, ratio {r}")
    amplitude = float(np.sqrt(square) * force / stiffness)

    def needed(tau):
        return (np.sin(tau) + r * g * (np.cos(r * tau) - np.cos(tau))) / (r * np.sin(r * tau))

    taus = np.linspace(0, np.pi / r, 4001)[1:-1]
    best = int(np.argmax(needed(taus)))
    around = (taus[max(best - 1, 0)], taus[min(best + 1, len(taus) - 1)])
    inside = minimize_scalar(lambda tau: -needed(tau), bounds=around, method="bounded", options={"xatol": 1e-12})
    largest = max(1 / r**2, float(-inside.fun))
    if amplitude <= largest * friction_force / stiffness:
        raise StopsOccurError(f"the mass stops: friction {friction_force} N, force {force} N, ratio {r}")
    return amplitude


def coulomb_orbit(mass, damping, stiffness, load, friction_dof, friction_force, omega, *, transient=30) -> Orbit:
    """Periodic motion of `M x'' + C x' + K x + lambda = Re(load exp(i omega t))` from rest.

    mass, damping, stiffness (n, n); load (n,), N, may be complex. lambda acts on `friction_dof` alone, which may have
    no mass and damping: rigid Coulomb friction to ground, |lambda| <= friction_force (positive), N, with sticking. The
    phases of the orbit are "stick", "forward" and "backward".

    Raises NoPeriodicMotionError.
    """
    load = np.asarray(load, complex)
    given = mass, damping, stiffness, np.zeros(load.size), load
    return ContactPair(*given, None, friction_dof, friction_force, 0.0, 1.0, omega).orbit_from_rest(transient)


def slider_orbit(mass, damping, stiffness, force, friction_force, omega) -> Orbit:
    """Periodic motion of one mass under force cos(omega t) with rigid Coulomb friction, sticking allowed.

    Raises NoPeriodicMotionError.
    """
    return coulomb_orbit([[mass]], [[damping]], [[stiffness]], [force], 0, friction_force, omega)


def slider_amplitude(mass, damping, stiffness, force, friction_force, omega) -> float:
    """A quarter of the distance, m, that the mass of `slider_orbit` slides in a period: its amplitude.

    Closed where Den Hartog's form holds, from the events elsewhere. Raises NoPeriodicMotionError.
    """
    if friction_force == 0:
        return float(force / abs(stiffness - mass * omega**2 + 1j * omega * damping))
    if damping == 0:
        try:
            return den_hartog_amplitude(mass, stiffness, force, friction_force, omega)
        except StopsOccurError:
            pass
    orbit = slider_orbit(mass, damping, stiffness, force, friction_force, omega)
    return orbit.path(0, ("forward", "backward")) / 4


def slider_wear_depth(
    cycles, amplitude, *, wear=1.1e-11, friction=0.5, area=1e-4, load=10.0, stiffness=1e5
) -> FloatArray:
    """Wear depth W, m, at cycle counts (ascending, the first 0) of a slider that a spring presses.

    Integrates `dW/dcycle = (k_w / alpha) N 4 X(mu N)`, `N = N_0 - k_N W`, where `amplitude(friction_force)` is X, m.
    wear: 1/Pa; area: m2; load, stiffness: N_0, N, and k_N, N/m, of the spring. Defaults are those of `sdof_slider`.
    """

    def rate(_, depth):
        normal = max(load - stiffness * float(depth[0]), 0.0)
        return np.array([wear / area * normal * 4.0 * amplitude(friction * normal) if normal else 0.0])

    counts = np.asarray(cycles, dtype=np.float64)
    atol = 1e-13 * rate(0.0, np.zeros(1))[0] * counts[-1]
    found = solve_ivp(rate, (counts[0], counts[-1]), [0.0], method="DOP853", t_eval=counts, rtol=1e-11, atol=atol)
    if not found.success:
        raise RuntimeError(found.message)
    return found.y[0]


def vibro_impact_orbit(mass, damping, stiffness, force, wall, gap, omega, begin) -> Orbit:
    """Periodic motion of a mass on a spring that meets an elastic wall at the distance `gap`, under force cos(omega t).

    wall: N/m. gap < 0: the wall presses on the resting mass. The branch is the one that a sweep reaches from rest at
    `begin`, rad/s, in steps of 2 % of the undamped frequency without wall; behind its end the motion falls on another
    one. The phases of the orbit are "open" and "closed". damping must be positive: a transient has to die out.

    Raises NoPeriodicMotionError.
    """
    spring = np.array([[wall, -wall], [-wall, wall + stiffness]])
    parts = np.diag([0.0, mass]), np.diag([0.0, damping]), spring, np.zeros(2), np.array([0.0, force])
    first, *others = np.append(np.arange(begin, omega, 0.02 * np.sqrt(stiffness / mass)), omega)
    orbit = ContactPair(*parts, 0, None, 0.0, gap, 0.0, first).orbit_from_rest(30)
    for there in others:
        displacement, velocity = np.pad(orbit.sample(1), ((0, 0), (1, 0)))
        orbit = ContactPair(*parts, 0, None, 0.0, gap, 0.0, there).orbit_near(displacement, velocity)
    return orbit

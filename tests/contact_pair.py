"""Exact periodic motions of a structure with one contact pair of at most one tangent, from event to event.

The pair is exact: rigid, unilateral along the normal, with Coulomb friction along the tangent. Its closing displacement
has no mass; its tangential one has a mass of its own (a mass on a slider) or none (a slider behind a spring, whose
place while it sticks is history). Every phase of such a motion is linear in the state of `tests.event_driven`, and so
are the forces of the pair and its slip velocity: rows that are multiplied by the state. Shares no code with the solver.
"""

import contextlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from tests.event_driven import (
    ON_SWITCH,
    FloatArray,
    NoPeriodicMotionError,
    Orbit,
    Phase,
    PiecewiseLinear,
    close_orbit,
    solve_orbit,
)

SLIDING = {"forward": 1.0, "backward": -1.0}
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)
_CELLS = 32  # of the grid for events, of which a piece of an integral takes at most so many


@dataclass(frozen=True)
class ContactPair(PiecewiseLinear):
    """`M x'' + C x' + K x + lambda = static + Re(harmonic exp(i omega t))`, n displacements.

    mass, damping, stiffness (n, n); load_static (n,), load_harmonic (n,) complex, N. normal: index of the closing
    displacement, massless and undamped; None where `normal_load`, N, presses for ever. tangent: index of the tangential
    one, massless and undamped or not; None where there is none. gap: m. omega: rad/s.
    """

    mass: ArrayLike
    damping: ArrayLike
    stiffness: ArrayLike
    load_static: ArrayLike
    load_harmonic: ArrayLike
    normal: int | None
    tangent: int | None
    normal_load: float
    gap: float
    friction: float
    omega: float

    @cached_property
    def _m(self) -> FloatArray:
        return np.array(self.mass, np.float64)

    @cached_property
    def _k(self) -> FloatArray:
        return np.array(self.stiffness, np.float64)

    @cached_property
    def elastic(self) -> bool:
        """Whether the tangential displacement has no mass."""
        return self.tangent is not None and self._m[self.tangent, self.tangent] == 0.0

    @cached_property
    def massive(self) -> list[int]:
        """Displacements that have a mass; they are the first ones of the state."""
        return [index for index in range(len(self._m)) if self._m[index, index] > 0.0]

    @property
    def n(self) -> int:
        """Displacements of the masses; behind them the place of an elastic slider, whose velocity is not used."""
        return len(self.massive) + self.elastic

    @property
    def _place(self) -> int:
        """Of the tangential displacement in the state."""
        return self.n - 1 if self.elastic else self.massive.index(self.tangent)

    def _one(self, index: int) -> FloatArray:
        return np.eye(2 * self.n + 3)[index]

    def _load(self, index: int) -> FloatArray:
        harmonic = np.array(self.load_harmonic, np.complex128)[index]
        static = np.array(self.load_static, np.float64)[index]
        return harmonic.real * self._one(-3) - harmonic.imag * self._one(-2) + static * self._one(-1)

    def _masses(self) -> FloatArray:
        rows = np.zeros((len(self._m), 2 * self.n + 3))
        rows[self.massive, range(len(self.massive))] = 1.0
        return rows

    def _left(self, index: int, rows: FloatArray) -> FloatArray:
        """Load on a displacement less what its springs take: force of the pair on a massless one."""
        return self._load(index) - self._k[index] @ rows

    def _flow(self, rows: FloatArray, friction: FloatArray, held: bool = False) -> tuple[FloatArray, FloatArray]:
        """Flow of the masses under a friction force, or with the mass at the pair held, and what then holds it."""
        n, masses = self.n, self.massive
        flow = np.zeros((2 * n + 3, 2 * n + 3))
        flow[2 * n, 2 * n + 1], flow[2 * n + 1, 2 * n] = -self.omega, self.omega
        velocity = np.roll(self._masses(), n, axis=1)
        forces = np.array([self._load(index) for index in masses])
        forces -= self._k[masses] @ rows + np.array(self.damping, np.float64)[masses] @ velocity
        moving = list(range(len(masses)))
        flow[moving] = velocity[masses]
        if self.tangent is not None and not self.elastic:
            forces[self._place] -= friction
        if held:
            moving.remove(self._place)
            flow[self._place] = 0.0
        mass = self._m[np.ix_(masses, masses)]
        acceleration = np.zeros_like(forces)
        acceleration[moving] = np.linalg.solve(mass[np.ix_(moving, moving)], forces[moving])
        flow[n : n + len(masses)] = acceleration
        return flow, (forces - mass @ acceleration)[self._place] if held else self._one(0) * 0.0

    @cached_property
    def phases(self) -> dict[str, Phase]:
        """Of these "forward", "backward" and "stick" where there is a tangent, else "closed"; "open"."""
        phases, closed = {}, self._masses()
        if self.normal is not None:
            closed[self.normal] = self.gap * self._one(-1)
        for name, sign in ({"stick": 0.0} | SLIDING if self.tangent is not None else {"closed": 0.0}).items():
            rows, place, slip = closed.copy(), None, 0.0 * self._one(0)
            if self.elastic:
                place = self._one(self._place) if name == "stick" else self._slid(closed, sign)
                rows[self.tangent] = place
            normal = self.normal_load * self._one(-1) if self.normal is None else self._left(self.normal, rows)
            limit = self.friction * normal
            flow, held = self._flow(rows, sign * limit, held=name == "stick" and not self.elastic)
            if name == "stick":
                force = self._left(self.tangent, rows) if self.elastic else held
                guards = [limit - force, limit + force]
            elif sign:
                slip = place @ flow if self.elastic else self._one(self.n + self._place)
                guards = [sign * slip]
            else:
                guards = []
            if self.elastic:
                flow[self._place] = slip
            guards += [] if self.normal is None else [normal]
            phases[name] = Phase(flow, np.array(guards), normal, slip, None if name == "stick" else place)
        if self.normal is not None:
            phases["open"] = self._open()
        return phases

    def _slid(self, closed: FloatArray, sign: float) -> FloatArray:
        """Where an elastic slider is that slips: `lambda_T = sign mu lambda_N`, both from the springs."""
        t, n = self.tangent, self.normal
        if n is None:
            return (self._left(t, closed) - sign * self.friction * self.normal_load * self._one(-1)) / self._k[t, t]
        force = self._left(t, closed) - sign * self.friction * self._left(n, closed)
        return force / (self._k[t, t] - sign * self.friction * self._k[n, t])

    def _open(self) -> Phase:
        nothing, rows = np.zeros(2 * self.n + 3), self._masses()
        free = [self.normal, self.tangent] if self.elastic else [self.normal]
        rows[free] = np.linalg.solve(self._k[np.ix_(free, free)], [self._left(index, rows) for index in free])
        flow, _ = self._flow(rows, nothing)
        place = rows[self.tangent] if self.elastic else None
        if place is not None:
            flow[self._place] = place @ flow
        guards = (self.gap * self._one(-1) - rows[self.normal])[np.newaxis]
        return Phase(flow, guards, nothing, nothing, place)

    def next_phase(self, name: str, y: FloatArray) -> tuple[str, FloatArray]:
        """The phase after an event, and y with the event exactly on its switch.

        It is the first other phase whose guards are positive at once; which ones there are says the event.
        """
        phase = self.phases[name]
        y, others = y.copy(), [other for other in self.phases if other != name]
        values = np.abs(phase.guards @ y)
        if phase.place is not None:
            y[self._place] = phase.place @ y
        if name in SLIDING and self.elastic:
            # from one way to the other a slider behind a spring always sticks
            others.remove("backward" if name == "forward" else "forward")
        elif name == "stick":
            others.remove("backward" if values[0] < values[1] else "forward")
        elif self.tangent is not None and not self.elastic:
            velocity = self.n + self._place
            fast = np.abs(y[self.n : 2 * self.n]).max() + self.omega * np.abs(y[: self.n]).max()
            sizes = [fast, max(float(np.abs(phase.normal * y).max()), 1e-300)][: len(values)]
            if name in SLIDING and np.argmin(values / sizes) == 0:
                y[velocity] = 0.0
            else:
                others = [o for o in others if o != "stick" and SLIDING.get(o, 0.0) * y[velocity] >= 0.0]
        for other in others:
            if self._begins(other, y):
                return other, y
        raise NoPeriodicMotionError(f"no phase follows {name}")

    def _begins(self, name: str, y: FloatArray) -> bool:
        """Whether the first derivative of each guard that is not zero, the guard itself included, is positive."""
        phase, width = self.phases[name], self.cell
        derivatives = [y]
        for order in range(1, 5):
            derivatives.append(phase.flow @ derivatives[-1] * width / order)
        for guard in (np.array(derivatives) @ phase.guards.T).T:
            nonzero = guard[np.abs(guard) > ON_SWITCH * np.abs(guard).max()]
            if nonzero.size == 0 or nonzero[0] <= 0.0:
                return False
        return True

    def phase_at(self, name: str, y: FloatArray) -> str:
        """Phase of a state near one of the phase `name`, away from the switches."""
        if self.tangent is None:
            return self._likely_phase(y)
        if name in SLIDING and not self.elastic:
            return "forward" if y[self.n + self._place] > 0 else "backward"
        return name

    def fixed(self, name: str) -> list[int]:
        """Indices of y that cannot vary in a phase."""
        if self.elastic:
            return [2 * self.n - 1] if name == "stick" else [2 * self.n - 1, self._place]
        return [self.n + self._place] if name == "stick" else []

    def orbit_near(self, displacement: FloatArray, velocity: FloatArray) -> Orbit:
        """Periodic motion next to displacements and velocities (n,) at time 0, stable or not; else the one that the
        motion from there on goes over into. Those of the massless displacements other than the tangential one are not
        used. Raises NoPeriodicMotionError.
        """
        x, v = np.zeros(self.n), np.zeros(self.n)
        x[: len(self.massive)], v[: len(self.massive)] = displacement[self.massive], velocity[self.massive]
        if self.elastic:
            x[-1] = displacement[self.tangent]
        if self.tangent is not None and not self.elastic:
            fastest = np.abs(v).max() + self.omega * np.abs(x).max()
            v[self._place] = v[self._place] if abs(v[self._place]) > 1e-9 * fastest else 0.0
        y = self.extended(x, v)
        name = self._likely_phase(y)
        with contextlib.suppress(NoPeriodicMotionError):
            return close_orbit(self, name, y)
        return solve_orbit(self, name, y, transient=2, attempts=100)

    def orbit_from_rest(self, transient: int) -> Orbit:
        """Periodic motion from rest, after at least so many periods. Raises NoPeriodicMotionError."""
        y = self.extended(np.zeros(self.n), np.zeros(self.n))
        return solve_orbit(self, self._likely_phase(y), y, transient, attempts=20)

    def _likely_phase(self, y: FloatArray) -> str:
        """Phase of a state that need not be exact."""
        if "open" in self.phases and (self.phases["open"].guards @ y).min() > 0.0:
            return "open"
        if self.tangent is None:
            return "closed"
        if self.elastic:
            low, high = self.phases["stick"].guards[:2] @ y
            name = "forward" if low < high else "backward"
            slips = min(low, high) <= 0.0 and (self.phases[name].guards[0] @ y) > 0.0
            return name if slips else "stick"
        velocity = y[self.n + self._place]
        if velocity == 0.0:
            low, high = self.phases["stick"].guards[:2] @ y
            if min(low, high) > 0.0:
                return "stick"
            velocity = high - low
        return "forward" if velocity > 0.0 else "backward"

    def response(self, orbit: Orbit) -> np.ndarray:
        """Complex first harmonics of the masses, m."""
        return np.array([orbit.harmonic(place) for place in range(len(self.massive))])

    def slip_work(self, orbit: Orbit) -> float:
        """Integral of normal force times slip over a period, N m."""
        total = 0.0
        for segment in orbit.segments:
            phase = self.phases[segment.phase]
            if segment.phase not in SLIDING:
                continue
            pieces = int(np.ceil(segment.duration / (_CELLS * self.cell)))
            length, y = segment.duration / pieces, segment.start
            within = np.array([expm(phase.flow * length * (node + 1.0) / 2.0) for node in _NODES])
            for _ in range(pieces):
                states = within @ y
                total += length / 2.0 * float(_WEIGHTS @ np.abs((states @ phase.normal) * (states @ phase.slip)))
                y = expm(phase.flow * length) @ y
        return total

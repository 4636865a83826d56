"""Exact periodic motions of piecewise linear oscillators under a harmonic force, from event to event.

Between two events the motion is linear, and the state extended by the force,
`y = [x (n), x' (n), cos(omega t), sin(omega t), 1]`, follows `y' = flow y` without a right-hand side. So a phase is a
matrix exponential, an event is the root of a power series, and a Fourier coefficient is an exponential as well: nothing
is discretised, the results are exact to round-off. The only grid is the one on which events are looked for.

The period map is closed by Newton's method after a transient. Made for textbook systems: a handful of unknowns.
"""

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import brentq

FloatArray = NDArray[np.float64]
_TERMS = 24  # of the power series inside a cell, whose length is at most a quarter of the shortest time constant
_RESOLUTION = 0.25
_MINIMUM_CELLS = 256  # in a period
_CLOSED = 1e-12  # relative distance of the states one period apart in a periodic motion
ON_SWITCH = 1e-9  # relative size of a guard that counts as zero where a phase starts; round-off: 1e-10


class NoPeriodicMotionError(RuntimeError):
    """The period map was not closed: no periodic motion with the period of the force near the transient."""


@dataclass(frozen=True)
class Phase:
    """A linear piece of the motion.

    flow (m, m): `y' = flow y`, 1/s. guards (n_guards, m): the phase lasts while every `guards @ y` is positive.
    Rows (m,) that give normal force, N, slip velocity, m/s, and the place, m, of an elastic slider that moves.
    """

    flow: FloatArray
    guards: FloatArray
    normal: FloatArray
    slip: FloatArray
    place: FloatArray | None


@dataclass(frozen=True)
class Segment:
    """A phase that lasted from `start` (m,) for `duration`, s."""

    phase: str
    start: FloatArray
    duration: float


class PiecewiseLinear:
    """Oscillator with n displacements under a force of the angular frequency omega, rad/s.

    phases: by name; in "stick" nothing need move. What a kind of oscillator adds has `ContactPair`.
    """

    omega: float
    n: int
    phases: Mapping[str, Phase]

    @property
    def period(self) -> float:
        """Period of the force, s."""
        return 2 * np.pi / self.omega

    @cached_property
    def cell(self) -> float:
        """Length of a cell of the grid for events, s; a whole number of cells makes a period."""
        fastest = max(float(np.abs(np.linalg.eigvals(phase.flow)).max()) for phase in self.phases.values())
        return self.period / max(_MINIMUM_CELLS, int(np.ceil(self.period * fastest / _RESOLUTION)))

    @cached_property
    def grids(self) -> dict[str, FloatArray]:
        """By phase: the exponentials (n_cells + 1, m, m) at the ends of the cells of one period."""
        n_cells = round(self.period / self.cell)
        grids = {}
        for name, phase in self.phases.items():
            step = expm(phase.flow * self.cell)
            powers = [np.eye(len(step))]
            for _ in range(n_cells):
                powers.append(step @ powers[-1])
            grids[name] = np.array(powers)
        return grids

    def extended(self, displacement: FloatArray, velocity: FloatArray, time: float = 0.0) -> FloatArray:
        """State y of a displacement (n,), m, and a velocity (n,), m/s, at a time of the force, s."""
        angle = self.omega * time
        return np.concatenate([displacement, velocity, [np.cos(angle), np.sin(angle), 1.0]])

    def advance(self, name: str, y: FloatArray, duration: float) -> tuple[str, FloatArray, list[Segment]]:
        """Move for `duration`, s, at most a period; returns the phase and state at the end and the segments."""
        segments = []
        left = duration
        while True:
            elapsed, y_end, event = self._first_event(name, y, left)
            segments.append(Segment(name, y, elapsed))
            left -= elapsed
            if not event:
                return name, y_end, segments
            if len(segments) > 1000:
                raise NoPeriodicMotionError(f"1000 events in {duration - left} s")
            name, y = self.next_phase(name, y_end)

    def _first_event(self, name: str, y: FloatArray, left: float) -> tuple[float, FloatArray, bool]:
        phase, grid = self.phases[name], self.grids[name]
        states = grid @ y
        values = states @ phase.guards.T
        rates = states @ (phase.guards @ phase.flow).T
        crossed = (values[1:] <= 0).any(axis=1)
        dipped = ((values[:-1] > 0) & (values[1:] > 0) & (rates[:-1] < 0) & (rates[1:] > 0)).any(axis=1)
        # The first cell is always looked at: its guard starts at zero where the phase started on a switch.
        for cell in sorted({0, *np.flatnonzero(crossed | dipped).tolist()}):
            if cell * self.cell >= left:
                break
            series = _power_series(phase.flow, states[cell])
            width = min(self.cell, left - cell * self.cell)
            roots = [_first_root(guard, width, starts_on_switch=cell == 0) for guard in (series @ phase.guards.T).T]
            found = [root for root in roots if root is not None]
            if found:
                return cell * self.cell + min(found), _evaluate(series, min(found)), True
        whole = min(int(left / self.cell), len(grid) - 1)
        return left, _evaluate(_power_series(phase.flow, states[whole]), left - whole * self.cell), False


def _power_series(flow: FloatArray, y: FloatArray) -> FloatArray:
    terms = [y]
    for order in range(1, _TERMS):
        terms.append(flow @ terms[-1] / order)
    return np.array(terms)


def _evaluate(series: FloatArray, time: float) -> FloatArray:
    value: FloatArray = np.zeros_like(series[0])
    for term in series[::-1]:
        value = value * time + term
    return value


def _first_root(series: FloatArray, width: float, starts_on_switch: bool) -> float | None:
    """First time in (0, width] at which the guard stops being positive; None where it stays positive.

    A guard that starts at zero, because its phase started on that switch, is divided by the time; out of stick the
    velocity and the acceleration both start at zero.
    """
    sizes = np.abs(series) * width ** np.arange(len(series))
    while starts_on_switch and sizes[0] <= ON_SWITCH * sizes.max() and len(series) > _TERMS - 2:
        series, sizes = series[1:], sizes[1:]
    if starts_on_switch and series[0] <= 0:
        raise NoPeriodicMotionError("a phase ended as it began")
    times = np.linspace(0.0, width, 33)
    values = np.polynomial.polynomial.polyval(times, series)
    negative = np.flatnonzero(values[1:] <= 0)
    if len(negative) == 0:
        return None
    first, last = times[negative[0]], times[negative[0] + 1]
    if values[negative[0]] <= 0:
        return 0.0
    return float(brentq(lambda time: np.polynomial.polynomial.polyval(time, series), first, last, xtol=1e-16 * width))


@dataclass(frozen=True)
class Orbit:
    """A periodic motion.

    start_time: s, time of the force at which the first segment starts. residual: distance of the states one period
    apart, relative to the largest displacement and velocity.
    """

    system: PiecewiseLinear
    segments: tuple[Segment, ...]
    start_time: float
    residual: float

    def multipliers(self) -> NDArray[np.complex128]:
        """Floquet multipliers (2 n,), largest first, by differences of the period map."""
        y, name, free = self.segments[0].start, self.segments[0].phase, list(range(2 * self.system.n))
        found = np.linalg.eigvals(_period_slope(self.system, name, y, np.full(len(free), np.abs(y[free]).max()), free))
        return found[np.lexsort((-found.imag, -np.abs(found)))]

    def harmonic(self, dof: int, order: int = 1) -> complex:
        """Amplitude X of a displacement: `x(t)` has the harmonic `Re(X exp(i order omega t))`; the mean for order 0."""
        total, time = 0.0 + 0.0j, self.start_time
        rate = 1j * order * self.system.omega
        for segment in self.segments:
            flow = self.system.phases[segment.phase].flow
            size = len(flow)
            block = np.zeros((2 * size, 2 * size), dtype=np.complex128)
            block[:size, :size] = flow - rate * np.eye(size)
            block[:size, size:] = np.eye(size)
            integral = expm(block * segment.duration)[:size, size:] @ segment.start
            total += integral[dof] * np.exp(-rate * time)
            time += segment.duration
        return complex(total) * (1 if order == 0 else 2) / self.system.period

    def sample(self, n_samples: int) -> FloatArray:
        """Displacements and velocities (2 n, n_samples) at the times k T / n_samples of the force."""
        n, times = self.system.n, self.system.period * np.arange(n_samples) / n_samples
        starts = np.cumsum([0.0, *(segment.duration for segment in self.segments[:-1])])
        columns = []
        for elapsed in (times - self.start_time) % self.system.period:
            index = int(np.searchsorted(starts, elapsed, side="right")) - 1
            segment = self.segments[index]
            flow = self.system.phases[segment.phase].flow
            columns.append((expm(flow * (elapsed - starts[index])) @ segment.start)[: 2 * n])
        return np.array(columns).T

    def path(self, dof: int, phases: Sequence[str]) -> float:
        """Distance, m, that a displacement covers in a period in the given phases, in which it must be monotone."""
        ends = [*(segment.start[dof] for segment in self.segments[1:]), self.segments[0].start[dof]]
        parts = zip(self.segments, ends, strict=True)
        return float(sum(abs(end - part.start[dof]) for part, end in parts if part.phase in phases))


def solve_orbit(system: PiecewiseLinear, name: str, y: FloatArray, transient: int, attempts: int) -> Orbit:
    """Periodic motion reached from a phase and state at time 0 of the force.

    Newton's method is tried `attempts` times, each after so many periods; the period is cut in the middle of the
    longest phase that is not "stick". Raises NoPeriodicMotionError.
    """
    start_time = 0.0
    for _ in range(attempts):
        segments: list[Segment] = []
        for _ in range(transient):
            name, y, segments = system.advance(name, y, system.period)
        cut = max((s for s in segments if s.phase != "stick"), key=lambda s: s.duration, default=None)
        if cut is not None:
            position = next(i for i, segment in enumerate(segments) if segment is cut)
            elapsed = sum(segment.duration for segment in segments[:position]) + cut.duration / 2
            name, y, _ = system.advance(name, y, elapsed)
            start_time = (start_time + elapsed) % system.period
        with contextlib.suppress(NoPeriodicMotionError):
            return close_orbit(system, name, y, start_time)
    raise NoPeriodicMotionError(f"no periodic motion at {system.omega} rad/s after {attempts * transient} periods")


def close_orbit(system: PiecewiseLinear, name: str, y: FloatArray, start_time: float = 0.0) -> Orbit:
    """Periodic motion next to a phase and state at `start_time`, stable or not. Raises NoPeriodicMotionError.

    Newton's method on the period map, its derivative from differences, its steps halved until the defect shrinks.
    """
    n = system.n
    free = [index for index in range(2 * n) if index not in system.fixed(name)]
    y = system.extended(y[:n], y[n : 2 * n], start_time)
    name = system.phase_at(name, y)
    orbit, defect = _defect(system, name, y, start_time, free)
    for _ in range(20):
        if orbit.residual <= _CLOSED:
            return orbit
        scale = _scale(orbit)
        slope = _period_slope(system, name, y, scale[free], free)
        # Least squares: a mass that sticks for ever may do so in more than one place.
        jacobian = (slope - np.eye(len(free))) * scale[free] / scale[free][:, np.newaxis]
        full = scale[free] * np.linalg.lstsq(jacobian, defect / scale[free], rcond=1e-9)[0]
        for halving in range(8):
            moved = y.copy()
            moved[free] -= full / 2**halving
            moved_name = system.phase_at(name, moved)
            moved_orbit, moved_defect = _defect(system, moved_name, moved, start_time, free)
            if np.abs(moved_defect / scale[free]).max() < np.abs(defect / scale[free]).max():
                break
        else:
            break
        name, y, orbit, defect = moved_name, moved, moved_orbit, moved_defect
    raise NoPeriodicMotionError("Newton's method does not close the period")


def _period_slope(system: PiecewiseLinear, name: str, y: FloatArray, sizes: FloatArray, free: list[int]) -> FloatArray:
    """Derivative of some entries (k,) of the state a period later by themselves, by central differences."""
    columns = []
    for index, length in zip(free, 1e-6 * sizes, strict=True):
        step = length * np.eye(len(y))[index]
        ends = [system.advance(system.phase_at(name, at), at, system.period)[1] for at in (y + step, y - step)]
        columns.append((ends[0] - ends[1])[free] / (2.0 * length))
    return np.array(columns).T


def _defect(
    system: PiecewiseLinear, name: str, y: FloatArray, start_time: float, free: list[int]
) -> tuple[Orbit, FloatArray]:
    end_name, end, segments = system.advance(name, y, system.period)
    open_orbit = Orbit(system, tuple(segments), start_time, np.inf)
    defect = (end - y)[free]
    residual = float(np.abs(defect / _scale(open_orbit)[free]).max()) if end_name == name else np.inf
    return replace(open_orbit, residual=residual), defect


def _scale(orbit: Orbit) -> FloatArray:
    """Largest displacement and velocity at the events, in the order of the state."""
    n = orbit.system.n
    visited = np.abs(np.array([segment.start for segment in orbit.segments]))
    scale = np.repeat([visited[:, :n].max(), visited[:, n : 2 * n].max()], n)
    # A motion that starts at a turn has no velocity there.
    scale[:n] = np.maximum(scale[:n], scale[n:] / orbit.system.omega)
    scale[n:] = np.maximum(scale[n:], scale[:n] * orbit.system.omega)
    return np.where(scale > 0, scale, 1.0)

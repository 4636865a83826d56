"""The contact law once more, slow and plain: an elastic pair by the displacement of its slider, a mass by its velocity.

The pair is written from Eqs. (11)-(15) in the convention of the project. The mass, `m v' + c v = p(t) - lambda`,
|lambda| <= limit(t), is exact between events where there is one direction, and takes tiny implicit steps in the plane.
Both share nothing with the solver.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

# --- elastic pairs ---


FloatArray = np.ndarray


def project(force: FloatArray, radius: float) -> FloatArray:
    """Point of the Coulomb disc nearest to a tangential force (2,)."""
    size = float(np.linalg.norm(force))
    return force if size <= radius else force * (radius / size)


def pair_period(predicted: FloatArray, friction: float, slip: FloatArray, passes: int) -> tuple[FloatArray, FloatArray]:
    """Contact force (3, N) and slip at the N + 1 ends of the samples (2, N + 1) of the last of some passes.

    predicted (3, N), N. slip (2,): at the start, in force units. A spring of unit stiffness ties the slider to the
    predicted force: what it pulls beyond the disc moves the slider.
    """
    force = np.zeros_like(predicted)
    trace = [np.array(slip, float)]
    for _ in range(passes):
        trace = [trace[-1]]
        for n in range(predicted.shape[1]):
            normal = max(predicted[0, n], 0.0)
            pull = predicted[1:, n] - trace[-1]
            force[0, n] = normal
            force[1:, n] = project(pull, friction * normal)
            trace.append(trace[-1] + (pull - force[1:, n]))
        if np.array_equal(trace[-1], trace[0]):
            break  # all further passes are the same
    return force, np.array(trace).T


def status(predicted: FloatArray, friction: float, slip: FloatArray) -> FloatArray:
    """0 separated, 1 stick, 2 slip, by the states before each sample (2, N); N integers."""
    pull = np.hypot(*(predicted[1:] - slip))
    return np.where(predicted[0] <= 0, 0, np.where(pull < friction * predicted[0], 1, 2))


# --- masses ---


SCAN = 2048  # points a period between which events are looked for


@dataclass(frozen=True)
class Series:
    """A Fourier series over the orders 0, 1, 2, ...: complex amplitudes X, `sum Re(X_n exp(i n w t))`."""

    amplitudes: FloatArray
    omega: float

    def __call__(self, time: FloatArray | float) -> FloatArray:
        orders = np.arange(self.amplitudes.size)
        return np.real(np.exp(1j * self.omega * np.multiply.outer(time, orders)) @ self.amplitudes)

    def scaled(self, factor: float) -> "Series":
        return Series(factor * self.amplitudes, self.omega)

    def minus(self, other: "Series") -> "Series":
        return Series(self.amplitudes - other.amplitudes, self.omega)


@dataclass(frozen=True)
class Slide:
    """Motion between two events: sign 1 forwards, -1 backwards, 0 at rest. velocity and force are functions of time."""

    begin: float
    end: float
    sign: int
    velocity: Callable[[FloatArray], FloatArray]
    force: Callable[[FloatArray], FloatArray]


def slide_exactly(predicted: Series, limit: Series, mass: float, drag: float, periods: int = 150) -> list[Slide]:
    """Slides of the last of some periods, from rest. limit must stay positive."""
    period = 2.0 * np.pi / predicted.omega
    grid = period / SCAN
    slides: list[Slide] = []
    time, velocity = 0.0, 0.0
    sign = _direction(predicted, limit, 0.0)
    end = periods * period
    while time < end:
        if sign == 0:
            motion, force = (lambda t: 0.0 * t), predicted

            def gap(t: FloatArray) -> FloatArray:
                return limit(t) - np.abs(predicted(t))
        else:
            motion, force = _sliding(predicted, limit.scaled(sign), mass, drag, time, velocity), limit.scaled(sign)

            def gap(t: FloatArray, motion=motion, sign=sign) -> FloatArray:
                return sign * motion(t)

        reach = min(end, time + 2.0 * period)
        event = _first_zero(gap, time, grid, reach)
        slides.append(Slide(time, event, sign, motion, force))
        if event >= end:
            break
        if event == reach:
            velocity = float(motion(np.array(event)))
        else:
            # a stuck mass starts, a sliding one has come to rest: it stays or goes where it is pushed
            velocity = 0.0
            sign = int(np.sign(predicted(event))) if sign == 0 else _direction(predicted, limit, event)
        time = event
    kept = []
    for slide in slides:
        if slide.end > end - period:
            kept.append(Slide(max(slide.begin, end - period), slide.end, slide.sign, slide.velocity, slide.force))
    return kept


def _direction(predicted: Series, limit: Series, time: float) -> int:
    return int(np.sign(predicted(time))) if abs(predicted(time)) > limit(time) else 0


def _sliding(
    predicted: Series, friction: Series, mass: float, drag: float, time: float, velocity: float
) -> Callable[[FloatArray], FloatArray]:
    orders = np.arange(predicted.amplitudes.size)
    driven = Series(
        predicted.minus(friction).amplitudes / (1j * orders * predicted.omega * mass + drag), predicted.omega
    )
    free = velocity - float(driven(time))
    return lambda t: driven(t) + free * np.exp(-drag / mass * (t - time))


def _first_zero(gap: Callable[[FloatArray], FloatArray], begin: float, grid: float, end: float) -> float:
    """First time at which a quantity that is positive behind `begin` is zero; `end` where it stays positive."""
    times = begin + grid * np.concatenate([[1e-3, 1e-2, 0.1], np.arange(1, int((end - begin) / grid) + 1)])
    times = np.append(times[times < end], end)
    below = np.flatnonzero(gap(times) <= 0.0)
    if below.size == 0:
        return end
    first = int(below[0])
    if first == 0:
        return float(times[0])
    return float(brentq(lambda t: float(gap(np.array(t))), times[first - 1], times[first], xtol=1e-15))


def harmonic(slides: list[Slide], order: int, omega: float) -> complex:
    """Complex amplitude of the friction force."""
    total = sum(
        _integral(lambda t, s=slide: s.force(t) * np.exp(-1j * order * omega * t), slide.begin, slide.end)
        for slide in slides
    )
    return complex(total) * omega / (2.0 * np.pi) * (1.0 if order == 0 else 2.0)


def slip_work(slides: list[Slide], normal: Series) -> float:
    """Integral over a period of normal force times speed."""
    return float(
        sum(
            np.real(_integral(lambda t, s=slide: normal(t) * np.abs(s.velocity(t)), slide.begin, slide.end))
            for slide in slides
        )
    )


def _integral(function: Callable[[FloatArray], FloatArray], begin: float, end: float) -> complex:
    points, weights = np.polynomial.legendre.leggauss(40)
    half = 0.5 * (end - begin)
    return complex(half * (weights @ function(begin + half * (points + 1.0))))


def step_in_the_plane(
    predicted: FloatArray, limit: FloatArray, mass: float, drag: float, period: float, periods: int = 4
) -> tuple[FloatArray, FloatArray]:
    """Friction force and velocity (2, N) of the last of some periods in N implicit Euler steps, from rest.

    predicted (2, N), N, and limit (N,), N, at the middles of the steps. The force is the one on the disc that is
    nearest to what would stop the mass.
    """
    n_steps = limit.size
    step = period / n_steps
    force, moved = np.zeros((2, n_steps)), np.zeros((2, n_steps))
    velocity = np.zeros(2)
    for _ in range(periods):
        for n in range(n_steps):
            stopping = predicted[:, n] + mass / step * velocity
            size = float(np.hypot(*stopping))
            force[:, n] = stopping if size <= limit[n] else stopping * (limit[n] / size)
            velocity = (stopping - force[:, n]) / (mass / step + drag)
            moved[:, n] = velocity
    return force, moved

"""Friction of a mass that sits directly on a slider, through one period. Floats and arrays only.

A rigid Coulomb force jumps where the mass turns, so that its harmonics fall as 1/n only and a balance of a few
harmonics is wrong by some per cent. Above the highest harmonic H, however, the structure acts by its mass alone. So
the motion of such a pair is marched through the period,

    m v' + c v = p - lambda,                       lambda = projection on the friction disc, against the motion,   (*)

where p is the predicted force of the pair, whose harmonics up to H are the unknowns of the balance. Equation (*) gives
their motion, `u_n = (p_n - lambda_n) / (i n w (i n w m + c))`: p is the paper's `F_r - Z_r u + eps u` with
`eps -> (i n w)^2 m + i n w c`. The harmonics of lambda above H act on the mass m in the march, as in the structure, up
to a relative error of `k / (n w)^2 m`. The drag c, in p and in the march alike, removes the influence of the start.

In a step of length dt the force p (mean over the step) and the friction limit are constant. The instant in the step at
which the mass turns or comes to rest is resolved, so that the residual is smooth and the error of second order in dt.
With two tangents there is no such instant, and the step is divided instead.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from solver.contact.coulomb import SEPARATED, SLIP, STICK, across_slip, friction_force, friction_limit, slip_direction
from solver.contact.period_march import MOST_PERIODS, Directions, Period, slip_work_rate
from solver.model import FloatArray, IntArray

PARTS = 8  # parts of a step of a pair with two tangents
SAME_VELOCITY = 1e-13  # of the velocity that the force gives in a period: a smaller change is a periodic motion


class Masses(NamedTuple):
    """Mass, kg, and drag, N s/m, of each pair (n_contact,); time between two samples, s."""

    mass: FloatArray
    drag: FloatArray
    step: float


@njit(cache=True)
def step_gains(mass: float, drag: float, step: float) -> tuple[float, float]:
    """`m/dt + c/2` and `m/dt - c/2`, so that `gain * velocity after = force - friction + loss * velocity before`."""
    return mass / step + 0.5 * drag, mass / step - 0.5 * drag


@njit(cache=True)
def step_line(
    force: float, velocity: float, limit: float, gain: float, loss: float, tangent: FloatArray
) -> tuple[float, float, float, float]:
    """One step along one line: mean friction force, velocity after the step, mean velocity and mean speed in the step.

    Coulomb's law in one direction. Changes between stick and slip inside the step are resolved.

    - force, velocity, limit: mean force, N, velocity before the step, m/s, and friction limit, N.
    - tangent (3, 3): receives the derivatives of (friction, velocity after, mean speed) by (force, velocity, limit).
    """
    tangent[:, :] = 0.0
    if velocity == 0.0 and abs(force) <= limit:
        tangent[0, 0] = 1.0
        return force, 0.0, 0.0, 0.0
    sign = 1.0 if velocity > 0.0 or (velocity == 0.0 and force > 0.0) else -1.0
    after = (force - sign * limit + loss * velocity) / gain
    if after * sign > 0.0:
        tangent[0, 2] = sign
        _add_velocity(tangent, gain, loss)
        for k in range(3):
            tangent[2, k] = 0.5 * sign * (tangent[1, k] + (k == 1))
        return sign * limit, after, 0.5 * (velocity + after), 0.5 * abs(velocity + after)
    # the mass comes to rest after the fraction of the step in which the retarding force takes its momentum
    retarding, speed = limit - sign * force, sign * velocity
    fraction = sign * loss * velocity / retarding
    by = (sign * fraction / retarding, sign * loss / retarding, -fraction / retarding)  # of the fraction
    if sign * force >= -limit:
        # the mass remains at rest: in the rest of the step friction equals the force
        tangent[0, 0] = 1.0
        tangent[0, 1] = loss
        for k in range(3):
            tangent[2, k] = 0.5 * (by[k] * speed + (fraction * sign if k == 1 else 0.0))
        return force + loss * velocity, 0.0, 0.5 * fraction * velocity, 0.5 * fraction * speed
    friction = (2.0 * fraction - 1.0) * sign * limit
    for k in range(3):
        tangent[0, k] = 2.0 * sign * limit * by[k]
    tangent[0, 2] += (2.0 * fraction - 1.0) * sign
    _add_velocity(tangent, gain, loss)
    after = (force - friction + loss * velocity) / gain
    backward = -sign * after
    for k in range(3):
        tangent[2, k] = 0.5 * (by[k] * (speed - backward) - (1.0 - fraction) * sign * tangent[1, k])
    tangent[2, 1] += 0.5 * fraction * sign
    mean = 0.5 * (fraction * velocity + (1.0 - fraction) * after)
    return friction, after, mean, 0.5 * (fraction * speed + (1.0 - fraction) * backward)


@njit(cache=True)
def _add_velocity(tangent: FloatArray, gain: float, loss: float) -> None:
    """Derivative of the velocity after a step, row 1, from that of the friction, row 0 of `tangent` (3, 3)."""
    for k in range(3):
        tangent[1, k] = -tangent[0, k] / gain
    tangent[1, 0] += 1.0 / gain
    tangent[1, 1] += loss / gain


@njit(cache=True)
def _add_speed(tangent: FloatArray, first: float, second: float, speed: float, inner: FloatArray) -> None:
    """Add half the derivative of a speed to that of the mean speed; inner (2, 5): derivative of its velocity."""
    if speed > 0.0:
        for k in range(5):
            tangent[4, k] += 0.5 * (first * inner[0, k] + second * inner[1, k]) / speed / PARTS


@njit(cache=True)
def step_plane(
    force: FloatArray,
    velocity: FloatArray,
    limit: float,
    gain: float,
    loss: float,
    out: FloatArray,
    tangent: FloatArray,
) -> None:
    """One step in the plane, in `PARTS` implicit parts; arguments as in `step_line`, force and velocity (2,).

    - out (7,): receives mean friction force (2), velocity after the step (2), mean velocity (2) and mean speed.
    - tangent (5, 5): receives the derivatives of (friction, velocity after, mean speed) by (force, velocity, limit).
    """
    mass, drag = 0.5 * (gain + loss), gain - loss
    gain = PARTS * mass + 0.5 * drag
    loss = PARTS * mass - 0.5 * drag
    out[:] = 0.0
    tangent[:, :] = 0.0
    first, second = velocity[0], velocity[1]
    inner = np.zeros((2, 5))  # derivative of the velocity with respect to (force, velocity, limit)
    inner[0, 2] = 1.0
    inner[1, 3] = 1.0
    drive = np.empty((2, 5))
    friction = np.empty((2, 5))
    for _ in range(PARTS):
        drive_1 = force[0] + loss * first
        drive_2 = force[1] + loss * second
        drive[:, :] = loss * inner
        drive[0, 0] += 1.0
        drive[1, 1] += 1.0
        before = np.hypot(first, second)
        _add_speed(tangent, first, second, before, inner)
        force_1, force_2, sticks = friction_force(drive_1, drive_2, limit)
        if sticks:
            # the whole force is friction: the mass is at rest after the part
            friction[:, :] = drive
        else:
            unit_1, unit_2, ratio = slip_direction(drive_1, drive_2, limit)
            across_11, across_12, across_22 = across_slip(unit_1, unit_2, ratio)
            for k in range(5):
                friction[0, k] = across_11 * drive[0, k] + across_12 * drive[1, k]
                friction[1, k] = across_12 * drive[0, k] + across_22 * drive[1, k]
            friction[0, 4] += unit_1
            friction[1, 4] += unit_2
        next_1 = (drive_1 - force_1) / gain
        next_2 = (drive_2 - force_2) / gain
        after = np.hypot(next_1, next_2)
        for k in range(5):
            inner[0, k] = (drive[0, k] - friction[0, k]) / gain
            inner[1, k] = (drive[1, k] - friction[1, k]) / gain
            tangent[0, k] += friction[0, k] / PARTS
            tangent[1, k] += friction[1, k] / PARTS
        _add_speed(tangent, next_1, next_2, after, inner)
        out[0] += force_1 / PARTS
        out[1] += force_2 / PARTS
        out[4] += 0.5 * (first + next_1) / PARTS
        out[5] += 0.5 * (second + next_2) / PARTS
        out[6] += 0.5 * (before + after) / PARTS
        first = next_1
        second = next_2
    out[2] = first
    out[3] = second
    tangent[2:4] = inner


@njit(cache=True)
def step_mass(
    force: FloatArray,
    velocity: FloatArray,
    limit: float,
    gain: float,
    loss: float,
    line: int,
    out: FloatArray,
    tangent: FloatArray,
) -> None:
    """One step of a pair, as `step_plane`. line: 0 or 1, the index of the only tangent; -1 for two tangents."""
    if line < 0:
        step_plane(force, velocity, limit, gain, loss, out, tangent)
        return
    small = np.empty((3, 3))
    friction, after, mean, speed = step_line(force[line], velocity[line], limit, gain, loss, small)
    out[:] = 0.0
    tangent[:, :] = 0.0
    out[line] = friction
    out[2 + line] = after
    out[4 + line] = mean
    out[6] = speed
    rows = (line, 2 + line, 4)
    for i in range(3):
        for j in range(3):
            tangent[rows[i], rows[j]] = small[i, j]


@njit(cache=True)
def march_masses(pairs: IntArray, period: Period, directions: Directions, masses: Masses) -> None:
    """March masses (n,) through the period until their velocity repeats.

    The tangential predicted forces are means over the steps, and so are the contact forces. The state is the
    displacement since the start of the period, m, the start receives the velocity there, m/s.
    """
    out, tangent = np.empty(7), np.empty((5, 5))
    step, n_samples = masses.step, period.status_t.shape[1]
    for pair in pairs:
        gain, loss = step_gains(masses.mass[pair], masses.drag[pair], step)
        predicted_t, force_t, place_t = period.predicted_t[pair], period.force_t[pair], period.state_t[pair]
        friction, line, start = period.friction[pair], directions.line[pair], period.start[pair]
        largest = np.abs(predicted_t[1:]).max()
        velocity = np.zeros(2)
        # far more periods than needed: the drag halves the change in each period
        for _ in range(MOST_PERIODS):
            start[:] = velocity
            work = 0.0
            for n in range(n_samples):
                normal = max(predicted_t[0, n], 0.0)
                rests = velocity[0] == 0.0 and velocity[1] == 0.0
                limit = friction_limit(friction, normal)
                step_mass(predicted_t[1:, n], velocity, limit, gain, loss, line, out, tangent)
                force_t[0, n], force_t[1, n], force_t[2, n] = normal, out[0], out[1]
                for i in range(2):
                    velocity[i] = out[2 + i]
                    place_t[i, n + 1] = place_t[i, n] + step * out[4 + i]
                work += slip_work_rate(normal, out[6]) * step
                if predicted_t[0, n] <= 0.0:
                    period.status_t[pair, n] = SEPARATED
                elif rests and out[2] == 0.0 and out[3] == 0.0:
                    period.status_t[pair, n] = STICK
                else:
                    period.status_t[pair, n] = SLIP
            period.slip_work[pair] = work
            change = np.hypot(velocity[0] - start[0], velocity[1] - start[1]) * masses.mass[pair]
            period.change[pair] = change / step
            if change <= SAME_VELOCITY * largest * step * n_samples:
                break

"""Friction of a mass that sits directly on a slider, through one period, and derivatives. Floats and arrays only.

A rigid Coulomb force jumps where the mass turns: its harmonics fall as 1/n only, and a balance of a few harmonics is
wrong by some per cent. Above the highest harmonic H the structure acts by its mass alone. So the pair is marched,

    m v' + c v = p - lambda,                       lambda = projection on the friction disc, against the motion,   (*)

and (*) gives the motion `u_n = (p_n - lambda_n) / (i n w (i n w m + c))`: the predicted force p is the paper's
`F_r - Z_r u + eps u` with `eps -> (i n w)^2 m + i n w c`. Harmonics of lambda above H act on m, as in the structure up
to a relative error of `k / (n w)^2 m`. The drag c, in p and in the march alike, removes the influence of the start.

In a step of length dt the force p (mean over the step) and the friction limit are constant. The instant at which the
mass turns or comes to rest is resolved, so that the residual is smooth and the error of second order in dt. With two
tangents there is no such instant, and the step is divided instead.

Results of a step are (friction (2), velocity after the step (2), mean velocity (2), mean speed), and its derivatives
(5, 5) those of (friction, velocity after, mean speed) by (force (2), velocity before (2), friction limit).
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numba.extending import register_jitable

from solver.contact.coulomb import SEPARATED, SLIP, STICK, friction_force, friction_limit, slip_tangent
from solver.contact.elastic_pairs import MOST_PERIODS, Period, assemble, fill_friction_column, periodic_start
from solver.contact.element import Tangents
from solver.model import FloatArray, IntArray

PARTS = 8  # of a step of a pair with two tangents; half and twice as many: sliding mass and two masses are equal
SAME_VELOCITY = 1e-13  # of the velocity that the force gives in a period: a smaller change is a periodic motion

Pair = tuple[float, float]


class Masses(NamedTuple):
    """Mass, kg, and drag, N s/m, of each pair (n,); its line, 0 or 1 where it has the first or the second tangent only,
    else -1; time between two samples, s.
    """

    mass: FloatArray
    drag: FloatArray
    line: IntArray
    step: float


@register_jitable
def step_gains(mass: float, drag: float, step: float) -> Pair:
    """`m/dt + c/2` and `m/dt - c/2`, so that `gain * velocity after = force - friction + loss * velocity before`."""
    return mass / step + 0.5 * drag, mass / step - 0.5 * drag


@register_jitable
def step_line(
    force: float, velocity: float, limit: float, gain: float, loss: float, tangent: FloatArray
) -> tuple[float, float, float, float]:
    """One step along one line: mean friction force, velocity after the step, mean velocity and mean speed.

    force, N, velocity before the step, m/s, limit, N. tangent (3, 3): receives the derivatives of (friction, velocity
    after, mean speed) by (force, velocity, limit).
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


@register_jitable
def _add_velocity(tangent: FloatArray, gain: float, loss: float) -> None:
    """Derivative of the velocity after a step, row 1, from that of the friction, row 0 of `tangent` (3, 3)."""
    for k in range(3):
        tangent[1, k] = -tangent[0, k] / gain
    tangent[1, 0] += 1.0 / gain
    tangent[1, 1] += loss / gain


@register_jitable
def _add_speed(tangent: FloatArray, first: float, second: float, inner: FloatArray) -> float:
    """The speed of a velocity; adds half its derivative to that of the mean speed. inner (2, 5): of the velocity."""
    speed = float(np.hypot(first, second))
    if speed > 0.0:
        for k in range(5):
            tangent[4, k] += 0.5 * (first * inner[0, k] + second * inner[1, k]) / speed / PARTS
    return speed


@register_jitable
def step_plane(force: Pair, velocity: FloatArray, limit: float, gains: Pair, out: FloatArray, by: FloatArray) -> None:
    """One step in the plane, in `PARTS` implicit parts; arguments as in `step_line`, velocity (2,).

    gains: see `step_gains`. out (7,), by (5, 5): receive results and derivatives.
    """
    mass, drag = 0.5 * (gains[0] + gains[1]), gains[0] - gains[1]
    gain, loss = PARTS * mass + 0.5 * drag, PARTS * mass - 0.5 * drag
    out[:] = 0.0
    by[:, :] = 0.0
    first, second = velocity[0], velocity[1]
    inner = np.zeros((2, 5))  # derivative of the velocity with respect to (force, velocity, limit)
    inner[0, 2] = inner[1, 3] = 1.0
    drive = np.empty((2, 5))
    for _ in range(PARTS):
        drive_1, drive_2 = force[0] + loss * first, force[1] + loss * second
        for i in range(2):
            for k in range(5):
                drive[i, k] = loss * inner[i, k]
            drive[i, i] += 1.0
        before = _add_speed(by, first, second, inner)
        friction_1, friction_2, sticks = friction_force(drive_1, drive_2, limit)
        # while it sticks the whole force is friction: the mass is at rest after the part
        n_1, n_2, across_11, across_12, across_22 = 0.0, 0.0, 1.0, 0.0, 1.0
        if not sticks:
            n_1, n_2, _, across_11, across_12, across_22 = slip_tangent(drive_1, drive_2, limit)
        for k in range(5):
            by_1 = across_11 * drive[0, k] + across_12 * drive[1, k] + (n_1 if k == 4 else 0.0)
            by_2 = across_12 * drive[0, k] + across_22 * drive[1, k] + (n_2 if k == 4 else 0.0)
            inner[0, k], inner[1, k] = (drive[0, k] - by_1) / gain, (drive[1, k] - by_2) / gain
            by[0, k] += by_1 / PARTS
            by[1, k] += by_2 / PARTS
        next_1, next_2 = (drive_1 - friction_1) / gain, (drive_2 - friction_2) / gain
        after = _add_speed(by, next_1, next_2, inner)
        out[0] += friction_1 / PARTS
        out[1] += friction_2 / PARTS
        out[4] += 0.5 * (first + next_1) / PARTS
        out[5] += 0.5 * (second + next_2) / PARTS
        out[6] += 0.5 * (before + after) / PARTS
        first, second = next_1, next_2
    out[2], out[3] = first, second
    for k in range(5):
        by[2, k], by[3, k] = inner[0, k], inner[1, k]


@register_jitable
def step_mass(
    force: Pair, velocity: FloatArray, limit: float, gains: Pair, line: int, out: FloatArray, tangent: FloatArray
) -> None:
    """One step of a pair, as `step_plane`. line: index of the only tangent; -1 for two."""
    if line < 0:
        step_plane(force, velocity, limit, gains, out, tangent)
        return
    out[:] = 0.0
    tangent[:, :] = 0.0
    small = np.empty((3, 3))
    out[line], out[2 + line], out[4 + line], out[6] = step_line(force[line], velocity[line], limit, *gains, small)
    places = (line, 2 + line, 4)
    for i in range(3):
        for j in range(3):
            tangent[places[i], places[j]] = small[i, j]


@njit(cache=True)
def march_masses(pairs: IntArray, period: Period, masses: Masses) -> None:
    """March masses (n,) through the period until their velocity repeats.

    Tangential forces are means over the steps. The state is the displacement since the start of the period, m; `start`
    receives the velocity there, m/s.
    """
    out, tangent, velocity = np.empty(7), np.empty((5, 5)), np.empty(2)
    step, n_samples = masses.step, period.status_t.shape[1]
    for pair in pairs:
        gains = step_gains(masses.mass[pair], masses.drag[pair], step)
        predicted_t, force_t, place_t = period.predicted_t[pair], period.force_t[pair], period.state_t[pair]
        start, largest = period.start[pair], 0.0
        velocity[:] = 0.0
        for n in range(n_samples):
            largest = max(largest, abs(predicted_t[1, n]), abs(predicted_t[2, n]))
        # far more periods than needed: the drag halves the change in each period
        for _ in range(MOST_PERIODS):
            start[0], start[1] = velocity[0], velocity[1]
            work = 0.0
            for n in range(n_samples):
                normal, force = max(predicted_t[0, n], 0.0), (predicted_t[1, n], predicted_t[2, n])
                rests = velocity[0] == 0.0 and velocity[1] == 0.0
                limit = friction_limit(period.friction[pair], normal)
                step_mass(force, velocity, limit, gains, masses.line[pair], out, tangent)
                force_t[0, n], force_t[1, n], force_t[2, n] = normal, out[0], out[1]
                for i in range(2):
                    velocity[i] = out[2 + i]
                    place_t[i, n + 1] = place_t[i, n] + step * out[4 + i]
                work += normal * out[6] * step
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


@njit(cache=True)
def mass_slopes(pairs: IntArray, period: Period, masses: Masses) -> tuple[FloatArray, FloatArray]:
    """Derivatives (n, N, 5, 5) of the steps of some masses (n,) through a period, and mean speeds (n, N), m/s."""
    n_samples, out, velocity = period.status_t.shape[1], np.empty(7), np.empty(2)
    slopes, speed_t = np.empty((pairs.size, n_samples, 5, 5)), np.empty((pairs.size, n_samples))
    for place, pair in enumerate(pairs):
        gains, predicted_t = step_gains(masses.mass[pair], masses.drag[pair], masses.step), period.predicted_t[pair]
        velocity[0], velocity[1] = period.start[pair, 0], period.start[pair, 1]
        for n in range(n_samples):
            limit = friction_limit(period.friction[pair], max(predicted_t[0, n], 0.0))
            force = predicted_t[1, n], predicted_t[2, n]
            step_mass(force, velocity, limit, gains, masses.line[pair], out, slopes[place, n])
            velocity[0], velocity[1], speed_t[place, n] = out[2], out[3], out[6]
    return slopes, speed_t


@njit(cache=True)
def mass_tangent(
    pairs: IntArray,
    period: Period,
    steps: tuple[FloatArray, FloatArray],
    step: float,
    by_column_t: tuple[FloatArray, FloatArray],
    analysis_h: FloatArray,
    out: Tangents,
) -> None:
    """Derivatives of the results of `march_masses` of some pairs (n,), with the periodicity, into `out`.

    steps: as `mass_slopes` gives them. step: between samples, s. by_column_t: synthesis of samples and of means over
    steps, as `by_columns` gives them. analysis_h (m, N): harmonics from such means; contiguous.
    """
    m, n_samples = analysis_h.shape
    w, (slopes, speed_t), (sample_t, mean_t) = 3 * m + 3, steps, by_column_t
    dforce_t, after, dstart = np.empty((n_samples, 2 * w)), np.empty((5, w)), np.zeros((2, w))
    for place, pair in enumerate(pairs):
        work, velocity = np.zeros(w), np.zeros((2, w))
        velocity[0, 3 * m] = velocity[1, 3 * m + 1] = 1.0
        fill_friction_column(period.predicted_t[pair, 0], period.friction[pair], sample_t)
        for n in range(n_samples):
            normal = max(period.predicted_t[pair, 0, n], 0.0)
            by_limit = period.friction[pair] if normal > 0.0 else 0.0
            by_0, by_1, by_2 = sample_t[n, 2 * m :], mean_t[n, m:], mean_t[n]
            for row in range(5):
                by = slopes[place, n, row]
                for j in range(w):
                    from_before = by[2] * velocity[0, j] + by[3] * velocity[1, j]
                    after[row, j] = from_before + by[0] * by_1[j] + by[1] * by_2[j] + by[4] * (by_limit * by_0[j])
            speed = speed_t[place, n] if normal > 0.0 else 0.0
            for j in range(w):
                dforce_t[n, j], dforce_t[n, w + j] = after[0, j], after[1, j]
                velocity[0, j], velocity[1, j] = after[2, j], after[3, j]
                work[j] = work[j] + normal * step * after[4, j] + (speed * step * by_0[j] if j < m else 0.0)
        periodic_start(velocity, dstart)
        assemble(out, pair, dforce_t, work, dstart, analysis_h)

"""Exact derivatives of the periodic state of elastic pairs and of masses, including the periodicity.

Floats and arrays only. `coulomb` has the derivative of a sample, `rigid_slider` the derivative of a step of a mass. The
last period gives the derivatives with its start held, and those with respect to its start. The derivative of the start
follows from the periodicity.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from solver.contact.coulomb import STICK, advance_tangent, contact_sample, contact_tangent, friction_limit
from solver.contact.period_march import PLAIN_PERIODS, increment_slopes, slip_work_slopes, solve_periodicity
from solver.contact.rigid_slider import Masses, step_gains, step_mass
from solver.model import BoolArray, FloatArray, IntArray


@njit(cache=True)
def march_tangent(
    pairs: IntArray,
    predicted_t: FloatArray,
    friction: FloatArray,
    start: FloatArray,
    state_t: FloatArray,
    periods: IntArray,
    line: IntArray,
    has_normal: BoolArray,
    series: tuple[FloatArray, FloatArray],
    out: tuple[FloatArray, FloatArray],
) -> None:
    """Derivatives of the results of `march_period` and `integrate_slip_work` of some pairs (n,), with the periodicity.

    Where the periodicity does not determine the start of the last period (the pair has come to stick), the derivative
    of the start follows from the periods before.

    - predicted_t, friction, start: arguments of `march_period`; state_t, periods: its results.
    - line, has_normal (n_contact,): as in `model.ContactInterface`.
    - series (m, N), (N, m): synthesis and analysis of the Fourier basis.
    - out: receives the derivatives of the harmonics of the friction force (n_contact, 3m, 3m), dimensionless, in the
      rows of the tangents that exist, and of the slip work (N * N), (n_contact, 3m), N.
    """
    # rows of the transposes are contiguous, as the loops over columns need
    basis_t, analysis_t = np.ascontiguousarray(series[0].T), np.ascontiguousarray(series[1].T)
    n_samples, m = basis_t.shape
    for pair in pairs:
        columns, tangents, width = pair_columns(m, line[pair], has_normal[pair])
        dforce_t = np.empty((n_samples, tangents.size, width + 2))
        dforce, before, dstart = np.empty((2, width + 2)), np.empty((2, width + 2)), np.empty((2, width))
        work = np.zeros(width + 2)
        dstate = np.zeros((2, width + 2))
        dstate[0, width] = dstate[1, width + 1] = 1.0
        for n in range(n_samples):
            normal, force_1, force_2 = predicted_t[pair, 0, n], predicted_t[pair, 1, n], predicted_t[pair, 2, n]
            first, second = state_t[pair, 0, n], state_t[pair, 1, n]
            normal, _, _, _, _, status = contact_sample(normal, force_1, force_2, friction[pair], first, second)
            by = contact_tangent(status, normal, force_1 - first, force_2 - second, friction[pair])
            before[:, :] = dstate
            if tangents.size == 2:
                advance_tangent(dstate, dforce_t[n], basis_t[n], columns, status, by)
            else:
                advance_tangent(dstate, dforce, basis_t[n], columns, status, by)
                dforce_t[n, 0] = dforce[tangents[0]]
            _add_slip_work(work, n, predicted_t[pair, 0], state_t[pair], before, dstate, basis_t, has_normal[pair])
        plain = min(periods[pair] - 1, PLAIN_PERIODS)
        _start_tangent(dstart, dstate, predicted_t[pair], friction[pair], start[pair], plain, basis_t, columns)
        _assemble(out[0][pair], out[1][pair], dforce_t, work, dstart, analysis_t, tangents, columns)


@njit(cache=True)
def pair_columns(m: int, line: int, has_normal: bool) -> tuple[IntArray, IntArray, int]:
    """Columns of the derivatives of a pair: first column of each component (3,), -1 for none; its tangents; number.

    A pair with one tangent has the columns of its components alone; a pair with both tangents has 3m columns.
    """
    columns = np.array([0 if has_normal else -1, m, 2 * m])
    if line < 0:
        return columns, np.array([0, 1]), 3 * m
    own = m if has_normal else 0
    columns[1 + line], columns[2 - line] = own, -1
    return columns, np.array([line]), own + m


@njit(cache=True)
def _add_slip_work(
    work: FloatArray,
    n: int,
    normal_t: FloatArray,
    state_t: FloatArray,
    before: FloatArray,
    after: FloatArray,
    basis_t: FloatArray,
    has_normal: bool,
) -> None:
    """Add the derivative of the slip work of sample n to `work` (width + 2,).

    normal_t (N,): predicted normal force, N. before, after (2, width + 2): derivatives of the state around the sample.
    """
    step_1 = state_t[0, n + 1] - state_t[0, n]
    step_2 = state_t[1, n + 1] - state_t[1, n]
    slip = np.hypot(step_1, step_2)
    if slip == 0.0:
        return
    last = n - 1 if n > 0 else normal_t.size - 1
    normal_before, normal = max(normal_t[last], 0.0), max(normal_t[n], 0.0)
    by_normal, by_slip = increment_slopes(normal_before, normal, slip)
    for column in range(work.size):
        work[column] += by_slip * (
            step_1 / slip * (after[0, column] - before[0, column])
            + step_2 / slip * (after[1, column] - before[1, column])
        )
    if has_normal:
        for k in range(basis_t.shape[1]):
            if normal_before > 0.0:
                work[k] += by_normal * basis_t[last, k]
            if normal > 0.0:
                work[k] += by_normal * basis_t[n, k]


@njit(cache=True)
def _assemble(
    tangent: FloatArray,
    work_tangent: FloatArray,
    dforce_t: FloatArray,
    work: FloatArray,
    dstart: FloatArray,
    analysis_t: FloatArray,
    tangents: IntArray,
    columns: IntArray,
) -> None:
    """Derivatives of a pair: of the harmonics of friction into `tangent` (3m, 3m), of the slip work into (3m,).

    - dforce_t (N, n_tangents, width + 2 or more), work (width + 2,): derivatives with the start of the period held; the
      last two of width + 2 columns by the start.
    - dstart (2, width): derivative of the start.
    """
    (m, n_samples), width = analysis_t.shape, dstart.shape[1]
    dforce_h = np.dot(analysis_t, dforce_t.reshape(n_samples, -1)).reshape(m, tangents.size, -1)
    for component in range(3):
        first, full = columns[component], component * m
        if first < 0:
            continue
        for k in range(m):
            column = first + k
            work_tangent[full + k] = (
                work[column] + work[width] * dstart[0, column] + work[width + 1] * dstart[1, column]
            )
        for place, along in enumerate(tangents):
            for row in range(m):
                out, own = tangent[(1 + along) * m + row, full : full + m], dforce_h[row, place]
                for k in range(m):
                    column = first + k
                    out[k] = own[column] + own[width] * dstart[0, column] + own[width + 1] * dstart[1, column]


@njit(cache=True)
def _start_tangent(
    dstart: FloatArray,
    dstate: FloatArray,
    predicted_t: FloatArray,
    friction: float,
    start: FloatArray,
    periods: int,
    basis_t: FloatArray,
    columns: IntArray,
) -> None:
    """Derivative of the start of the last period, into `dstart` (2, width).

    - dstate (2, width + 2): derivative of the end of the last period.
    - periods: those before the last one, which give the derivative where the periodicity does not; 0: start given.
    """
    width = dstart.shape[1]
    dstart[:, :] = 0.0
    if periods == 0:
        return
    monodromy = dstate[:, width:]
    _, _, found = solve_periodicity(monodromy, 0.0, 0.0)
    if found:
        for column in range(width):
            first, second, _ = solve_periodicity(monodromy, dstate[0, column], dstate[1, column])
            dstart[0, column], dstart[1, column] = first, second
        return
    moved, dforce = np.zeros_like(dstate), np.empty_like(dstate)
    first, second = start
    for _ in range(periods):
        for n in range(predicted_t.shape[1]):
            trial_1 = predicted_t[1, n] - first
            trial_2 = predicted_t[2, n] - second
            normal, _, _, first, second, status = contact_sample(
                predicted_t[0, n], predicted_t[1, n], predicted_t[2, n], friction, first, second
            )
            if status != STICK:
                by = contact_tangent(status, normal, trial_1, trial_2, friction)
                advance_tangent(moved, dforce, basis_t[n], columns, status, by)
    dstart[:, :] = moved[:, :width]


@njit(cache=True)
def mass_tangent(
    pairs: IntArray,
    predicted_t: FloatArray,
    friction: FloatArray,
    masses: Masses,
    step: float,
    start: FloatArray,
    has_normal: BoolArray,
    series: tuple[FloatArray, FloatArray, FloatArray],
    out: tuple[FloatArray, FloatArray],
) -> None:
    """Exact derivative of the periodic motion of `march_masses` of some pairs (n,) by the harmonics of the predicted
    force.

    - predicted_t, friction, masses, step: arguments of `march_masses`.
    - start (n_contact, 2): velocity at the start of the period, m/s.
    - series (m, N), (m, N), (N, m): from the harmonics to the normal force at the samples and to the means of the
      tangential forces over the steps, and from these means back to their harmonics.
    - out: receives what that of `march_tangent` receives; the derivative of the slip work is in m.
    """
    point_t, mean_t = np.ascontiguousarray(series[0].T), np.ascontiguousarray(series[1].T)
    analysis_t = np.ascontiguousarray(series[2].T)
    n_samples, m = point_t.shape
    ahead, local = np.empty(7), np.empty((5, 5))
    for pair in pairs:
        line = masses[2][pair]
        columns, tangents, width = pair_columns(m, line, has_normal[pair])
        leave = np.empty((5, width + 2))
        # in whole blocks of 8 columns: the round-off of the product does not depend on the number of columns
        padded = width + 2 if line < 0 else (width + 2 + 7) // 8 * 8
        dforce_t = np.zeros((n_samples, tangents.size, padded))
        work = np.zeros(width + 2)
        gain, loss = step_gains(masses[0][pair], masses[1][pair], step)
        velocity = start[pair].copy()
        # columns: the harmonics of the predicted force, then the velocity at the start
        entry = np.zeros((2, width + 2))
        entry[0, width] = entry[1, width + 1] = 1.0
        for n in range(n_samples):
            normal = max(predicted_t[pair, 0, n], 0.0)
            limit = friction_limit(friction[pair], normal)
            step_mass(predicted_t[pair, 1:, n], velocity, limit, gain, loss, line, ahead, local)
            by_limit = friction[pair] if normal > 0.0 and has_normal[pair] else 0.0
            _leave(leave, local, entry, tangents, columns, mean_t[n], by_limit * point_t[n])
            for place, tangent in enumerate(tangents):
                dforce_t[n, place, : width + 2] = leave[tangent]
            by_normal, by_speed = slip_work_slopes(normal, ahead[6])
            work += by_speed * step * leave[4]
            if normal > 0.0 and has_normal[pair]:
                work[:m] += by_normal * step * point_t[n]
            velocity[:] = ahead[2:4]
            entry[:, :] = leave[2:4]
        dstart = np.empty((2, width))
        for column in range(width):
            first, second, _ = solve_periodicity(entry[:, width:], entry[0, column], entry[1, column])
            dstart[0, column], dstart[1, column] = first, second
        _assemble(out[0][pair], out[1][pair], dforce_t, work, dstart, analysis_t, tangents, columns)


@njit(cache=True)
def _leave(
    leave: FloatArray,
    local: FloatArray,
    entry: FloatArray,
    tangents: IntArray,
    columns: IntArray,
    mean: FloatArray,
    limit: FloatArray,
) -> None:
    """Derivatives (5, width + 2) of the results of a step of a mass by all columns, into `leave`.

    - local (5, 5): derivatives of the step. entry (2, width + 2): of the velocities before the step.
    - mean, limit (m,): derivatives of a force, and of the friction limit by the normal force, by their harmonics.
    """
    for row in range(5):
        first, second = local[row, 2], local[row, 3]
        for column in range(entry.shape[1]):
            leave[row, column] = first * entry[0, column] + second * entry[1, column]
        for tangent in tangents:
            own = leave[row, columns[1 + tangent] : columns[1 + tangent] + mean.size]
            for k in range(mean.size):
                own[k] += local[row, tangent] * mean[k]
        if columns[0] >= 0:
            for k in range(mean.size):
                leave[row, k] += local[row, 4] * limit[k]

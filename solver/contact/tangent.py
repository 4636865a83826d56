"""Exact derivatives of the periodic state of elastic pairs and of masses, including the periodicity.

Floats and arrays only. `coulomb` has the derivative of a sample, `rigid_slider` the derivative of a step of a mass.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from solver.contact.coulomb import STICK, advance_tangent, contact_sample, friction_limit
from solver.contact.period_march import PLAIN_PERIODS, increment_slopes, slip_work_slopes, solve_periodicity
from solver.contact.rigid_slider import step_mass
from solver.model import BoolArray, FloatArray, IntArray


@njit(cache=True)
def march_tangent(
    predicted_t: FloatArray,
    friction: FloatArray,
    start: FloatArray,
    state_t: FloatArray,
    periods: IntArray,
    line: IntArray,
    synthesis: FloatArray,
    analysis: FloatArray,
    has_normal: BoolArray,
) -> tuple[FloatArray, FloatArray]:
    """Derivatives of the results of `march_period` and `integrate_slip_work`, including the periodicity.

    The last period gives the derivatives with its start held, and the derivatives with respect to its start. The
    derivative of the start follows from the periodicity. Where the periodicity does not determine the start (the pair
    has come to stick), the derivative of the start follows from the periods before.

    Parameters
    ----------
    predicted_t, friction, start : array
        Arguments of `march_period`.
    state_t, periods : array
        Results of `march_period`.
    line : array (n_contact,)
        As in `rigid_slider.step_mass`. A tangent that does not exist is returned as sticking.
    synthesis, analysis : array (m, N), (N, m)
        Matrices of the Fourier basis.
    has_normal : array (n_contact,)
        False where the normal force is constant.

    Returns
    -------
    force_tangent : array (n_contact, 3m, 3m)
        d(harmonics of the tangential force)/d(harmonics of the predicted force) of each pair, harmonics as in
        `coulomb.advance_tangent`, dimensionless; the rows of the normal force are zero.
    slip_work_tangent : array (n_contact, 3m)
        Derivative of the slip work (N * N), N.
    """
    n_contact, _, n_samples = predicted_t.shape
    m = synthesis.shape[0]
    # rows of the transposes are contiguous, as the loops over columns need
    basis_t = np.ascontiguousarray(synthesis.T)
    force_tangent = np.zeros((n_contact, 3 * m, 3 * m))
    slip_work_tangent = np.zeros((n_contact, 3 * m))
    analysis_t = np.ascontiguousarray(analysis.T)
    for pair in range(n_contact):
        columns, width = pair_columns(m, line[pair], has_normal[pair])
        dforce_t = np.empty((n_samples, 2, width + 2))
        before = np.empty((2, width + 2))
        dstart = np.empty((2, width))
        work = np.zeros(width + 2)
        dstate = np.zeros((2, width + 2))
        dstate[0, width] = dstate[1, width + 1] = 1.0
        for n in range(n_samples):
            first = state_t[pair, 0, n]
            second = state_t[pair, 1, n]
            normal, _, _, _, _, status = contact_sample(
                predicted_t[pair, 0, n], predicted_t[pair, 1, n], predicted_t[pair, 2, n], friction[pair], first, second
            )
            trial_1 = predicted_t[pair, 1, n] - first
            trial_2 = predicted_t[pair, 2, n] - second
            before[:, :] = dstate
            advance_tangent(dstate, basis_t[n], status, normal, trial_1, trial_2, friction[pair], columns, dforce_t[n])
            _add_slip_work(work, n, predicted_t[pair, 0], state_t[pair], before, dstate, basis_t, has_normal[pair])
        plain = min(periods[pair] - 1, PLAIN_PERIODS)
        start_tangent(dstart, dstate, predicted_t[pair], friction[pair], start[pair], plain, basis_t, columns)
        if line[pair] >= 0:
            _line_tangent(force_tangent[pair], dforce_t[:, line[pair]], dstart, analysis_t, line[pair], columns)
        else:
            _plane_tangent(force_tangent[pair], dforce_t, dstart, analysis_t)
        for component in range(3):
            for column in range(columns[component], columns[component] + m if columns[component] >= 0 else -1):
                slip_work_tangent[pair, component * m + column - columns[component]] = (
                    work[column] + work[width] * dstart[0, column] + work[width + 1] * dstart[1, column]
                )
    return force_tangent, slip_work_tangent


@njit(cache=True)
def pair_columns(m: int, line: int, has_normal: bool) -> tuple[IntArray, int]:
    """Columns of the derivatives of a pair: first column of each component (3,), -1 for none, and number of columns.

    A pair with one tangent (`line` as in `rigid_slider.step_mass`) has the columns of its components alone; a pair with
    both tangents has 3m columns.
    """
    columns = np.array([0 if has_normal else -1, m, 2 * m])
    if line < 0:
        return columns, 3 * m
    own = m if has_normal else 0
    columns[1 + line], columns[2 - line] = own, -1
    return columns, own + m


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

    normal_t (N,), state_t (2, N + 1): predicted normal force and state of the pair, N. before, after (2, width + 2):
    derivatives of the state before and after the sample.
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
def _plane_tangent(tangent: FloatArray, dforce_t: FloatArray, dstart: FloatArray, analysis_t: FloatArray) -> None:
    """Tangent (3m, 3m) of a pair with two tangents, in place; `dforce_t` (N, 2, width + 2): derivative of its force."""
    m, n_samples = analysis_t.shape
    width = dstart.shape[1]
    dforce_h = np.dot(analysis_t, dforce_t.reshape(n_samples, -1)).reshape(m, 2, width + 2)
    for component in range(2):
        for k in range(m):
            row = (1 + component) * m + k
            start_1 = dforce_h[k, component, width]
            start_2 = dforce_h[k, component, width + 1]
            for column in range(width):
                tangent[row, column] = (
                    dforce_h[k, component, column] + start_1 * dstart[0, column] + start_2 * dstart[1, column]
                )


@njit(cache=True)
def _line_tangent(
    tangent: FloatArray, dforce: FloatArray, dstart: FloatArray, analysis_t: FloatArray, line: int, columns: IntArray
) -> None:
    """Tangent (3m, 3m) of a pair with one tangent, in place; `dforce` (N, width + 2): derivative of its force."""
    m, n_samples = analysis_t.shape
    width, own, rows = dstart.shape[1], columns[1 + line], (1 + line) * m
    closed = np.empty((n_samples, width))
    for n in range(n_samples):
        for k in range(width):
            start = dforce[n, width] * dstart[0, k] + dforce[n, width + 1] * dstart[1, k]
            closed[n, k] = dforce[n, k] + start
    harmonics = np.dot(analysis_t, closed)
    for row in range(m):
        for k in range(own):
            tangent[rows + row, k] = harmonics[row, k]
        for k in range(m):
            tangent[rows + row, rows + k] = harmonics[row, own + k]
    for k in range((2 - line) * m, (3 - line) * m):
        tangent[k, k] = 1.0


@njit(cache=True)
def start_tangent(
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
    - periods: number of periods before the last one, which give the derivative where the periodicity does not; 0 where
      the start is given.
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
                advance_tangent(moved, basis_t[n], status, normal, trial_1, trial_2, friction, columns, dforce)
    for column in range(width):
        dstart[0, column], dstart[1, column] = moved[0, column], moved[1, column]


@njit(cache=True)
def mass_tangent(
    predicted_t: FloatArray,
    friction: FloatArray,
    mass: FloatArray,
    drag: FloatArray,
    line: IntArray,
    step: float,
    start: FloatArray,
    synthesis: FloatArray,
    step_synthesis: FloatArray,
    step_analysis: FloatArray,
    has_normal: BoolArray,
) -> tuple[FloatArray, FloatArray]:
    """Exact derivative of the periodic motion of `march_masses` with respect to the harmonics of the predicted force.

    Parameters
    ----------
    predicted_t, friction, mass, drag, line, step
        Arguments of `march_masses`.
    start : array (n_contact, 2)
        Velocity at the start of the period, m/s.
    synthesis : array (m, N)
        From the harmonics to the normal force at the samples.
    step_synthesis : array (m, N)
        From the harmonics to the means of the tangential forces over the steps.
    step_analysis : array (N, m)
        From the means of the tangential forces back to their harmonics.
    has_normal : array (n_contact,)
        False where the normal force is constant.

    Returns
    -------
    force_tangent : array (n_contact, 3m, 3m)
        As `march_tangent`, without its normal rows, dimensionless.
    slip_work_tangent : array (n_contact, 3m)
        Derivative of the slip work, m.
    """
    n_contact, _, n_samples = predicted_t.shape
    m = synthesis.shape[0]
    force_tangent = np.zeros((n_contact, 3 * m, 3 * m))
    slip_work_tangent = np.zeros((n_contact, 3 * m))
    point_t = np.ascontiguousarray(synthesis.T)
    mean_t = np.ascontiguousarray(step_synthesis.T)
    out, local = np.empty(7), np.empty((5, 5))
    analysis_t = np.ascontiguousarray(step_analysis.T)
    for pair in range(n_contact):
        columns, width = pair_columns(m, line[pair], has_normal[pair])
        tangents = np.array([0, 1]) if line[pair] < 0 else np.array([line[pair]])
        leave = np.empty((5, width + 2))
        # in whole blocks of 8 columns: the round-off of the product below does not depend on the number of columns
        padded = width + 2 if line[pair] < 0 else (width + 2 + 7) // 8 * 8
        dforce_t = np.zeros((n_samples, tangents.size, padded))
        work = np.zeros(width + 2)
        gain = mass[pair] / step + 0.5 * drag[pair]
        loss = mass[pair] / step - 0.5 * drag[pair]
        velocity = start[pair].copy()
        # columns: the harmonics of the predicted force, then the velocity at the start
        entry = np.zeros((2, width + 2))
        entry[0, width] = entry[1, width + 1] = 1.0
        for n in range(n_samples):
            normal = max(predicted_t[pair, 0, n], 0.0)
            limit = friction_limit(friction[pair], normal)
            step_mass(predicted_t[pair, 1:, n], velocity, limit, gain, loss, line[pair], out, local)
            by_limit = friction[pair] if normal > 0.0 and has_normal[pair] else 0.0
            _leave(leave, local, entry, tangents, columns, mean_t[n], by_limit * point_t[n])
            for place, tangent in enumerate(tangents):
                dforce_t[n, place, : width + 2] = leave[tangent]
            by_normal, by_speed = slip_work_slopes(normal, out[6])
            work += by_speed * step * leave[4]
            if normal > 0.0 and has_normal[pair]:
                work[:m] += by_normal * step * point_t[n]
            velocity[:] = out[2:4]
            entry[:, :] = leave[2:4]
        closed = _closed_start(entry)
        dforce_h = np.dot(analysis_t, dforce_t.reshape(n_samples, -1)).reshape(m, tangents.size, padded)
        for component in range(3):
            for harmonic in range(m if columns[component] >= 0 else 0):
                column, full = columns[component] + harmonic, component * m + harmonic
                first, second = closed[0, column], closed[1, column]
                for place, tangent in enumerate(tangents):
                    by_start = dforce_h[:, place, width] * first + dforce_h[:, place, width + 1] * second
                    rows = slice((1 + tangent) * m, (2 + tangent) * m)
                    force_tangent[pair, rows, full] = dforce_h[:, place, column] + by_start
                slip_work_tangent[pair, full] = work[column] + work[width] * first + work[width + 1] * second
    return force_tangent, slip_work_tangent


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
    """Derivatives (5, width + 2) of the results of a step of a mass with respect to all columns, into `leave`.

    - local (5, 5): derivatives of the step, as of `rigid_slider.step_plane`.
    - entry (2, width + 2): derivatives of the velocities before the step.
    - tangents, columns: tangents of the pair, and first columns of its components.
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


@njit(cache=True)
def _closed_start(entry: FloatArray) -> FloatArray:
    """Derivatives (2, width) of the velocities at the start of the period, which are those at its end: v0 = v(x, v0).

    entry (2, width + 2): derivatives of the velocities at the end; the last two columns by those at the start.
    """
    width = entry.shape[1] - 2
    own_1, other_1 = entry[0, width], entry[0, width + 1]
    other_2, own_2 = entry[1, width], entry[1, width + 1]
    determinant = (1.0 - own_1) * (1.0 - own_2) - other_1 * other_2
    closed = np.empty((2, width))
    for column in range(width):
        closed[0, column] = ((1.0 - own_2) * entry[0, column] + other_1 * entry[1, column]) / determinant
        closed[1, column] = ((1.0 - own_1) * entry[1, column] + other_2 * entry[0, column]) / determinant
    return closed

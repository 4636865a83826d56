"""Exact derivatives of the periodic state of elastic pairs and of masses, including the periodicity.

Floats and arrays only. `coulomb` has the derivative of a sample, `rigid_slider` the derivative of a step of a mass. The
last period gives the derivatives with its start held, and those with respect to its start. The derivative of the start
follows from the periodicity.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from solver.contact.coulomb import STICK, contact_sample, contact_tangent, friction_limit
from solver.contact.period_march import (
    PLAIN_PERIODS,
    Directions,
    Period,
    increment_slopes,
    slip_work_slopes,
    solve_periodicity,
)
from solver.contact.rigid_slider import Masses, step_gains, step_mass
from solver.model import FloatArray, IntArray

Series = tuple[FloatArray, FloatArray, FloatArray]
"""From the harmonics to the samples of the normal force (m, N) and of the tangential forces (m, N), and from samples of
tangential forces back to harmonics (N, m). With masses, the tangential forces are means over the steps."""

Tangents = tuple[FloatArray, FloatArray]
"""Receive the derivatives by the harmonics of the predicted force: of those of the friction force (n_contact, 3m, 3m),
dimensionless, in the rows of the tangents that exist, and of the slip work as in `Period` (n_contact, 3m)."""


@njit(cache=True)
def march_tangent(pairs: IntArray, period: Period, directions: Directions, series: Series, out: Tangents) -> None:
    """Derivatives of the results of `march_period` of some pairs (n,), with the periodicity.

    Where the periodicity does not determine the start of the last period (the pair has come to stick), the derivative
    of the start follows from the periods before.
    """
    # rows of the transposes are contiguous, as the loops over columns need
    basis_t, analysis_t = np.ascontiguousarray(series[0].T), np.ascontiguousarray(series[2].T)
    n_samples, m = basis_t.shape
    for pair in pairs:
        has_normal, friction = directions.has_normal[pair], period.friction[pair]
        predicted_t, state_t = period.predicted_t[pair], period.state_t[pair]
        columns, tangents, width = pair_columns(m, directions.line[pair], has_normal)
        dforce_t = np.empty((n_samples, tangents.size, width + 2))
        dforce, before, dstart = np.empty((2, width + 2)), np.empty((2, width + 2)), np.empty((2, width))
        work, dstate = np.zeros(width + 2), np.zeros((2, width + 2))
        dstate[0, width] = dstate[1, width + 1] = 1.0
        for n in range(n_samples):
            pressed, pull_1, pull_2 = predicted_t[0, n], predicted_t[1, n], predicted_t[2, n]
            first, second = state_t[0, n], state_t[1, n]
            normal, _, _, _, _, status = contact_sample(pressed, pull_1, pull_2, friction, first, second)
            by = contact_tangent(status, normal, pull_1 - first, pull_2 - second, friction)
            if status != STICK:
                before[:, :] = dstate
            if tangents.size == 2:
                _advance(dstate, dforce_t[n], basis_t[n], columns, status, by)
            else:
                _advance(dstate, dforce, basis_t[n], columns, status, by)
                dforce_t[n, 0] = dforce[tangents[0]]
            if status != STICK:
                _add_slip_work(work, n, predicted_t[0], state_t, before, dstate, basis_t, has_normal)
        plain = min(period.periods[pair] - 1, PLAIN_PERIODS)
        _start_tangent(dstart, dstate, predicted_t, friction, period.start[pair], plain, basis_t, columns)
        _assemble(out[0][pair], out[1][pair], dforce_t, work, dstart, analysis_t, tangents, columns)


@njit(cache=True)
def _advance(
    dstate: FloatArray,
    dforce: FloatArray,
    basis: FloatArray,
    first: IntArray,
    status: int,
    by: tuple[float, float, float, float, float],
) -> None:
    """Derivatives of one sample, in place: `dforce` (2, w) of the tangential force, `dstate` (2, w) of the state.

    Eqs. (13)-(15), with the dependence on all earlier samples of the period. dstate: on entry that of the sample
    before.

    - basis (m,): derivative of a time sample by its harmonics.
    - first (3,): first of the m columns of each component of the predicted force; -1 where there are none.
    - status, by: of the sample; `by` from `contact_tangent`.
    """
    m, width = basis.size, dstate.shape[1]
    pull_1, pull_2, across_11, across_12, across_22 = by
    if status == STICK:
        for column in range(width):
            dforce[0, column] = -dstate[0, column]
            dforce[1, column] = -dstate[1, column]
    else:
        for column in range(width):
            dforce[0, column] = -across_11 * dstate[0, column] - across_12 * dstate[1, column]
            dforce[1, column] = -across_12 * dstate[0, column] - across_22 * dstate[1, column]
    for component, by_1, by_2 in ((0, pull_1, pull_2), (1, across_11, across_12), (2, across_12, across_22)):
        place = first[component]
        if place >= 0 and by_1 != 0.0:
            _add(dforce[0, place : place + m], by_1, basis)
        if place >= 0 and by_2 != 0.0:
            _add(dforce[1, place : place + m], by_2, basis)
    if status == STICK:
        return
    for component in range(2):
        for column in range(width):
            dstate[component, column] = -dforce[component, column]
        place = first[1 + component]
        if place >= 0:
            _add(dstate[component, place : place + m], 1.0, basis)


@njit(cache=True)
def _add(row: FloatArray, times: float, basis: FloatArray) -> None:
    """Add `times` the basis (m,) to a row (m,)."""
    for k in range(basis.size):
        row[k] += times * basis[k]


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

    - dforce_t (N, n_tangents, width + 2), work (width + 2,): derivatives with the start of the period held; the
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
                _advance(moved, dforce, basis_t[n], columns, status, by)
    dstart[:, :] = moved[:, :width]


@njit(cache=True)
def mass_tangent(
    pairs: IntArray, period: Period, directions: Directions, masses: Masses, series: Series, out: Tangents
) -> None:
    """Derivatives of the results of `march_masses` of some pairs (n,), with the periodicity."""
    point_t, mean_t = np.ascontiguousarray(series[0].T), np.ascontiguousarray(series[1].T)
    analysis_t = np.ascontiguousarray(series[2].T)
    n_samples, m = point_t.shape
    ahead, local = np.empty(7), np.empty((5, 5))
    for pair in pairs:
        has_normal, line, friction = directions.has_normal[pair], directions.line[pair], period.friction[pair]
        columns, tangents, width = pair_columns(m, line, has_normal)
        gain, loss = step_gains(masses.mass[pair], masses.drag[pair], masses.step)
        dforce_t, leave = np.empty((n_samples, tangents.size, width + 2)), np.empty((5, width + 2))
        work, velocity = np.zeros(width + 2), period.start[pair].copy()
        # columns: the harmonics of the predicted force, then the velocity at the start
        entry = np.zeros((2, width + 2))
        entry[0, width] = entry[1, width + 1] = 1.0
        for n in range(n_samples):
            normal = max(period.predicted_t[pair, 0, n], 0.0)
            limit = friction_limit(friction, normal)
            step_mass(period.predicted_t[pair, 1:, n], velocity, limit, gain, loss, line, ahead, local)
            by_limit = friction if normal > 0.0 and has_normal else 0.0
            _leave(leave, local, entry, tangents, columns, mean_t[n], by_limit * point_t[n])
            for place, tangent in enumerate(tangents):
                dforce_t[n, place] = leave[tangent]
            by_normal, by_speed = slip_work_slopes(normal, ahead[6])
            work += by_speed * masses.step * leave[4]
            if normal > 0.0 and has_normal:
                work[:m] += by_normal * masses.step * point_t[n]
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

"""Derivatives of the contact law through one period, for `coulomb` and `rigid_slider`. Floats and arrays only."""

from __future__ import annotations

import numpy as np
from numba import njit

from solver.contact.coulomb import PLAIN_PASSES, SLIP, STICK, close, contact_sample
from solver.contact.rigid_slider import step_mass
from solver.model import BoolArray, FloatArray, IntArray


@njit(cache=True)
def state_tangent(
    dstate: FloatArray,
    basis: FloatArray,
    status: int,
    normal: float,
    pre_1: float,
    pre_2: float,
    friction: float,
    has_normal: bool,
    dforce: FloatArray,
) -> None:
    """Derivatives of one sample, in place: `dforce` (2, 3m+2) of the tangential force, `dstate` (2, 3m+2) of the state.

    Columns are the harmonics of the predicted force of the pair: normal (m), tangent 1 (m), tangent 2 (m), and the
    state at the start of the period. `basis` (m,) holds the derivative of a time sample with respect to its harmonics.
    `dstate` comes in as that of the sample before.
    """
    m = basis.size
    if status == STICK:
        for column in range(3 * m + 2):
            dforce[0, column] = -dstate[0, column]
            dforce[1, column] = -dstate[1, column]
        for k in range(m):
            dforce[0, m + k] += basis[k]
            dforce[1, 2 * m + k] += basis[k]
        return
    for column in range(3 * m + 2):
        dforce[0, column] = 0.0
        dforce[1, column] = 0.0
    if status == SLIP and friction * normal > 0.0:
        size = np.sqrt(pre_1 * pre_1 + pre_2 * pre_2)
        unit_1 = pre_1 / size
        unit_2 = pre_2 / size
        ratio = friction * normal / size
        across_11 = ratio * (1.0 - unit_1 * unit_1)
        across_12 = -ratio * unit_1 * unit_2
        across_22 = ratio * (1.0 - unit_2 * unit_2)
        for column in range(3 * m + 2):
            dforce[0, column] = -across_11 * dstate[0, column] - across_12 * dstate[1, column]
            dforce[1, column] = -across_12 * dstate[0, column] - across_22 * dstate[1, column]
        for k in range(m):
            if has_normal:
                dforce[0, k] += friction * unit_1 * basis[k]
                dforce[1, k] += friction * unit_2 * basis[k]
            dforce[0, m + k] += across_11 * basis[k]
            dforce[0, 2 * m + k] += across_12 * basis[k]
            dforce[1, m + k] += across_12 * basis[k]
            dforce[1, 2 * m + k] += across_22 * basis[k]
    for column in range(3 * m + 2):
        dstate[0, column] = -dforce[0, column]
        dstate[1, column] = -dforce[1, column]
    for k in range(m):
        dstate[0, m + k] += basis[k]
        dstate[1, 2 * m + k] += basis[k]


@njit(cache=True)
def march_tangent(
    predicted_t: FloatArray,
    friction: float,
    start: FloatArray,
    state_t: FloatArray,
    passes: IntArray,
    line: IntArray,
    synthesis: FloatArray,
    analysis: FloatArray,
    has_normal: BoolArray,
) -> tuple[FloatArray, FloatArray]:
    """Derivative of what `march_period` and `wear_integral` give, the closure of the period included.

    start (n_contact, 2): as in `march_period`. state_t, passes: as it has returned them. line (n_contact,): as in
    `inertia.step_plane`; a tangent that does not exist is returned as one that sticks. has_normal (n_contact,): False
    where the normal force is constant. Returns

    - force_tangent (n_contact, 3m, 3m): d(harmonics of the tangential force)/d(harmonics of the predicted force) of
      each pair, harmonics as in `state_tangent`, dimensionless; the rows of the normal force are zero;
    - wear_tangent (n_contact, 3m): derivative of the wear integral (N * N), N.

    The last pass gives the derivatives with its start held and those with respect to its start. The start moves with
    the predicted force as a state that repeats has to; where nothing makes it do so (the pair has come to stick), as it
    has been marched to.
    """
    n_contact, _, n_samples = predicted_t.shape
    m = synthesis.shape[0]
    width = 3 * m
    # rows of the transposes are contiguous, which is what the loops over columns need
    basis_t = np.ascontiguousarray(synthesis.T)
    force_tangent = np.zeros((n_contact, width, width))
    wear_tangent = np.zeros((n_contact, width))
    dstate = np.empty((2, width + 2))
    before_dstate = np.empty((2, width + 2))
    analysis_t = np.ascontiguousarray(analysis.T)
    dforce_t = np.empty((n_samples, 2, width + 2))
    dforce = np.empty((2, width + 2))
    wear = np.empty(width + 2)
    dstart = np.empty((2, width))
    for pair in range(n_contact):
        wear[:] = 0.0
        dstate[:, :] = 0.0
        dstate[0, width] = dstate[1, width + 1] = 1.0
        for n in range(n_samples):
            first = state_t[pair, 0, n]
            second = state_t[pair, 1, n]
            normal, _, _, _, _, status = contact_sample(
                predicted_t[pair, 0, n], predicted_t[pair, 1, n], predicted_t[pair, 2, n], friction, first, second
            )
            pre_1 = predicted_t[pair, 1, n] - first
            pre_2 = predicted_t[pair, 2, n] - second
            before_dstate[:, :] = dstate
            state_tangent(dstate, basis_t[n], status, normal, pre_1, pre_2, friction, has_normal[pair], dforce_t[n])
            step_1 = state_t[pair, 0, n + 1] - first
            step_2 = state_t[pair, 1, n + 1] - second
            slip = np.hypot(step_1, step_2)
            if slip == 0.0:
                continue
            before = n - 1 if n > 0 else n_samples - 1
            normal_before = max(predicted_t[pair, 0, before], 0.0)
            mean = 0.5 * (normal_before + normal)
            for column in range(width + 2):
                wear[column] += mean * (
                    step_1 / slip * (dstate[0, column] - before_dstate[0, column])
                    + step_2 / slip * (dstate[1, column] - before_dstate[1, column])
                )
            if has_normal[pair]:
                for k in range(m):
                    if normal_before > 0.0:
                        wear[k] += 0.5 * slip * basis_t[before, k]
                    if normal > 0.0:
                        wear[k] += 0.5 * slip * basis_t[n, k]
        start_tangent(
            dstart,
            dstate,
            predicted_t[pair],
            friction,
            start[pair],
            min(passes[pair] - 1, PLAIN_PASSES),
            basis_t,
            has_normal[pair],
            dforce,
        )
        if line[pair] >= 0:
            along = dforce_t[:, line[pair]]
            _line_tangent(force_tangent[pair], along, dstart, analysis_t, line[pair], has_normal[pair])
        else:
            dforce_h = np.dot(analysis_t, dforce_t.reshape(n_samples, -1)).reshape(m, 2, width + 2)
            for component in range(2):
                for k in range(m):
                    row = (1 + component) * m + k
                    start_1 = dforce_h[k, component, width]
                    start_2 = dforce_h[k, component, width + 1]
                    for column in range(width):
                        force_tangent[pair, row, column] = (
                            dforce_h[k, component, column] + start_1 * dstart[0, column] + start_2 * dstart[1, column]
                        )
        for column in range(width):
            wear_tangent[pair, column] = (
                wear[column] + wear[width] * dstart[0, column] + wear[width + 1] * dstart[1, column]
            )
    return force_tangent, wear_tangent


@njit(cache=True)
def _line_tangent(
    tangent: FloatArray, dforce: FloatArray, dstart: FloatArray, analysis_t: FloatArray, line: int, has_normal: bool
) -> None:
    """Tangent (3m, 3m) of a pair with one tangent, in place, from `dforce` (N, 3m+2), that of its force: only the
    columns that there are are analysed.
    """
    m, n_samples = analysis_t.shape
    first, own = 0 if has_normal else m, (1 + line) * m
    packed = np.empty((n_samples, 2 * m - first))
    for n in range(n_samples):
        for k in range(2 * m - first):
            column = first + k if first + k < m else own + first + k - m
            start = dforce[n, 3 * m] * dstart[0, column] + dforce[n, 3 * m + 1] * dstart[1, column]
            packed[n, k] = dforce[n, column] + start
    harmonics = np.dot(analysis_t, packed)
    tangent[own : own + m, first:m] = harmonics[:, : m - first]
    tangent[own : own + m, own : own + m] = harmonics[:, m - first :]
    for k in range((2 - line) * m, (3 - line) * m):
        tangent[k, k] = 1.0


@njit(cache=True)
def start_tangent(
    dstart: FloatArray,
    dstate: FloatArray,
    predicted_t: FloatArray,
    friction: float,
    start: FloatArray,
    passes: int,
    basis_t: FloatArray,
    has_normal: bool,
    dforce: FloatArray,
) -> None:
    """Derivative (2, 3m) of the start of the last pass, into `dstart`; `dstate` (2, 3m+2): that of its end.

    passes: those to march before the last one where the closure does not say it, 0 where the start is given.
    """
    width = dstart.shape[1]
    dstart[:, :] = 0.0
    if passes == 0:
        return
    influence = dstate[:, width:]
    _, _, found = close(influence, 0.0, 0.0)
    if found:
        for column in range(width):
            first, second, _ = close(influence, dstate[0, column], dstate[1, column])
            dstart[0, column], dstart[1, column] = first, second
        return
    moved = np.zeros_like(dstate)
    first, second = start
    for _ in range(passes):
        for n in range(predicted_t.shape[1]):
            pre_1 = predicted_t[1, n] - first
            pre_2 = predicted_t[2, n] - second
            normal, _, _, first, second, status = contact_sample(
                predicted_t[0, n], predicted_t[1, n], predicted_t[2, n], friction, first, second
            )
            if status != STICK:
                state_tangent(moved, basis_t[n], status, normal, pre_1, pre_2, friction, has_normal, dforce)
    dstart[:, :] = moved[:, :width]


@njit(cache=True)
def mass_tangent(
    predicted_t: FloatArray,
    friction: float,
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

    start (n_contact, 2): velocity at the start of the period, m/s. synthesis (m, N) gives the normal force at the
    samples, step_synthesis (m, N) the tangential ones as means over the steps, step_analysis (N, m) their harmonics
    back from such means. Returns

    - force_tangent (n_contact, 3m, 3m): as `march_tangent`, without its normal rows, dimensionless;
    - wear_tangent (n_contact, 3m): of slip_work, m.
    """
    n_contact, _, n_samples = predicted_t.shape
    m = synthesis.shape[0]
    force_tangent = np.zeros((n_contact, 3 * m, 3 * m))
    wear_tangent = np.zeros((n_contact, 3 * m))
    point_t = np.ascontiguousarray(synthesis.T)
    mean_t = np.ascontiguousarray(step_synthesis.T)
    out = np.empty(7)
    local = np.empty((5, 5))
    entry = np.empty((2, 3 * m + 2))
    leave = np.empty((5, 3 * m + 2))
    analysis_t = np.ascontiguousarray(step_analysis.T)
    dforce_t = np.empty((n_samples, 2, 3 * m + 2))
    work = np.empty(3 * m + 2)
    for pair in range(n_contact):
        gain = mass[pair] / step + 0.5 * drag[pair]
        loss = mass[pair] / step - 0.5 * drag[pair]
        velocity = start[pair].copy()
        # columns: the harmonics of the predicted force, then the velocity at the start
        entry[:, :] = 0.0
        entry[0, 3 * m] = 1.0
        entry[1, 3 * m + 1] = 1.0
        work[:] = 0.0
        for n in range(n_samples):
            normal = max(predicted_t[pair, 0, n], 0.0)
            step_mass(predicted_t[pair, 1:, n], velocity, friction * normal, gain, loss, line[pair], out, local)
            # entry holds the velocities; both forces and the friction limit have columns of their own
            for row in range(5):
                first, second = local[row, 2], local[row, 3]
                for column in range(3 * m + 2):
                    leave[row, column] = first * entry[0, column] + second * entry[1, column]
                for k in range(m):
                    leave[row, m + k] += local[row, 0] * mean_t[n, k]
                    leave[row, 2 * m + k] += local[row, 1] * mean_t[n, k]
                if normal > 0.0 and has_normal[pair]:
                    limit = friction * local[row, 4]
                    for k in range(m):
                        leave[row, k] += limit * point_t[n, k]
            dforce_t[n] = leave[:2]
            for column in range(3 * m + 2):
                work[column] += normal * step * leave[4, column]
            if normal > 0.0 and has_normal[pair]:
                for k in range(m):
                    work[k] += out[6] * step * point_t[n, k]
            velocity[0] = out[2]
            velocity[1] = out[3]
            entry[0, :] = leave[2]
            entry[1, :] = leave[3]
        # the start of the period is its end: v0 = v(x, v0)
        determinant = (1.0 - entry[0, 3 * m]) * (1.0 - entry[1, 3 * m + 1]) - entry[0, 3 * m + 1] * entry[1, 3 * m]
        dforce_h = np.dot(analysis_t, dforce_t.reshape(n_samples, -1)).reshape(m, 2, 3 * m + 2)
        for column in range(3 * m):
            first = (
                (1.0 - entry[1, 3 * m + 1]) * entry[0, column] + entry[0, 3 * m + 1] * entry[1, column]
            ) / determinant
            second = ((1.0 - entry[0, 3 * m]) * entry[1, column] + entry[1, 3 * m] * entry[0, column]) / determinant
            for component in range(2):
                for k in range(m):
                    force_tangent[pair, (1 + component) * m + k, column] = (
                        dforce_h[k, component, column]
                        + dforce_h[k, component, 3 * m] * first
                        + dforce_h[k, component, 3 * m + 1] * second
                    )
            wear_tangent[pair, column] = work[column] + work[3 * m] * first + work[3 * m + 1] * second
    return force_tangent, wear_tangent

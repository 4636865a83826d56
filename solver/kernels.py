"""Contact through one period: force, its tangent and the wear integral. Floats and arrays only.

The law is applied to a *predicted* force `p` (what the joint would take up if the pair did not move) and to a
force-like tangential state `x = eps X_T` (X_T: corrected slip, m), Eqs. (11)-(15). With compression positive (PHYSICS
section 2: the print has the sign of the normal test the other way round):

- separated, `p_N <= 0`: no force, and the state follows freely, `x = p_T`;
- stick, `|p_T - x'| < mu p_N` with x' the state one sample earlier: `lambda_T = p_T - x'`, `x = x'`;
- slip otherwise: `lambda_T = mu p_N n` along `n = (p_T - x') / |p_T - x'|`, `x = p_T - lambda_T`.

The state at the start of a period is history. The period is marched again from where it ended until it repeats, and at
least twice where anything slips or opens, because the second pass is what carries the derivative of the start state.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from solver.model import BoolArray, FloatArray, IntArray

SEPARATED = 0
STICK = 1
SLIP = 2


@njit(cache=True)
def contact_sample(
    normal: float, tangent_1: float, tangent_2: float, friction: float, state_1: float, state_2: float
) -> tuple[float, float, float, float, float, int]:
    """One sample of one pair: normal force, two tangential forces, two states, status. All in N; Eqs. (11)-(15)."""
    if normal <= 0.0:
        return 0.0, 0.0, 0.0, tangent_1, tangent_2, SEPARATED
    pre_1 = tangent_1 - state_1
    pre_2 = tangent_2 - state_2
    size = np.sqrt(pre_1 * pre_1 + pre_2 * pre_2)
    limit = friction * normal
    if size < limit:
        return normal, pre_1, pre_2, state_1, state_2, STICK
    if limit == 0.0:
        return normal, 0.0, 0.0, tangent_1, tangent_2, SLIP
    force_1 = limit * pre_1 / size
    force_2 = limit * pre_2 / size
    return normal, force_1, force_2, tangent_1 - force_1, tangent_2 - force_2, SLIP


@njit(cache=True)
def closed_share(force: float, neighbour: float) -> tuple[float, float, float]:
    """Normal force of a sample over the half step towards a neighbour, and its derivatives to both predicted forces.

    Between two samples the predicted normal force is taken as linear, so the pair closes or opens where it is zero: the
    half step next to an opening counts by the closed part of the step. Without this every sample that changes its state
    is a corner in the residual, and a branch with hard impacts breaks up into small folds. `force` is positive.
    """
    if neighbour >= 0.0:
        return force, 1.0, 0.0
    share = force / (force - neighbour)
    # in shares, not squares: predicted forces of pairs without preload may be as small as numbers get
    return share * force, share * (2.0 - share), share * share


@njit(cache=True)
def mean_normal_force(predicted_t: FloatArray) -> FloatArray:
    """Normal force (n_contact, N), N, averaged around each sample: what its harmonics are taken from."""
    n_contact, _, n_samples = predicted_t.shape
    mean = np.zeros((n_contact, n_samples))
    for pair in range(n_contact):
        for n in range(n_samples):
            force = predicted_t[pair, 0, n]
            if force > 0.0:
                before, _, _ = closed_share(force, predicted_t[pair, 0, n - 1])
                after, _, _ = closed_share(force, predicted_t[pair, 0, (n + 1) % n_samples])
                mean[pair, n] = 0.5 * (before + after)
    return mean


@njit(cache=True)
def mean_normal_tangent(
    predicted_t: FloatArray, synthesis: FloatArray, analysis: FloatArray, has_normal: BoolArray
) -> FloatArray:
    """Derivative (n_contact, m, m) of the harmonics of `mean_normal_force` with respect to those of its argument."""
    n_contact, _, n_samples = predicted_t.shape
    m = synthesis.shape[0]
    basis_t = np.ascontiguousarray(synthesis.T)
    tangent = np.zeros((n_contact, m, m))
    row = np.empty(m)
    for pair in range(n_contact):
        if not has_normal[pair]:
            continue
        for n in range(n_samples):
            force = predicted_t[pair, 0, n]
            if force <= 0.0:
                continue
            ahead = (n + 1) % n_samples
            _, own_before, other_before = closed_share(force, predicted_t[pair, 0, n - 1])
            _, own_after, other_after = closed_share(force, predicted_t[pair, 0, ahead])
            for j in range(m):
                row[j] = 0.5 * (
                    (own_before + own_after) * basis_t[n, j]
                    + other_before * basis_t[n - 1, j]
                    + other_after * basis_t[ahead, j]
                )
            for k in range(m):
                for j in range(m):
                    tangent[pair, k, j] += analysis[n, k] * row[j]
    return tangent


@njit(cache=True)
def march_period(
    predicted_t: FloatArray,
    friction: float,
    start: FloatArray,
    closure: float,
    most_passes: int,
) -> tuple[FloatArray, FloatArray, IntArray, IntArray, FloatArray]:
    """March every pair through the period until its tangential state repeats.

    predicted_t (n_contact, 3, N): N, normal first. start (n_contact, 2): tangential state at the start of the first
    pass, N. closure: N, accepted difference of the state over a period. Returns

    - force_t (n_contact, 3, N): contact force, N, compression positive;
    - state_t (n_contact, 2, N+1): tangential state of the last pass, its start first, N;
    - status_t (n_contact, N): SEPARATED, STICK, SLIP;
    - passes (n_contact,): number of passes marched;
    - drift (n_contact,): what is left of the change of the state over the last pass, N.
    """
    n_contact, _, n_samples = predicted_t.shape
    force_t = np.zeros((n_contact, 3, n_samples))
    state_t = np.zeros((n_contact, 2, n_samples + 1))
    status_t = np.zeros((n_contact, n_samples), np.int64)
    passes = np.zeros(n_contact, np.int64)
    drift = np.zeros(n_contact)
    for pair in range(n_contact):
        first = start[pair, 0]
        second = start[pair, 1]
        for sweep in range(most_passes):
            state_t[pair, 0, 0] = first
            state_t[pair, 1, 0] = second
            moved = False
            for n in range(n_samples):
                normal, force_1, force_2, first, second, status = contact_sample(
                    predicted_t[pair, 0, n], predicted_t[pair, 1, n], predicted_t[pair, 2, n], friction, first, second
                )
                force_t[pair, 0, n] = normal
                force_t[pair, 1, n] = force_1
                force_t[pair, 2, n] = force_2
                state_t[pair, 0, n + 1] = first
                state_t[pair, 1, n + 1] = second
                status_t[pair, n] = status
                moved = moved or status != STICK
            passes[pair] = sweep + 1
            drift[pair] = np.hypot(first - state_t[pair, 0, 0], second - state_t[pair, 1, 0])
            if not moved or (sweep > 0 and drift[pair] <= closure):
                break
    return force_t, state_t, status_t, passes, drift


@njit(cache=True)
def wear_integral(force_t: FloatArray, state_t: FloatArray) -> FloatArray:
    """Integral over a period of normal force times corrected slip, as force times state: N * N, (n_contact,).

    Eq. (21) with the sliding velocity, integrated as force times increments of the corrected slip: divided by the
    tangential penalty it is N m. The trapezoidal rule takes the force of both ends of an increment.
    """
    n_contact, _, n_samples = force_t.shape
    integral = np.zeros(n_contact)
    for pair in range(n_contact):
        for n in range(n_samples):
            before = n - 1 if n > 0 else n_samples - 1
            slip = np.hypot(
                state_t[pair, 0, n + 1] - state_t[pair, 0, n], state_t[pair, 1, n + 1] - state_t[pair, 1, n]
            )
            integral[pair] += 0.5 * (force_t[pair, 0, before] + force_t[pair, 0, n]) * slip
    return integral


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
    """Derivatives of one sample, in place: `dforce` (2, 3m) of the tangential force, `dstate` (2, 3m) of the state.

    Columns are the harmonics of the predicted force of the pair: normal (m), tangent 1 (m), tangent 2 (m). `basis` (m,)
    holds the derivative of a time sample with respect to its harmonics. `dstate` comes in as that of the sample before.
    """
    m = basis.size
    if status == STICK:
        for column in range(3 * m):
            dforce[0, column] = -dstate[0, column]
            dforce[1, column] = -dstate[1, column]
        for k in range(m):
            dforce[0, m + k] += basis[k]
            dforce[1, 2 * m + k] += basis[k]
        return
    for column in range(3 * m):
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
        for column in range(3 * m):
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
    for column in range(3 * m):
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
    passes: IntArray,
    synthesis: FloatArray,
    analysis: FloatArray,
    has_normal: BoolArray,
) -> tuple[FloatArray, FloatArray]:
    """Exact derivative of `march_period` and `wear_integral` after the same number of passes.

    has_normal (n_contact,): False where the normal force is constant. Returns

    - force_tangent (n_contact, 3m, 3m): d(harmonics of the tangential force)/d(harmonics of the predicted force) of
      each pair, harmonics as in `state_tangent`, dimensionless; the rows of the normal force are zero;
    - wear_tangent (n_contact, 3m): derivative of the wear integral (N * N), N.
    """
    n_contact, _, n_samples = predicted_t.shape
    m = synthesis.shape[0]
    # rows of the transposes are contiguous, which is what the loops over columns need
    basis_t = np.ascontiguousarray(synthesis.T)
    force_tangent = np.zeros((n_contact, 3 * m, 3 * m))
    wear_tangent = np.zeros((n_contact, 3 * m))
    dstate = np.empty((2, 3 * m))
    before_dstate = np.empty((2, 3 * m))
    dforce = np.empty((2, 3 * m))
    for pair in range(n_contact):
        dstate[:, :] = 0.0
        first = start[pair, 0]
        second = start[pair, 1]
        for sweep in range(passes[pair]):
            last = sweep == passes[pair] - 1
            for n in range(n_samples):
                pre_1 = predicted_t[pair, 1, n] - first
                pre_2 = predicted_t[pair, 2, n] - second
                old_first = first
                old_second = second
                normal, _, _, first, second, status = contact_sample(
                    predicted_t[pair, 0, n], predicted_t[pair, 1, n], predicted_t[pair, 2, n], friction, first, second
                )
                if not last and status == STICK:
                    continue
                before_dstate[:, :] = dstate
                state_tangent(dstate, basis_t[n], status, normal, pre_1, pre_2, friction, has_normal[pair], dforce)
                if not last:
                    continue
                if status != SEPARATED:
                    for k in range(m):
                        for column in range(3 * m):
                            force_tangent[pair, m + k, column] += analysis[n, k] * dforce[0, column]
                            force_tangent[pair, 2 * m + k, column] += analysis[n, k] * dforce[1, column]
                step_1 = first - old_first
                step_2 = second - old_second
                slip = np.hypot(step_1, step_2)
                if slip == 0.0:
                    continue
                before = n - 1 if n > 0 else n_samples - 1
                normal_before = max(predicted_t[pair, 0, before], 0.0)
                mean = 0.5 * (normal_before + normal)
                for column in range(3 * m):
                    wear_tangent[pair, column] += mean * (
                        step_1 / slip * (dstate[0, column] - before_dstate[0, column])
                        + step_2 / slip * (dstate[1, column] - before_dstate[1, column])
                    )
                if has_normal[pair]:
                    for k in range(m):
                        if normal_before > 0.0:
                            wear_tangent[pair, k] += 0.5 * slip * basis_t[before, k]
                        if normal > 0.0:
                            wear_tangent[pair, k] += 0.5 * slip * basis_t[n, k]
    return force_tangent, wear_tangent

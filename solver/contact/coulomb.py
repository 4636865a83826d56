"""Contact through one period: force, its tangent and the wear integral. Floats and arrays only.

The law is applied to a *predicted* force `p` (what the joint would take up if the pair did not move) and to a
force-like tangential state `x = eps X_T` (X_T: corrected slip, m), Eqs. (11)-(15). With compression positive (PHYSICS,
section 2: the print has the sign of the normal test the other way round):

- separated, `p_N <= 0`: no force, and the state follows freely, `x = p_T`;
- stick, `|p_T - x'| < mu p_N` with x' the state one sample earlier: `lambda_T = p_T - x'`, `x = x'`;
- slip otherwise: `lambda_T = mu p_N n` along `n = (p_T - x') / |p_T - x'|`, `x = p_T - lambda_T`.

The state at the start of a period is history. The period is marched again from where it ended until it repeats, and at
least twice where anything slips or opens. Slip whose direction varies closes slowly, by a factor a period: after a few
periods the start is taken from Newton's method on the closure, which the march then has to confirm.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from solver.model import BoolArray, FloatArray, IntArray

SEPARATED = 0
STICK = 1
SLIP = 2

PLAIN_PASSES = 4  # before the closure is sought by Newton's method; most pairs close within two
NEUTRAL = 1e-9  # of the determinant of the closure: what does not fade from period to period has to be marched


@njit(cache=True)
def contact_sample(
    normal: float, tangent_1: float, tangent_2: float, friction: float, state_1: float, state_2: float
) -> tuple[float, float, float, float, float, int]:
    """One sample of one pair: normal force, two tangential ones, two states, status. In N; Eqs. (3), (4), (11)-(15)."""
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
    analysis_t = np.ascontiguousarray(analysis.T)
    rows = np.empty((n_samples, m))
    for pair in range(n_contact):
        if not has_normal[pair]:
            continue
        for n in range(n_samples):
            force = predicted_t[pair, 0, n]
            rows[n] = 0.0
            if force <= 0.0:
                continue
            ahead = (n + 1) % n_samples
            _, own_before, other_before = closed_share(force, predicted_t[pair, 0, n - 1])
            _, own_after, other_after = closed_share(force, predicted_t[pair, 0, ahead])
            for j in range(m):
                rows[n, j] = 0.5 * (
                    (own_before + own_after) * basis_t[n, j]
                    + other_before * basis_t[n - 1, j]
                    + other_after * basis_t[ahead, j]
                )
        tangent[pair] = np.dot(analysis_t, rows)
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
    influence = np.zeros((2, 2))
    for pair in range(n_contact):
        first = start[pair, 0]
        second = start[pair, 1]
        before = np.inf
        for sweep in range(most_passes):
            state_t[pair, 0, 0] = first
            state_t[pair, 1, 0] = second
            moved = False
            tracked = sweep >= PLAIN_PASSES
            influence[:, :] = 0.0
            influence[0, 0] = influence[1, 1] = 1.0
            for n in range(n_samples):
                pre_1 = predicted_t[pair, 1, n] - first
                pre_2 = predicted_t[pair, 2, n] - second
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
                if tracked and status != STICK:
                    turn_influence(influence, status, friction * normal, pre_1, pre_2)
            passes[pair] = sweep + 1
            change_1, change_2 = first - state_t[pair, 0, 0], second - state_t[pair, 1, 0]
            drift[pair] = np.hypot(change_1, change_2)
            if not moved or (sweep > 0 and drift[pair] <= closure):
                break
            # a plain pass never takes the state further away; one from a start that Newton's method gave may
            if tracked and drift[pair] < 0.5 * before:
                before = drift[pair]
                missing_1, missing_2, found = close(influence, change_1, change_2)
                if found:
                    first = state_t[pair, 0, 0] + missing_1
                    second = state_t[pair, 1, 0] + missing_2
            else:
                before = np.inf
    return force_t, state_t, status_t, passes, drift


@njit(cache=True)
def turn_influence(influence: FloatArray, status: int, limit: float, pre_1: float, pre_2: float) -> None:
    """Derivative (2, 2) of the state with respect to that at the start of the period, taken past a sample, in place."""
    size = np.sqrt(pre_1 * pre_1 + pre_2 * pre_2)
    if status == SEPARATED or limit == 0.0:
        influence[:, :] = 0.0
        return
    unit_1 = pre_1 / size
    unit_2 = pre_2 / size
    # what lies across the slip turns with it; what lies along it is forgotten
    for column in range(2):
        across = limit / size * (unit_1 * influence[1, column] - unit_2 * influence[0, column])
        influence[0, column] = -unit_2 * across
        influence[1, column] = unit_1 * across


@njit(cache=True)
def close(influence: FloatArray, change_1: float, change_2: float) -> tuple[float, float, bool]:
    """Solution of `(I - influence) x = change`, and whether there is one that means anything."""
    a, b = 1.0 - influence[0, 0], -influence[0, 1]
    c, d = -influence[1, 0], 1.0 - influence[1, 1]
    determinant = a * d - b * c
    if determinant <= NEUTRAL:
        return 0.0, 0.0, False
    return (d * change_1 - b * change_2) / determinant, (a * change_2 - c * change_1) / determinant, True


@njit(cache=True)
def wear_integral(force_t: FloatArray, state_t: FloatArray) -> FloatArray:
    """Integral over a period of normal force times corrected slip, as force times state: N * N, (n_contact,).

    Eqs. (7), (21) with the sliding velocity, integrated as force times increments of corrected slip: divided by the
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

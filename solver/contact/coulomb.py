"""Coulomb friction with separation at one sample: contact force, derivative, mean normal force. Floats and arrays only.

Arguments of the law, Eqs. (11)-(15), are the *predicted* force `p` and the tangential state `x = eps X_T`, N (X_T:
corrected slip, m). Compression is positive (PHYSICS, section 2: the print has the opposite sign in the normal test).
With x' the state at the sample before:

- separated, `p_N <= 0`: no force, and the state follows freely, `x = p_T`;
- stick, `|p_T - x'| < mu p_N`: `lambda_T = p_T - x'`, `x = x'`;
- slip otherwise: `lambda_T = mu p_N n` along `n = (p_T - x') / |p_T - x'|`, `x = p_T - lambda_T`.

So the friction force is the projection of a trial force on a disc of radius `mu p_N`, also for masses on sliders. Its
derivative during slip is

    d lambda_T = mu n d p_N + (mu p_N / |p_T - x'|) (1 - n n^T) (d p_T - d x').

Friction follows the normal force at the sample; the harmonics of the normal force, Eqs. (11), (12), are those of its
means around each sample (`closed_fraction`).
"""

from typing import TypeVar

import numpy as np
from numba import njit
from numba.extending import register_jitable

from solver.model import FloatArray, IntArray

# the last one: of a law without these states
SEPARATED, STICK, SLIP, OTHER = range(4)

Force = TypeVar("Force", float, FloatArray)


@register_jitable
def friction_limit(friction: Force, normal: Force) -> Force:
    """Largest friction force, N, under a normal force, N: `mu lambda_N`, Eq. (15). Numbers or arrays."""
    return friction * normal


@register_jitable
def friction_force(trial_1: float, trial_2: float, limit: float) -> tuple[float, float, bool]:
    """Projection of a trial force on the friction disc, N, and whether the pair sticks, Eqs. (13)-(15)."""
    size = np.sqrt(trial_1 * trial_1 + trial_2 * trial_2)
    if size < limit:
        return trial_1, trial_2, True
    if limit == 0.0:
        return 0.0, 0.0, False
    return limit * trial_1 / size, limit * trial_2 / size, False


@register_jitable
def slip_tangent(trial_1: float, trial_2: float, limit: float) -> tuple[float, float, float, float, float, float]:
    """Derivative of `friction_force` of a slipping pair, Eq. (15); all zero where the trial force is zero.

    Returns n (2), the derivative by the limit; `ratio` = limit over |trial|; and entries 11, 12, 22 of
    `ratio (1 - n n^T)`, the derivative by the trial force.
    """
    size = np.sqrt(trial_1 * trial_1 + trial_2 * trial_2)
    if size == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    n_1, n_2, ratio = trial_1 / size, trial_2 / size, limit / size
    return n_1, n_2, ratio, ratio * (1.0 - n_1 * n_1), -ratio * n_1 * n_2, ratio * (1.0 - n_2 * n_2)


@register_jitable
def contact_sample(
    normal: float, tangent_1: float, tangent_2: float, friction: float, state_1: float, state_2: float
) -> tuple[float, float, float, float, float, int]:
    """Normal force, 2 friction forces, 2 states, N, and status at one sample, Eqs. (3), (4), (11)-(15)."""
    if normal <= 0.0:
        return 0.0, 0.0, 0.0, tangent_1, tangent_2, SEPARATED
    limit = friction_limit(friction, normal)
    force_1, force_2, sticks = friction_force(tangent_1 - state_1, tangent_2 - state_2, limit)
    if sticks:
        return normal, force_1, force_2, state_1, state_2, STICK
    return normal, force_1, force_2, tangent_1 - force_1, tangent_2 - force_2, SLIP


@register_jitable
def contact_tangent(
    status: int, normal: float, trial_1: float, trial_2: float, friction: float
) -> tuple[float, float, float, float, float]:
    """Derivative of the tangential force of `contact_sample`; the new state is `p_T - lambda_T`.

    Returns that by the normal force (2), and entries 11, 12, 22 of that by the trial force `p_T - x'`.
    """
    if status == STICK:
        return 0.0, 0.0, 1.0, 0.0, 1.0
    limit = friction_limit(friction, normal)
    if status == SEPARATED or limit == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    n_1, n_2, _, across_11, across_12, across_22 = slip_tangent(trial_1, trial_2, limit)
    # the limit grows with the normal force by the friction coefficient
    return friction * n_1, friction * n_2, across_11, across_12, across_22


@register_jitable
def advance_monodromy(
    monodromy: FloatArray, status: int, normal: float, trial_1: float, trial_2: float, friction: float
) -> None:
    """Multiply the monodromy (2, 2) by the derivative of one sample that slips or is separated, in place.

    Slip leaves only changes of the state across the slip direction, separation leaves none.
    """
    limit = friction_limit(friction, normal)
    if status == SEPARATED or limit == 0.0:
        monodromy[:, :] = 0.0
        return
    n_1, n_2, ratio, _, _, _ = slip_tangent(trial_1, trial_2, limit)
    for column in range(2):
        # 1 - n n^T is computed as t t^T with t across n: round-off then leaves nothing along n
        across = ratio * (n_1 * monodromy[1, column] - n_2 * monodromy[0, column])
        monodromy[0, column] = -n_2 * across
        monodromy[1, column] = n_1 * across


@register_jitable
def closed_fraction(force: float, neighbour: float) -> tuple[float, float, float]:
    """Mean normal force over the half step towards a neighbour, and its derivatives by both predicted normal forces.

    The predicted normal force is linear between two samples. Without this each change of a status is a corner of the
    residual, and a branch with hard impacts breaks up into small folds. `force` is positive.
    """
    if neighbour >= 0.0:
        return force, 1.0, 0.0
    fraction = force / (force - neighbour)
    # fractions instead of squares: squares of the tiny predicted forces of pairs without preload may underflow
    return fraction * force, fraction * (2.0 - fraction), fraction * fraction


@njit(cache=True)
def mean_normal_force(predicted_t: FloatArray) -> FloatArray:
    """Mean normal force (n_contact, N), N, around each sample."""
    n_contact, _, n_samples = predicted_t.shape
    mean = np.zeros((n_contact, n_samples))
    for pair in range(n_contact):
        for n in range(n_samples):
            force = predicted_t[pair, 0, n]
            if force > 0.0:
                before, _, _ = closed_fraction(force, predicted_t[pair, 0, n - 1])
                after, _, _ = closed_fraction(force, predicted_t[pair, 0, (n + 1) % n_samples])
                mean[pair, n] = 0.5 * (before + after)
    return mean


@njit(cache=True)
def mean_normal_tangent(
    pairs: IntArray, predicted_t: FloatArray, basis_t: FloatArray, analysis_h: FloatArray, out: FloatArray
) -> None:
    """Derivative of the harmonics of `mean_normal_force` of some pairs (n,) by those of the predicted normal force,
    into the first m rows and columns of out (n_contact, 3m, 3m). basis_t (N, m), analysis_h (m, N): contiguous.
    """
    n_samples, m = basis_t.shape
    rows, part = np.empty((n_samples, m)), np.empty((m, m))
    for pair in pairs:
        for n in range(n_samples):
            force, ahead = predicted_t[pair, 0, n], (n + 1) % n_samples
            own_before = other_before = own_after = other_after = 0.0
            if force > 0.0:
                _, own_before, other_before = closed_fraction(force, predicted_t[pair, 0, n - 1])
                _, own_after, other_after = closed_fraction(force, predicted_t[pair, 0, ahead])
            for j in range(m):
                rows[n, j] = 0.5 * (
                    (own_before + own_after) * basis_t[n, j]
                    + other_before * basis_t[n - 1, j]
                    + other_after * basis_t[ahead, j]
                )
        np.dot(analysis_h, rows, part)
        for i in range(m):
            for j in range(m):
                out[pair, i, j] = part[i, j]

"""Coulomb friction with separation in one sample of one pair: the return map and its derivative. Floats only.

The law is applied to a *predicted* force `p` (what the joint would take up if the pair did not move) and to a
force-like tangential state `x = eps X_T` (X_T: corrected slip, m), Eqs. (11)-(15). With compression positive (PHYSICS,
section 2: the print has the sign of the normal test the other way round) and the trial force `p_T - x'`, x' the state
one sample earlier:

- separated, `p_N <= 0`: no force, and the state follows freely, `x = p_T`;
- stick, `|p_T - x'| < mu p_N`: `lambda_T = p_T - x'`, `x = x'`;
- slip otherwise: `lambda_T = mu p_N n` along `n = (p_T - x') / |p_T - x'|`, `x = p_T - lambda_T`.

So the friction force is the projection of a trial force on a disc of radius `mu p_N`, of elastic pairs and of masses on
sliders alike; its derivative where it slips is

    d lambda_T = mu n d p_N + (mu p_N / |p_T - x'|) (1 - n n^T) (d p_T - d x').
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numba import njit
from numba.extending import register_jitable

from solver.model import FloatArray

SEPARATED = 0
STICK = 1
SLIP = 2


Force = TypeVar("Force", float, FloatArray)


@register_jitable
def friction_limit(friction: Force, normal: Force) -> Force:
    """Largest friction force, N, under a normal force, N: `mu lambda_N`, Eq. (15). Numbers or arrays."""
    return friction * normal


@njit(cache=True)
def friction_force(trial_1: float, trial_2: float, limit: float) -> tuple[float, float, bool]:
    """Projection of a trial force on the friction disc, N, and whether the pair sticks, Eqs. (13)-(15)."""
    size = np.sqrt(trial_1 * trial_1 + trial_2 * trial_2)
    if size < limit:
        return trial_1, trial_2, True
    if limit == 0.0:
        return 0.0, 0.0, False
    return limit * trial_1 / size, limit * trial_2 / size, False


@njit(cache=True)
def slip_direction(trial_1: float, trial_2: float, limit: float) -> tuple[float, float, float]:
    """Derivative of `friction_force` where the pair slips, Eq. (15): the direction n (2), and the limit over |trial|.

    The derivative with respect to the limit is n, that with respect to the trial force `limit / |trial| (1 - n n^T)`.
    Zero where there is no trial force.
    """
    size = np.sqrt(trial_1 * trial_1 + trial_2 * trial_2)
    if size == 0.0:
        return 0.0, 0.0, 0.0
    return trial_1 / size, trial_2 / size, limit / size


@njit(cache=True)
def across_slip(unit_1: float, unit_2: float, ratio: float) -> tuple[float, float, float]:
    """Entries 11, 12, 22 of the symmetric `ratio (1 - n n^T)`, arguments as `slip_direction` returns them."""
    return ratio * (1.0 - unit_1 * unit_1), -ratio * unit_1 * unit_2, ratio * (1.0 - unit_2 * unit_2)


@njit(cache=True)
def contact_sample(
    normal: float, tangent_1: float, tangent_2: float, friction: float, state_1: float, state_2: float
) -> tuple[float, float, float, float, float, int]:
    """One sample of one pair: normal force, two tangential ones, two states, status. In N; Eqs. (3), (4), (11)-(15)."""
    if normal <= 0.0:
        return 0.0, 0.0, 0.0, tangent_1, tangent_2, SEPARATED
    force_1, force_2, sticks = friction_force(
        tangent_1 - state_1, tangent_2 - state_2, friction_limit(friction, normal)
    )
    if sticks:
        return normal, force_1, force_2, state_1, state_2, STICK
    return normal, force_1, force_2, tangent_1 - force_1, tangent_2 - force_2, SLIP


@njit(cache=True)
def contact_tangent(
    status: int, normal: float, trial_1: float, trial_2: float, friction: float
) -> tuple[float, float, float, float, float]:
    """Derivative of `contact_sample`: of the tangential force with respect to what the sample is given.

    Returns the derivative with respect to the normal force (2), and the entries 11, 12, 22 of the symmetric one with
    respect to the trial force `p_T - x'`. The new state is `p_T - lambda_T`.
    """
    if status == STICK:
        return 0.0, 0.0, 1.0, 0.0, 1.0
    limit = friction_limit(friction, normal)
    if status == SEPARATED or limit == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    unit_1, unit_2, ratio = slip_direction(trial_1, trial_2, limit)
    across_11, across_12, across_22 = across_slip(unit_1, unit_2, ratio)
    # the limit grows with the normal force by the friction coefficient
    return friction * unit_1, friction * unit_2, across_11, across_12, across_22


@njit(cache=True)
def advance_monodromy(
    monodromy: FloatArray, status: int, normal: float, trial_1: float, trial_2: float, friction: float
) -> None:
    """Derivative (2, 2) of the state with respect to that at the start of the period, taken past a sample, in place.

    Arguments as in `contact_tangent`, of a sample that does not stick. What lies across the slip turns with it; what
    lies along it is forgotten.
    """
    limit = friction_limit(friction, normal)
    if status == SEPARATED or limit == 0.0:
        monodromy[:, :] = 0.0
        return
    unit_1, unit_2, ratio = slip_direction(trial_1, trial_2, limit)
    for column in range(2):
        # 1 - n n^T is t t^T with t across n: so nothing along n is left by round-off
        across = ratio * (unit_1 * monodromy[1, column] - unit_2 * monodromy[0, column])
        monodromy[0, column] = -unit_2 * across
        monodromy[1, column] = unit_1 * across


@njit(cache=True)
def advance_tangent(
    dstate: FloatArray,
    basis: FloatArray,
    status: int,
    normal: float,
    trial_1: float,
    trial_2: float,
    friction: float,
    has_normal: bool,
    dforce: FloatArray,
) -> None:
    """Derivatives of one sample, in place: `dforce` (2, 3m+2) of the tangential force, `dstate` (2, 3m+2) of the state.

    Eqs. (13)-(15), with all that came before in the period. Columns are the harmonics of the predicted force of the
    pair: normal (m), tangent 1 (m), tangent 2 (m), and the state at the start of the period. `basis` (m,) holds the
    derivative of a time sample with respect to its harmonics. `dstate` comes in as that of the sample before.
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
    pull_1, pull_2, across_11, across_12, across_22 = contact_tangent(status, normal, trial_1, trial_2, friction)
    if status == SLIP and friction_limit(friction, normal) > 0.0:
        for column in range(3 * m + 2):
            dforce[0, column] = -across_11 * dstate[0, column] - across_12 * dstate[1, column]
            dforce[1, column] = -across_12 * dstate[0, column] - across_22 * dstate[1, column]
        for k in range(m):
            if has_normal:
                dforce[0, k] += pull_1 * basis[k]
                dforce[1, k] += pull_2 * basis[k]
            dforce[0, m + k] += across_11 * basis[k]
            dforce[0, 2 * m + k] += across_12 * basis[k]
            dforce[1, m + k] += across_12 * basis[k]
            dforce[1, 2 * m + k] += across_22 * basis[k]
    else:
        for column in range(3 * m + 2):
            dforce[0, column] = 0.0
            dforce[1, column] = 0.0
    for column in range(3 * m + 2):
        dstate[0, column] = -dforce[0, column]
        dstate[1, column] = -dforce[1, column]
    for k in range(m):
        dstate[0, m + k] += basis[k]
        dstate[1, 2 * m + k] += basis[k]

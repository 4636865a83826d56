"""March of elastic pairs through the period: force, state and slip work of a periodic state. Floats and arrays only.

`coulomb` has the law of a sample. The first period starts from the tangential history. Each next period starts from the
end of the period before, until the state repeats; a pair that slips or opens is marched at least twice. Where the
direction of slip varies, the change of the state falls slowly, by a constant factor in each period. So after a few
periods Newton's method on the periodicity gives the start, with the monodromy of the march. The next period has to
confirm this start.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numba.extending import register_jitable

from solver.contact.coulomb import STICK, advance_monodromy, contact_sample
from solver.model import FloatArray, IntArray
from solver.settings import ROUND_OFF

MOST_PERIODS = 400
"""Largest number of periods; then a state that is not periodic is accepted. Pairs with a turning slip direction need up
to about 20 with Newton's method and above 40 without (`tests/solver/test_kernels.py`)."""

PLAIN_PERIODS = 4  # periods before Newton's method is used on the periodicity; most pairs repeat within two
SMALLEST_DETERMINANT = ROUND_OFF  # of 1 - monodromy: below it a part of the state does not fade


@register_jitable
def slip_work_rate(normal: float, speed: float) -> float:
    """Slip work per time, W, from normal force, N, and sliding speed, m/s; or slip work, J, with slip, m, for speed."""
    return normal * speed


@register_jitable
def slip_work_slopes(normal: float, speed: float) -> tuple[float, float]:
    """Derivatives of `slip_work_rate` by the normal force and by the speed."""
    return speed, normal


@njit(cache=True)
def march_period(
    predicted_t: FloatArray,
    friction: FloatArray,
    start: FloatArray,
    periodicity: float,
    most_periods: int,
) -> tuple[FloatArray, FloatArray, IntArray, IntArray, FloatArray]:
    """March every pair through the period until its tangential state repeats, Eqs. (11)-(15).

    - predicted_t (n_contact, 3, N): predicted force, N, normal first.
    - start (n_contact, 2): tangential state at the start of the first period, N.
    - periodicity: accepted difference of the state over a period, N.

    Returns `force_t`, `state_t` of the last period, `status_t` and `periods` of `law.Marched`, and the change of the
    state over the last period (n_contact,), N.
    """
    n_contact, _, n_samples = predicted_t.shape
    force_t = np.zeros((n_contact, 3, n_samples))
    state_t = np.zeros((n_contact, 2, n_samples + 1))
    status_t = np.zeros((n_contact, n_samples), np.int64)
    periods = np.zeros(n_contact, np.int64)
    periodicity_error = np.zeros(n_contact)
    monodromy = np.zeros((2, 2))
    for pair in range(n_contact):
        first = start[pair, 0]
        second = start[pair, 1]
        before = np.inf
        for period in range(most_periods):
            state_t[pair, 0, 0] = first
            state_t[pair, 1, 0] = second
            moved = False
            tracked = period >= PLAIN_PERIODS
            monodromy[:, :] = 0.0
            monodromy[0, 0] = monodromy[1, 1] = 1.0
            for n in range(n_samples):
                trial_1 = predicted_t[pair, 1, n] - first
                trial_2 = predicted_t[pair, 2, n] - second
                normal, force_1, force_2, first, second, status = contact_sample(
                    predicted_t[pair, 0, n],
                    predicted_t[pair, 1, n],
                    predicted_t[pair, 2, n],
                    friction[pair],
                    first,
                    second,
                )
                force_t[pair, 0, n] = normal
                force_t[pair, 1, n] = force_1
                force_t[pair, 2, n] = force_2
                state_t[pair, 0, n + 1] = first
                state_t[pair, 1, n + 1] = second
                status_t[pair, n] = status
                moved = moved or status != STICK
                if tracked and status != STICK:
                    advance_monodromy(monodromy, status, normal, trial_1, trial_2, friction[pair])
            periods[pair] = period + 1
            change_1, change_2 = first - state_t[pair, 0, 0], second - state_t[pair, 1, 0]
            periodicity_error[pair] = np.hypot(change_1, change_2)
            if not moved or (period > 0 and periodicity_error[pair] <= periodicity):
                break
            # a plain period never increases the change; a period from a start of Newton's method may
            if tracked and periodicity_error[pair] < 0.5 * before:
                before = periodicity_error[pair]
                missing_1, missing_2, found = solve_periodicity(monodromy, change_1, change_2)
                if found:
                    first = state_t[pair, 0, 0] + missing_1
                    second = state_t[pair, 1, 0] + missing_2
            else:
                before = np.inf
    return force_t, state_t, status_t, periods, periodicity_error


@njit(cache=True)
def solve_periodicity(monodromy: FloatArray, change_1: float, change_2: float) -> tuple[float, float, bool]:
    """Solution of `(I - monodromy) x = change`, and whether the determinant is large enough for one."""
    a, b = 1.0 - monodromy[0, 0], -monodromy[0, 1]
    c, d = -monodromy[1, 0], 1.0 - monodromy[1, 1]
    determinant = a * d - b * c
    if determinant <= SMALLEST_DETERMINANT:
        return 0.0, 0.0, False
    return (d * change_1 - b * change_2) / determinant, (a * change_2 - c * change_1) / determinant, True


@njit(cache=True)
def integrate_slip_work(force_t: FloatArray, state_t: FloatArray) -> FloatArray:
    """Slip work of a period times the tangential penalty (n_contact,), N * N.

    Eqs. (7), (21) with the sliding velocity (the print has the displacement): sum of normal force times increment of
    the tangential state.
    """
    n_contact, _, n_samples = force_t.shape
    integral = np.zeros(n_contact)
    for pair in range(n_contact):
        for n in range(n_samples):
            before = n - 1 if n > 0 else n_samples - 1
            slip = np.hypot(
                state_t[pair, 0, n + 1] - state_t[pair, 0, n], state_t[pair, 1, n + 1] - state_t[pair, 1, n]
            )
            integral[pair] += increment_work(force_t[pair, 0, before], force_t[pair, 0, n], slip)
    return integral


@njit(cache=True)
def increment_work(normal_before: float, normal: float, slip: float) -> float:
    """Slip work of an increment of slip by the trapezoidal rule, with the mean of the normal forces at both ends."""
    return slip_work_rate(0.5 * (normal_before + normal), slip)


@njit(cache=True)
def increment_slopes(normal_before: float, normal: float, slip: float) -> tuple[float, float]:
    """Derivatives of `increment_work` by the normal force at each end, and by the slip."""
    by_normal, by_slip = slip_work_slopes(0.5 * (normal_before + normal), slip)
    return 0.5 * by_normal, by_slip

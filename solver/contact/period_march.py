"""March of elastic pairs through the period: force, state and slip work of a periodic state. Floats and arrays only.

`coulomb` has the law of a sample. The first period starts from the tangential history. Each next period starts from the
end of the period before, until the state repeats; a pair that slips or opens is marched at least twice. Where the
direction of slip varies, the change of the state falls slowly, by a constant factor in each period. So after a few
periods Newton's method on the periodicity gives the start, with the monodromy of the march. The next period has to
confirm this start.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numba.extending import register_jitable

from solver.contact.coulomb import STICK, advance_monodromy, contact_sample
from solver.model import BoolArray, FloatArray, IntArray
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


class Period(NamedTuple):
    """A period of pairs; the marches fill all but the predicted force, friction coefficients and start.

    - friction (n_contact,): friction coefficients.
    - change (n_contact,): change over the last period of the tangential state; of masses of the velocity, as a force
      m v / dt, N.
    - all others: as in `law.Marched`; `slip_work` of elastic pairs times the tangential penalty, N * N.
    """

    predicted_t: FloatArray
    friction: FloatArray
    start: FloatArray
    force_t: FloatArray
    state_t: FloatArray
    status_t: IntArray
    periods: IntArray
    change: FloatArray
    slip_work: FloatArray


class Directions(NamedTuple):
    """Displacements of the pairs: `line` and `has_normal` (n_contact,) as in `model.ContactInterface`."""

    line: IntArray
    has_normal: BoolArray


def new_period(predicted_t: FloatArray, friction: FloatArray, start: FloatArray) -> Period:
    """Period of the predicted force (n_contact, 3, N), N, to be marched."""
    n_contact, _, n_samples = predicted_t.shape
    return Period(
        predicted_t,
        friction,
        start,
        force_t=np.zeros(predicted_t.shape),
        state_t=np.zeros((n_contact, 2, n_samples + 1)),
        status_t=np.zeros((n_contact, n_samples), np.int64),
        periods=np.ones(n_contact, np.int64),
        change=np.zeros(n_contact),
        slip_work=np.zeros(n_contact),
    )


@njit(cache=True)
def march_period(pairs: IntArray, period: Period, periodicity: float, most_periods: int) -> None:
    """March elastic pairs (n,) through the period until their tangential state repeats, Eqs. (11)-(15).

    periodicity: accepted difference of the state over a period, N.
    """
    monodromy = np.zeros((2, 2))
    for pair in pairs:
        first, second = period.start[pair, 0], period.start[pair, 1]
        before = np.inf
        predicted_t, force_t, state_t = period.predicted_t[pair], period.force_t[pair], period.state_t[pair]
        friction = period.friction[pair]
        for number in range(most_periods):
            state_t[0, 0], state_t[1, 0] = first, second
            moved, tracked = False, number >= PLAIN_PERIODS
            monodromy[:, :] = 0.0
            monodromy[0, 0] = monodromy[1, 1] = 1.0
            for n in range(period.status_t.shape[1]):
                pressed, pull_1, pull_2 = predicted_t[0, n], predicted_t[1, n], predicted_t[2, n]
                trial_1, trial_2 = pull_1 - first, pull_2 - second
                normal, force_1, force_2, first, second, status = contact_sample(
                    pressed, pull_1, pull_2, friction, first, second
                )
                force_t[0, n], force_t[1, n], force_t[2, n] = normal, force_1, force_2
                state_t[0, n + 1], state_t[1, n + 1] = first, second
                period.status_t[pair, n] = status
                moved = moved or status != STICK
                if tracked and status != STICK:
                    advance_monodromy(monodromy, status, normal, trial_1, trial_2, friction)
            period.periods[pair] = number + 1
            change_1, change_2 = first - state_t[0, 0], second - state_t[1, 0]
            change = np.hypot(change_1, change_2)
            period.change[pair] = change
            if not moved or (number > 0 and change <= periodicity):
                break
            # a plain period never increases the change; a period from a start of Newton's method may
            if tracked and change < 0.5 * before:
                before = change
                missing_1, missing_2, found = solve_periodicity(monodromy, change_1, change_2)
                if found:
                    first, second = state_t[0, 0] + missing_1, state_t[1, 0] + missing_2
            else:
                before = np.inf
        period.slip_work[pair] = _slip_work(force_t[0], state_t)


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
def _slip_work(normal_t: FloatArray, state_t: FloatArray) -> float:
    """Slip work of a period times the tangential penalty, N * N.

    Eqs. (7), (21) with the sliding velocity (the print has the displacement): sum of normal force times increment of
    the tangential state.
    """
    work = 0.0
    for n in range(normal_t.size):
        before = n - 1 if n > 0 else normal_t.size - 1
        slip = np.hypot(state_t[0, n + 1] - state_t[0, n], state_t[1, n + 1] - state_t[1, n])
        work += increment_work(normal_t[before], normal_t[n], slip)
    return work


@njit(cache=True)
def increment_work(normal_before: float, normal: float, slip: float) -> float:
    """Slip work of an increment of slip by the trapezoidal rule, with the mean of the normal forces at both ends."""
    return slip_work_rate(0.5 * (normal_before + normal), slip)


@njit(cache=True)
def increment_slopes(normal_before: float, normal: float, slip: float) -> tuple[float, float]:
    """Derivatives of `increment_work` by the normal force at each end, and by the slip."""
    by_normal, by_slip = slip_work_slopes(0.5 * (normal_before + normal), slip)
    return 0.5 * by_normal, by_slip

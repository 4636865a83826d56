"""Elastic pairs through a period: force, state and slip work of the periodic state, and their exact derivatives.

Floats and arrays only; `coulomb` has the law of a sample. The first period starts from the tangential history, the next
ones from the end of the period before, until the state repeats. Where the direction of slip varies, its change falls
slowly. So after a few periods Newton's method on the periodicity gives the start, which the next period confirms.

Derivatives have 3m columns for the harmonics of the predicted force, those of one component after the other, 2 for the
state at the start of the period, and one for the friction coefficient.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numba.extending import register_jitable

from solver.contact.coulomb import STICK, advance_monodromy, contact_sample, contact_tangent
from solver.contact.element import Tangents
from solver.model import FloatArray, IntArray
from solver.settings import ROUND_OFF

MOST_PERIODS = 400
"""Most periods; then a state that is not periodic is accepted. Pairs with a turning slip direction need up to 20 with
Newton's method and above 40 without (`tests/solver/test_kernels.py`)."""

PLAIN_PERIODS = 4
"""Periods before Newton's method is used on the periodicity; most pairs repeat within two. Half and twice as many:
blocks, waves and impacts are equal."""
SMALLEST_DETERMINANT = ROUND_OFF  # of 1 - monodromy: below it a part of the state does not fade


class Period(NamedTuple):
    """A period of pairs, as in `Marched`; the marches fill all but predicted_t, friction and start.

    friction (n_contact,): coefficients. change (n_contact,): of the tangential state over the last period, of masses of
    the velocity, as a force m v / dt, N. slip_work: of elastic pairs times the tangential penalty, N * N.
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
                missing_1, missing_2, found = solve_periodicity(monodromy, 0, change_1, change_2)
                if found:
                    first, second = state_t[0, 0] + missing_1, state_t[1, 0] + missing_2
            else:
                before = np.inf
        period.slip_work[pair] = _slip_work(force_t[0], state_t)


@register_jitable
def solve_periodicity(of: FloatArray, first: int, change_1: float, change_2: float) -> tuple[float, float, bool]:
    """Solution of `(I - monodromy) x = change`, and whether the determinant is large enough for one; the monodromy is
    in two columns of an array, from the `first` on.
    """
    a, b = 1.0 - of[0, first], -of[0, first + 1]
    c, d = -of[1, first], 1.0 - of[1, first + 1]
    determinant = a * d - b * c
    if determinant <= SMALLEST_DETERMINANT:
        return 0.0, 0.0, False
    return (d * change_1 - b * change_2) / determinant, (a * change_2 - c * change_1) / determinant, True


@register_jitable
def _slip_work(normal_t: FloatArray, state_t: FloatArray) -> float:
    """Slip work of a period times the tangential penalty, N * N, by the trapezoidal rule, Eqs. (7), (21) with the
    sliding velocity (the print has the displacement).
    """
    work = 0.0
    for n in range(normal_t.size):
        slip = np.hypot(state_t[0, n + 1] - state_t[0, n], state_t[1, n + 1] - state_t[1, n])
        work += 0.5 * (normal_t[n - 1] + normal_t[n]) * slip
    return work


def by_columns(series_t: FloatArray) -> FloatArray:
    """Rows (N, 5m + 3) of a synthesis (N, m) between zeros: from (2 - i) m on, one has the derivative of component i of
    the predicted force by all 3m + 3 columns.
    """
    n_samples, m = series_t.shape
    rows = np.zeros((n_samples, 5 * m + 3))
    rows[:, 2 * m : 3 * m] = series_t
    return rows


@register_jitable
def fill_friction_column(normal_t: FloatArray, friction: float, by_column_t: FloatArray) -> None:
    """Normal force over friction in the column of the friction coefficient, as a normal force that acts on the limit
    alone: `d(mu p_N) = mu (dp_N + p_N / mu dmu)`.
    """
    place = by_column_t.shape[1] - 1
    for n in range(normal_t.size):
        by_column_t[n, place] = max(normal_t[n], 0.0) / friction if friction > 0.0 else 0.0


@njit(cache=True)
def march_tangent(
    pairs: IntArray, period: Period, starts: FloatArray, by_column_t: FloatArray, analysis_h: FloatArray, out: Tangents
) -> None:
    """Derivatives of the results of `march_period` of some pairs (n,), with the periodicity, into `out`.

    starts (n_contact, 2, 3m + 1): of the start. by_column_t: the synthesis as `by_columns` gives it. analysis_h (m, N):
    contiguous transpose of the analysis.
    """
    m, n_samples = analysis_h.shape
    w = 3 * m + 3
    dforce_t = np.empty((n_samples, 2 * w))
    for pair in pairs:
        predicted_t, friction, start = period.predicted_t[pair], period.friction[pair], period.start[pair]
        dstate, dstart, work = np.zeros((2, w)), np.zeros((2, w)), np.zeros(w)
        dstate[0, 3 * m] = dstate[1, 3 * m + 1] = 1.0
        fill_friction_column(predicted_t[0], friction, by_column_t)
        first, second = period.state_t[pair, 0, 0], period.state_t[pair, 1, 0]
        _pass_tangent(dstate, dforce_t, work, predicted_t, friction, first, second, by_column_t)
        plain = min(period.periods[pair] - 1, PLAIN_PERIODS)
        if plain == 0 or not periodic_start(dstate, dstart):
            # a pair that has come to stick: the periodicity does not determine its start, the periods before do
            for i in range(2):
                for j in range(3 * m):
                    dstart[i, j] = starts[pair, i, j]
                dstart[i, w - 1] = starts[pair, i, 3 * m]
            first, second = start[0], start[1]
            unused_t, unused = np.empty((n_samples, 2 * w)), np.zeros(w)
            for _ in range(plain):
                end = _pass_tangent(dstart, unused_t, unused, predicted_t, friction, first, second, by_column_t)
                first, second = end
        assemble(out, pair, dforce_t, work, dstart, analysis_h)


@register_jitable
def _pass_tangent(
    dstate: FloatArray,
    dforce_t: FloatArray,
    work: FloatArray,
    predicted_t: FloatArray,
    friction: float,
    first: float,
    second: float,
    by_column_t: FloatArray,
) -> tuple[float, float]:
    """A period from the state `first`, `second`, Eqs. (13)-(15); returns the state at its end.

    dstate (2, w): derivative of the state, from start to end, in place. dforce_t (N, 2w): receives those of both forces
    of friction; that of the slip work is added to work (w,).
    """
    n_samples, w, m = predicted_t.shape[1], work.size, (work.size - 3) // 3
    for n in range(n_samples):
        pressed, pull_1, pull_2 = predicted_t[0, n], predicted_t[1, n], predicted_t[2, n]
        normal, _, _, next_1, next_2, status = contact_sample(pressed, pull_1, pull_2, friction, first, second)
        by_normal_1, by_normal_2, across_11, across_12, across_22 = contact_tangent(
            status, normal, pull_1 - first, pull_2 - second, friction
        )
        dforce, by_0, by_1, by_2 = dforce_t[n], by_column_t[n, 2 * m :], by_column_t[n, m:], by_column_t[n]
        for j in range(w):
            from_1 = -across_11 * dstate[0, j] - across_12 * dstate[1, j]
            from_2 = -across_12 * dstate[0, j] - across_22 * dstate[1, j]
            dforce[j] = from_1 + by_normal_1 * by_0[j] + across_11 * by_1[j] + across_12 * by_2[j]
            dforce[w + j] = from_2 + by_normal_2 * by_0[j] + across_12 * by_1[j] + across_22 * by_2[j]
        if status != STICK:
            step_1, step_2 = next_1 - first, next_2 - second
            slip = np.hypot(step_1, step_2)
            mean, along_1, along_2 = 0.5 * (max(predicted_t[0, n - 1], 0.0) + max(pressed, 0.0)), 0.0, 0.0
            if slip > 0.0:
                along_1, along_2 = step_1 / slip, step_2 / slip
            for j in range(w):
                next_by_1, next_by_2 = by_1[j] - dforce[j], by_2[j] - dforce[w + j]
                work[j] += mean * (along_1 * (next_by_1 - dstate[0, j]) + along_2 * (next_by_2 - dstate[1, j]))
                dstate[0, j], dstate[1, j] = next_by_1, next_by_2
            for end in (n - 1, n):
                if predicted_t[0, end] > 0.0:
                    for k in range(m):
                        work[k] += 0.5 * slip * by_column_t[end, 2 * m + k]
        first, second = next_1, next_2
    return first, second


@register_jitable
def periodic_start(dend: FloatArray, dstart: FloatArray) -> bool:
    """Derivative (2, w) of the start of a period that repeats into `dstart`, from that of its end (2, w); whether there
    is one.
    """
    w, found = dend.shape[1], False
    for column in range(w):
        if column < w - 3 or column == w - 1:
            change_1, change_2 = dend[0, column], dend[1, column]
            dstart[0, column], dstart[1, column], found = solve_periodicity(dend, w - 3, change_1, change_2)
    return found


@register_jitable
def assemble(
    out: Tangents, pair: int, dforce_t: FloatArray, work: FloatArray, dstart: FloatArray, analysis_h: FloatArray
) -> None:
    """Derivatives of the harmonics of friction and of the slip work of a pair, into `out`.

    dforce_t (N, 2w), work (w,): derivatives, with those by the start of the period. dstart (2, w): of the start.
    """
    tangent, work_tangent, by_friction = out[0][pair], out[1][pair], out[2][pair]
    m, w = analysis_h.shape[0], work.size
    dforce_h = np.empty((m, 2 * w))
    np.dot(analysis_h, dforce_t, dforce_h)
    one, other, last = w - 3, w - 2, w - 1
    for k in range(one):
        work_tangent[k] = work[k] + work[one] * dstart[0, k] + work[other] * dstart[1, k]
    by_friction[one] = work[last] + work[one] * dstart[0, last] + work[other] * dstart[1, last]
    for row in range(m):
        for along in range(2):
            own, place = dforce_h[row, along * w : (along + 1) * w], (1 + along) * m + row
            for k in range(one):
                tangent[place, k] = own[k] + own[one] * dstart[0, k] + own[other] * dstart[1, k]
            by_friction[place] = own[last] + own[one] * dstart[0, last] + own[other] * dstart[1, last]

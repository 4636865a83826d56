"""Elastic pairs through a period: force, state and slip work of the periodic state, and their exact derivatives.

Floats and arrays only; `coulomb` has the law of a sample. The first period starts from the tangential history, the next
ones from the end of the period before, until the state repeats. Where the direction of slip varies, its change falls
slowly. So after a few periods Newton's method on the periodicity gives the start, which the next period confirms.

Derivatives have 3m columns for the harmonics of the predicted force, those of one component after the other, and 2 for
the state at the start of the period.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from solver.contact.coulomb import STICK, advance_monodromy, contact_sample, contact_tangent
from solver.model import FloatArray, IntArray
from solver.settings import ROUND_OFF

MOST_PERIODS = 400
"""Most periods; then a state that is not periodic is accepted. Pairs with a turning slip direction need up to 20 with
Newton's method and above 40 without (`tests/solver/test_kernels.py`)."""

PLAIN_PERIODS = 4  # periods before Newton's method is used on the periodicity; most pairs repeat within two
SMALLEST_DETERMINANT = ROUND_OFF  # of 1 - monodromy: below it a part of the state does not fade

Tangents = tuple[FloatArray, FloatArray]
"""Derivatives by the harmonics of the predicted force: of those of friction, in the last 2m rows of
(n_contact, 3m, 3m), and of the slip work as in `Period`, (n_contact, 3m)."""


class Period(NamedTuple):
    """A period of pairs, as in `law.Marched`; the marches fill all but predicted_t, friction and start.

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
    """Slip work of a period times the tangential penalty, N * N, by the trapezoidal rule, Eqs. (7), (21) with the
    sliding velocity (the print has the displacement).
    """
    work = 0.0
    for n in range(normal_t.size):
        slip = np.hypot(state_t[0, n + 1] - state_t[0, n], state_t[1, n + 1] - state_t[1, n])
        work += 0.5 * (normal_t[n - 1] + normal_t[n]) * slip
    return work


@njit(cache=True)
def march_tangent(
    pairs: IntArray, period: Period, starts: FloatArray, synthesis: FloatArray, analysis: FloatArray, out: Tangents
) -> None:
    """Derivatives of the results of `march_period` of some pairs (n,), with the periodicity, into `out`.

    starts (n_contact, 2, 3m): of the start. synthesis (m, N), analysis (N, m): as in `FourierBasis`.
    """
    # rows of the transposes are contiguous, as the loops over columns need
    basis_t, analysis_t = np.ascontiguousarray(synthesis.T), np.ascontiguousarray(analysis.T)
    n_samples, m = basis_t.shape
    for pair in pairs:
        friction, predicted_t, state_t = period.friction[pair], period.predicted_t[pair], period.state_t[pair]
        dforce_t, work = np.empty((n_samples, 2, 3 * m + 2)), np.zeros(3 * m + 2)
        dstate, before = start_columns(3 * m), np.empty((2, 3 * m + 2))
        for n in range(n_samples):
            first, second = state_t[0, n], state_t[1, n]
            before[:, :] = dstate
            if _advance(dstate, dforce_t[n], predicted_t[:, n], first, second, friction, basis_t[n])[2] != STICK:
                _add_slip_work(work, n, predicted_t[0], state_t, dstate - before, basis_t)
        plain, start = min(period.periods[pair] - 1, PLAIN_PERIODS), period.start[pair]
        dstart = _start_tangent(dstate, predicted_t, friction, start, starts[pair], plain, basis_t)
        assemble(out[0][pair], out[1][pair], dforce_t, work, dstart, analysis_t)


@njit(cache=True)
def start_columns(width: int) -> FloatArray:
    """Derivative (2, width + 2) of the state at the start of the period by all columns."""
    columns = np.zeros((2, width + 2))
    columns[0, width] = columns[1, width + 1] = 1.0
    return columns


@njit(cache=True)
def _advance(
    dstate: FloatArray,
    dforce: FloatArray,
    predicted: FloatArray,
    first: float,
    second: float,
    friction: float,
    basis: FloatArray,
) -> tuple[float, float, int]:
    """State and status at a sample, Eqs. (13)-(15); derivatives `dforce` (2, w) of friction and `dstate` (2, w), in
    place. dstate, first, second: at the sample before. basis (m,): derivative of a time sample by its harmonics.
    """
    pressed, pull_1, pull_2 = predicted[0], predicted[1], predicted[2]
    normal, _, _, next_1, next_2, status = contact_sample(pressed, pull_1, pull_2, friction, first, second)
    by = contact_tangent(status, normal, pull_1 - first, pull_2 - second, friction)
    by_normal_1, by_normal_2, across_11, across_12, across_22 = by
    m = basis.size
    for column in range(dstate.shape[1]):
        dforce[0, column] = -across_11 * dstate[0, column] - across_12 * dstate[1, column]
        dforce[1, column] = -across_12 * dstate[0, column] - across_22 * dstate[1, column]
    for component, by_1, by_2 in ((0, by_normal_1, by_normal_2), (1, across_11, across_12), (2, across_12, across_22)):
        for k in range(m):
            dforce[0, component * m + k] += by_1 * basis[k]
            dforce[1, component * m + k] += by_2 * basis[k]
    if status != STICK:
        dstate[:, :] = -dforce
        for k in range(m):
            dstate[0, m + k] += basis[k]
            dstate[1, 2 * m + k] += basis[k]
    return next_1, next_2, status


@njit(cache=True)
def _add_slip_work(
    work: FloatArray, n: int, normal_t: FloatArray, state_t: FloatArray, moved: FloatArray, basis_t: FloatArray
) -> None:
    """Add the derivative of the slip work of sample n to `work` (w,); moved (2, w): that of the slip of the sample."""
    step_1 = state_t[0, n + 1] - state_t[0, n]
    step_2 = state_t[1, n + 1] - state_t[1, n]
    slip = np.hypot(step_1, step_2)
    if slip == 0.0:
        return
    mean = 0.5 * (max(normal_t[n - 1], 0.0) + max(normal_t[n], 0.0))
    for column in range(work.size):
        work[column] += mean * (step_1 / slip * moved[0, column] + step_2 / slip * moved[1, column])
    for end in (n - 1, n):
        if normal_t[end] > 0.0:
            for k in range(basis_t.shape[1]):
                work[k] += 0.5 * slip * basis_t[end, k]


@njit(cache=True)
def _start_tangent(
    dstate: FloatArray,
    predicted_t: FloatArray,
    friction: float,
    start: FloatArray,
    dfirst: FloatArray,
    periods: int,
    basis_t: FloatArray,
) -> FloatArray:
    """Derivative (2, w - 2) of the start of the last period, from that of its end (2, w). Where a pair has come to
    stick, the periodicity does not determine it: then through the `periods` before, from the `start` (2,), N, with its
    own derivative `dfirst` (2, w - 2).
    """
    width = dstate.shape[1] - 2
    if periods == 0:
        return dfirst
    dstart, found = periodic_start(dstate)
    if not found:
        moved, dforce = np.zeros_like(dstate), np.empty_like(dstate)
        moved[:, :width] = dfirst
        first, second = start
        for _ in range(periods):
            for n in range(predicted_t.shape[1]):
                first, second, _ = _advance(moved, dforce, predicted_t[:, n], first, second, friction, basis_t[n])
        dstart[:, :] = moved[:, :width]
    return dstart


@njit(cache=True)
def periodic_start(dend: FloatArray) -> tuple[FloatArray, bool]:
    """Derivative (2, w - 2) of the start of a period that repeats, from that of its end (2, w), and whether there is
    one.
    """
    width, found = dend.shape[1] - 2, False
    dstart = np.zeros((2, width))
    for column in range(width):
        dstart[0, column], dstart[1, column], found = solve_periodicity(
            dend[:, width:], dend[0, column], dend[1, column]
        )
    return dstart, found


@njit(cache=True)
def assemble(
    tangent: FloatArray,
    work_tangent: FloatArray,
    dforce_t: FloatArray,
    work: FloatArray,
    dstart: FloatArray,
    analysis_t: FloatArray,
) -> None:
    """Derivatives of a pair: of the harmonics of friction into `tangent` (3m, 3m), of the slip work into (3m,).

    dforce_t (N, 2, w), work (w,): derivatives, in the last two columns by the start of the period. dstart (2, w - 2):
    of the start.
    """
    (m, n_samples), width = analysis_t.shape, dstart.shape[1]
    work_tangent[:] = work[:width] + work[width] * dstart[0] + work[width + 1] * dstart[1]
    dforce_h = np.dot(analysis_t, dforce_t.reshape(n_samples, -1)).reshape(m, 2, -1)
    for row in range(m):
        for along in range(2):
            own = dforce_h[row, along]
            tangent[(1 + along) * m + row] = own[:width] + own[width] * dstart[0] + own[width + 1] * dstart[1]

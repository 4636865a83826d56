"""Events in the period of a state (slip, lift-off, loss of symmetry) that decide about harmonics and samples."""

from __future__ import annotations

import numpy as np

from solver.contact.coulomb import SEPARATED, STICK
from solver.harmonic_balance.dlft import Evaluation
from solver.model import FloatArray, IntArray
from solver.settings import NEGLIGIBLE, ROUND_OFF


def nothing_happens(evaluation: Evaluation) -> bool:
    """Whether every pair sticks or is open throughout the period, so that the joint is linear.

    A pair that reaches its friction limit without slip counts as stuck.
    """
    separated, state_t = evaluation.status_t == SEPARATED, evaluation.state_t
    rests = np.ptp(state_t, axis=2) <= ROUND_OFF * np.abs(state_t).max(axis=2)
    still = rests.all(axis=1) & ~separated.any(axis=1)
    sticks = (evaluation.status_t == STICK).all(axis=1)
    return bool((sticks | still | separated.all(axis=1)).all())


def lacks_even(orders: tuple[int, ...], evaluation: Evaluation) -> bool:
    """Whether a state has odd harmonics only although its contact forces have even ones: its symmetry is lost."""
    return all(order % 2 for order in orders) and not half_wave_symmetric(evaluation, NEGLIGIBLE)


def half_wave_symmetric(evaluation: Evaluation, fraction: float) -> bool:
    """Whether all even harmonics of the contact force but the static one are below a fraction of its largest value."""
    half = evaluation.force_t.shape[2] // 2
    if evaluation.force_t.shape[2] % 2:
        return False
    total = evaluation.force_t[:, :, :half] + evaluation.force_t[:, :, half:]
    size = np.abs(evaluation.force_t).max(initial=0.0)
    return bool(np.ptp(total, axis=2).max(initial=0.0) <= fraction * size)


def shortest_contact(status_t: IntArray, normal_force_t: FloatArray, felt: float) -> float:
    """Duration of the shortest contact of all pairs that open, as a fraction of the period; 1 where no pair opens.

    status_t, normal_force_t (n_contact, N): states of the pairs at the samples, and N. felt: fraction of the largest
    normal force; pairs whose force is lower all period long are left out.
    """
    n_samples = status_t.shape[1]
    shortest = n_samples
    pressed = normal_force_t.max(axis=1, initial=0.0)
    for closed in status_t[pressed >= felt * pressed.max(initial=0.0)] != SEPARATED:
        begins = np.flatnonzero(closed & ~np.roll(closed, 1))
        ends = np.flatnonzero(~closed & np.roll(closed, 1))
        if begins.size:
            # where the period begins in contact, the first end belongs to the last beginning
            lasted = (ends - begins if ends[0] > begins[0] else np.roll(ends, -1) - begins) % n_samples
            shortest = min(shortest, int(lasted.min()))
    return float(shortest / n_samples)


def left_out(orders: tuple[int, ...], evaluation: Evaluation) -> float:
    """Fraction of the vibrating contact force in harmonics other than `orders`, which only its samples hold.

    The fraction grows and falls with the error of the state, and needs no further solve.
    """
    force_h = np.fft.rfft(evaluation.force_t, axis=2)[:, :, 1:]
    size = np.linalg.norm(force_h)
    beyond = np.delete(force_h, np.array(orders, int) - 1, axis=2)
    return float(np.linalg.norm(beyond) / size) if size > 0.0 else 0.0

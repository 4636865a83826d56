"""Whether a periodic state doubles its period: a real Floquet multiplier beyond -1, as bouncing joints have them.

Over two periods T = 2 pi / w of the excitation a state is the same series with the fundamental w / 2, its harmonics the
even ones. What grows by a multiplier beyond -1 changes its sign from one period to the next: it is a series of the odd
ones. A shift by T leaves the state as it is, so the Jacobian of the balance over two periods couples no even harmonic
with an odd one, and the determinant of its odd part is that of Hill's equation at the multiplier -1. As in `stability`
its sign is that of the joint that is open all over where no multiplier lies beyond -1; each one that does changes it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.balance import Balance, Evaluation, Linearisation
from solver.harmonics import build_basis, change_orders
from solver.joint import Joint
from solver.kernels import SEPARATED
from solver.model import FloatArray, ReducedModel
from solver.structure import build_structure

FEWEST = 19  # harmonics
FINE = 1024  # samples of two periods, at least: a short contact decides
MOST_UNKNOWNS = 1500  # of the balance over two periods; its Jacobian is factorised as it is


def doubles_period(model: ReducedModel, joint: Joint, evaluation: Evaluation) -> bool:
    """True where the state has an odd number of real multipliers beyond -1.

    evaluation: of the state, its wear held. False as well where that is not looked for: where no pair comes and goes (a
    friction contact alone damps), in a travelling wave (no nodal diameter belongs to half an order) and where the
    unknowns are many.
    """
    opens = evaluation.status_t == SEPARATED
    if not (opens.any(axis=1) & ~opens.all(axis=1)).any() or (model.n_sectors and model.nodal_diameter):
        return False
    if joint.slots.size * (4 * max(*joint.basis.orders, FEWEST) + 1) > MOST_UNKNOWNS:
        return False
    sign, _ = np.linalg.slogdet(odd_part(linearise_over_two(model, joint, evaluation)))
    return bool(sign < 0.0)


def two_periods(orders: tuple[int, ...], below: int) -> tuple[int, ...]:
    """Harmonics of half the frequency: the even ones are those of one period, and the odd ones below the highest; more
    of these where there are few, as what grows need not be as smooth as the state. below: half the number of samples.
    """
    highest = min(2 * max(*orders, FEWEST), below)
    return tuple(sorted({2 * order for order in orders} | set(range(1, highest, 2))))


def linearise_over_two(model: ReducedModel, joint: Joint, evaluation: Evaluation) -> Linearisation:
    """Derivative of the balance over two periods at a state that repeats after one."""
    samples = max(2 * joint.basis.n_samples, 0 if joint.penalty.inertial.any() else FINE)
    orders = two_periods(joint.basis.orders, samples // 2)
    omega = 0.5 * joint.omega
    longer = replace(
        joint,
        omega=omega,
        structure=build_structure(model, omega, joint.excitation_amplitude, orders),
        basis=build_basis(orders, samples),
    )
    balance = Balance(longer, evaluation.history, evaluation.wear_depth, np.zeros_like(evaluation.wear_depth))
    doubled = tuple(2 * order for order in joint.basis.orders)
    return balance.linearise(balance.evaluate(change_orders(evaluation.predicted_h, doubled, orders)))


def odd_part(tangent: Linearisation) -> FloatArray:
    """Rows and columns of the odd harmonics; those of pairs that do not depend on them are an identity, left out."""
    basis = tangent.joint.basis
    odd = np.concatenate([[False], np.repeat(np.array(basis.orders) % 2 == 1, 2)])
    matrix = tangent.dense(tangent.active())
    chosen = np.tile(odd, matrix.shape[0] // odd.size)
    return np.asarray(matrix[np.ix_(chosen, chosen)])

"""Transfer of a state to other harmonics or to another penalty: balance and predicted force to start from.

Other harmonics have another penalty, and a pair may be inertial with one penalty and elastic with the other
(`solver.structure.penalty`). So force, motion and tangential history are converted to the new penalty.
"""

from __future__ import annotations

import numpy as np

from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.model import BoolArray, FloatArray
from solver.structure.fourier import change_orders, synthesis
from solver.structure.joint import Case, Joint


def transfer(
    case: Case, joint: Joint, evaluation: Evaluation, old_orders: tuple[int, ...], inertial: BoolArray | None = None
) -> tuple[Balance, FloatArray]:
    """Balance in the case, and a predicted force (n_rel, m), N, to start from, for a state of other harmonics.

    inertial (n_contact,): inertial pairs of the state; by default the inertial pairs of `joint`.
    """
    was = joint.penalty.inertial if inertial is None else inertial
    history = carried_history(evaluation, old_orders, was, joint)
    balance = Balance.frozen(joint, history, evaluation.wear_depth)
    orders = case.resolution.orders
    return balance, balance.predict(
        change_orders(evaluation.displacement_h, old_orders, orders),
        change_orders(evaluation.force_h, old_orders, orders),
    )


def carried_history(evaluation: Evaluation, orders: tuple[int, ...], inertial: BoolArray, joint: Joint) -> FloatArray:
    """Tangential history (n_contact, 2), m, of a state, converted for a joint in which other pairs may be inertial.

    - orders: harmonics of the state.
    - inertial (n_contact,): inertial pairs of the state.

    The history of a pair that becomes inertial is its mean position. The history of a pair that becomes elastic is its
    position at the end of the period, which equals the corrected slip (`coulomb`: the tangential state is the penalty
    times the motion).
    """
    now = joint.penalty.inertial
    if np.array_equal(inertial, now):
        return evaluation.history
    tangential = evaluation.displacement_h[:, 1:]
    n_samples = evaluation.force_t.shape[2]
    at_end = (tangential @ synthesis(orders, np.array([-2.0 * np.pi / n_samples])))[:, :, 0]
    changed = np.where(now[:, None], tangential[:, :, 0], at_end)
    return np.where((inertial == now)[:, None], evaluation.history, changed)

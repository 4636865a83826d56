"""A state taken to other harmonics or to another penalty: what it starts from there.

Other harmonics have another penalty, and a mass may be marched with some of them and held by a spring with others
(`solver.structure.penalty`): what a state takes along is put into the terms of the penalty that it goes to.
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
    """Balance and predicted force (n_rel, m), N, from which a state of other harmonics is solved in this case.

    inertial (n_contact,): pairs that were marched with their mass in the state; by default those that are in this case.
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
    """History (n_contact, 2), m, of a state in the terms of another joint: pairs may be marched with their mass in one
    of them only.

    inertial (n_contact,): where they were in the state, of harmonics `orders`. A pair that is now takes its mean
    position along; one that no longer is its place at the end of the period, which its corrected slip equals
    (`coulomb`: the tangential state is the penalty times the motion).
    """
    now = joint.penalty.inertial
    if np.array_equal(inertial, now):
        return evaluation.history
    tangential = evaluation.displacement_h[:, 1:]
    n_samples = evaluation.force_t.shape[2]
    at_end = (tangential @ synthesis(orders, np.array([-2.0 * np.pi / n_samples])))[:, :, 0]
    changed = np.where(now[:, None], tangential[:, :, 0], at_end)
    return np.where((inertial == now)[:, None], evaluation.history, changed)

"""Transfer of a state to other harmonics or to another penalty: balance and predicted force to start from.

Other harmonics have another penalty, and a pair may be inertial with one penalty and elastic with the other
(`solver.structure.penalty`). So force, motion and tangential history are converted to the new penalty.
"""

from __future__ import annotations

import numpy as np

from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.model import FloatArray
from solver.structure.fourier import change_orders, synthesis
from solver.structure.joint import Case, Joint


def transfer(old: Case, joint: Joint, evaluation: Evaluation) -> tuple[Balance, FloatArray]:
    """Balance of `joint`, and a predicted force (n_rel, m), N, to start from, for a state of the case `old`."""
    balance = Balance(joint, carried_history(old, joint, evaluation), evaluation.wear_depth)
    motion_h, force_h = (
        change_orders(part, old.resolution.orders, joint.basis.orders)
        for part in (evaluation.displacement_h, evaluation.force_h)
    )
    return balance, balance.predict(motion_h, force_h)


def carried_history(old: Case, joint: Joint, evaluation: Evaluation) -> FloatArray:
    """Tangential history (n_contact, 2), m, of a state of the case `old`, converted for the law of `joint`."""
    tangential = evaluation.displacement_h[:, 1:]
    end = np.array([-2.0 * np.pi / evaluation.force_t.shape[2]])
    last = (tangential @ synthesis(old.resolution.orders, end))[:, :, 0]
    return joint.law.history_from(old.penalty, evaluation.history, tangential[:, :, 0], last)

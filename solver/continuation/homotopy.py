"""Homotopy in the harmonics, to states that Newton's method does not find directly.

A balance of H harmonics equals a balance of more harmonics in which the structure answers to the new
harmonics as the penalty E_n does. With the compliance G_n = 1 / Z_n replaced by 1 / E_n the predicted forces
(1 - E_n G_n) lambda_n of the new harmonics are zero (`solver.structure.penalty`). The homotopy is

    G_n(s) = (1 - s) / E_n + s G_n

for the new harmonics. At s = 0 the known state is a solution, at s = 1 the state with all harmonics. In between the
predicted forces of the new harmonics grow from zero. The compliance is interpolated, not the stiffness: the stiffnesses
of an elastic joint and of a mass have opposite signs, and interpolated stiffnesses would pass through a resonance.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.continuation.natural import follow_naturally
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.harmonic_balance.state import BalanceAt, State, carried_history
from solver.model import ComplexArray, FloatArray, IntArray
from solver.newton.run import Run
from solver.settings import Resolution
from solver.structure.fourier import build_basis, change_orders, to_complex
from solver.structure.harmonic_stiffness import DenseStiffness
from solver.structure.joint import Case, Joint


def add_harmonics(
    case: Case, joint: Joint, evaluation: Evaluation, resolution: Resolution, run: Run
) -> Evaluation | None:
    """State with more harmonics, by a homotopy in their compliance; None where it does not reach its end.

    case, joint, evaluation: the known state. resolution: its harmonics and new ones, and at least as many samples.
    The state has the penalty of `case`; the caller transfers it to the penalty of the new harmonics.
    """
    finer = replace(case, resolution=resolution).joint(joint.omega, joint.excitation_amplitude)
    new = np.flatnonzero(~np.isin(resolution.orders, case.resolution.orders))
    balance_at = harmonic_homotopy(finer, evaluation, new)
    start = change_orders(evaluation.predicted_h, case.resolution.orders, resolution.orders)
    begun = run.fresh().state(balance_at(0.0, evaluation.history), start)
    if begun is None:
        return None
    first = State(begun.evaluation, evaluation.history, 0.0)
    last, arrived = follow_naturally(balance_at, first, 1.0, run.fresh(), keep_history=True)
    return last.evaluation if arrived else None


def harmonic_homotopy(joint: Joint, known: Evaluation, new: IntArray) -> BalanceAt:
    """Balances between the state without the new harmonics (s = 0) and the state with the new harmonics (s = 1).

    joint: with all harmonics. known: its history and depths hold. new (k,): indices of the new harmonics.
    """
    structure = joint.structure
    unit = np.zeros((joint.contact.n_contact, 3, 2 * joint.basis.n_harmonics + 1))
    unit[:, :, 1::2] = 1.0
    penalty = to_complex(joint.to_relative(joint.law.force(unit)))[:, new]
    compliant = np.stack([np.diag(1.0 / column) for column in penalty.T])  # 1 / E_n (k, n_rel, n_rel), m/N
    compliance: ComplexArray = np.linalg.inv(structure.dynamic_stiffness[new]).astype(complex)

    def balance_at(parameter: float, _: FloatArray) -> Balance:
        mixed_joint = joint
        if parameter < 1.0:
            mixed = structure.dynamic_stiffness.astype(complex)
            mixed[new] = np.linalg.inv((1.0 - parameter) * compliant + parameter * compliance)
            mixed_joint = replace(joint, structure=replace(structure, moving=DenseStiffness(mixed)))
        return Balance(mixed_joint, known.history, known.wear_depth)

    return balance_at


def start_with_tail(old: Case, joint: Joint, evaluation: Evaluation) -> tuple[Balance, FloatArray]:
    """Balance with more harmonics, and a predicted force (n_rel, m), N, to start from.

    The new harmonics of the force are taken from the force samples, and the new harmonics of the motion are the motion
    of the structure under these forces. Zeros would remove the impacts that the samples contain.

    old, evaluation: the known state. joint: with all harmonics.
    """
    balance = Balance(joint, carried_history(old, joint, evaluation), evaluation.wear_depth)
    orders, known = joint.basis.orders, old.resolution.orders
    force = joint.to_relative(evaluation.force_t @ build_basis(orders, evaluation.force_t.shape[2]).analysis)
    motion_h, force_h = (
        change_orders(joint.to_relative(part), known, orders)
        for part in (evaluation.displacement_h, evaluation.force_h)
    )
    for place in np.flatnonzero(~np.isin(orders, known)):
        both = slice(2 * place + 1, 2 * place + 3)
        force_h[:, both] = force[:, both]
        amplitude = force[:, 2 * place + 1] - 1j * force[:, 2 * place + 2]
        moved = -np.linalg.solve(joint.structure.moving.matrix(int(place)), amplitude)
        motion_h[:, 2 * place + 1], motion_h[:, 2 * place + 2] = moved.real, -moved.imag
    return balance, balance.predict(joint.to_pairs(motion_h), joint.to_pairs(force_h))

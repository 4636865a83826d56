"""A state led to more harmonics where a warm start does not find it.

A balance of H harmonics is the one of more harmonics in which the new ones take the contact force up exactly as the
penalty E_n does: with the compliance G_n = 1 / Z_n replaced by 1 / E_n the predicted forces (1 - E_n G_n) lambda_n that
were left out are zero (`solver.structure.penalty`). So with

    G_n(s) = (1 - s) / E_n + s G_n

for the new harmonics the known state is a solution at s = 0, and the state with all of them the one at s = 1, along
which the predicted forces that were left out grow from nothing. The compliance is what is mixed: of the stiffnesses of
an elastic joint and of a mass the one is positive and the other negative, and a mixture of them would pass a resonance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.continuation.natural import follow_naturally
from solver.harmonic_balance.converged import PathPoint
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.harmonic_balance.prolongation import carried_history
from solver.model import BoolArray, ComplexArray, FloatArray
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Effort, solve_balance
from solver.settings import Resolution
from solver.structure.fourier import build_basis, change_orders, to_complex
from solver.structure.joint import Case, Joint


def lead_to(
    case: Case, joint: Joint, evaluation: Evaluation, resolution: Resolution, effort: Effort
) -> Evaluation | None:
    """The state `evaluation` of `joint`, with more harmonics and at least as many samples; None where the way ends.

    case: of the joint. The penalty is still that of the case: the state is to be transferred to its own.
    """
    tolerance = case.settings.tolerance
    richer = replace(case, resolution=resolution).joint(joint.omega, joint.excitation_amplitude)
    new = np.flatnonzero(~np.isin(resolution.orders, case.resolution.orders))
    way = _Way(richer, evaluation.history, evaluation.wear_depth, new, *_compliances(richer, new))
    old = case.resolution.orders
    start = change_orders(evaluation.predicted_h, old, resolution.orders)
    first = way.at(0.0, evaluation.history)
    result = solve_balance(first, start, JacobianSolver(), tolerance, effort)
    if not result.converged:
        return None
    point = PathPoint(0.0, result.evaluation, evaluation.history)
    last, arrived = follow_naturally(way.at, point, 1.0, JacobianSolver(), tolerance, effort, keep_history=True)
    return last.evaluation if arrived else None


def start_with_tail(
    joint: Joint, evaluation: Evaluation, old: tuple[int, ...], inertial: BoolArray | None = None
) -> tuple[Balance, FloatArray]:
    """Balance and predicted force (n_rel, m), N, with which a state of harmonics `old` is solved with more of them.

    joint: with all harmonics, of the case. inertial: as in `carried_history`, by default those of the joint. The new
    harmonics are those of the force samples and what the structure does under them: zeros would take back the impacts
    that the samples have.
    """
    history = carried_history(evaluation, old, joint.penalty.inertial if inertial is None else inertial, joint)
    balance = Balance.frozen(joint, history, evaluation.wear_depth)
    orders = joint.basis.orders
    force = joint.to_relative(evaluation.force_t @ build_basis(orders, evaluation.force_t.shape[2]).analysis)
    motion_h, force_h = (
        joint.to_relative(change_orders(part, old, orders)) for part in (evaluation.displacement_h, evaluation.force_h)
    )
    for place in np.flatnonzero(~np.isin(orders, old)):
        both = slice(2 * place + 1, 2 * place + 3)
        force_h[:, both] = force[:, both]
        amplitude = force[:, 2 * place + 1] - 1j * force[:, 2 * place + 2]
        moved = -np.linalg.solve(joint.structure.dynamic_stiffness[place], amplitude)
        motion_h[:, 2 * place + 1], motion_h[:, 2 * place + 2] = moved.real, -moved.imag
    return balance, balance.predict(joint.to_pairs(motion_h), joint.to_pairs(force_h))


def _compliances(joint: Joint, places: np.ndarray) -> tuple[ComplexArray, ComplexArray]:
    """Compliance (k, n_rel, n_rel), m/N, of the penalty and of the structure at some places among the harmonics."""
    unit = np.zeros((joint.contact.n_contact, 3, 2 * joint.basis.n_harmonics + 1))
    unit[:, :, 1::2] = 1.0
    penalty = to_complex(joint.to_relative(joint.surplus(unit)))[:, places]
    return np.stack([np.diag(1.0 / column) for column in penalty.T]), np.linalg.inv(
        joint.structure.dynamic_stiffness[places]
    ).astype(complex)


@dataclass(frozen=True)
class _Way:
    """Balances between the state without the new harmonics, 0, and that with them, 1."""

    joint: Joint
    history: FloatArray
    wear_depth: FloatArray
    new: np.ndarray
    penalty_compliance: ComplexArray
    compliance: ComplexArray

    def at(self, share: float, _: FloatArray) -> Balance:
        """Balance at a share of the way; its history stays."""
        structure = self.joint.structure
        if share < 1.0:
            mixed = structure.dynamic_stiffness.astype(complex)
            mixed[self.new] = np.linalg.inv((1.0 - share) * self.penalty_compliance + share * self.compliance)
            structure = replace(structure, dynamic_stiffness=mixed)
        joint = replace(self.joint, structure=structure)
        return Balance.frozen(joint, self.history, self.wear_depth)

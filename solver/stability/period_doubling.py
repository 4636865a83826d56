"""Whether a periodic state doubles its period: a real Floquet multiplier beyond -1, as bouncing joints have them.

Over two periods T = 2 pi / w of the excitation a state is the same series with the fundamental w / 2, its harmonics the
even ones. A disturbance with a multiplier beyond -1 changes its sign from one period to the next: it is a series of
the odd ones. A shift by T leaves the state as it is, so the Jacobian of the balance over two periods couples no even
harmonic with an odd one, and the determinant of its odd part is that of Hill's equation at the multiplier -1. As in
`hill` its sign is that of the joint that is open all over where no multiplier lies beyond -1; each one that does
changes it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.contact.coulomb import SEPARATED
from solver.harmonic_balance.dlft import Balance, Evaluation, Linearisation
from solver.harmonic_balance.prolongation import transfer
from solver.model import FloatArray, ReducedModel
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Effort, solve_balance
from solver.settings import Resolution, all_orders
from solver.stability.options import STABILITY
from solver.structure.condensation import build_structure
from solver.structure.fourier import build_basis, change_orders
from solver.structure.joint import Case, Joint


def doubles_period(case: Case, joint: Joint, evaluation: Evaluation, effort: Effort) -> bool:
    """Whether a state has an odd number of real multipliers beyond -1.

    Parameters
    ----------
    case : Case
        Of the state.
    joint, evaluation : Joint, Evaluation
        The state, its wear held.
    effort : Effort
        Where Newton iterations are counted.

    Returns
    -------
    bool
        False, too, where it is not looked for: where no pair opens and closes (friction alone damps), in a travelling
        wave (no nodal diameter belongs to half an order) and where there are too many unknowns.

    Raises
    ------
    OutOfTimeError
        Behind the deadline of the effort.
    """
    opens = evaluation.status_t == SEPARATED
    travels = case.model.n_sectors > 0 and case.model.nodal_diameter > 0
    if travels or not (opens.any(axis=1) & ~opens.all(axis=1)).any():
        return False
    fine = Resolution(
        all_orders(STABILITY.doubling_harmonics), max(STABILITY.doubling_samples, case.resolution.samples)
    )
    if case.resolution.highest < fine.highest and _unknowns(joint, fine.orders) <= STABILITY.doubling_unknowns:
        sharp = case.at(fine)
        finer = sharp.joint(joint.omega, joint.excitation_amplitude)
        balance, start = transfer(sharp, finer, evaluation, joint.basis.orders, joint.penalty.inertial)
        result = solve_balance(balance, start, JacobianSolver(), case.settings.tolerance, effort)
        if result.converged:
            joint, evaluation = finer, result.evaluation
    if _unknowns(joint, joint.basis.orders) > STABILITY.doubling_unknowns:
        return False
    sign, _ = np.linalg.slogdet(odd_part(linearise_over_two(case.model, joint, evaluation)))
    return bool(sign < 0.0)


def _unknowns(joint: Joint, orders: tuple[int, ...]) -> int:
    return joint.component_index.size * (4 * max(orders) + 1)


def two_periods(orders: tuple[int, ...]) -> tuple[int, ...]:
    """Harmonics of half the frequency: the even ones are those of one period, and all odd ones below the highest.

    Higher odd ones would be judged with a stiffness of the contact that the truncated state does not have.
    """
    return tuple(sorted({2 * order for order in orders} | set(range(1, 2 * max(orders), 2))))


def linearise_over_two(model: ReducedModel, joint: Joint, evaluation: Evaluation) -> Linearisation:
    """Derivative of the balance over two periods at a state that repeats after one."""
    orders = two_periods(joint.basis.orders)
    omega = 0.5 * joint.omega
    longer = replace(
        joint,
        omega=omega,
        structure=build_structure(model, omega, joint.excitation_amplitude, orders),
        basis=build_basis(orders, 2 * joint.basis.n_samples),
    )
    balance = Balance.frozen(longer, evaluation.history, evaluation.wear_depth)
    doubled = tuple(2 * order for order in joint.basis.orders)
    return balance.linearise(balance.evaluate(change_orders(evaluation.predicted_h, doubled, orders)))


def odd_part(tangent: Linearisation) -> FloatArray:
    """Rows and columns of the odd harmonics, without those of pairs that do not depend on them (an identity)."""
    basis = tangent.joint.basis
    odd = np.concatenate([[False], np.repeat(np.array(basis.orders) % 2 == 1, 2)])
    matrix = tangent.dense(tangent.active())
    chosen = np.tile(odd, matrix.shape[0] // odd.size)
    return np.asarray(matrix[np.ix_(chosen, chosen)])

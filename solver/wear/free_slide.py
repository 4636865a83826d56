"""A joint that slides as a whole: a soft hold of its mean position in the direction without stiffness.

Only friction holds a root along a prismatic slot. Where every pair slips at some time of the period, nothing determines
the mean position along the slot: the Jacobian is singular, and the mean friction along the slot has to be zero.

- In a symmetric joint the mean friction is zero.
- Pairs with unequal wear, even by 1e-5 of their depth, leave a small force g (dovetail, friction 0.3, 1 N: up to 2e-6
  of the friction F). Strictly, no periodic state exists: the root creeps. The force turns the directions of slip by
  g / F. So the root moves by about g / F of its slip path in a period, here 1e-12 m, and motion and wear change by
  g / F at most.

So a soft spring holds the mean position from there on. Its force is the force g that drives the creep. Where g / F is
no longer negligible there is no periodic state, and the outcome is ADRIFT.
"""

from __future__ import annotations

import numpy as np

from solver.contact.coulomb import STICK
from solver.continuation.natural import follow_naturally
from solver.harmonic_balance.converged import PathPoint, final_history, vibration_change
from solver.harmonic_balance.dlft import Evaluation
from solver.model import FloatArray
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Budget
from solver.options import COMMON
from solver.results.options import RESULTS
from solver.stability.options import STABILITY
from solver.structure.joint import Case, Hold, Joint
from solver.structure.penalty import MEAN_STIFFNESS_FRACTION
from solver.wear.branch_loss import is_stable_when_held
from solver.wear.euler import held_wear


def free_slide(joint: Joint, at: Evaluation) -> Hold | None:
    """Hold of the mean position of a state.

    None unless every pair slips at some time and the structure is free to slide in one direction; masses on rigid
    ground have a hold of their own (`Penalty.mean`).
    """
    if (at.status_t == STICK).all(axis=1).any() or joint.law.rate_dependent:
        return None
    stiffness, directions = np.linalg.eigh(joint.structure.static_stiffness)
    # spin softening may give small negative eigenvalues
    free = np.abs(stiffness) < COMMON.round_off * stiffness[-1]
    along = directions[:, int(np.argmin(np.abs(stiffness)))]
    closes = np.abs(along[joint.component_index % 3 == 0]).max(initial=0.0)
    if np.count_nonzero(free) != 1 or closes > COMMON.negligible:
        return None
    motion = joint.to_relative(at.displacement_h)[:, 0]
    return Hold(along, MEAN_STIFFNESS_FRACTION * float(stiffness[-1]), float(along @ motion))


def creeps(joint: Joint, hold: Hold, at: Evaluation) -> bool:
    """Whether the force of a hold is so large that the joint would creep noticeably without it."""
    friction = float(joint.friction_coefficient @ at.force_h[:, 0, 0])
    return abs(hold.force(joint.to_relative(at.displacement_h)[:, 0])) > RESULTS.held_force * friction


def held_on(
    case: Case, joint: Joint, last: PathPoint, worn: FloatArray, solver: JacobianSolver, budget: Budget
) -> tuple[Hold, PathPoint] | None:
    """The hold of a joint, and the held state at the depths `worn` (n_contact,), m, just beyond the last state.

    None where the joint does not slide as a whole, or where the vibration changes: then a branch has ended.
    """
    hold = free_slide(joint, last.evaluation)
    if hold is None:
        return None
    held = case.held(hold)
    other = held.joint(joint.omega, joint.excitation_amplitude)
    balance_at = held_wear(other, last.evaluation.wear_depth, worn)
    found, arrived = follow_naturally(balance_at, last, 1.0, solver, case.settings.tolerance, budget, keep_history=True)
    changed = vibration_change(last.evaluation, found.evaluation) > STABILITY.other_branch
    if (
        not arrived
        or changed
        or creeps(other, hold, found.evaluation)
        or not is_stable_when_held(other, found.evaluation, solver)
    ):
        return None
    history = final_history(balance_at(1.0, last.history), found.evaluation)
    return hold, PathPoint(0.0, found.evaluation, history)

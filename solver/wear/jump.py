"""A jump: from the end of the branch of the vibration to a stable state a little beyond, while the joint wears.

Where a branch folds, the vibration goes on in a state of another branch. Where the joint begins to slide as a whole,
its mean position gets a soft hold in the direction without stiffness.

Only friction holds a root along a prismatic slot. Where every pair slips at some time, or slides slowly, nothing
determines the mean position along the slot: the Jacobian is singular. Pairs with unequal wear leave a small mean force
g along the slot (dovetail, friction 0.3, 1 N: up to 2e-6 of the friction F). Motion and wear change by g / F at most
where a soft spring holds the mean position. Where g / F is no longer negligible there is no periodic state: ADRIFT.
"""

from dataclasses import replace

import numpy as np

from solver.continuation.transient import SEARCH_ITERATIONS, relax_to_periodic
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.harmonic_balance.state import Failure, vibration_change
from solver.model import FloatArray
from solver.outcome import Outcome, in_digits
from solver.settings import NEGLIGIBLE, ROUND_OFF
from solver.stability.floquet import OTHER_BRANCH
from solver.structure.joint import Hold, Joint
from solver.structure.penalty import HOLD_FRACTION
from solver.wear.wearing_joint import LastStep, WearingJoint, WearState


def jump(wearing: WearingJoint, state: WearState, worn: FloatArray, cycle: float) -> WearState | Failure:
    """A stable state beyond the end of a branch: with a hold, or of another branch. worn (2, n_contact): its depths, m,
    and dissipated energies, J/m2.
    """
    wearing.run.budget.most_iterations = wearing.run.budget.iterations + SEARCH_ITERATIONS
    reached = _with_hold(wearing, state, worn) or _on_another_branch(wearing, state, worn)
    if isinstance(reached, Failure) and reached.outcome is Outcome.ADRIFT:
        # the last pairs that stick come loose together
        reached = _with_hold(wearing, state, worn, drifts=True) or reached
    wearing.run.budget.most_iterations = float("inf")
    if isinstance(reached, Failure):
        return reached
    return wearing.with_rates(replace(reached, cycle=cycle, last=LastStep()))


def _with_hold(wearing: WearingJoint, state: WearState, worn: FloatArray, *, drifts: bool = False) -> WearState | None:
    """The stable state with a hold of the mean position; None where no joint slides as a whole, or a branch ends."""
    hold = None if state.point.hold else free_slide(wearing.joint_of(state), state.at, drifts=drifts)
    if hold is None:
        return None
    joint = replace(state.point, hold=hold).joint(wearing.case)
    point = wearing.run.state(Balance(joint, state.point.next_history, worn[0], energy=worn[1]), state.at.predicted_h)
    if point is None or not wearing.run.is_stable(joint, at := point.evaluation):
        return None
    if creeps(joint.after(at.energy), hold, at) or vibration_change(state.at, at) > OTHER_BRANCH:
        return None
    # without a factorisation of the joint without a hold
    wearing.run = wearing.run.fresh()
    return replace(state, point=point, record=replace(state.record, held_from=state.cycle))


def _on_another_branch(wearing: WearingJoint, state: WearState, worn: FloatArray) -> WearState | Failure:
    """The state of another branch to which the structure relaxes in time when it is worn (2, n_contact).

    No other search has found a state in 60 random scenes and in the tests where relaxation finds none: neither arc
    length along the frequency through the folds of the branch, nor a first state from rest.
    """
    joint = wearing.joint_of(state)
    point = relax_to_periodic(joint, worn, state.point, joint, wearing.run)
    if isinstance(point, Failure):
        reason = point.outcome if point.outcome is Outcome.ADRIFT else Outcome.MARCH_FAILED
        return Failure(reason, f"no state is found beyond cycle {in_digits(state.cycle)}: {point.message}")
    # a small fold of the branch at a corner is no jump, and there may be many corners
    if vibration_change(state.at, point.evaluation) > OTHER_BRANCH:
        first = float(np.fmin(state.record.jump_cycle, state.cycle))
        state = replace(state, record=replace(state.record, jump_cycle=first))
    return replace(state, point=point)


def free_slide(joint: Joint, at: Evaluation, *, drifts: bool = False) -> Hold | None:
    """Hold of the mean position of a state; None unless every pair slips at some time or has slid, or is known to drift
    although it sticks, and the structure can slide in one direction. Masses on rigid ground have a hold of their own
    (`Penalty.mean`).
    """
    if (at.stuck.any() and not drifts) or joint.law.rate_dependent:
        return None
    stiffness, directions = np.linalg.eigh(joint.structure.static_stiffness)
    # spin softening may give small negative eigenvalues
    free = np.abs(stiffness) < ROUND_OFF * stiffness[-1]
    along = directions[:, int(np.argmin(np.abs(stiffness)))]
    closes = np.abs(along[joint.component_index % 3 == 0]).max(initial=0.0)
    if np.count_nonzero(free) != 1 or closes > NEGLIGIBLE:
        return None
    motion = joint.motion(at)[:, 0]
    return Hold(along, HOLD_FRACTION * float(stiffness[-1]), float(along @ motion))


def creeps(joint: Joint, hold: Hold, at: Evaluation) -> bool:
    """Whether the force of a hold is so large that the joint would creep noticeably without it."""
    friction = float(joint.contact.friction @ at.force_h[:, 0, 0])
    moved = float(hold.direction @ joint.motion(at)[:, 0]) - hold.position
    return abs(hold.stiffness * moved) > HOLD_FRACTION * friction

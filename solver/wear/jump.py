"""A jump: from the end of the branch of the vibration to a stable state a little beyond, while the joint wears."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.state import Failure, State, vibration_change
from solver.model import FloatArray
from solver.outcome import Outcome
from solver.stability.options import STABILITY
from solver.wear.branch_loss import state_after_fold
from solver.wear.free_slide import held_on
from solver.wear.state import WearState
from solver.wear.step import Step
from solver.wear.step_limit import too_long
from solver.wear.wearing_joint import WearingJoint


def land(work: WearingJoint, step: Step, *, bounded: bool) -> WearState | Failure:
    """A stable state a little beyond the end of the branch that a step has reached.

    Where the branch ends because the joint slides as a whole, the state has a hold of the mean position (`free_slide`).
    Otherwise the state belongs to another branch (`branch_loss`).

    bounded: whether a jump that moves many times the normal forces is refused.
    """
    state = step.state
    joint, at = work.at(state), state.point.evaluation
    beyond = min(2.0 * step.end_known_to, step.length)
    worn = state.depth + beyond * work.rate(at)
    if bounded and (said := too_long(joint, at, worn, state.cycle, beyond)) is not None:
        return Failure(Outcome.STEP_TOO_LONG, said)
    work.run.budget.limit = work.run.budget.iterations + CONTINUATION.search_iterations
    landed = _held(work, state, worn) or _on_another_branch(work, state, worn)
    work.run.budget.limit = float("inf")
    if isinstance(landed, Failure):
        return landed
    return replace(landed, cycle=state.cycle + beyond, change=None, previous=None)


def _held(work: WearingJoint, state: WearState, worn: FloatArray) -> WearState | None:
    """The state with a hold of the mean position; None where the joint does not slide as a whole."""
    if state.hold is not None:
        return None
    found = held_on(work.case, work.at(state), state.point, worn, work.run)
    if found is None:
        return None
    hold, point = found
    return replace(state, point=point, hold=hold, held_from=state.cycle)


def _on_another_branch(work: WearingJoint, state: WearState, worn: FloatArray) -> WearState | Failure:
    """A stable state of another branch at depths `worn` (n_contact,), m."""
    landed = state_after_fold(work.case, work.at(state), state.point, worn, work.run)
    if not isinstance(landed, State):
        return Failure(landed if landed is Outcome.ADRIFT else Outcome.MARCH_FAILED)
    if vibration_change(state.point.evaluation, landed.evaluation) <= STABILITY.other_branch:
        # a small fold of the branch at a corner is no jump, and there may be many corners
        return replace(state, point=landed)
    first = state.cycle if np.isnan(state.jump_cycle) else state.jump_cycle
    return replace(state, point=landed, jump_cycle=first)

"""The stable state beyond the end of a branch, at which the vibration of a wearing joint goes on."""

from __future__ import annotations

from dataclasses import replace

from solver.continuation.after_fold import states_after_fold
from solver.continuation.natural import follow_naturally
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.harmonic_balance.state import State, final_history
from solver.model import FloatArray
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.stability.hill import is_stable
from solver.structure.joint import Case, Joint
from solver.wear.euler import held_wear


def is_stable_when_held(joint: Joint, evaluation: Evaluation, run: Run) -> bool:
    """Whether a state is stable at fixed wear depth."""
    held = Balance.frozen(joint, evaluation.history, evaluation.wear_depth)
    return is_stable(held, evaluation, run)


def state_after_fold(case: Case, joint: Joint, last: State, worn: FloatArray, run: Run) -> State | Outcome:
    """A stable state just beyond the end of the branch of `last`, or the reason why there is none.

    worn (n_contact,): wear depth of this state, m.
    Raises OutOfTimeError.
    """
    for landed in states_after_fold(case, joint, last, worn, run):
        if isinstance(landed, Outcome):
            return landed
        # a search along the frequency keeps the old depth: the state has to exist at the depths `worn`, too
        balance_at = held_wear(joint, landed.evaluation.wear_depth, worn)
        start = replace(landed, parameter=0.0)
        point, arrived = follow_naturally(balance_at, start, 1.0, run, keep_history=True)
        if arrived and is_stable_when_held(joint, point.evaluation, run):
            return State(point.evaluation, final_history(balance_at(1.0, start.history), point.evaluation))
    return Outcome.MARCH_FAILED

"""Ratcheting of masses on sliders, and the state after shakedown.

A very small stiffness holds the mean position of an inertial pair (`penalty.mean`), and drag holds its mean velocity.
Vibration may let the mass slip to a mean position u_0 that differs from the position of its history. The law then
ratchets by 2 pi / omega penalty.mean (u_0 - history) / c in each period, with c the drag, although the Fourier series
are periodic. The slip of this motion counts as wear, but its work is not in the balance of energy. In the joint the
mean position has moved already: with u_0 as the new history only a fraction of the ratcheting is left. In the end the
mass slips to and fro, or sticks: this is the state after shakedown.
"""

from __future__ import annotations

import numpy as np

from solver.continuation.natural import ATTEMPTS, follow_naturally
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.harmonic_balance.state import State, final_history
from solver.model import FloatArray
from solver.newton.run import Run
from solver.structure.joint import Joint


def ratcheting_work(joint: Joint, evaluation: Evaluation) -> float:
    """Mean normal force times ratcheting in a period, N m: the part of the slip work that is not periodic."""
    return float(np.abs(evaluation.force_h[:, 0, 0]) @ np.hypot(*joint.law.drift(evaluation).T))


def ratchets(joint: Joint, evaluation: Evaluation, fraction: float) -> bool:
    """Whether the work of ratcheting exceeds a fraction of the slip work."""
    return ratcheting_work(joint, evaluation) > fraction * float(evaluation.slip_work.sum())


def shake_down(joint: Joint, state: State, fraction: float, run: Run) -> State:
    """State after shakedown of the masses, at an unchanged wear depth; the last one found where it does not end.

    fraction: accepted work of ratcheting over the slip work.
    """
    run, worn = run.fresh(), state.evaluation.wear_depth
    for _ in range(ATTEMPTS):
        if not ratchets(joint, state.evaluation, fraction):
            break
        before = state.evaluation.history
        # from the mean position of the masses in the history to the one reached
        shift = joint.law.origin(state.evaluation.displacement_h[:, 1:, 0] - before)

        def balance_at(part: float, _: FloatArray, before: FloatArray = before, shift: FloatArray = shift) -> Balance:
            return Balance(joint, before + part * shift, worn)

        start = State(state.evaluation, before, 0.0)
        moved, arrived = follow_naturally(balance_at, start, 1.0, run, keep_history=True)
        if not arrived:
            break
        history = final_history(balance_at(1.0, before), moved.evaluation)
        state = State(moved.evaluation, history, state.parameter)
    return state

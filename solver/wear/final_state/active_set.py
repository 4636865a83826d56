"""The final state of a joint without slow time: pairs that slip under pressure are opened until no such pair is left.

In a final state every pair that slips carries no force. Many depths give such a state. A joint is cooperative where
wear at a pair only raises the wear rates of the others (`dg_i/dW_j >= 0`). Then a wear history of the unworn joint
leads to the least of these depths, whatever the wear law and its rates are: a pair that slips under pressure goes on
to slip, however deep the others are worn, until the pair carries no force.

So all pairs that slip under pressure are opened, and the state without these pairs is solved. This is repeated while
further pairs begin to slip; no pair comes back. The final depth of an opened pair is the depth at which the pair just
grazes: the largest closing displacement over a period minus the gap. The number of rounds is at most the number of
pairs.

The condition of a cooperative joint is tested at states between the unworn and the final one (`cooperation`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.contact.coulomb import SEPARATED
from solver.continuation.natural import follow_naturally
from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.harmonic_balance.state import State, final_history
from solver.model import BoolArray, FloatArray
from solver.newton.linear_solver import FORCING
from solver.settings import NEGLIGIBLE
from solver.structure.joint import Joint
from solver.wear.state import Reached, WearState
from solver.wear.step import held_wear
from solver.wear.wearing_joint import WearingJoint


class NoActiveSetError(Exception):
    """The active set gives no final state; the text is the reason."""


@dataclass(frozen=True)
class WornOff:
    """Result of an active set.

    state: state in which the worn pairs just graze.
    off (n_contact,): whether a pair is worn.
    n_rounds: number of rounds in which pairs were opened.
    """

    state: WearState
    off: BoolArray
    n_rounds: int


def least_rate(state: WearState, share: float) -> float:
    """Wear rate of a pair that counts as zero, m3 per cycle, as in `solver.wear.stop` and `WearingJoint.wears`."""
    largest = float(state.largest_rates[:-1].max(initial=0.0))
    return max(share**2 * largest, state.least_rate)


def wear_off(work: WearingJoint, state: WearState, unworn: FloatArray, off: BoolArray, share: float) -> WornOff:
    """Open pairs that slip under pressure until there is no such pair.

    Parameters
    ----------
    work, state
        The joint at its unworn state, or at a state with open worn pairs.
    unworn
        (n_contact,), m, depth of the unworn state.
    off
        (n_contact,), pairs that are worn already, whose depth is computed anew.
    share
        `settings.ToTheEnd.final_share`: below its square times the largest wear rate, nothing wears.

    Raises
    ------
    NoActiveSetError
        Where pairs have a constant normal force, or a state without the pairs is not found.
    """
    off, n_rounds = off.copy(), 0
    for _ in range(unworn.size + 2):
        begin = (state.rates[:-1] > least_rate(state, share)) & ~off
        if not begin.any() and (n_rounds > 0 or not off.any()):
            return WornOff(state, off, n_rounds)
        joint = work.at(state)
        if not joint.contact.has_normal[begin].all():
            raise NoActiveSetError("pairs slip whose normal force no wear changes")
        off, n_rounds = off | begin, n_rounds + 1
        point = without(work, state, unworn, off)
        depth = grazing_depth(joint, point.evaluation, unworn, off)
        held = Balance(joint, point.evaluation.history, depth)
        grazing = held.evaluate(held.predict(point.evaluation.displacement_h, point.evaluation.force_h))
        grazes = State(grazing, final_history(held, grazing))
        state = replace(
            work.accepted(state, Reached(grazes, state.omega, state.lag, state.half_width), 0.0),
            change=None,
            previous=None,
        )
    raise NoActiveSetError("pairs begin to slip without end")


def grazing_depth(joint: Joint, at: Evaluation, unworn: FloatArray, off: BoolArray) -> FloatArray:
    """Depth (n_contact,), m, at which the worn pairs `off` just graze; `unworn` for the others."""
    return np.where(off, np.maximum(closing(joint, at), unworn), unworn)


def closing(joint: Joint, at: Evaluation) -> FloatArray:
    """Depth (n_contact,), m, at which pairs just graze: largest closing displacement at a sample, minus the gap."""
    return np.asarray((at.displacement_h[:, 0] @ joint.basis.synthesis).max(axis=1) - joint.contact.gap)


def without(work: WearingJoint, state: WearState, unworn: FloatArray, off: BoolArray) -> State:
    """State in which the worn pairs `off` are open throughout the period. Raises NoActiveSetError."""
    joint, last = work.at(state), state.point
    rows = np.flatnonzero(joint.component_index % 3 == 0)
    stiffness = np.zeros(unworn.size)
    stiffness[joint.component_index[rows] // 3] = joint.structure.static_stiffness[rows, rows]
    forces = last.evaluation.force_h[:, 0, 0]
    overlap = np.divide(forces, stiffness, out=np.zeros_like(forces), where=stiffness > 0.0)
    grazing = np.maximum(closing(joint, last.evaluation), unworn)
    # a pair that grazes without force has no overlap
    least = NEGLIGIBLE * float(np.abs(grazing[off]).max(initial=0.0))
    # the pair has to remain open while others are opened: the result does not depend on the distance
    margin = 10.0 * max(unworn.size * float(overlap.max()), least)
    force_h = np.where(off[:, None, None], 0.0, last.evaluation.force_h)
    for _ in range(CONTINUATION.attempts):
        depth = np.where(off, np.maximum(closing(joint, last.evaluation), unworn) + margin, unworn)
        balance = Balance(joint, last.history, depth)
        start = balance.predict(last.evaluation.displacement_h, force_h)
        found = work.run.solve(balance, start)
        point = State(found.evaluation, last.history)
        if not found.converged:
            before = last.evaluation.wear_depth
            balance_at = held_wear(joint, before, np.where(off, np.maximum(depth - margin, before), before))
            near, arrived = follow_naturally(balance_at, replace(last, parameter=0.0), 1.0, work.run, keep_history=True)
            if not arrived:
                raise NoActiveSetError("without the pairs that slip under pressure no state was found")
            last, force_h = near, np.where(off[:, None, None], 0.0, near.evaluation.force_h)
            continue
        if (point.evaluation.status_t[off] == SEPARATED).all():
            # one more iteration: without it the depths of a sphere are 3e-6 off
            finer = work.run.to(FORCING * work.run.tolerance)
            exact = finer.solve(balance, found.evaluation.predicted_h)
            return State(exact.evaluation, last.history) if exact.converged else point
        margin *= 10.0
    raise NoActiveSetError("without the pairs that slip under pressure the joint does not bear its load")

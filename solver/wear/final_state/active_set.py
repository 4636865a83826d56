"""The final state of a joint without slow time: pairs that slip under pressure are opened until no such pair is left.

In a final state every pair that slips carries no force. Many depths give such a state. A joint is cooperative where
wear at a pair only raises the wear rates of the others (`dg_i/dW_j >= 0`). Then a wear history of the unworn joint
leads to the least of these depths, whatever the wear law and its rates are: a pair that slips under pressure goes on
to slip, however deep the others are worn, until the pair carries no force.

So all pairs that slip under pressure are opened, and the state without these pairs is solved. This is repeated while
further pairs begin to slip; no pair comes back. The final depth of an opened pair is the depth at which the pair just
grazes: the largest closing displacement over a period minus the gap. The number of rounds is at most the number of
pairs.

`not_cooperative` tests states between the unworn and the final one, at fractions of the final depths:

- No pair wears that is unworn in the final state.
- Every pair that is worn in the final state slips where the pair is pressed.
- By the exact derivatives, the wear of the other pairs at their present rates raises the wear rate of each pair, or
  reduces this rate by less than a fraction of the change by the wear of the pair itself:

      sum over j != i of dg_i/dW_j g_j  >=  - `LOSS_OF_RATE` |dg_i/dW_i| g_i.

- At the final depths nothing wears, and the worn pairs graze at equal depths with the friction that this history of
  states has left in the joint.

The condition `dg_i/dW_j >= 0` for all pairs would be too strict: next to a stick zone, a pair that takes over pressure
slips less at first and wears off all the same. The test covers some states only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.accuracy.options import ACCURACY
from solver.contact.coulomb import SEPARATED
from solver.continuation.natural import ATTEMPTS, follow_naturally
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.harmonic_balance.state import State, final_history
from solver.model import BoolArray, FloatArray
from solver.newton.linear_solver import FORCING
from solver.settings import NEGLIGIBLE
from solver.structure.joint import Joint
from solver.wear.jump import held_wear
from solver.wear.rate_slope import rate_changes
from solver.wear.state import WearState
from solver.wear.wearing_joint import WearingJoint

LOSS_OF_RATE = 0.5
"""Largest reduction of the wear rate of a pair by the wear of the others, over the change by its own wear. Above, the
pair may stick again. Cylinder in partial slip: the others add 0.4 to 0.9. Sphere: they reduce the rate by 0.2 at the
edge of the stick zone in the unworn state, and add later."""

TESTED_STATES = 3
"""Number of states from the unworn to the final one, the first included, at which the loss of rate is tested."""

SLOPE_RTOL = 1e-6
"""Relative residual of the steps of a derivative: with that of a Newton direction single entries are 0.6 % off."""


class NoActiveSetError(Exception):
    """The active set gives no final state; the text is the reason."""


@dataclass(frozen=True)
class WornOff:
    """A state in which the worn pairs `off` (n_contact,) just graze."""

    state: WearState
    off: BoolArray


def least_rate(state: WearState, share: float) -> float:
    """Wear rate of a pair that counts as zero, m3 per cycle, as in `integrate.is_over` and `WearState.wears`."""
    largest = float(state.largest_rates[:-1].max(initial=0.0))
    return max(share**2 * largest, state.least_rate)


def wear_off(work: WearingJoint, state: WearState, unworn: FloatArray, off: BoolArray, share: float) -> WornOff:
    """Open pairs that slip under pressure until there is no such pair.

    work, state: the joint at its unworn state, or at a state with open worn pairs.
    unworn (n_contact,): depth of the unworn state, m.
    off (n_contact,): pairs that are worn already, whose depth is computed anew.
    share: `settings.ToTheEnd.final_share`: below its square times the largest wear rate, nothing wears.

    Raises NoActiveSetError where pairs have a constant normal force, or a state without the pairs is not found.
    """
    for n_rounds in range(unworn.size + 2):
        begin = (state.rates[:-1] > least_rate(state, share)) & ~off
        if not begin.any() and (n_rounds > 0 or not off.any()):
            return WornOff(state, off)
        joint = work.at(state)
        if not joint.contact.has_normal[begin].all():
            raise NoActiveSetError("pairs slip whose normal force no wear changes")
        off = off | begin
        point = without(work, state, unworn, off)
        at = point.evaluation
        balance = Balance(joint, at.history, grazing_depth(joint, at, unworn, off))
        grazing = balance.evaluate(balance.predict(at.displacement_h, at.force_h))
        grazes = State(grazing, final_history(balance, grazing))
        state = work.noted(replace(state, point=grazes, change=None, previous=None))
    raise NoActiveSetError("pairs begin to slip without end")


def grazing_depth(joint: Joint, at: Evaluation, unworn: FloatArray, off: BoolArray) -> FloatArray:
    """Depth (n_contact,), m, at which the worn pairs `off` just graze, at least `unworn`; `unworn` for the others.

    A pair grazes at the largest closing displacement at a sample, minus the gap.
    """
    closing = (at.displacement_h[:, 0] @ joint.basis.synthesis).max(axis=1) - joint.contact.gap
    return np.where(off, np.maximum(closing, unworn), unworn)


def without(work: WearingJoint, state: WearState, unworn: FloatArray, off: BoolArray) -> State:
    """State in which the worn pairs `off` are open throughout the period. Raises NoActiveSetError."""
    joint, last = work.at(state), state.point
    margin = _margin(joint, last.evaluation, unworn, off)
    force_h = np.where(off[:, None, None], 0.0, last.evaluation.force_h)
    for _ in range(ATTEMPTS):
        depth = grazing_depth(joint, last.evaluation, unworn, off) + np.where(off, margin, 0.0)
        balance = Balance(joint, last.history, depth)
        found = work.run.solve(balance, balance.predict(last.evaluation.displacement_h, force_h))
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


def _margin(joint: Joint, at: Evaluation, unworn: FloatArray, off: BoolArray) -> float:
    """Opening of the worn pairs, m, with which they remain open while others are opened; no result depends on it."""
    rows = np.flatnonzero(joint.component_index % 3 == 0)
    stiffness = np.zeros(unworn.size)
    stiffness[joint.component_index[rows] // 3] = joint.structure.static_stiffness[rows, rows]
    forces = at.force_h[:, 0, 0]
    overlap = np.divide(forces, stiffness, out=np.zeros_like(forces), where=stiffness > 0.0)
    # a pair that grazes without force has no overlap
    least = NEGLIGIBLE * float(np.abs(grazing_depth(joint, at, unworn, off)[off]).max(initial=0.0))
    return 10.0 * max(unworn.size * float(overlap.max()), least)


def not_cooperative(work: WearingJoint, unworn: WearState, final: WornOff, share: float) -> str:
    """Reason why the final state of an active set may differ from that of a wear history; empty if all tests hold.

    unworn: first state of a history, with the harmonics and samples of the final state.
    """
    joint, run = work.at(unworn), work.run.fresh()
    before, after = unworn.depth, final.state.depth
    balance_at, point = held_wear(joint, before, after), replace(unworn.point, parameter=0.0)
    largest = np.zeros(before.size)
    for place in range(TESTED_STATES + 1):
        fraction = place / TESTED_STATES
        where = f"at {100 * fraction:.0f} % of the final depths"
        point, arrived = follow_naturally(balance_at, point, fraction, run)
        if not arrived:
            return f"the vibration does not go on to {100 * fraction:.0f} % of the final depths"
        at = point.evaluation
        # of each pair, m3 per cycle
        rate = work.rate(at) * work.area
        largest = np.maximum(largest, rate)
        floor = max(least_rate(final.state, share), share**2 * float(largest.max(initial=0.0)))
        if fraction == 1.0:
            if (rate > np.maximum(share * largest, floor)).any():
                return "pairs still wear at the final depths, which the vibration comes to in another state"
            free = without(work, replace(unworn, point=point), before, final.off)
            apart = float(np.abs(grazing_depth(joint, free.evaluation, before, final.off) - after).max(initial=0.0))
            if apart > ACCURACY.negligible * work.case.settings.rtol * float(after.max(initial=0.0)):
                return f"residual shear makes the depths depend on the way to them, by {apart:.2g} m or more"
            return ""
        wears, normal = rate > floor, at.force_h[:, 0, 0]
        if (wears & ~final.off).any():
            return f"{where} pairs wear that do not in the end"
        pressed = normal > share * float(normal.max(initial=0.0))
        if (final.off & pressed & ~wears).any():
            return f"{where} pairs stick under pressure that wear before"
        depth_rate = np.where(wears, rate, 0.0) / work.area
        wearing, wearing_pairs = replace(work.wearing, depth_held=True), np.diag(depth_rate)[wears]
        changes = rate_changes(joint, at, work.gain(1.0), wearing, wearing_pairs, run, SLOPE_RTOL)[:, wears]
        own = np.diagonal(changes)
        if (changes.sum(axis=0) - own < -LOSS_OF_RATE * np.abs(own)).any():
            return f"{where} the wear of some pairs takes that of others"
    return ""

"""Test whether a joint is cooperative (wear at a pair lets the others wear on), as an active set requires.

The test uses states between the unworn and the final one, at fractions of the final depths. Conditions at each state:

- No pair wears that is unworn in the final state.
- Every pair that is worn in the final state slips where the pair is pressed.
- By the exact derivatives, the wear of the other pairs at their present rates raises the wear rate of each pair, or
  reduces this rate by less than a fraction of the change by the wear of the pair itself:

      sum over j != i of dg_i/dW_j g_j  >=  - `loss_of_rate` |dg_i/dW_i| g_i.

Conditions at the final depths: nothing wears, and the worn pairs graze at equal depths with the friction that this
history of states has left in the joint.

The condition `dg_i/dW_j >= 0` for all pairs would be too strict: next to a stick zone, a pair that takes over pressure
slips less at first and wears off all the same. The test covers some states only.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.accuracy.options import ACCURACY
from solver.contact.wear_law import WearingWork
from solver.continuation.natural import follow_naturally
from solver.harmonic_balance.dlft import Balance, Evaluation, worn_by
from solver.model import FloatArray, IntArray
from solver.newton.run import Run
from solver.structure.joint import Joint
from solver.wear.final_state.active_set import WornOff, grazing_depth, least_rate, without
from solver.wear.options import WEAR
from solver.wear.state import WearState
from solver.wear.step import held_wear
from solver.wear.wearing_joint import WearingJoint

_RTOL = 1e-6
"""Relative residual of the steps of a derivative: with that of a Newton direction single entries are 0.6 % off."""


def work_slopes(joint: Joint, at: Evaluation, wearing: WearingWork, run: Run, pairs: IntArray) -> FloatArray:
    """Derivatives (n_contact, n_pairs), J/m, of the wearing work of all pairs with respect to the depths of some pairs.

    From the balance `R(p, W) = 0`, the predicted force follows a depth as `dp = -J^-1 Z E dW`, with E the static normal
    displacements. The dependence of a tabulated wear law itself on the depth is neglected.
    """
    tangent = Balance(joint, at.history, at.wear_depth).linearise(at)
    force_tangent, slip_work_tangent = joint.law.tangent(at)
    by_work, by_force, _ = wearing.slopes(*worn_by(at))
    row = by_work[:, None] * slip_work_tangent + by_force[:, None] * force_tangent[:, 0, :]
    found = np.zeros((joint.contact.n_contact, pairs.size))
    for place, pair in enumerate(pairs):
        moved = np.zeros_like(at.displacement_h)
        moved[pair, 0, 0] = 1.0
        step = run.solver.solve(tangent, -joint.structure.apply(joint.to_relative(moved)), _RTOL)
        found[:, place] = (row * joint.to_pairs(step).reshape(joint.contact.n_contact, -1)).sum(axis=1)
    return found


def failure(work: WearingJoint, unworn: WearState, final: WornOff, share: float) -> str:
    """Reason why the final state of an active set may differ from that of a wear history; empty if all tests hold.

    unworn: first state of a history, with the harmonics and samples of the final state.
    """
    joint, run = work.at(unworn), work.run.fresh()
    before, after = unworn.depth, final.state.depth
    balance_at, point = held_wear(joint, before, after), replace(unworn.point, parameter=0.0)
    largest = np.zeros(before.size)
    for place in range(WEAR.tested_states + 1):
        fraction = place / WEAR.tested_states
        point, arrived = follow_naturally(balance_at, point, fraction, run)
        if not arrived:
            return f"the vibration does not go on to {100 * fraction:.0f} % of the final depths"
        at = point.evaluation
        # of each pair, m3 per cycle
        rate = work.wear_coefficient * work.wearing.work(*worn_by(at))
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
        wears = rate > floor
        where = f"at {100 * fraction:.0f} % of the final depths"
        if (wears & ~final.off).any():
            return f"{where} pairs wear that do not in the end"
        normal = at.force_h[:, 0, 0]
        pressed = normal > share * float(normal.max(initial=0.0))
        if (final.off & pressed & ~wears).any():
            return f"{where} pairs stick under pressure that wear before"
        pairs = np.flatnonzero(wears)
        slopes = work_slopes(joint, at, work.wearing, run, pairs)[pairs]
        depth_rate = rate[pairs] / joint.contact.area[pairs]
        own = np.abs(np.diagonal(slopes)) * depth_rate
        np.fill_diagonal(slopes, 0.0)
        if (slopes @ depth_rate < -WEAR.loss_of_rate * own).any():
            return f"{where} the wear of some pairs takes that of others"
    return ""

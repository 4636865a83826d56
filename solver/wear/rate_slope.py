"""Derivative of the wear rates of a state with respect to the depths of the pairs, at a given tangential history.

The motion follows the depth as dp = -J^-1 Z E dW, where E puts the depths into the static normal displacements, and the
rates follow the motion as dg = G dp. A table of factors adds its own derivative with respect to the depth.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.contact.wear_law import WearingWork
from solver.harmonic_balance.dlft import Balance, Evaluation, worn_by
from solver.model import BoolArray, FloatArray
from solver.newton.run import Run
from solver.structure.joint import Joint


def rate_slope(
    joint: Joint, at: Evaluation, gain: FloatArray, wearing: WearingWork, pairs: BoolArray, run: Run
) -> FloatArray:
    """Derivative dg/dW (n_contact, n_contact), 1 per cycle; column: pair whose depth changes.

    Parameters
    ----------
    joint, at
        The joint and its converged state.
    gain
        (n_contact,), growth of the depth per wearing work in one cycle, m/J.
    wearing
        Part of the slip work that wears.
    pairs
        (n_contact,), the pairs whose depths change; the columns of all others are 0.
    run
        Solves with the Jacobian of the state.
    """
    balance = Balance(joint, at.history, at.wear_depth)
    plain = balance.linearise(at)
    growth = replace(balance, wear_gain=gain, wearing=replace(wearing, depth_held=True)).linearise(at).growth_tangent
    slope = np.diag(gain * wearing.slopes(*worn_by(at))[2] * pairs)
    normal = np.flatnonzero((joint.component_index % 3 == 0) & pairs[joint.component_index // 3])
    if not normal.size:
        # nothing acts back on a constant normal force
        return slope
    rights = np.zeros((normal.size, *at.predicted_h.shape))
    rights[:, :, 0] = -joint.structure.static_stiffness[:, normal].T
    for row, step in zip(normal, run.solver.solve_all(plain, rights), strict=True):
        moved = joint.to_pairs(step).reshape(growth.shape)
        slope[:, joint.component_index[row] // 3] += (growth * moved).sum(axis=1)
    return slope

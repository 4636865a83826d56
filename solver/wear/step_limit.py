"""Whether a step on the slow time scale is a result: by how much of the preload it moves.

Worn depth lets the parts come nearer to each other where it is uniform, and takes the load off a pair where it is not.
What a step wears is no result where that would move many times all normal forces at once: an explicit step then
wears by a wear rate that its pairs had long lost, and an implicit one by one that they have only where they are left.
The share is that of the linear static structure, with the tangents of pairs that slip free: it asks nothing of the
vibration, which may change at will where a branch ends, and it is zero where wear does not act back on the joint.
"""

from __future__ import annotations

import numpy as np

from solver.contact.coulomb import SEPARATED, STICK
from solver.harmonic_balance.dlft import Evaluation
from solver.model import BoolArray, FloatArray
from solver.structure.joint import Joint

LARGEST = (
    10.0  # of the normal forces, in their norm: with less, the error of the worn volume tells (measured: 27 % with 0.6)
)
SURE = 0.5  # of this, with all tangents held: then nothing need be followed
USEFUL = 0.1  # the same of a step that is advised: the usual one of the dovetail root moves 0.001 to 0.01


class StepTooLongError(Exception):
    """A step wears off so much that its end is no result; what the step would have to be."""


def moved_share(joint: Joint, before: Evaluation, wear_depth: FloatArray) -> float:
    """Share of the mean normal forces, in their norm, that wear down to `wear_depth` (n_contact,), m, moves.

    before: state at the start of the step. Pairs that are open all period long carry nothing and hold nothing, tangents
    of pairs that slip follow.
    """
    normal, free, worn, preload = _parts(joint, before, wear_depth)
    stiffness = joint.structure.static_stiffness
    force = stiffness @ worn
    if free.any():
        # a root that is free to slide along its slot has no stiffness there, and no force either
        followed = np.linalg.lstsq(stiffness[np.ix_(free, free)], force[free])[0]
        force = force - stiffness[:, free] @ followed
    moved = float(np.linalg.norm(force[normal]))
    return moved / preload if preload > 0.0 else 0.0


def _parts(joint: Joint, before: Evaluation, wear_depth: FloatArray) -> tuple[BoolArray, BoolArray, FloatArray, float]:
    """Rows of pressed normals, rows that follow, worn depth on the rows, m, and norm of the normal forces, N."""
    pair, component = joint.component_index // 3, joint.component_index % 3
    stuck = (before.status_t == STICK).all(axis=1)
    opened = (before.status_t == SEPARATED).all(axis=1)
    free = np.where(component == 0, opened[pair], ~stuck[pair])
    normal = (component == 0) & ~free
    preload = float(np.linalg.norm(before.force_h[pair[normal], 0, 0]))
    return normal, free, np.where(normal, (wear_depth - before.wear_depth)[pair], 0.0), preload


def check_step(joint: Joint, before: Evaluation, wear_depth: FloatArray, cycle: float, length: float) -> None:
    """Raises StepTooLongError where a step of `length` cycles, or a jump, wears down to a depth that is no result.

    before: state at the start of the step, at the count `cycle`. wear_depth (n_contact,): m, at its end.
    """
    normal, _, worn, preload = _parts(joint, before, wear_depth)
    if np.linalg.norm((joint.structure.static_stiffness @ worn)[normal]) <= SURE * LARGEST * preload:
        return
    share = moved_share(joint, before, wear_depth)
    if share > LARGEST:
        advised = length * USEFUL / share
        raise StepTooLongError(
            f"wearing on for {length:.3g} cycles at once from cycle {cycle:.6g} on moves {share:.2g} times the normal"
            f" forces of the joint: use steps of at most {advised:.2g} cycles"
        )

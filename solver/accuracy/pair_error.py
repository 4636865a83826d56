"""What the slip work of single pairs is wrong by: those at the edge of a slip zone by far more than all together."""

from __future__ import annotations

import numpy as np

from solver.accuracy.harmonic_levels import n_unknowns, room_for, shifted
from solver.accuracy.options import ACCURACY
from solver.harmonic_balance.converged import PathPoint
from solver.model import FloatArray
from solver.newton.solve_balance import Effort, move_point
from solver.structure.joint import Case, Joint


def slip_work_error(case: Case, joint: Joint, point: PathPoint, effort: Effort) -> FloatArray:
    """Change (n_contact,) of the slip work, J per cycle, with more harmonics and samples, or fewer where they are many.

    Zero where there are none to compare with.
    """
    evaluation = point.evaluation
    n_rel = joint.component_index.size
    costly = n_unknowns(case.resolution, n_rel) > room_for(ACCURACY.costly_unknowns, n_rel)
    wanted = shifted(case.resolution, -1 if costly else 2)
    if wanted == case.resolution or not case.model.holds(wanted.highest):
        return np.zeros(evaluation.slip_work.shape)
    other = case.at(wanted)
    moved = move_point(case, other, other.joint(joint.omega, joint.excitation_amplitude), point, effort)
    if moved is None:
        return np.zeros(evaluation.slip_work.shape)
    change: FloatArray = np.abs(moved.evaluation.slip_work - evaluation.slip_work)
    return change

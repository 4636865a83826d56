"""Branches followed by arc length through their folds."""

import numpy as np
import pytest

from solver.continuation.arc_length import Arc
from solver.continuation.natural import follow_naturally
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import State
from solver.newton.run import Run
from solver.settings import SolverSettings
from solver.structure.joint import build_case
from tests.solver.models import crossings, first_point, scene
from tests.solver.test_natural import GRAZING, TOLERANCE, WALL_OMEGA, wall


def upper_branch_size(amplitude):
    """Motion on the branch with impacts, along the frequency: a path that avoids the fold."""
    case = build_case(scene("vibro_impact"), 0.0, WALL_OMEGA, SolverSettings(5, 64))
    idle = np.zeros(1)

    def balance_at(omega, history):
        return Balance(case.joint(omega, amplitude), history, idle)

    found = first_point(case, 0.9, amplitude, idle)
    point = State(found.evaluation, found.history, 0.9)
    for omega in np.linspace(0.95, WALL_OMEGA, 6):
        point, arrived = follow_naturally(balance_at, point, float(omega), Run(TOLERANCE))
        assert arrived
    structure = case.joint(WALL_OMEGA, amplitude).structure
    response = structure.response_h(point.evaluation.displacement_h[0, :1])
    return float(np.hypot(response[0, 1], response[0, 2]))


def test_arc_length_goes_through_both_folds_to_the_other_branch():
    balance_at, first, size = wall(WALL_OMEGA)
    arc = Arc(balance_at, first(0.03), 0.03, Run(TOLERANCE))
    folds, farthest = [], 0.03
    for before, reached, fold in arc.steps(1.0):
        farthest = min(farthest, reached.parameter)
        if fold is not None:
            folds.append(fold.parameter)
        if before.parameter < 0.06 <= reached.parameter:
            break
    assert len(folds) == 2
    assert folds[0] == pytest.approx(GRAZING, rel=0.01, abs=0.0)
    # back behind the start on the unstable branch between
    assert farthest < 0.02
    point = next(crossings(arc, 0.06))
    assert point.parameter == 0.06
    assert point.evaluation.scaled_residual() <= TOLERANCE
    assert size(point) == pytest.approx(upper_branch_size(0.06), rel=1e-6, abs=0.0)

"""Branches followed by arc length through their folds."""

from functools import lru_cache

import numpy as np
import pytest

from solver.continuation.arc_length import ARC_CORRECTORS, Arc, follow_arc
from solver.continuation.natural import follow_naturally
from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import State
from solver.newton.run import Budget, Run
from solver.settings import SolverSettings
from solver.structure.joint import build_case
from tests.solver.models import first_point, scene
from tests.solver.test_natural import GRAZING, TOLERANCE, WALL_OMEGA, wall


@lru_cache
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
    visited: list[float] = []

    def watched(amplitude, history):
        visited.append(amplitude)
        return balance_at(amplitude, history)

    start = first(0.03)
    result = follow_arc(Arc(watched, start, 0.03, Run(TOLERANCE)), 0.06)
    point = result.state
    assert len(result.folds) == 2
    assert result.folds[0] == pytest.approx(GRAZING, rel=0.01, abs=0.0)
    assert point.parameter == 0.06
    assert point.evaluation.scaled_residual() <= TOLERANCE
    assert size(point) == pytest.approx(upper_branch_size(0.06), rel=1e-6, abs=0.0)
    # back behind the start on the unstable branch between
    assert min(visited) < 0.02


@pytest.mark.slow
def test_arc_length_gives_up_where_the_branch_does_not_reach_the_target():
    balance_at, first, _ = wall(0.5)
    budget = Budget()
    result = follow_arc(Arc(balance_at, first(0.01), 0.01, Run(TOLERANCE, budget)), np.inf)
    assert result.state is None
    assert budget.iterations <= ARC_CORRECTORS * CONTINUATION.near_iterations


def test_arc_length_does_not_go_on_where_stability_is_lost_without_a_fold():
    """No slow change of the parameter leads to what the branch comes to beyond the target."""
    balance_at, first, _ = wall(0.9)
    spent, farthest = [], []
    for beyond in (True, False):
        visited: list[float] = []
        budget = Budget()

        def watched(amplitude, history, visited=visited):
            visited.append(amplitude)
            return balance_at(amplitude, history)

        arc = Arc(watched, first(0.01), 0.02, Run(TOLERANCE, budget))
        result = follow_arc(arc, 0.03, lambda _: False, beyond=beyond)
        assert result.state is None
        spent.append(budget.iterations)
        farthest.append(max(visited))
    assert farthest[1] < 0.05 < farthest[0]
    assert spent[1] < 0.5 * spent[0]

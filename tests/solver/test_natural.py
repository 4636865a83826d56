"""Continuation along a parameter: natural steps and the history that they leave, arc length through folds."""

import numpy as np
import pytest

from solver.continuation.arc_length import Arc
from solver.continuation.natural import follow_naturally
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import State, final_history
from solver.newton.run import Run
from solver.settings import SolverSettings
from solver.structure.joint import build_case
from tests.solver.models import OMEGA, crossings, first_point, random_model, scene

TOLERANCE = 1e-9
WALL_OMEGA = 1.2  # rad/s; without the wall the mass reaches it at 0.1 |1 - 1.2^2 + 0.06i| = 0.0444 N
GRAZING = 0.1 * abs(1 - WALL_OMEGA**2 + 0.05j * WALL_OMEGA)


def wall(omega):
    """Vibro-impact along the excitation amplitude: balances, a state found from nothing, and the motion of the mass."""
    case = build_case(scene("vibro_impact"), 0.0, WALL_OMEGA, SolverSettings(5, 64))
    idle = np.zeros(1)

    def balance_at(amplitude, history):
        return Balance(case.joint(omega, amplitude), history, idle)

    def first(amplitude):
        found = first_point(case, omega, amplitude, idle)
        return State(found.evaluation, found.history, amplitude)

    def size(point):
        structure = case.joint(omega, point.parameter).structure
        response = structure.response_h(point.evaluation.displacement_h[0, :1])
        return float(np.hypot(response[0, 1], response[0, 2]))

    return balance_at, first, size


@pytest.mark.parametrize(("start", "target"), [(0.01, 0.06), (0.06, 0.01)])
def test_a_natural_step_reaches_its_target_from_either_side(start, target):
    balance_at, first, size = wall(0.5)
    point, arrived = follow_naturally(balance_at, first(start), target, Run(TOLERANCE))
    assert arrived
    assert point.parameter == target
    assert point.evaluation.scaled_residual() <= TOLERANCE
    # below the gap the mass does not feel the wall
    assert size(point) == pytest.approx(target / abs(1 - 0.25 + 0.025j), rel=1e-7, abs=0.0)


def test_natural_steps_end_before_a_fold_and_say_so():
    balance_at, first, size = wall(WALL_OMEGA)
    point, arrived = follow_naturally(balance_at, first(0.03), 0.06, Run(TOLERANCE))
    assert not arrived
    # the branch without impacts ends where the mass reaches the wall; 1/64 of the range is the shortest step
    assert point.parameter == pytest.approx(GRAZING, abs=2 * 0.03 / 64)
    assert point.evaluation.scaled_residual() <= TOLERANCE
    assert size(point) == pytest.approx(0.1, rel=0.02, abs=0.0)


def test_history_is_handed_on():
    case = build_case(random_model(1, ("3d", "3d")), 0.4, OMEGA, SolverSettings(3, 64))
    idle = np.zeros(2)

    def balance_at(amplitude, history):
        return Balance(case.joint(OMEGA, amplitude), history, idle)

    found = first_point(case, OMEGA, 20.0, idle)
    start = State(found.evaluation, found.history, 20.0)
    assert start.history.any()
    point, arrived = follow_naturally(balance_at, start, 80.0, Run(TOLERANCE))
    assert arrived
    assert not np.array_equal(point.history, start.history)
    balance = balance_at(80.0, point.evaluation.history)
    assert np.array_equal(point.history, final_history(balance, point.evaluation))


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
        folds.extend([] if fold is None else [fold.parameter])
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

"""Steps along a parameter: natural ones and the history that they leave, the rule for their lengths."""

import numpy as np
import pytest

from solver.continuation.natural import LARGEST_STEP_RATIO, STEP_SAFETY, Lengths, follow_naturally, take_step
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import Failure, State, final_history
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import SolverSettings
from solver.structure.joint import build_case
from tests.solver.models import OMEGA, first_point, random_model, scene

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


class Line:
    """Steps that are found up to a length, with an error of a given order; where none is found, a failure."""

    def __init__(self, found_to=10.0, allowed=1.0, order=2):
        self.found_to, self.allowed, self.order = found_to, allowed, order
        self.tried: list[float] = []

    def attempt(self, here, length):
        self.tried.append(length)
        return here + length if length <= self.found_to else None

    def judge(self, _, __, length):
        return (length / self.allowed) ** self.order

    def rescue(self, _, length):
        return Failure(Outcome.BRANCH_LOST, f"{length:g}")


@pytest.mark.parametrize("order", [1, 2])
def test_the_next_step_is_as_long_as_allowed_but_for_a_safety(order):
    lengths = Lengths(order)
    end, ahead = take_step(Line(allowed=0.8, order=order), 2.0, 0.6, lengths)
    assert end == 2.6
    assert ahead == pytest.approx(STEP_SAFETY * 0.8)
    _, ahead = take_step(Line(allowed=100.0, order=order), 2.0, 0.6, lengths)
    assert ahead == pytest.approx(LARGEST_STEP_RATIO * 0.6)


def test_a_refused_step_is_made_again_as_long_as_allowed():
    line = Line(allowed=0.5)
    end, _ = take_step(line, 0.0, 1.0, Lengths(2))
    assert line.tried == pytest.approx([1.0, 0.5 * STEP_SAFETY])
    assert end == line.tried[-1]


def test_a_step_that_is_not_found_is_shortened_and_rescued_at_last():
    line = Line(found_to=0.1)
    assert take_step(line, 0.0, 1.0, Lengths(2, rescue=0.05))[0] == 0.0625
    assert line.tried == [1.0, 0.25, 0.0625]
    line = Line(found_to=0.0)
    failure = take_step(line, 0.0, 1.0, Lengths(2, rescue=0.2))
    assert failure == Failure(Outcome.BRANCH_LOST, "0.2")
    assert line.tried == [1.0, 0.25, 0.2]


def test_no_step_is_shorter_than_the_shortest():
    line = Line(allowed=0.1)
    failure = take_step(line, 0.0, 1e-3, Lengths(2, shortest=0.5))
    assert isinstance(failure, Failure)
    assert line.tried == [0.5]

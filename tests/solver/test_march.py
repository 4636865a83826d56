"""One step along a line: accepted, refused, shortened, or left to the rescue; and the rule for its length."""

import pytest

from solver.harmonic_balance.state import Failure
from solver.march.steps import LARGEST_STEP_RATIO, STEP_SAFETY, Lengths, take_step
from solver.outcome import Outcome


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

"""How far a history went that ended early, in words."""

import math

import pytest

from studyrunner.plan.point_text import describe_reach


@pytest.mark.parametrize(
    ("error", "said"),
    [(0.05, "computed up to cycle 2000 of 100 000, the worn volume there to 5 %"), (0.0, ""), (math.inf, "")],
)
def test_a_volume_that_is_known_comes_with_its_error(error, said):
    reached = describe_reach(2000.0, 1e5, error)
    assert reached == (said or "computed up to cycle 2000 of 100 000")

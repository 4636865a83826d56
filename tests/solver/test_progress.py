"""Lines about how far a computation is."""

import numpy as np
import pytest

from solver import Block, arguments, backbone, frequency_response, integrate_mission, march_wear
from solver.loading_history.start_states import FrequencySweep
from solver.model import with_friction
from solver.settings import SolverSettings, WearTarget
from solver.wear.history import integrate_together
from solver.wear.wearing_joint import WearRequest
from tests.solver.models import scene


@pytest.fixture
def lines(monkeypatch):
    monkeypatch.setattr(arguments, "SECONDS_A_LINE", 0.0)
    return list[str]()


def test_long_work_says_where_it_is(lines):
    model = scene("sdof_slider")
    frequency_response(model, [150.0, 160.0], 10.0, 0.5, progress=lines.append)
    assert [line for line in lines if line.endswith(" Hz")]
    lines.clear()
    march_wear(model, 160.0, 10.0, 0.5, 1e-11, 1e4, progress=lines.append)
    counts = [float(line.removeprefix("cycle ")) for line in lines if line.startswith("cycle ")]
    assert max(counts) >= 1e4
    lines.clear()
    blocks = [Block(scene("sdof_slider", damping=10.0), 160.0, 10.0, 0.5, 100.0)]
    integrate_mission(blocks, 1e-12, 2, progress=lines.append)
    assert {"mission 1", "mission 2"} <= set(lines)
    lines.clear()
    backbone(model, np.array([3e-3]), 0.5, sweep="down", progress=lines.append)
    assert lines


@pytest.mark.parametrize("until", [None, WearTarget("wear_depth", 1e-6)])
def test_a_history_says_how_far_its_solutions_are(until):
    """Of one to a target: by the wear where this comes before the last count."""
    model, told = with_friction(scene("sdof_slider"), 0.5), list[tuple[str, int, float]]()
    _, start = next(FrequencySweep(model, 10.0, "up", SolverSettings()).states(np.array([160.0])))
    request = WearRequest(1e-11, None, np.linspace(0.0, 1e5, 3), until=until)
    next(integrate_together(model, SolverSettings(), start, [request], report=lambda *said: told.append(said)))
    numbers, shares = [number for _, number, _ in told], [number + share for _, number, share in told]
    assert set(numbers) == {0, 1}
    assert shares == sorted(shares)
    assert shares[0] < 0.1
    assert shares[-1] == 2.0
    assert told[-1][0].startswith("reference solution, cycle ")
    assert max(share for _, number, share in told if number == 0) == 1.0


def test_there_is_no_line_where_nobody_waits():
    lines = list[str]()
    march_wear(scene("sdof_slider"), 160.0, 1.0, 0.5, 1e-11, 1e3, progress=lines.append)
    assert lines == []

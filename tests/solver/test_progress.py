"""Lines about how far a computation is."""

import numpy as np
import pytest

from solver import Block, arguments, backbone, frequency_response, integrate_mission, march_wear
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


def test_a_mode_says_where_it_is(lines):
    backbone(scene("sdof_slider"), np.array([3e-3]), 0.5, sweep="down", progress=lines.append)
    assert lines


def test_there_is_no_line_where_nobody_waits():
    lines = list[str]()
    march_wear(scene("sdof_slider"), 160.0, 1.0, 0.5, 1e-11, 1e3, progress=lines.append)
    assert lines == []

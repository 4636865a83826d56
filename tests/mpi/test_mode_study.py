"""Nonlinear modes on several ranks, killed and gone on."""

import contextlib
import os
import signal

import pytest
import xarray as xr

from tests.mpi.launching import count_rows, results, run_to_end

STUDY = """
[study]
name = "modes"
[scene]
model = "sdof_slider"
[axes]
modal_amplitude = {start = 2e-5, stop = 1e-3, num = 5, spacing = "log"}
sweep = "down"
friction_coefficient = [0.4, 0.6]
"""

pytestmark = [pytest.mark.slow, pytest.mark.mpi]


@pytest.fixture(scope="module")
def arguments(tmp_path_factory):
    path = tmp_path_factory.mktemp("study") / "modes.toml"
    path.write_text(STUDY, encoding="utf-8")
    return ["-m", "studyrunner.cli", str(path), "-o", "out.nc"]


@pytest.fixture(scope="module")
def alone(arguments, tmp_path_factory):
    """The result of one process without a launcher."""
    folder = tmp_path_factory.mktemp("alone")
    assert run_to_end(0, arguments, folder).status == 0
    return results(folder / "out.nc")


def test_a_run_that_is_killed_keeps_its_points_and_goes_on(arguments, alone, tmp_path):
    """With the result of one rank, on three, of which one has nothing to do."""

    def kill(running):
        assert running.reaches(lambda: count_rows("start_states", tmp_path / "out.nc") > 2), running.said
        with contextlib.suppress(ProcessLookupError, KeyError):
            os.kill(running.ranks()[1], signal.SIGKILL)

    assert run_to_end(2, arguments, tmp_path, disturb=kill).status != 0
    assert count_rows("start_states", tmp_path / "out.nc") > 2
    ended = run_to_end(3, arguments, tmp_path)
    assert ended.status == 0, ended.said
    xr.testing.assert_identical(results(tmp_path / "out.nc"), alone)

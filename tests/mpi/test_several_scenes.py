"""Studies of several scenes on several ranks: built side by side, killed and gone on."""

import contextlib
import os
import signal

import pytest
import xarray as xr

from tests.mpi.launching import count_rows, results, run_to_end

STUDY = (
    *("-m", "studyrunner.cli", "sdof_slider"),
    *("--set", "axes.frequency=160"),
    *("--set", "axes.scheme=implicit"),
    *("--set", "axes.stiffness=[1.6e5, 1.65e5, 1.7e5]"),
    *("--set", "scatter={samples = 2, friction_coefficient = {normal = {std = 0.03}}, mass = {normal = {std = 1e-3}}}"),
    *("--set", "solver.harmonics=3"),
    *("--set", "solver.samples=32"),
    *("--set", "slow_time.cycles=2000"),
    *("--set", "slow_time.outputs=3"),
)
"""Six scenes, of which each rank holds two at most."""


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The result of one process without a launcher."""
    folder = tmp_path_factory.mktemp("alone")
    assert run_to_end(0, [*STUDY, "-o", "out.nc"], folder).status == 0
    found = results(folder / "out.nc")
    assert found.worn_volume.sizes["stiffness"] * found.worn_volume.sizes["sample"] == 6
    assert (found.outcome == 0).all()
    return found


def test_a_run_that_is_killed_twice_goes_on_to_the_same_result(alone, tmp_path):
    """Once when some of the scenes are built, then when some of the histories are there; at last on three ranks."""
    for table, victim in (("computed", 1), ("results", 0)):

        def kill(running, table=table, victim=victim):
            assert running.reaches(lambda: count_rows(table, tmp_path / "out.nc") > 0), running.said
            with contextlib.suppress(ProcessLookupError, KeyError):
                os.kill(running.ranks()[victim], signal.SIGKILL)

        assert run_to_end(2, [*STUDY, "-o", "out.nc"], tmp_path, disturb=kill).status != 0
        assert count_rows(table, tmp_path / "out.nc") > 0
    ended = run_to_end(3, [*STUDY, "-o", "out.nc"], tmp_path)
    assert ended.status == 0, ended.said
    xr.testing.assert_identical(results(tmp_path / "out.nc"), alone)

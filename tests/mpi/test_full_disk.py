"""A full disk: one line says so, what was finished is kept, and the run goes on when there is room."""

import subprocess
from pathlib import Path

import pytest
import xarray as xr

from tests.mpi.launching import CHEAP, FAKED, count_entries, fake_here, mounted, results, run_to_end

STUDY = [
    FAKED,
    *CHEAP,
    *("--set", "axes.frequency={start = 100, stop = 139, num = 40}"),
    *("--set", "axes.scheme=implicit"),
]


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 12 MB; a start state of the stand-in takes 0.8 MB."""
    with mounted(tmp_path / "disk", "size=12m") as folder:
        yield folder


def test_a_full_disk_costs_nothing_that_was_finished(small_disk, tmp_path):
    environment = {"FAKE_SECONDS": "0.005", "FAKE_STEPS": "2"}
    target = str(small_disk / "out.nc")
    ended = run_to_end(2, [*STUDY, "-o", target], tmp_path, environment)
    assert ended.status == 1
    (line,) = [line for line in ended.said.splitlines() if line.startswith("run-study: ")]
    assert "No space left on device: make room there" in line
    assert "Traceback" not in ended.said
    assert not (small_disk / "out.nc").exists()
    kept = count_entries("start", Path(target))
    assert kept > 0
    # as full as it is the run ends at once: without room for a trial before anything is computed
    again = run_to_end(2, [*STUDY, "-o", target], tmp_path, environment)
    assert again.status in (1, 2)
    assert "No space left on device" in again.said
    subprocess.run(["mount", "-o", "remount,size=100m", str(small_disk)], check=True)
    assert fake_here([*STUDY, "-o", target], tmp_path, environment) == 0
    assert count_entries("start", Path(target)) >= kept
    assert fake_here([*STUDY, "-o", "whole.nc"], tmp_path, environment) == 0
    xr.testing.assert_identical(results(Path(target)), results(tmp_path / "whole.nc"))

"""A task whose process crashes costs one run and its own points, nothing else."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from studyrunner.evaluate import CRASHED
from tests.mpi.launching import CHEAP, FAKED, Running, results, run_to_end

STUDY = [
    FAKED,
    *CHEAP,
    *("--set", "axes.frequency=[100, 110, 120, 130, 140]"),
    *("--set", "axes.scheme=implicit"),
    *("-o", "out.nc"),
]
MESSAGES = {"segfault": "Segmentation fault (__init__.py, line ", "abort": "Aborted (run_faked.py, line "}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    """The result of a run that does not crash."""
    folder = tmp_path_factory.mktemp("whole")
    assert run_to_end(0, STUDY, folder).status == 0
    return results(folder / "out.nc")


@pytest.mark.parametrize("n_ranks", [0, 2])
@pytest.mark.parametrize("how", ["segfault", "abort"])
def test_a_march_that_crashes_is_one_bad_point(how: str, n_ranks: int, whole: xr.Dataset, tmp_path: Path) -> None:
    crash = {"FAKE_CRASH": how, "FAKE_SECONDS": "0.01", "UCX_HANDLE_ERRORS": "none"}
    assert run_to_end(n_ranks, STUDY, tmp_path, crash).status not in (0, 1, 2, 3, 130)
    assert not (tmp_path / "out.nc").exists()
    assert run_to_end(n_ranks, STUDY, tmp_path, crash).status == 3
    found = results(tmp_path / "out.nc").squeeze()
    assert found.outcome.values.tolist() == [0, CRASHED, 0, 0, 0]
    assert str(found.message.values[1]).startswith(MESSAGES[how])
    assert found.worn_volume.isnull().all("cycle").values.tolist() == [False, True, False, False, False]
    # not tried again, unless asked for: then it crashes again, and once the reason is gone it does not
    assert run_to_end(n_ranks, STUDY, tmp_path, crash).status == 3
    assert run_to_end(n_ranks, [*STUDY, "--retry-failed"], tmp_path, crash).status not in (0, 1, 2, 3)
    assert run_to_end(n_ranks, STUDY, tmp_path).status == 3
    assert run_to_end(n_ranks, [*STUDY, "--retry-failed"], tmp_path).status == 0
    assert results(tmp_path / "out.nc").identical(whole)
    assert list(tmp_path.glob("*.parts/*.crash")) == []


def test_a_branch_that_crashes_ends_there(tmp_path: Path) -> None:
    """States before the crash that were lost with the process are computed again, what lies behind it is lost."""
    crash = {"FAKE_CRASH": "segfault in branch"}
    assert run_to_end(0, STUDY, tmp_path, crash).status == -signal.SIGSEGV
    assert run_to_end(0, STUDY, tmp_path, crash).status == 3
    found = results(tmp_path / "out.nc").squeeze()
    assert found.outcome.values.tolist() == [0, 0, 0, CRASHED, CRASHED]
    assert run_to_end(0, [*STUDY, "--retry-failed"], tmp_path).status == 0
    assert (results(tmp_path / "out.nc").outcome == 0).all()


def test_a_rank_that_is_killed_has_not_crashed(tmp_path: Path) -> None:
    def kill(running: Running) -> None:
        # both compute: each has the file that it would write a crash into
        assert running.reaches(lambda: len(list(tmp_path.glob("*.parts/*.crash"))) == 2), running.said
        os.kill(running.ranks()[1], signal.SIGKILL)

    assert run_to_end(2, STUDY, tmp_path, {"FAKE_SECONDS": "100"}, kill).status == 9
    assert len(list(tmp_path.glob("*.parts/*.crash"))) == 2
    assert run_to_end(2, STUDY, tmp_path).status == 0
    assert np.all(results(tmp_path / "out.nc").outcome == 0)
    assert list(tmp_path.glob("*.parts/*.crash")) == []

"""A task that crashes two processes costs its own points, nothing else; one that crashes a single one costs none."""

import os
import signal

import numpy as np
import pytest

from solver.outcome import Outcome
from tests.mpi.launching import CHEAP, FAKED, count_rows, fake_here, results, run_to_end

STUDY = [
    FAKED,
    *CHEAP,
    *("--set", "axes.frequency=[100, 110, 120, 130, 140]"),
    *("--set", "axes.scheme=implicit"),
    *("-o", "out.nc"),
]
MESSAGES = {"segfault": "Segmentation fault (__init__.py, line ", "abort": "Aborted (run_faked.py, line "}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The result of a run that does not crash."""
    folder = tmp_path_factory.mktemp("whole")
    assert fake_here(STUDY, folder) == 0
    return results(folder / "out.nc")


def test_a_march_that_crashes_is_one_bad_point(whole, tmp_path, capsys):
    how, n_ranks = "segfault", 2
    crash = {"FAKE_CRASH": how, "FAKE_SECONDS": "0.01", "UCX_HANDLE_ERRORS": "none"}
    first, second = (run_to_end(n_ranks, STUDY, tmp_path, crash) for _ in range(2))
    for ended in (first, second):
        assert ended.status not in (0, 1, 2, 3, 130), ended.said
        assert not (tmp_path / "out.nc").exists()
    said = f"a task has ended its process ({MESSAGES[how]}"
    assert (first.said.count(said), second.said.count(said)) == (0, 1)
    assert run_to_end(n_ranks, STUDY, tmp_path, crash).status == 3
    found = results(tmp_path / "out.nc").squeeze()
    assert found.outcome.values.tolist() == [0, Outcome.CRASHED, 0, 0, 0]
    assert str(found.message.values[1]).startswith(MESSAGES[how])
    assert found.worn_volume.isnull().all("cycle").values.tolist() == [False, True, False, False, False]
    # not tried again, unless asked for
    assert fake_here(STUDY, tmp_path) == 3
    assert "tried once more" not in capsys.readouterr().err
    assert fake_here([*STUDY, "--retry-failed"], tmp_path) == 0
    assert results(tmp_path / "out.nc").identical(whole)
    assert left_of_crashes(tmp_path) == []


def test_one_crash_says_nothing_of_the_task(whole, tmp_path):
    """The signal may have come from outside."""
    n_ranks = 2

    def crash(running):
        assert running.reaches(lambda: is_at_a_task(tmp_path, n_ranks)), running.said
        os.kill(running.ranks()[max(0, n_ranks - 1)], signal.SIGSEGV)

    slow = {"FAKE_SECONDS": "100", "UCX_HANDLE_ERRORS": "none"}
    assert run_to_end(n_ranks, STUDY, tmp_path, slow, crash).status not in (0, 1, 2, 3, 130)
    ended = run_to_end(n_ranks, STUDY, tmp_path)
    assert ended.status == 0, ended.said
    assert "a task has ended its process (Segmentation fault (" in ended.said
    assert results(tmp_path / "out.nc").identical(whole)
    assert left_of_crashes(tmp_path) == []


def test_crashes_are_counted_until_the_run_starts_over_or_tries_again(tmp_path):
    """Two after each: else --retry-failed would end at the same task for ever."""
    crash = {"FAKE_CRASH": "abort"}
    for arguments in ([], ["--fresh"], []):
        assert run_to_end(0, [*STUDY, *arguments], tmp_path, crash).status == -signal.SIGABRT
    assert run_to_end(0, STUDY, tmp_path, crash).status == 3
    retry = [*STUDY, "--retry-failed"]
    for _ in range(2):
        assert run_to_end(0, retry, tmp_path, crash).status == -signal.SIGABRT
    assert run_to_end(0, retry, tmp_path, crash).status == 3
    assert results(tmp_path / "out.nc").squeeze().outcome.values.tolist() == [0, Outcome.CRASHED, 0, 0, 0]
    assert left_of_crashes(tmp_path) == []


def is_at_a_task(folder, n_ranks):
    """Whether the last rank has been given one."""
    notes = [path for path in folder.glob("*.crashes/*.crash") if path.name == f"rank-{max(0, n_ranks - 1)}.crash"]
    return any(path.stat().st_size > 0 for path in notes) and count_rows("start_states", folder / "out.nc") > 0


def left_of_crashes(folder):
    return list(folder.glob("*.crashes"))


def test_a_branch_that_crashes_ends_there(tmp_path):
    """States before the crash that were lost with the process are computed again, what lies behind it is lost."""
    crash = {"FAKE_CRASH": "segfault in branch"}
    for _ in range(2):
        assert run_to_end(0, STUDY, tmp_path, crash).status == -signal.SIGSEGV
    assert run_to_end(0, STUDY, tmp_path, crash).status == 3
    found = results(tmp_path / "out.nc").squeeze()
    assert found.outcome.values.tolist() == [0, 0, 0, Outcome.CRASHED, Outcome.CRASHED]


def test_a_rank_that_is_killed_has_not_crashed(tmp_path):
    def kill(running):
        # both compute: each has the file that it would write a crash into
        assert running.reaches(lambda: len(list(tmp_path.glob("*.crashes/*.crash"))) == 2), running.said
        os.kill(running.ranks()[1], signal.SIGKILL)

    assert run_to_end(2, STUDY, tmp_path, {"FAKE_SECONDS": "100"}, kill).status == 9
    assert len(list(tmp_path.glob("*.crashes/*.crash"))) == 2
    assert run_to_end(2, STUDY, tmp_path).status == 0
    assert np.all(results(tmp_path / "out.nc").outcome == 0)
    assert left_of_crashes(tmp_path) == []

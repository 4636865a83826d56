"""A task that crashes its process again and again costs its own points; runs that are killed cost none."""

import os
import signal

import pytest

from solver.outcome import Outcome
from studyrunner.checkpoint.completion_index import MOST_CRASHES
from tests.mpi.launching import CHEAP, FAKED, count_entries, fake_here, results, run_to_end

STUDY = [
    FAKED,
    *CHEAP,
    *("--set", "axes.frequency=[100, 110, 120, 130, 140]"),
    *("--set", "axes.scheme=implicit"),
    *("-o", "out.nc"),
]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The result of a run that does not crash."""
    folder = tmp_path_factory.mktemp("whole")
    assert fake_here(STUDY, folder) == 0
    return results(folder / "out.nc")


def test_a_history_that_crashes_is_one_bad_point(whole, tmp_path):
    environment = {"FAKE_CRASH": "segfault", "FAKE_SECONDS": "0.01", "UCX_HANDLE_ERRORS": "none"}
    n_crashes = 0
    # which may take two runs more than are counted
    while n_crashes < MOST_CRASHES + 3 and (ended := run_to_end(2, STUDY, tmp_path, environment)).status != 3:
        assert ended.status not in (0, 1, 2, 130), ended.said
        n_crashes += 1
    assert MOST_CRASHES <= n_crashes < MOST_CRASHES + 3
    found = results(tmp_path / "out.nc").squeeze()
    assert found.outcome.values.tolist() == [0, Outcome.CRASHED, 0, 0, 0]
    assert str(found.message.values[1]).startswith(f"{MOST_CRASHES} runs in a row have crashed")
    # not tried again, unless asked for, and then as often as before
    assert fake_here(STUDY, tmp_path) == 3
    retry = [*STUDY, "--retry-failed"]
    assert run_to_end(0, retry, tmp_path, {"FAKE_CRASH": "abort"}).status == -signal.SIGABRT
    assert fake_here(STUDY, tmp_path) == 0
    assert results(tmp_path / "out.nc").identical(whole)


def test_a_run_that_is_killed_says_nothing_of_its_tasks(whole, tmp_path):
    def kill(running):
        started = running.reaches(lambda: "] " in running.said and len(running.ranks()) == 2)
        assert started, running.said
        assert running.reaches(lambda: count_entries("start", tmp_path / "out.nc") > 0), running.said
        # a kill leaves no memory behind
        assert not any(running.shared_memory().values())
        os.kill(running.ranks()[1], signal.SIGKILL)

    for _ in range(2):
        assert run_to_end(2, STUDY, tmp_path, {"FAKE_SECONDS": "100"}, kill).status == 9
    ended = run_to_end(2, STUDY, tmp_path)
    assert ended.status == 0, ended.said
    assert results(tmp_path / "out.nc").identical(whole)

"""Tasks that crash their process, ranks that break off, and full disks cost nothing that was finished."""

import re
import signal
import subprocess
from pathlib import Path

from solver.outcome import Outcome
from studyrunner.checkpoint.completion_index import MOST_CRASHES
from tests.mpi.launching import CHEAP, FAKED, count_entries, mounted, options, results, run_here, run_to_end

STUDY = (FAKED, *CHEAP, *options("axes.frequency=[100, 110, 120, 130, 140]", "axes.scheme=implicit"), "-o", "out.nc")
LONG = (FAKED, *CHEAP, *options("axes.frequency={start = 100, stop = 139, num = 40}", "axes.scheme=implicit"), "-o")


def test_a_history_that_crashes_is_one_bad_point(tmp_path):
    environment = {"FAKE_CRASH": "segfault", "FAKE_SECONDS": "0.01", "UCX_HANDLE_ERRORS": "none"}
    n_crashes = 0
    # which may take two runs more than are counted
    while n_crashes < MOST_CRASHES + 3 and (ended := run_to_end(2, STUDY, tmp_path, environment)).status != 3:
        assert ended.status not in (0, 1, 2, 130), ended.said
        n_crashes += 1
    assert MOST_CRASHES <= n_crashes < MOST_CRASHES + 3
    found = results(tmp_path / "out.nc").squeeze()
    assert found.outcome.values.tolist() == [0, Outcome.CRASHED, 0, 0, 0]
    assert str(MOST_CRASHES) in str(found.message.values[1])
    # not tried again, unless asked for, and then as often as before
    assert run_here(STUDY, tmp_path) == 3
    retry = [*STUDY, "--retry-failed"]
    assert run_to_end(0, retry, tmp_path, {"FAKE_CRASH": "abort"}).status == -signal.SIGABRT
    for name in ("out.nc", "whole.nc"):
        assert run_here([*STUDY[:-1], name], tmp_path) == 0
    assert results(tmp_path / "out.nc").identical(results(tmp_path / "whole.nc"))


def test_an_exception_on_one_rank_ends_all(tmp_path):
    ended = run_to_end(2, STUDY, tmp_path, {"FAKE_FAILURE": "1"})
    assert ended.status == 1
    assert "unexpected failure on rank 1 of 2" in ended.said
    assert re.search(r"ValueError: not \d results from History", ended.said)
    # what was finished is kept, and the result is written when the run ends in good order only
    left = {path.name for path in tmp_path.iterdir() if path.suffix != ".partial"}
    assert left - {"out.nc.progress-journal"} == {"out.nc.progress"}


def test_a_full_disk_costs_nothing_that_was_finished(tmp_path):
    """On 12 MB, where a start state of the stand-in takes 0.8 MB."""
    with mounted(tmp_path / "disk", "size=12m") as small_disk:
        environment = {"FAKE_SECONDS": "0.005", "FAKE_STEPS": "2"}
        target = small_disk / "out.nc"
        ended = run_to_end(2, [*LONG, str(target)], tmp_path, environment)
        assert ended.status == 1
        (line,) = [line for line in ended.said.splitlines() if line.startswith("run-study: ")]
        assert "No space left on device" in line
        assert "Traceback" not in ended.said
        assert not target.exists()
        kept = count_entries("start", target)
        assert kept > 0
        # as full as it is the run ends at once: without room for a trial before anything is computed
        again = run_to_end(2, [*LONG, str(target)], tmp_path, environment)
        assert again.status in (1, 2)
        assert "No space left on device" in again.said
        subprocess.run(["mount", "-o", "remount,size=100m", str(small_disk)], check=True)
        for path in (target, Path("whole.nc")):
            assert run_here([*LONG, str(path)], tmp_path, environment) == 0
        assert count_entries("start", target) >= kept
        assert results(target).identical(results(tmp_path / "whole.nc"))

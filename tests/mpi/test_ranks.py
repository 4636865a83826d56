"""run-study under mpiexec: the same result for any number of ranks, and an end in good order for all of them."""

import re
import signal
import sys

import pytest
import xarray as xr

from solver.outcome import Outcome
from tests.benchmarks.overhead import run
from tests.mpi.launching import CHEAP, FAKED, SOON, launcher, run_command, run_to_end
from tests.studyrunner.test_progress import LINE

GRID = [
    *CHEAP,
    *("--set", "axes.frequency={start = 100, stop = 160, num = 13}"),
    *("--set", "axes.sweep=['up', 'down']"),
    *("--set", "axes.step=[500, 1000]"),
    *("--set", "axes.wear_coefficient=[0, 5e-12, 1e-11]"),
    *("--set", "axes.scheme=['implicit', 'adaptive']"),
]


def start(n_ranks, arguments, folder, environment=None):
    """Runs under mpiexec, or alone for 0 ranks."""
    return run_command([*launcher(n_ranks), sys.executable, *arguments], folder, environment)


def test_result_does_not_depend_on_the_number_of_ranks(tmp_path):
    results, tables = {}, set()
    for n_ranks in (0, 1, 3):
        done = start(n_ranks, [FAKED, *GRID, "-o", f"{n_ranks}.nc"], tmp_path)
        assert done.returncode == 0, done.stderr
        summary, *table = done.stdout.splitlines()
        tables.add("\n".join(table))
        assert summary.startswith(f"{n_ranks}.nc: 312 points, 312 computed, 0 failed")
        with xr.open_dataset(tmp_path / f"{n_ranks}.nc") as result:
            results[n_ranks] = result.load().drop_vars("run_time")
    for n_ranks in (1, 3):
        xr.testing.assert_identical(results[n_ranks], results[0])
    assert len(tables) == 1


def test_histories_are_done_while_their_sweep_goes_on(tmp_path):
    """Every sweep stands still after its first start state until a history from it is done, which no rank but one has
    time for."""
    arguments = [FAKED, *GRID, "--set", "axes.sweep=up"]
    done = start(2, arguments, tmp_path, {"FAKE_SECONDS": "0.01", "FAKE_PATIENCE": "120"})
    assert done.returncode == 0, done.stderr


def test_an_exception_on_one_rank_ends_all(tmp_path):
    done = start(2, [FAKED, *GRID], tmp_path, {"FAKE_FAILURE": "1"})
    assert done.returncode == 1
    assert "unexpected failure on rank 1 of 2" in done.stderr
    assert re.search(r"ValueError: not \d results from History", done.stderr)
    # What was finished is kept, and the result is written when the run ends in good order only.
    left = {path.name for path in tmp_path.iterdir() if path.suffix != ".partial"}
    assert left - {"two_masses.nc.progress-journal"} == {"two_masses.nc.progress"}


@pytest.fixture
def default_signals():
    """Whoever runs the tests may ignore signals, as `nohup` does: the processes that they start would inherit it."""
    before = {number: signal.signal(number, signal.SIG_DFL) for number in (signal.SIGHUP, signal.SIGUSR1)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


# the launcher of MPICH ends by itself at SIGHUP, and all ranks with it
@pytest.mark.parametrize(("n_ranks", "number"), [(0, signal.SIGHUP), (2, signal.SIGUSR1)])
def test_an_interrupted_run_ends_at_once(n_ranks, number, tmp_path, default_signals):
    def interrupt(running):
        assert running.reaches(lambda: "by 2 sweeps" in running.said), running.said
        running.process.send_signal(number)

    ended = run_to_end(n_ranks, [FAKED, *GRID, "-o", "out.nc"], tmp_path, {"FAKE_SECONDS": "60"}, interrupt)
    assert ended.status == 130
    assert ended.seconds < SOON
    assert ended.said.count("run-study: interrupted: out.nc holds ") == 1
    assert "of 312 points, the same command goes on" in ended.said
    assert "Traceback" not in ended.said
    # beside lines of progress, which a busy machine has more of
    assert sum(not line.startswith("[") for line in ended.said.splitlines()) < 6
    assert sorted(path.name for path in tmp_path.glob("*out.nc*")) == ["out.nc", "out.nc.progress"]
    with xr.open_dataset(tmp_path / "out.nc") as result:
        assert (result.outcome == Outcome.NOT_COMPUTED).any()


def test_bad_input_is_said_once(tmp_path):
    done = start(2, [FAKED, "sdof_slider", "--set", "axes.frequency=-1"], tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert "sdof_slider: axes.frequency = -1: " in line
    assert list(tmp_path.iterdir()) == []


def test_a_run_on_two_ranks_says_how_far_it_is(tmp_path):
    """Both ranks are seen at work, and the rank that serves them is not too busy to say so."""
    study = (*CHEAP, "--set", "axes.scheme=['implicit', 'explicit']", "-o", "out.nc")
    told = {"FAKE_STEPS": "4", "FAKE_SECONDS": "0.06", "FAKE_TELLING": "0.1"}
    ended = run_to_end(2, [FAKED, *study], tmp_path, told)
    assert ended.status == 0, ended.said
    found = [match for line in ended.said.splitlines() if (match := LINE.fullmatch(line))]
    assert len(found) >= 5, ended.said
    assert all(match["left"] for match in found[:-1])
    done = [int(match["done"]) for match in found]
    assert done == sorted(done)
    assert done[0] < done[-1]
    assert int(found[0]["percent"]) < int(found[-1]["percent"])
    assert max(len(match["running"].split(", ")) for match in found if match["running"]) == 2, ended.said


def test_rank_0_does_not_hold_results(tmp_path):
    """Eight times as much in each result takes hardly more memory."""
    outputs, n_points = 16_001, 200
    # both have the slab of 16 MB and the cache of the netCDF library
    small, large = (run(0, n_points, tmp_path, f"{n}.nc", n) for n in (2_001, outputs))
    size = n_points * outputs * 10 * 8 / 2**20
    assert large.memory - small.memory < 60.0 < 0.3 * size

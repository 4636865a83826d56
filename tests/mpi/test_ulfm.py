"""Open MPI under `mpiexec --with-ft ulfm`: the others finish the study when a rank is killed, all but rank 0."""

import os
import signal

import pytest
import xarray as xr

from solver.outcome import Outcome
from studyrunner.mpi import ranks
from tests.mpi.launching import (
    CHEAP,
    FAKED,
    SOON,
    count_rows,
    fake_here,
    results,
    run_command,
    watch_to_end,
)

N_RANKS = 3
STUDY = [
    *(*CHEAP, "-o", "out.nc"),
    *("--set", "axes.frequency={start = 100, stop = 160, num = 7}"),
    *("--set", "axes.sweep=['up', 'down']"),
    *("--set", "axes.step=[500, 1000]"),
    *("--set", "axes.wear_coefficient=[0, 5e-12, 1e-11]"),
    *("--set", "axes.scheme=['implicit', 'adaptive']"),
]
SECONDS = {"FAKE_SECONDS": "0.06"}
SLOWLY = {"FAKE_SECONDS": "2"}  # the disk has results long before the last history, however busy the machine is


def run_and_kill(open_mpi, folder, rank=None, n_noted=0, n_ranks=N_RANKS, study=STUDY, faked=SECONDS):
    """A run of which a rank is killed after so many histories; rank 0 only when some of them are on the disk, too. What
    is counted may be of a transaction that is not complete: with the third count those before are.
    """
    counts = set()

    def is_time():
        counts.add(count_rows("results", folder / "out.nc") if rank == 0 else 0)
        return count_noted(folder) >= n_noted and (rank != 0 or len(counts - {0}) >= 3)

    def kill(running):
        if rank is not None:
            running.wait_for("computing")
            assert running.reaches(is_time), running.said
            os.kill(running.ranks()[rank], signal.SIGKILL)

    command = [*open_mpi.launcher(n_ranks, "--with-ft", "ulfm"), open_mpi.python, FAKED, *study]
    return watch_to_end(command, folder, {**open_mpi.environment, **faked}, kill)


def count_noted(folder):
    """Histories that the ranks have computed."""
    return sum(len(path.read_text(encoding="ascii").splitlines()) for path in folder.glob("rank*.txt"))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The result of one process without a launcher, and the number of its histories."""
    folder = tmp_path_factory.mktemp("whole")
    assert fake_here([FAKED, *STUDY], folder, {"FAKE_SECONDS": "0.001"}) == 0
    return results(folder / "out.nc"), count_noted(folder)


def test_the_others_finish_when_a_rank_is_killed(open_mpi, whole, tmp_path):
    expected, n_histories = whole
    done = run_and_kill(open_mpi, tmp_path, rank=2, n_noted=n_histories // 3)
    assert done.status == 0, done.said
    (line,) = [line for line in done.said.splitlines() if "lost" in line]
    assert "rank 2 is lost, which had " in line
    assert "Traceback" not in done.said
    xr.testing.assert_identical(results(tmp_path / "out.nc"), expected)


def test_without_rank_0_all_end_and_the_next_run_goes_on(open_mpi, whole, tmp_path):
    expected, _ = whole
    done = run_and_kill(open_mpi, tmp_path, rank=0, n_noted=6, faked=SLOWLY)
    assert done.status == 1
    assert done.seconds < SOON
    assert done.said.count("run-study: rank 0 is lost, which the others cannot do without") == 1
    assert not (tmp_path / "out.nc").exists()
    done = run_and_kill(open_mpi, tmp_path)
    assert done.status == 0, done.said
    # what was written is there: at least start states, and histories where the disk was not slow
    assert "14 start states along 2 sweeps" not in done.said
    xr.testing.assert_identical(results(tmp_path / "out.nc"), expected)


def test_a_run_that_is_ended_from_outside_leaves_what_there_is(open_mpi, whole, tmp_path):
    """By a signal to the launcher that it passes on."""
    expected, n_histories = whole

    def end(running):
        assert running.reaches(lambda: count_noted(tmp_path) >= n_histories // 4), running.said
        os.kill(running.process.pid, signal.SIGUSR1)

    command = [*open_mpi.launcher(N_RANKS, "--with-ft", "ulfm"), open_mpi.python, FAKED, *STUDY]
    done = watch_to_end(command, tmp_path, {**open_mpi.environment, **SECONDS}, end)
    assert done.status == 130, done.said
    assert done.said.count("run-study: interrupted: out.nc holds ") == 1
    assert done.seconds < SOON
    left = results(tmp_path / "out.nc").outcome
    assert 0 < int((left == Outcome.NOT_COMPUTED).sum()) < left.size
    assert fake_here([FAKED, *STUDY], tmp_path) == 0
    xr.testing.assert_identical(results(tmp_path / "out.nc"), expected)


def test_a_march_that_crashes_takes_two_ranks_with_it(open_mpi, tmp_path):
    """Never rank 0, which follows the branch and gives the marches to ranks that are free, and then to one of them."""
    study = ["two_masses", "-o", "out.nc", "--set", "axes.frequency=[0.1, 0.11, 0.12]"]
    done = run_and_kill(open_mpi, tmp_path, n_ranks=4, study=study, faked={"FAKE_CRASH": "abort"})
    assert done.status == 3, done.said
    assert done.said.count(" is lost, which had 1 task: ") == 2
    found = results(tmp_path / "out.nc").squeeze()
    assert found.outcome.values.tolist() == [0, Outcome.CRASHED, 0]
    assert str(found.message.values[1]).startswith("Aborted (run_faked.py, line ")


def test_a_rank_that_is_lost_while_it_starts_ends_all(open_mpi, tmp_path):
    """The library waits for it for ever, the others for some minutes."""
    assert ranks._SECONDS_TO_START <= 120.0
    program = (
        "import os; from studyrunner.mpi import ranks; ranks._SECONDS_TO_START = 2.0;"
        "os.environ['OMPI_COMM_WORLD_RANK'] == '2' and os.kill(os.getpid(), 9); ranks.start_ranks()"
    )
    command = [*open_mpi.launcher(N_RANKS, "--with-ft", "ulfm"), open_mpi.python, "-c", program]
    done = run_command(command, tmp_path, open_mpi.environment)
    assert done.returncode == 1
    assert done.stderr.count("Timeout (0:00:02)!") == 1
    assert "in start_ranks" in done.stderr

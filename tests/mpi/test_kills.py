"""A run that is killed or ended at any time goes on, and ends with the result of one that was not disturbed."""

import contextlib
import os
import random
import re
import shutil
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import pytest
import xarray as xr

from solver.outcome import Outcome
from studyrunner.checkpoint.completion_index import MOST_CRASHES
from tests.mpi.launching import CHEAP, FAKED, SOON, options, results, run_here, run_to_end
from tests.mpi.run_faked import DONE

AT_ONCE = 4  # runs side by side: they sleep as long as they compute
N_POINTS = 24
KILLED = "killed.txt"
PROMISED = 5.0
"""Seconds: what was finished longer before a kill is not lost."""


@dataclass(frozen=True)
class Disturbed:
    """A study that is disturbed on its way.

    n_steps: that the stand-in takes, which notes each of them; 0 for the solver itself.
    """

    arguments: tuple[str, ...]
    environment: dict[str, str]
    n_steps: int


AT_REST = {"FAKE_SECONDS": "0"}
WEARS = "axes.wear_coefficient=[0, 5e-12, 1e-11]"
FAKED_STUDY = Disturbed(
    (
        *(FAKED, *CHEAP),
        *options("axes.frequency=[100, 110, 120, 130]", "axes.sweep=['up', 'down']", WEARS, "axes.scheme=implicit"),
    ),
    {"FAKE_STEPS": "4", "FAKE_SECONDS": "0.025"},
    n_steps=2 * 4 + 4 * N_POINTS,
)
SHORT_STUDY = Disturbed(
    (FAKED, *CHEAP, *options("axes.frequency=[100, 110]", WEARS, "axes.scheme=implicit")),
    {"FAKE_STEPS": "20", "FAKE_SECONDS": "0.05"},
    n_steps=2 + 20 * 6,
)
"""Its tasks take long enough for their progress to be saved."""


def lines(path):
    return [line.split() for line in path.read_text(encoding="ascii").splitlines()] if path.exists() else []


def count_steps(folder):
    """Those that all runs of the stand-in in this folder have noted."""
    return sum(what == "step" for _, what, *_ in lines(folder / DONE))


def note(folder, what):
    """`kill`: a run in this folder is killed now; `end`: its last process has ended."""
    with (folder / KILLED).open("a", encoding="ascii") as file:
        file.write(f"{time.time()} {what}\n")


def ages_of_losses(folder):
    """How long before the kill that was finished which was done again after it, s; nothing of what was not lost."""
    # a rank may outlive the kill for a moment
    times = {what: float(when) for when, what in lines(folder / KILLED)}
    done = {}
    for when, what, *thing in lines(folder / DONE):
        if not what.startswith("resumed"):
            done.setdefault((what, *thing), []).append(float(when))
    lost = [min(finished) for finished in done.values() if min(finished) <= times["end"] < max(finished)]
    return [max(0.0, times["kill"] - when) for when in lost]


def kill_and_go_on(study, folder, seed):
    """How the run ended that went on after one whose launcher or a rank was killed, mostly while they compute."""
    chance = random.Random(seed)

    def kill(running):
        if chance.random() < 0.8:
            # a line of its progress
            running.reaches(lambda: "] " in running.said)
            wanted = chance.randrange(max(1, study.n_steps))
            running.reaches(lambda: count_steps(folder) >= wanted)
        time.sleep(chance.uniform(0.0, 0.05 if study.n_steps else 2.0))
        victims = [running.process.pid, *running.ranks().values()]
        if running.process.poll() is None:
            note(folder, "kill")
            with contextlib.suppress(ProcessLookupError):
                os.kill(chance.choice(victims), signal.SIGKILL)

    while True:
        folder.mkdir()
        command = [*study.arguments, "-o", "out.nc"]
        killed = run_to_end((0, 2, 2, 3)[seed % 4], command, folder, study.environment, kill)
        note(folder, "end")
        if killed.status != 0:
            return run_to_end(chance.choice([0, 2]), command, folder, study.environment)
        # it was faster than what was to kill it
        shutil.rmtree(folder)


def test_a_run_that_is_killed_goes_on_to_the_same_result(tmp_path):
    study = SHORT_STUDY
    assert run_here([*study.arguments, "-o", "whole.nc"], tmp_path, {**study.environment, **AT_REST}) == 0
    assert count_steps(tmp_path) == study.n_steps
    expected = results(tmp_path / "whole.nc")
    # alone and on two and three ranks, most of them killed in the midst of a task
    seeds = range(5, 9)
    folders = [tmp_path / str(seed) for seed in seeds]
    with ThreadPoolExecutor(AT_ONCE) as pool:
        found = list(pool.map(lambda seed, folder: kill_and_go_on(study, folder, seed), seeds, folders))
    for folder, ended in zip(folders, found, strict=True):
        assert ended.status == 0, ended.said
        xr.testing.assert_identical(results(folder / "out.nc"), expected)
    assert max((age for folder in folders for age in ages_of_losses(folder)), default=0.0) <= PROMISED
    assert "resumed-history" in {what for folder in folders for _, what, *_ in lines(folder / DONE)}


def assert_interrupted(ended):
    assert ended.status == 130, ended.said
    assert ended.seconds < SOON
    assert ended.said.count("run-study: interrupted: out.nc holds ") == 1
    assert "Traceback" not in ended.said


ENDED_BY = {
    "an interrupt": (0, signal.SIGINT, (None,)),
    "the launcher": (2, signal.SIGTERM, (None,)),
    "one rank": (2, signal.SIGTERM, (1,)),
    "one rank first": (2, signal.SIGTERM, (1, 0)),
    "the terminal of a rank": (2, signal.SIGHUP, (1,)),
}
"""Number of ranks, signal, and who gets it one after the other: ranks, or the process that was started."""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The result of a run that nothing disturbs."""
    folder = tmp_path_factory.mktemp("whole")
    assert run_here([*FAKED_STUDY.arguments, "-o", "out.nc"], folder, {**FAKED_STUDY.environment, **AT_REST}) == 0
    return results(folder / "out.nc")


@pytest.mark.parametrize("case", ENDED_BY)
def test_a_run_that_is_ended_leaves_a_result_and_goes_on(case, whole, tmp_path):
    """The launcher sends it to all ranks, to some earlier than others: rank 0 may be writing by then."""
    study, (n_ranks, number, victims) = FAKED_STUDY, ENDED_BY[case]
    arguments = [*study.arguments, "-o", "out.nc"]

    def end(running):
        # about half of the points are there
        assert running.reaches(lambda: count_steps(tmp_path) >= study.n_steps // 2), running.said
        ranks = running.ranks()
        for victim in victims:
            with contextlib.suppress(ProcessLookupError):
                os.kill(running.process.pid if victim is None else ranks[victim], number)
            time.sleep(0.1)

    ended = run_to_end(n_ranks, arguments, tmp_path, study.environment, end)
    assert_interrupted(ended)
    left = results(tmp_path / "out.nc")
    assert run_here(arguments, tmp_path, {**study.environment, **AT_REST}) == 0
    xr.testing.assert_identical(results(tmp_path / "out.nc"), whole)
    there = left.outcome != Outcome.NOT_COMPUTED
    n_there = int(there.sum())
    assert 0 < n_there < N_POINTS
    assert f"holds {n_there} of {N_POINTS} points" in ended.said
    assert left.wear_depth.where(~there).isnull().all()
    for name in set(left.data_vars) - {"message", "outcome"}:
        xr.testing.assert_equal(left[name].where(there), whole[name].where(there))


# the launcher of MPICH ends by itself at SIGHUP, and all ranks with it
@pytest.mark.parametrize(("n_ranks", "number"), [(0, signal.SIGHUP), (2, signal.SIGUSR1)])
def test_an_interrupted_run_does_not_wait_for_its_tasks(n_ranks, number, tmp_path):
    def interrupt(running):
        assert running.reaches(lambda: "by 2 sweeps" in running.said), running.said
        running.process.send_signal(number)

    ended = run_to_end(n_ranks, [*FAKED_STUDY.arguments, "-o", "out.nc"], tmp_path, {"FAKE_SECONDS": "60"}, interrupt)
    assert_interrupted(ended)
    # beside lines of progress, which a busy machine has more of
    assert sum(not line.startswith("[") for line in ended.said.splitlines()) < 6
    assert sorted(path.name for path in tmp_path.glob("*out.nc*")) == ["out.nc", "out.nc.progress"]
    assert (results(tmp_path / "out.nc").outcome == Outcome.NOT_COMPUTED).any()


STUCK = """
import sys, time
from studyrunner.checkpoint.store import Store
from studyrunner.system import process
process.SECONDS_OF_GRACE = 1.0

def hang(*_, **__):
    print("hangs", file=sys.stderr, flush=True)
    while True:
        time.sleep(600)

Store.tick = hang
from studyrunner.cli import main
sys.exit(main())
"""


def test_one_more_signal_ends_a_run_that_cannot_end(tmp_path):
    """A disk that does not answer, for one."""
    script = tmp_path / "stuck.py"
    script.write_text(STUCK, encoding="utf-8")

    def end_twice(running):
        assert running.reaches(lambda: "hangs" in running.said), running.said
        for seconds in (0.0, 0.2, 2.0):
            time.sleep(seconds)
            running.process.send_signal(signal.SIGTERM)

    ended = run_to_end(0, [str(script), "two_masses", "-o", "out.nc"], tmp_path, disturb=end_twice)
    assert (ended.status, ended.seconds < SOON) == (130, True)


# --- tasks that crash their process, ranks that break off, full disks ---

STUDY = (FAKED, *CHEAP, *options("axes.frequency=[100, 110, 120, 130, 140]", "axes.scheme=implicit"), "-o", "out.nc")


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


def test_a_rank_without_memory_ends_all_and_no_point_is_lost(tmp_path):
    ended = run_to_end(2, STUDY, tmp_path, {"FAKE_CRASH": "memory"})
    (line,) = [line for line in ended.said.splitlines() if line.startswith("run-study: ")]
    assert (ended.status, line.startswith("run-study: MemoryError: ")) == (1, True)
    assert run_here(STUDY, tmp_path) == 0

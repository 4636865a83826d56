"""A run that is killed or ended at any time goes on, and ends with the result of one that was not disturbed."""

import contextlib
import os
import random
import shutil
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import pytest
import xarray as xr

from solver.outcome import Outcome
from studyrunner.mpi.schedule import SECONDS_TO_PROGRESS
from tests.mpi.launching import CHEAP, FAKED, SOON, fake_here, results, run_to_end
from tests.mpi.losses import PROMISED, ages_of_losses, note

AT_ONCE = 4  # runs side by side: they sleep as long as they compute
MOST_RUNS = 8
N_POINTS = 24


@dataclass(frozen=True)
class Disturbed:
    """A study that is disturbed on its way.

    n_steps: that the stand-in takes, which notes each of them; 0 for the solver itself. latest: s from the start of
    the run, or of what is computed, to the signal where that is not given by a step.
    """

    arguments: tuple[str, ...]
    environment: dict[str, str]
    n_steps: int
    latest: float


FAKED_STUDY = Disturbed(
    (
        *(FAKED, *CHEAP),
        *("--set", "axes.frequency=[100, 110, 120, 130]"),
        *("--set", "axes.sweep=['up', 'down']"),
        *("--set", "axes.wear_coefficient=[0, 5e-12, 1e-11]"),
        *("--set", "axes.scheme=['implicit']"),
    ),
    {"FAKE_STEPS": "4", "FAKE_SECONDS": "0.025"},
    n_steps=2 * 4 + 4 * N_POINTS,
    latest=2.0,
)
LONG_STUDY = Disturbed(
    (
        *(FAKED, *CHEAP),
        *("--set", "axes.frequency=[100, 110]"),
        *("--set", "axes.wear_coefficient=[0, 5e-12, 1e-11]"),
        *("--set", "axes.scheme=['implicit']"),
    ),
    {"FAKE_STEPS": "25", "FAKE_SECONDS": "0.2", "FAKE_PROGRESS": str(SECONDS_TO_PROGRESS)},
    n_steps=2 + 25 * 6,
    latest=10.0,
)
"""Goes on for 10 to 30 s, and says as often as any other how far its tasks are."""

SHORT_STUDY = replace(
    LONG_STUDY, environment={"FAKE_STEPS": "20", "FAKE_SECONDS": "0.05"}, n_steps=2 + 20 * 6, latest=2.0
)
"""Its tasks take long enough for their progress to be saved."""

REAL_STUDY = Disturbed(
    (
        *("-m", "studyrunner.cli", "sdof_slider"),
        *("--set", "axes.frequency=[100, 160]"),
        *("--set", "axes.wear_coefficient=[5e-12, 1e-11]"),
        *("--set", "axes.scheme=['implicit', 'adaptive']"),
        *("--set", "axes.step=[100]"),
        *("--set", "solver.harmonics=5"),
        *("--set", "solver.samples=64"),
    ),
    {},
    n_steps=0,
    latest=2.0,
)


def wait_a_while(running, study, folder, chance):
    """Until some time after the run has begun to compute."""
    before = count_steps(folder)
    # a line of its progress
    running.reaches(lambda: "] " in running.said)
    if study.n_steps:
        wanted = before + chance.randrange(max(1, study.n_steps - before))
        running.reaches(lambda: count_steps(folder) >= wanted)
        time.sleep(chance.uniform(0.0, 0.05))
    else:
        time.sleep(chance.uniform(0.0, study.latest))


def count_steps(folder):
    """Those that all runs of the stand-in in this folder have noted."""
    path = folder / "steps.txt"
    return path.stat().st_size // len("step\n") if path.exists() else 0


def kill_one(study, folder, chance):
    """One of the ranks or the launcher is killed: mostly while they compute, now and then before."""

    def disturb(running):
        if chance.random() < 0.8:
            wait_a_while(running, study, folder, chance)
        else:
            time.sleep(chance.uniform(0.0, study.latest))
        victims = [running.process.pid, *running.ranks().values()]
        if running.process.poll() is None:
            note(folder, "kill")
            with contextlib.suppress(ProcessLookupError):
                os.kill(chance.choice(victims), signal.SIGKILL)

    return disturb


def kill_and_go_on(study, folder, seed):
    """What the run that ended by itself was like, after one that was killed, or several."""
    chance = random.Random(seed)
    n_killed = 0
    for attempt in range(MOST_RUNS):
        folder.mkdir(exist_ok=True)
        # one in four is killed twice
        kills = n_killed == 0 or (attempt == 1 and seed % 4 == 0)
        disturb = kill_one(study, folder, chance) if kills else lambda _: None
        n_ranks = (0, 2, 2, 3)[seed % 4] if attempt == 0 else chance.choice([0, 2])
        ended = run_to_end(n_ranks, [*study.arguments, "-o", "out.nc"], folder, study.environment, disturb)
        note(folder, "end")
        if ended.status == 0 and n_killed == 0:
            # it was faster than the one that was to kill it
            shutil.rmtree(folder)
        elif ended.status == 0:
            return f"killed {n_killed} times"
        elif not kills:
            return f"ended with {ended.status}: {ended.said}"
        else:
            n_killed += 1
    return "did not end"


def test_a_run_that_is_killed_goes_on_to_the_same_result(tmp_path):
    study = SHORT_STUDY
    assert fake_here([*study.arguments, "-o", "whole.nc"], tmp_path, study.environment) == 0
    assert count_steps(tmp_path) == study.n_steps
    expected = results(tmp_path / "whole.nc")
    # alone and on two and three ranks, most of them killed in the midst of a task
    seeds = range(5, 9)
    with ThreadPoolExecutor(AT_ONCE) as pool:
        found = list(pool.map(lambda seed: kill_and_go_on(study, tmp_path / str(seed), seed), seeds))
    for seed, how in zip(seeds, found, strict=True):
        assert how.startswith("killed"), how
        xr.testing.assert_identical(results(tmp_path / str(seed) / "out.nc"), expected)
    assert sum(int(how.split()[1]) for how in found) >= len(seeds)
    assert max((age for seed in seeds for age in ages_of_losses(tmp_path / str(seed))), default=0.0) <= PROMISED
    resumed = "".join(path.read_text(encoding="utf-8") for path in tmp_path.glob("*/resumed.txt")).splitlines()
    assert "history" in {line.split()[0] for line in resumed}


ENDED_BY = {
    "an interrupt": (0, signal.SIGINT, (None,)),
    "the launcher": (2, signal.SIGTERM, (None,)),
    "one rank": (2, signal.SIGTERM, (1,)),
    "one rank first": (2, signal.SIGTERM, (1, 0)),
}
"""Number of ranks, signal, and who gets it one after the other: ranks, or the process that was started."""


@pytest.mark.parametrize("case", ENDED_BY)
def test_a_run_that_is_ended_leaves_a_result_and_goes_on(case, tmp_path):
    """The launcher tells all ranks, some earlier than others: rank 0 may be writing by then."""
    study, (n_ranks, number, victims) = FAKED_STUDY, ENDED_BY[case]
    arguments = [*study.arguments, "-o", "out.nc"]
    (tmp_path / "whole").mkdir()
    assert fake_here(arguments, tmp_path / "whole", study.environment) == 0
    whole = results(tmp_path / "whole" / "out.nc")

    def end(running):
        # about half of the points are there
        assert running.reaches(lambda: count_steps(tmp_path) >= study.n_steps // 2), running.said
        ranks = running.ranks()
        for victim in victims:
            with contextlib.suppress(ProcessLookupError):
                os.kill(running.process.pid if victim is None else ranks[victim], number)
            time.sleep(0.1)

    ended = run_to_end(n_ranks, arguments, tmp_path, study.environment, end)
    assert ended.status == 130, ended.said
    assert ended.seconds < SOON
    assert ended.said.count("run-study: interrupted: out.nc holds ") == 1
    assert "Traceback" not in ended.said
    left = results(tmp_path / "out.nc")
    assert fake_here(arguments, tmp_path, study.environment) == 0
    xr.testing.assert_identical(results(tmp_path / "out.nc"), whole)
    there = left.outcome != Outcome.NOT_COMPUTED
    n_there = int(there.sum())
    assert 0 < n_there < N_POINTS
    assert f"holds {n_there} of {N_POINTS} points, the same command goes on" in ended.said
    for name in set(left.data_vars) - {"message", "outcome"}:
        xr.testing.assert_equal(left[name].where(there), whole[name].where(there))


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

    ended = run_to_end(0, [str(script), "two_masses", "-o", "out.nc"], tmp_path, {}, end_twice)
    assert (ended.status, ended.seconds < SOON) == (130, True)

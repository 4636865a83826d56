"""A run that is killed or ended at any time goes on, and ends with the result of one that was not disturbed."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import xarray as xr

from studyrunner.evaluate import NOT_COMPUTED
from tests.mpi.launching import FAKED, Ended, ranks_of, results, run_to_end

AT_ONCE = 4  # runs side by side: they sleep more than they compute
MOST_RUNS = 8
N_POINTS = 24

FAKED_STUDY = [
    FAKED,
    "sdof_slider",
    *("--set", "axes.frequency=[100, 110, 120, 130]"),
    *("--set", "axes.sweep=['up', 'down']"),
    *("--set", "axes.wear_coefficient=[0, 5e-12, 1e-11]"),
    *("--set", "axes.scheme=['implicit']"),
]
SLOW = {"FAKE_STEPS": "4", "FAKE_SECONDS": "0.025"}

REAL_STUDY = [
    *("-m", "studyrunner.cli", "sdof_slider"),
    *("--set", "axes.frequency=[100, 160]"),
    *("--set", "axes.wear_coefficient=[5e-12, 1e-11]"),
    *("--set", "axes.scheme=['implicit', 'adaptive']"),
    *("--set", "axes.step=[100]"),
    *("--set", "solver.harmonics=5"),
    *("--set", "solver.samples=64"),
]


def kill_one(chance: random.Random, longest: float) -> Callable[[subprocess.Popen[str]], None]:
    """After a while one of the ranks or the launcher is killed: mostly while they compute, now and then before."""

    def disturb(process: subprocess.Popen[str]) -> None:
        assert process.stderr is not None
        if chance.random() < 0.8:
            process.stderr.readline()
            time.sleep(chance.uniform(0.0, longest))
        else:
            time.sleep(chance.uniform(0.0, 2.0))
        if process.poll() is None:
            victims = [process.pid, *ranks_of(process.pid)]
            try:
                os.kill(chance.choice(victims), signal.SIGKILL)
            except ProcessLookupError:
                return

    return disturb


def kill_and_go_on(study: list[str], environment: dict[str, str], longest: float, folder: Path, seed: int) -> str:
    """What the run that ended by itself was like, after one that was killed, or several."""
    folder.mkdir()
    chance = random.Random(seed)
    for attempt in range(MOST_RUNS):
        # one in four is killed twice
        kills = attempt == 0 or (attempt == 1 and seed % 4 == 0)
        disturb = kill_one(chance, longest) if kills else lambda _: None
        n_ranks = chance.choice([2, 2, 3]) if attempt == 0 else chance.choice([0, 2])
        ended = run_to_end(n_ranks, [*study, "-o", "out.nc"], folder, environment, disturb)
        if ended.status == 0:
            return f"killed {attempt} times"
        if not kills:
            return f"ended with {ended.status}: {ended.said}"
    return "did not end"


@pytest.mark.parametrize(
    ("study", "environment", "longest", "n_trials"),
    [(FAKED_STUDY, SLOW, 1.5, 46), (REAL_STUDY, {}, 2.0, 4)],
    ids=["faked", "real"],
)
def test_a_run_that_is_killed_goes_on_to_the_same_result(
    study: list[str], environment: dict[str, str], longest: float, n_trials: int, tmp_path: Path
) -> None:
    assert run_to_end(0, [*study, "-o", "whole.nc"], tmp_path, environment).status == 0
    expected = results(tmp_path / "whole.nc")
    with ThreadPoolExecutor(AT_ONCE) as pool:
        found = list(
            pool.map(
                lambda seed: kill_and_go_on(study, environment, longest, tmp_path / str(seed), seed), range(n_trials)
            )
        )
    same = 0
    for seed, how in enumerate(found):
        assert how.startswith("killed"), how
        xr.testing.assert_identical(results(tmp_path / str(seed) / "out.nc"), expected)
        same += 1
    n_killed = sum(not how.startswith("killed 0") for how in found)
    resumed = "".join(path.read_text(encoding="utf-8") for path in tmp_path.glob("*/resumed.txt")).splitlines()
    gone_on = f"; {len(resumed)} tasks were gone on from" if environment else ""
    print(f"{same} of {n_trials} identical; {n_killed} were killed on their way{gone_on}")
    assert same == n_trials
    # otherwise it would show nothing
    assert n_killed > 0.6 * n_trials
    if environment:
        assert {line.split()[0] for line in resumed} == {"march", "branch"}


@pytest.mark.parametrize("n_ranks", [0, 2])
def test_a_run_that_is_ended_leaves_a_result_and_goes_on(n_ranks: int, tmp_path: Path) -> None:
    assert run_to_end(0, [*FAKED_STUDY, "-o", "whole.nc"], tmp_path, SLOW).status == 0
    expected = results(tmp_path / "whole.nc")

    def terminate(when: float) -> Callable[[subprocess.Popen[str]], None]:
        def disturb(process: subprocess.Popen[str]) -> None:
            assert process.stderr is not None
            assert "following 2 branches" in process.stderr.readline()
            time.sleep(when)
            process.send_signal(signal.SIGTERM)

        return disturb

    def end_and_go_on(seed: int) -> Ended:
        folder = tmp_path / str(seed)
        folder.mkdir()
        arguments = [*FAKED_STUDY, "-o", "out.nc"]
        ended = run_to_end(n_ranks, arguments, folder, SLOW, terminate(random.Random(seed).uniform(0.0, 1.2)))
        (folder / "out.nc").rename(folder / "left.nc")
        assert run_to_end(0, arguments, folder, SLOW).status == 0
        return ended

    with ThreadPoolExecutor(AT_ONCE) as pool:
        found = list(pool.map(end_and_go_on, range(10)))
    opened, slowest, n_partial = 0, 0.0, 0
    for seed, ended in enumerate(found):
        # netCDF does not like threads: the files are opened here
        left = results(tmp_path / str(seed) / "left.nc")
        xr.testing.assert_identical(results(tmp_path / str(seed) / "out.nc"), expected)
        assert ended.status == 130, ended.said
        assert ended.said.count("run-study: interrupted: out.nc holds ") == 1
        assert "Traceback" not in ended.said
        n_left = int((left.outcome == NOT_COMPUTED).sum())
        assert f"holds {N_POINTS - n_left} of {N_POINTS} points" in ended.said
        there = left.outcome != NOT_COMPUTED
        for name in set(left.data_vars) - {"message", "outcome"}:
            xr.testing.assert_equal(left[name].where(there), expected[name].where(there))
        n_partial += 0 < n_left < N_POINTS
        slowest = max(slowest, ended.seconds)
        opened += 1
    print(f"{opened} of 10 left a result that opens, the slowest within {slowest:.1f} s; {n_partial} held some points")
    assert opened == 10
    assert slowest < 10.0
    assert n_partial >= 3


def test_a_rank_that_is_ended_ends_the_run_in_good_order(tmp_path: Path) -> None:
    """The launcher tells all ranks; some other program may tell one."""

    def terminate_one(process: subprocess.Popen[str]) -> None:
        assert process.stderr is not None
        assert "following 2 branches" in process.stderr.readline()
        time.sleep(0.5)
        os.kill(ranks_of(process.pid)[-1], signal.SIGTERM)

    ended = run_to_end(3, [*FAKED_STUDY, "-o", "out.nc"], tmp_path, SLOW, terminate_one)
    assert ended.status == 130
    assert ended.said.count("run-study: interrupted: out.nc holds ") == 1
    assert ended.seconds < 10.0
    assert (results(tmp_path / "out.nc").outcome == NOT_COMPUTED).any()

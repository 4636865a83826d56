"""A run that is ended at any point leaves a result that opens, and the next one ends with the same numbers."""

import contextlib
import os
import signal
import sqlite3
import time
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from solver.outcome import Outcome
from solver.packing import Packed
from studyrunner.cli import main
from studyrunner.kinds.wear import History, Sweep
from studyrunner.mpi import schedule
from studyrunner.result import write
from tests.mpi.launching import count_entries, results
from tests.studyrunner.faked_runs import SMALL
from tests.studyrunner.fakes import fake_sweep

pytestmark = [pytest.mark.usefixtures("folder"), pytest.mark.processes]

N_POINTS, N_RESULTS = 8, 4 + 8
TWO_WAYS = [*SMALL[:-2], "--set", "axes.sweep=['up', 'down']", *SMALL[-2:]]


def whole(solver, study=TWO_WAYS):
    """The result of a run that nothing disturbs."""
    assert main([*study[:-1], "whole.nc"]) == 0
    solver.begin_again()
    return results("whole.nc")


def assert_partial(found, expected):
    """Points that are there are right, the others hold nothing; how many are there."""
    left = found.outcome == Outcome.NOT_COMPUTED
    for name in set(found.data_vars) - {"outcome", "message", "stuck_frequency"}:
        for point in np.argwhere(left.values):
            there = found[name].values[tuple(point)]
            assert (np.isnan(there) if there.dtype.kind == "f" else there == 0).all(), name
        xr.testing.assert_equal(found[name].where(~left), expected[name].where(~left))
    return int((~left).sum())


@pytest.mark.slow
def test_an_interrupt_in_the_midst(solver, capsys):
    expected = whole(solver)
    solver.end_at(8)
    capsys.readouterr()
    assert main(TWO_WAYS) == 130
    n_there = assert_partial(results(), expected)
    said = capsys.readouterr().err.splitlines()[-1]
    assert said == f"run-study: interrupted: out.nc holds {n_there} of {N_POINTS} points, the same command goes on"
    n_first = solver.n_results - 1
    solver.begin_again()
    assert main(TWO_WAYS) == 0
    assert n_first + solver.n_results == N_RESULTS
    xr.testing.assert_identical(results(), expected)
    assert f"{n_there} of {N_POINTS} points are there from an earlier run" in capsys.readouterr().err


def test_a_signal_while_the_whole_result_is_written_changes_nothing(solver, monkeypatch, capsys):
    own = write.write_result

    def end(*given, **more):
        os.kill(os.getpid(), signal.SIGTERM)
        return own(*given, **more)

    monkeypatch.setattr(write, "write_result", end)
    assert main(SMALL) == 0
    assert (results().outcome == 0).all()
    assert "interrupted" not in capsys.readouterr().err


@pytest.mark.slow
def test_an_exception_is_one_bad_point(solver, capsys):
    expected = whole(solver)

    def fail(task, _):
        if isinstance(task, History) and (task.sweep, task.position, task.wear_coefficient) == (1, 0, 1e-11):
            raise ZeroDivisionError("a bug in\nthe solver")

    solver.disturb = fail
    assert main(TWO_WAYS) == 3
    said = capsys.readouterr().out.splitlines()
    assert any(line.startswith("failed") and "unexpected error" in line for line in said)
    found = results()
    bad = {"frequency": 100.0, "sweep": "down", "wear_coefficient": 1e-11}
    assert found.outcome.sel(bad).item() == 11
    line = str(found.message.sel(bad).item())
    assert line.startswith("ZeroDivisionError: a bug in the solver (test_going_on.py, line ")
    assert int((found.outcome == 0).sum()) == N_POINTS - 1
    good = found.outcome == 0
    xr.testing.assert_equal(found.worn_volume.where(good), expected.worn_volume.where(good))
    # another run does not try it again
    solver.begin_again()
    assert main(TWO_WAYS) == 3
    assert solver.tasks == []
    xr.testing.assert_identical(results(), found)
    # unless it is asked to
    assert main([*TWO_WAYS, "--retry-failed"]) == 0
    assert len(solver.tasks) == 1
    xr.testing.assert_identical(results(), expected)


def test_a_second_run_of_the_same_study_is_refused(solver, capsys, monkeypatch):
    second: list[int] = []

    def run_again(_, n_results):
        # signals are for the main thread
        if n_results == 1:
            second.append(main(TWO_WAYS))

    monkeypatch.setattr("studyrunner.cli.take_endings", lambda: None)
    monkeypatch.setattr("studyrunner.checkpoint.store._SECONDS_TO_DIE", 0.1)
    solver.disturb = run_again
    assert main(TWO_WAYS) == 0
    assert second == [2]
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("run-study:")]
    assert "out.nc.progress: in use: by process" in line
    assert "wait for its end, or give another result file with -o" in line


@pytest.mark.slow
def test_progress_is_gone_on_from(solver, monkeypatch):
    expected = whole(solver)
    monkeypatch.setattr(schedule, "SECONDS_TO_PROGRESS", 0.01)
    evaluate = solver.evaluate

    def slow(model, task, keep):
        if isinstance(task, History) and task.resume is None:
            time.sleep(0.02)
            keep(Packed("half of it", (np.array([task.number]),)))
            raise KeyboardInterrupt
        yield from evaluate(model, task, keep)

    monkeypatch.setattr(solver, "evaluate", slow)
    # each run comes as far as to the first half of one more march
    assert [main(TWO_WAYS) for _ in range(9)] == [130] * 8 + [0]
    marches = [task for task in solver.tasks if isinstance(task, History)]
    assert len(marches) == 8
    assert all(task.resume == Packed("half of it", (np.array([task.number]),)) for task in marches)
    xr.testing.assert_identical(results(), expected)
    assert count_entries("progress") == 0


def test_progress_beyond_states_that_are_lost_is_no_harm(solver, monkeypatch):
    """Start states may be damaged while the progress of their branch is not."""
    study = [arg.replace("[100, 110]", "[100, 110, 120]") for arg in TWO_WAYS]
    expected = whole(solver, study)
    monkeypatch.setattr(schedule, "SECONDS_TO_PROGRESS", -1.0)
    own, ended = solver.evaluate, False

    def resume(task, models, keep):
        nonlocal ended
        passed = 0 if task.resume is None else int(task.resume.arrays[0])
        for number, start in enumerate(fake_sweep(replace(task, known=frozenset()))):
            if number >= passed and start.place not in task.known:
                yield start
                if number == 1 and not ended:
                    ended = True
                    raise KeyboardInterrupt
                keep(Packed("sweep", (np.array(number + 1),)))

    monkeypatch.setattr(Sweep, "_compute", resume)
    monkeypatch.setattr(
        solver,
        "evaluate",
        lambda model, task, keep: task.compute({}, keep) if task.gives_starts else own(model, task, keep),
    )
    assert main(study) == 130
    assert count_entries("progress") > 0
    with contextlib.closing(sqlite3.connect("out.nc.progress")) as database, database:
        database.execute("DELETE FROM entries WHERE kind = 'start'")
    assert main(study) == 0
    xr.testing.assert_identical(results(), expected)


@pytest.mark.slow
def test_a_march_that_was_given_up_goes_on_with_more_time(monkeypatch):
    """With the solver itself: to the numbers of a march that had the time at once."""
    from solver.newton import run as newton
    from solver.wear import history

    study = [
        *("sdof_slider", "--set", "axes.frequency=[160]", "--set", "axes.scheme=['implicit']"),
        *("--set", "solver.harmonics=5", "--set", "solver.samples=64", "--set", "slow_time.cycles=100_000"),
        *("--set", "axes.step=500"),
    ]
    assert main([*study, "-o", "whole.nc"]) == 0
    own, begun = history.integrate_together, []
    own_clock, n_looks = newton.computing_time, 0

    def integrate(*given):
        begun.append(given[-1])
        return own(*given)

    def clock():
        # the time is over in the midst of the march, however fast the machine is
        nonlocal n_looks
        n_looks += bool(begun)
        return np.inf if n_looks > 150 else own_clock()

    monkeypatch.setattr(history, "integrate_together", integrate)
    study += ["-o", "out.nc"]
    with monkeypatch.context() as slow:
        slow.setattr(newton, "computing_time", clock)
        assert main([*study, "--set", "solver.time_limit=1e6"]) == 3
        reached = results().last_cycle.item()
        assert 0.0 < reached < 100_000.0
        # without being asked it is not tried again
        assert main([*study, "--set", "solver.time_limit=1e6"]) == 3
        assert len(begun) == 1
    assert main([*study, "--retry-failed", "--set", "solver.time_limit=2e6"]) == 0
    assert [resume is not None for resume in begun] == [False, True]
    # but for the limit, which stands in their attributes
    xr.testing.assert_equal(results(), results("whole.nc"))
    assert count_entries("progress") == 0

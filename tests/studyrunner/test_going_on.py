"""A run that is ended at any point, or that a fault of the machine disturbs, leaves a result; the next one ends it."""

import contextlib
import os
import re
import signal
import sqlite3
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from solver.outcome import Outcome
from solver.packing import Packed
from studyrunner import cli
from studyrunner.checkpoint import store
from studyrunner.checkpoint.completion_index import CompletionIndex
from studyrunner.cli import main
from studyrunner.kinds.wear.histories import History, Sweep
from studyrunner.mpi import schedule
from studyrunner.result import write
from studyrunner.user_error import UserError
from tests.mpi.launching import count_entries, options, results
from tests.studyrunner.small_studies import SMALL

pytestmark = [pytest.mark.usefixtures("folder"), pytest.mark.processes]

N_POINTS = 8
TWO_WAYS = [*SMALL[:-2], "--set", "axes.sweep=['up', 'down']", *SMALL[-2:]]
NO_ROOM = OSError(122, "Disk quota exceeded")


def whole(solver, study=TWO_WAYS):
    """The result of a run that nothing disturbs."""
    assert main([*study[:-1], "whole.nc"]) == 0
    solver.begin_again()
    return results("whole.nc")


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
    said = capsys.readouterr().out
    assert f"{N_POINTS - 1} computed, 1 failed" in said
    assert "\nfailed" in said
    found = results()
    bad = {"frequency": 100.0, "sweep": "down", "wear_coefficient": 1e-11}
    assert found.outcome.sel(bad).item() == Outcome.EXCEPTION
    assert found.worn_volume.sel(bad).isnull().all()
    line = str(found.message.sel(bad).item())
    assert line.startswith("ZeroDivisionError: a bug in the solver (fail, test_going_on.py, line ")
    good = found.outcome == 0
    assert int(good.sum()) == N_POINTS - 1
    xr.testing.assert_equal(found.worn_volume.where(good), expected.worn_volume.where(good))
    # another run does not try it again, unless it is asked to
    for more, status, n_tasks, after in (([], 3, 0, found), (["--retry-failed"], 0, 1, expected)):
        solver.begin_again()
        assert main([*TWO_WAYS, *more]) == status
        assert len(solver.tasks) == n_tasks
        xr.testing.assert_identical(results(), after)


def test_no_other_run_writes_the_result_before_its_last_lines_are_read(solver, monkeypatch):
    monkeypatch.setattr(store, "_SECONDS_TO_DIE", 0.1)
    own = cli._answer

    def answer(path):
        with pytest.raises(UserError, match="in use"):
            store.Store(path.with_name("out.nc.progress"))
        return own(path)

    monkeypatch.setattr(cli, "_answer", answer)
    assert main(SMALL) == 0


@pytest.mark.slow
def test_a_history_that_was_given_up_goes_on_with_more_time(monkeypatch):
    """With the solver itself: to the numbers of a history that had the time at once."""
    from solver.newton import run as newton
    from solver.wear import history

    study = ["sdof_slider", *options("axes.frequency=160", "axes.scheme=implicit", "axes.step=500")]
    study += options("solver.harmonics=5", "solver.samples=64", "slow_time.cycles=100_000")
    assert main([*study, "-o", "whole.nc"]) == 0
    own, begun = history.integrate_together, []
    own_clock, n_looks = newton.computing_time, 0

    def integrate(*given):
        begun.append(given[5])
        return own(*given)

    def clock():
        # the time is over in the midst of the history, however fast the machine is
        nonlocal n_looks
        n_looks += bool(begun)
        return np.inf if n_looks > 150 else own_clock()

    monkeypatch.setattr(history, "integrate_together", integrate)
    limited = [*study, "-o", "out.nc", "--set", "solver.time_limit=1e6"]
    with monkeypatch.context() as slow:
        slow.setattr(newton, "computing_time", clock)
        assert main(limited) == 3
        assert 0.0 < results().last_cycle.item() < 100_000.0
        # without being asked it is not tried again
        assert main(limited) == 3
        assert len(begun) == 1
    assert main([*limited[:-1], "solver.time_limit=2e6", "--retry-failed"]) == 0
    assert [resume is not None for resume in begun] == [False, True]
    # but for the limit, which stands in their attributes
    xr.testing.assert_equal(results(), results("whole.nc"))
    assert count_entries("progress") == 0


def in_words(text):
    """JSON, or JSON in a text of JSON, with words for the numbers that have a point."""
    quote = '\\"' if '\\"' in text else '"'
    return re.sub(r"\d+\.\d+", lambda _: f"{quote}much{quote}", text)


ALTERED = {
    "empty arrays": lambda text, arrays: (text, [array[:0] for array in map(np.atleast_1d, arrays)]),
    "one number": lambda text, arrays: (text, [np.ones(1, array.dtype) for array in arrays]),
    "other numbers": lambda text, arrays: (text, [array.astype(complex) for array in arrays]),
    "deep text": lambda _, arrays: ("[" * 100_000, arrays),
    "text for numbers": lambda text, arrays: (in_words(text), arrays),
}


@pytest.fixture(scope="module")
def broken_off(tmp_path_factory):
    """A run of the solver itself that was ended in its second history: the study, its result, and what is left."""
    folder, own = tmp_path_factory.mktemp("broken_off"), CompletionIndex.keep

    def keep(self, task, progress):
        own(self, task, progress)
        if isinstance(task, History) and self.n_points_finished:
            raise KeyboardInterrupt

    study = [*SMALL[:-2], *options("solver.harmonics=3", "solver.samples=32")]
    study += [*options("axes.wear_coefficient=1e-11", "slow_time.cycles=20_000", "axes.step=100"), "-o", "out.nc"]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(schedule, "SECONDS_TO_PROGRESS", 0.0)
        assert main([*study[:-1], "whole.nc"]) == 0
        patch.setattr(CompletionIndex, "keep", keep)
        assert main(study) == 130
        assert [count_entries(kind) > 0 for kind in ("result", "progress", "computed")] == [True] * 3
        return study, results("whole.nc"), Path("out.nc.progress").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["result", "progress", "computed"])
@pytest.mark.parametrize("how", ALTERED)
def test_entries_that_were_altered_are_computed_again(how, kind, broken_off):
    study, expected, left = broken_off
    Path("out.nc.progress").write_bytes(left)
    with contextlib.closing(sqlite3.connect("out.nc.progress", isolation_level=None)) as changed:
        for key, blob in changed.execute("SELECT key, blob FROM entries WHERE kind=?", [kind]).fetchall():
            packed = store.from_blob(blob)
            text, arrays = ALTERED[how](packed.text, packed.arrays)
            blob = store.to_blob(Packed(text, tuple(arrays)))
            changed.execute("UPDATE entries SET blob=? WHERE kind=? AND key=?", [blob, kind, key])
        changed.execute("INSERT INTO entries VALUES ('crashes', 'of a task', 'no number')")
    assert main(study) == 0
    xr.testing.assert_identical(results(), expected)


# --- faults of the machine ---

OF_NUMPY = type("_ArrayMemoryError", (MemoryError,), {})("Unable to allocate 8.00 TiB")
FAULTS = [NO_ROOM, MemoryError(), OF_NUMPY, RuntimeError("can't start new thread")]


def assert_goes_on(study, expected, solver, fault, capsys):
    """The run ends in one sentence, and the same command completes it."""
    assert main(study) == 1
    said = capsys.readouterr().err
    (line,) = [line for line in said.splitlines() if line.startswith("run-study: ")]
    assert line.startswith(f"run-study: {type(fault).__name__}: {fault}")
    assert line.endswith("a fault of the machine; what was computed is kept, and the same command goes on from it")
    assert "Traceback" not in said
    solver.begin_again()
    assert main(study) == 0
    xr.testing.assert_identical(results(), expected)


@pytest.mark.parametrize(("kind", "fault"), list(zip(2 * [Sweep, History], FAULTS, strict=True)))
def test_a_run_that_a_fault_of_the_machine_has_ended_goes_on(kind, fault, solver, capsys):
    expected = whole(solver, SMALL)

    def disturb(task, _):
        if isinstance(task, kind):
            raise fault

    solver.disturb = disturb
    assert_goes_on(SMALL, expected, solver, fault, capsys)


@pytest.mark.parametrize(
    ("fault", "place"), [(FAULTS[3], "threading.Thread.start"), (FAULTS[1], "studyrunner.run.small_arrays")]
)
def test_a_fault_of_the_machine_outside_of_tasks(fault, place, solver, monkeypatch, capsys):
    expected = whole(solver, SMALL)

    def fail(*_, **__):
        broken.undo()
        raise fault

    with monkeypatch.context() as broken:
        broken.setattr(place, fail)
        assert_goes_on(SMALL, expected, solver, fault, capsys)


@pytest.mark.slow
def test_an_error_that_the_solver_takes_for_an_end_is_none(monkeypatch):
    """With the solver itself, whose histories break off in their midst."""
    from solver.wear.wearing_joint import WearingJoint

    own, n_calls = WearingJoint.with_rates, 0

    def with_rates(self, *given):
        nonlocal n_calls
        n_calls += 1
        if n_calls in (3, 30):
            raise FAULTS[n_calls % 2]
        return own(self, *given)

    monkeypatch.setattr(WearingJoint, "with_rates", with_rates)
    command = [*SMALL, "--set", "solver.harmonics=3", "--set", "solver.samples=32"]
    assert [main(command) for _ in range(3)] == [1, 1, 0]
    assert n_calls > 30
    assert (results().outcome == 0).all()

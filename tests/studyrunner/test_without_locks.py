"""Two runs with one result file where nothing keeps them apart: neither takes anything for its own that is not."""

from __future__ import annotations

import errno
import itertools
import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from solver.outcome import Outcome
from studyrunner.checkpoint.packed_files import unpack_records
from studyrunner.checkpoint.store import Store
from studyrunner.cli import main
from studyrunner.system import folder_lock
from tests.studyrunner.faked_runs import Solver, Task
from tests.studyrunner.test_store import KIND, assert_same, kept, key, names, record, records_of

SMALL = [
    "sdof_slider",
    *("--set", "axes.frequency=[100, 110]"),
    *("--set", "axes.wear_coefficient=[5e-12, 1e-11]"),
    *("--set", "axes.scheme=implicit"),
    *("--set", "solver.shortcuts=false"),
    *("-o", "out.nc"),
]
VARIANT = [*SMALL, "--set", "axes.excitation_amplitude=11"]


def no_locks(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on file systems that know none."""

    def fail(*_: object) -> None:
        raise OSError(errno.ENOSYS, "Function not implemented")

    monkeypatch.setattr(folder_lock.fcntl, "flock", fail)


def locks_of_two_hosts(monkeypatch: pytest.MonkeyPatch) -> None:
    """As where each host knows its own only."""
    monkeypatch.setattr(folder_lock.fcntl, "flock", lambda *_: None)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("locks", [no_locks, locks_of_two_hosts])
def test_two_stores_in_a_folder_share_no_file(
    locks: Callable[[pytest.MonkeyPatch], None], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    locks(monkeypatch)
    stores = [Store(folder / "out.nc.parts", KIND) for _ in range(2)]
    for number in range(60):
        for place, store in enumerate(stores):
            store.add_history(key(100 * place + number), record(100 * place + number))
            store.add_start(key(100 * place + number), kept(100 * place + number))
            store.keep_progress(key(place), kept(number + place))
            store.flush()
    for place, store in enumerate(stores):
        numbers = range(100 * place, 100 * place + 60)
        assert records_of(store) == {key(number): record(number).tobytes() for number in numbers}
        for number in numbers:
            assert_same(store.read_start(key(number)), kept(number))
        found = store.read_progress(key(place))
        assert found is not None
        assert_same(found, kept(59 + place))
        store.close()
    assert len(set(names(folder / "out.nc.parts"))) <= len(list((folder / "out.nc.parts").iterdir()))
    store = Store(folder / "out.nc.parts", KIND)
    assert len(store.histories) == 120
    store.close()


def test_what_another_run_may_be_at_is_left_alone(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    no_locks(monkeypatch)
    first = Store(folder / "parts", KIND)
    first.add_history(key(0), record(0))
    first.flush()
    (folder / "parts" / "00000009-0123456789ab.npy.partial").write_bytes(b"half of")
    (folder / "parts" / "00000009-0123456789ab.starts").write_bytes(b"damaged")
    before = names(folder / "parts")
    second = Store(folder / "parts", KIND)
    assert any("there are no locks on this file system" in note for note in second.notes)
    second.forget_history(key(0))
    second.remove_forgotten()
    second.prune((), (), (), 0.0)
    second.close()
    assert names(folder / "parts") == before
    assert records_of(first) == {key(0): record(0).tobytes()}
    first.close()


def test_a_run_says_once_that_there_are_no_locks(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    no_locks(monkeypatch)
    Solver(monkeypatch)
    assert main(SMALL) == 0
    lines = [line for line in capsys.readouterr().err.splitlines() if "locks" in line]
    assert len(lines) == 1
    assert lines[0].endswith("so nothing keeps a second run out: give each run a result file of its own with -o")


@pytest.mark.slow
@pytest.mark.parametrize("locks", [no_locks, locks_of_two_hosts])
@pytest.mark.parametrize("at", [1, 2, 4, 6])
def test_two_studies_with_one_result_file_do_not_mix(
    locks: Callable[[pytest.MonkeyPatch], None], at: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second one runs from its start to its end while the first one is at work."""
    locks(monkeypatch)
    solver = Solver(monkeypatch)
    expected = {}
    for name, command in (("first.nc", SMALL), ("second.nc", VARIANT)):
        assert main([*command[:-1], name] if command is SMALL else [*command, "-o", name]) == 0
        with xr.open_dataset(name) as result:
            expected[name] = result.load().drop_vars("run_time")
    status: list[int] = []

    def run_the_other(_: Task, n_results: int) -> None:
        if n_results == at and not status:
            status.append(-1)
            status[0] = main(VARIANT)
            with xr.open_dataset("out.nc") as result:
                xr.testing.assert_identical(result.load().drop_vars("run_time"), expected["second.nc"])

    solver.begin_again()
    solver.disturb = run_the_other
    monkeypatch.setattr("studyrunner.cli.take_endings", lambda: None)
    assert main(SMALL) == 0
    assert status == [0]
    with xr.open_dataset("out.nc") as result:
        xr.testing.assert_identical(result.load().drop_vars("run_time"), expected["first.nc"])


@pytest.mark.slow
@pytest.mark.parametrize("change", ["another record", "missing", "shorter", "another kind"])
def test_a_record_that_is_not_the_one_asked_for_is_no_result(
    change: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A file that changes between the time that it was written and the end of the run."""
    Solver(monkeypatch)
    assert main(SMALL) == 0
    with xr.open_dataset("out.nc") as result:
        expected = result.load().drop_vars("run_time")
    # the file of a study of the same shape, with other histories
    assert main([*VARIANT, "-o", "other.nc"]) == 0
    Path("out.nc").unlink()
    own_read, changed = Store.read, itertools.count()

    def read(store: Store, number: int) -> np.ndarray:
        path = store.path(number)
        if next(changed) == 0:
            if change == "another record":
                other = max(Path("other.nc.parts").glob("*.npy.z"), key=lambda file: file.stat().st_size)
                n_bytes = path.stat().st_size
                with path.open("wb") as file:
                    unpack_records(file, other)
                assert path.stat().st_size >= n_bytes
            elif change == "missing":
                path.unlink()
            elif change == "shorter":
                os.truncate(path, 1000)
            else:
                np.save(path.with_suffix(".other"), np.zeros(100))
                path.with_suffix(".other.npy").replace(path)
        return own_read(store, number)

    with monkeypatch.context() as disturbed:
        disturbed.setattr(Store, "read", read)
        assert main(SMALL) == 3
    said = capsys.readouterr().out
    assert "does not hold any more what this run has written there: its points are not computed" in said
    with xr.open_dataset("out.nc") as result:
        found = result.load().drop_vars("run_time")
    there = found.outcome != Outcome.NOT_COMPUTED
    assert not bool(there.all())
    xr.testing.assert_equal(found.worn_volume.where(there), expected.worn_volume.where(there))
    time.sleep(0.01)
    assert main(SMALL) == 0
    with xr.open_dataset("out.nc") as result:
        xr.testing.assert_identical(result.load().drop_vars("run_time"), expected)

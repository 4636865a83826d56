"""Two runs with one result file where nothing keeps them apart: neither takes anything for its own that is not."""

import contextlib

import pytest
import xarray as xr

from solver.outcome import Outcome
from studyrunner.checkpoint import store as store_module
from studyrunner.checkpoint.database import RESULTS
from studyrunner.checkpoint.store import Store
from studyrunner.cli import main
from studyrunner.netcdf import gather
from tests.mpi.launching import results
from tests.studyrunner.faked_runs import SMALL as FAKED
from tests.studyrunner.faked_runs import Solver
from tests.studyrunner.test_store import assert_same, entries_of, fill, kept, key, put

SMALL = [*FAKED, "--set", "solver.shortcuts=false"]
VARIANT = [*SMALL, "--set", "axes.excitation_amplitude=11"]


def no_locks(monkeypatch):
    """As on file systems that know none."""
    monkeypatch.setattr(store_module, "has_locks", lambda _: False)


@pytest.fixture(autouse=True)
def path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path / "out.nc.progress"


def test_each_run_has_a_file_of_its_own_and_takes_what_is_finished(path, monkeypatch):
    fill(path, range(2))
    no_locks(monkeypatch)
    first, second = Store(path), Store(path)
    assert len({path, first.path, second.path}) == 3
    assert entries_of(first).keys() == entries_of(second).keys()
    for number in range(10, 40):
        for place, store in enumerate((first, second)):
            put(store, RESULTS, 100 * place + number)
            store.keep_progress(key(9), kept(number + place))
            store.flush()
    third = Store(path)
    assert third.on_disk(RESULTS) == {key(number) for number in (0, 1, *range(10, 40), *range(110, 140))}
    for (table, name), packed in entries_of(third).items():
        if table == RESULTS:
            assert_same(packed, kept(int(name, 16)))
    assert_same(first.read_progress(key(9)), kept(39))
    assert_same(second.read_progress(key(9)), kept(40))
    for store in (first, second, third):
        store.close()


def test_what_another_run_may_be_at_is_left_alone(path, monkeypatch):
    no_locks(monkeypatch)
    with contextlib.closing(Store(path)) as first:
        put(first, RESULTS, 0)
        first.flush()
        damaged = path.with_name(f"{path.name}-0123456789ab")
        damaged.write_bytes(first.path.read_bytes()[:9000])
        before = {found: found.read_bytes() for found in (damaged, first.path)}
        with contextlib.closing(Store(path)) as second:
            no_lock, said = second.notes
            assert "there are no locks on this file system" in no_lock
            assert said == f"{damaged.name} is not used: it is damaged, or another run writes it now"
            second.forget(RESULTS, key(0))
            second.prune({}, 0.0)
            assert entries_of(second) == {}
        assert {found: found.read_bytes() for found in before} == before


@pytest.mark.slow
@pytest.mark.parametrize("at", [2, 6])
def test_two_studies_with_one_result_file_do_not_mix(at, monkeypatch):
    """The second one runs from its start to its end while the first one is at work."""
    no_locks(monkeypatch)
    solver = Solver(monkeypatch)
    expected = {}
    for name, command in (("first.nc", SMALL), ("second.nc", VARIANT)):
        assert main([*command, "-o", name]) == 0
        expected[name] = results(name)
    status: list[int] = []

    def run_the_other(_, n_results):
        if n_results == at and not status:
            status.append(-1)
            status[0] = main(VARIANT)
            xr.testing.assert_identical(results(), expected["second.nc"])

    solver.begin_again()
    solver.disturb = run_the_other
    monkeypatch.setattr("studyrunner.cli.take_endings", lambda: None)
    assert main(SMALL) == 0
    assert status == [0]
    xr.testing.assert_identical(results(), expected["first.nc"])


@pytest.mark.slow
@pytest.mark.parametrize("change", ["UPDATE results SET content=x'00'", "DELETE FROM results"])
def test_a_result_that_goes_during_the_run_is_no_result(change, monkeypatch):
    """As by a fault of the disk."""
    Solver(monkeypatch)
    assert main([*SMALL, "-o", "whole.nc"]) == 0
    own = gather._read_through

    def read_through(study, facts, completion):
        with completion.store._transaction():
            completion.store._database.execute(f"{change} WHERE frequency = 110")
        return own(study, facts, completion)

    with monkeypatch.context() as disturbed:
        disturbed.setattr(gather, "_read_through", read_through)
        assert main(SMALL) == 3
    with xr.open_dataset("out.nc") as result, xr.open_dataset("whole.nc") as whole:
        there = result.outcome != Outcome.NOT_COMPUTED
        assert int(there.sum()) == there.size // 2
        xr.testing.assert_equal(result.worn_volume.where(there), whole.worn_volume.where(there))
    assert main(SMALL) == 0
    xr.testing.assert_identical(results(), results("whole.nc"))

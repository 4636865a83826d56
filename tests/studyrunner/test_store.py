"""The file of a study: what was written is there later; damage, other runs, and faults of the disk."""

import contextlib
import itertools
import os
import sqlite3

import numpy as np
import pytest

from solver.packing import Packed
from studyrunner.checkpoint import store
from studyrunner.checkpoint.store import COMPUTED, PROGRESS, RESULTS, Store, read_study
from studyrunner.user_error import StorageError, UserError

KINDS = (RESULTS, PROGRESS, COMPUTED)


def key(number):
    return f"{number:032x}"


def kept(number):
    return Packed(f"é state {number}", (np.arange(3.0) + number, np.full((2, 2), number * 1j)))


def fill(path, numbers=range(4)):
    """A run that computes some entries and ends."""
    with contextlib.closing(Store(path)) as opened:
        for number in numbers:
            for kind in KINDS:
                opened.put(kind, key(number), kept(number))
            opened.flush()


def entries_of(opened):
    return {(kind, key): opened.read(kind, key) for kind in KINDS for key in sorted(opened.keys(kind))}


def assert_same(found, expected):
    assert found.text == expected.text
    for one, other in zip(found.arrays, expected.arrays, strict=True):
        np.testing.assert_array_equal(one, other, strict=True)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "out.nc.progress"


@pytest.fixture
def opened(path):
    with contextlib.closing(Store(path)) as found:
        yield found


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    monkeypatch.setattr(store, "_SECONDS_TO_DIE", 0.2)


def test_what_is_read_is_what_was_added_now_and_in_a_later_run(path):
    with contextlib.closing(Store(path)) as opened:
        for number, kind in itertools.product(range(7), KINDS):
            opened.put(kind, key(number), kept(number))
            assert_same(opened.read(kind, key(number)), kept(number))
            if number % 3 == 1:
                opened.flush()
    assert list(path.parent.iterdir()) == [path]
    with contextlib.closing(Store(path)) as opened:
        found = entries_of(opened)
        assert len(found) == 7 * len(KINDS)
        for (_, name), packed in found.items():
            assert_same(packed, kept(int(name, 16)))
        assert opened.read(RESULTS, key(8)) is None
        assert opened.notes == []


ARRAYS = [
    np.zeros((3, 0, 2)),
    np.array(-0.0),
    np.array([np.nan, -np.nan, np.inf, -0.0, 5e-324]),
    np.arange(24.0).reshape(2, 3, 4).transpose(2, 0, 1),
    np.arange(6.0)[::2] * 1j,
    np.array([True, False]),
    np.array(["é", "", "long text"]),
    np.arange(5, dtype=">f8"),
]


def test_arrays_are_kept_to_the_last_bit():
    given = Packed('{"text": "\udce9"}', tuple(ARRAYS))
    found = store.from_blob(store.to_blob(given))
    assert found.text == given.text
    for one, array in zip(found.arrays, ARRAYS, strict=True):
        assert (one.dtype, one.shape, one.tobytes()) == (array.dtype, array.shape, array.tobytes())
    with pytest.raises(TypeError, match="arrays of objects"):
        store.to_blob(Packed("", (np.array([{}], dtype=object),)))


def test_a_transaction_without_room_ends_the_run_and_costs_no_other_one(path):
    fill(path, range(2))
    with contextlib.closing(Store(path)) as opened:
        (n_pages,) = opened._database.execute("PRAGMA page_count").fetchone()
        opened._database.execute(f"PRAGMA max_page_count={n_pages + 1}").fetchall()
        opened.put(RESULTS, key(7), kept(7))
        with pytest.raises(StorageError, match="database or disk is full"):
            opened.put(PROGRESS, key(7), Packed("", (np.random.default_rng(0).random(10_000),)))
    with contextlib.closing(Store(path)) as opened:
        assert set(entries_of(opened)) == {(kind, key(number)) for kind in KINDS for number in range(2)}


def test_what_is_forgotten_is_gone_later_or_replaced_by_what_comes(path):
    fill(path)
    with contextlib.closing(Store(path)) as opened:
        opened.forget(RESULTS, key(1))
        opened.forget(PROGRESS, key(2))
        assert opened.read(RESULTS, key(1)) is None
        opened.put(RESULTS, key(1), kept(77))
    with contextlib.closing(Store(path)) as opened:
        assert_same(opened.read(RESULTS, key(1)), kept(77))
        assert key(2) not in opened.keys(PROGRESS)


def test_tasks_under_way_are_counted_where_a_run_ended_hard(path):
    """None that has given something, and none where the run ended in good order."""

    def end_hard(*keys, alive=()):
        opened = Store(path)
        opened.note_study("of a joint")
        for note, noted in ((opened.note_begin, keys), (opened.note_life, alive)):
            for each in noted:
                note(each)
            opened.flush()
        opened._database.close()
        return opened.crashes

    assert end_hard("a", "b", "c", alive=["b"]) == {}
    assert end_hard("a", "c", alive=["c"]) == {"a": 1}
    assert end_hard("a") == {"a": 2}
    for ended_hard, note, after in ((True, "note_begin", {"a": 3}), (False, "note_life", {"a": 3}), (False, None, {})):
        with contextlib.closing(Store(path)) as opened:
            assert (opened.ended_hard, opened.crashes) == (ended_hard, after)
            if note:
                getattr(opened, note)("a")


def change_tables(path, command):
    with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as changed:
        changed.execute(command).fetchall()


def write_over(path):
    with path.open("rb+") as file:
        file.seek(4096)
        file.write(os.urandom(4096))


DAMAGES = {
    "cut off": lambda path: os.truncate(path, path.stat().st_size // 2),
    "a page": write_over,
    "another file": lambda path: path.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(1000)),
    "another table": lambda path: change_tables(path, "CREATE VIEW spam AS SELECT load_extension('egg')"),
    "another version": lambda path: change_tables(path, "PRAGMA user_version=1"),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_file_or_that_of_another_version_is_kept_aside_and_the_study_begins_anew(damage, path):
    fill(path)
    DAMAGES[damage](path)
    before = path.read_bytes()
    with contextlib.closing(Store(path)) as opened:
        (note,) = opened.notes
        assert "out.nc.progress.old" in note
        assert entries_of(opened) == {}
        opened.put(RESULTS, key(8), kept(8))
        assert path.with_name("out.nc.progress.old").read_bytes() == before
    with contextlib.closing(Store(path)) as opened:
        assert opened.notes == []
        assert opened.keys(RESULTS).keys() == {key(8)}


def test_a_damaged_entry_is_forgotten_and_nothing_else(path):
    fill(path)
    change_tables(path, f"UPDATE entries SET blob=x'00' WHERE kind='{RESULTS}' AND key='{key(1)}'")
    with contextlib.closing(Store(path)) as opened:
        assert sum(found is None for found in entries_of(opened).values()) == 1
        assert opened.keys(RESULTS).keys() == {key(0), key(2), key(3)}


def test_a_disk_that_fails_for_now_is_no_reason_to_throw_anything_away(path, monkeypatch):
    fill(path)

    def fail(*_, **__):
        error = sqlite3.OperationalError("disk I/O error")
        error.sqlite_errorcode = sqlite3.SQLITE_IOERR_READ
        raise error

    with monkeypatch.context() as broken:
        broken.setattr(store, "_check", fail)
        with pytest.raises(StorageError, match="disk I/O error"):
            Store(path)
    with contextlib.closing(Store(path)) as opened:
        assert (len(entries_of(opened)), opened.notes) == (4 * len(KINDS), [])


@pytest.mark.parametrize("replaced", [False, True])
def test_a_file_that_was_removed_meanwhile_is_said(replaced, opened, path):
    path.unlink()
    if replaced:
        path.write_bytes(b"of somebody else")
    opened.put(RESULTS, key(2), kept(2))
    with pytest.raises(StorageError, match=r"another file has taken its place|No such file"):
        opened.flush()


def test_two_runs_are_kept_apart(path, opened):
    for _ in range(2):
        with pytest.raises(UserError, match=rf"in use: by process {os.getpid()} on \S+: "):
            Store(path)
    assert read_study(path) is None  # it has not said so, and nobody waits for its lock
    opened.note_study("of a joint")
    assert read_study(path) == "of a joint"
    assert read_study(path.with_name("none")) is None

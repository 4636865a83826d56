"""The file of a study: what was written is there later; damage, other runs, and files that nobody vouches for."""

import contextlib
import os
import random
import shutil
import sqlite3
import subprocess
import sys
import threading
import zlib
from pathlib import Path

import numpy as np
import pytest

from solver.packing import Packed
from studyrunner.checkpoint import contents, database, entries
from studyrunner.checkpoint import store as store_module
from studyrunner.checkpoint.database import COMPUTED, RESULTS, STARTS, TABLES, UNDER_WAY, StoreInUseError
from studyrunner.checkpoint.store import SECONDS_A_TRANSACTION, Store
from studyrunner.user_error import StorageError


def key(number):
    return f"{number:032x}"


def kept(number):
    return Packed(f"é state {number}", (np.arange(3.0) + number, np.full((2, 2), number * 1j)))


def put(store, table, number, finished=""):
    store.put(table, key(number), kept(number), {}, finished)


def fill(path, numbers=range(4), tables=TABLES):
    """A run that computes some entries and ends."""
    with contextlib.closing(Store(path)) as store:
        for number in numbers:
            for table in tables:
                put(store, table, number)
            store.flush()


def entries_of(store):
    return {(table, key): store.read(table, key) for table in TABLES for key in sorted(store.on_disk(table))}


def assert_same(found, expected):
    assert found.text == expected.text
    for one, other in zip(found.arrays, expected.arrays, strict=True):
        np.testing.assert_array_equal(one, other, strict=True)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "out.nc.progress"


@pytest.fixture
def opened(path):
    with contextlib.closing(Store(path)) as store:
        yield store


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    monkeypatch.setattr(database, "_SECONDS_TO_DIE", 0.2)


def test_what_is_read_is_what_was_added_now_and_in_a_later_run(path):
    store = Store(path)
    for number in range(7):
        for table in TABLES:
            put(store, table, number)
            assert_same(store.read(table, key(number)), kept(number))
        if number % 3 == 1:
            store.flush()
    store.flush()
    for _ in range(2):
        found = entries_of(store)
        assert len(found) == 7 * len(TABLES)
        for (_, name), packed in found.items():
            assert_same(packed, kept(int(name, 16)))
        assert store.read(RESULTS, key(8)) is None
        store.close()
        assert list(path.parent.iterdir()) == [path]
        store = Store(path)
        assert store.notes == []
    store.close()


ARRAYS = [
    np.zeros(0),
    np.zeros((3, 0, 2)),
    np.array(-0.0),
    np.array(7, "int8"),
    np.array([np.nan, -np.nan, np.inf, -0.0, 5e-324]),
    np.arange(24.0).reshape(2, 3, 4).transpose(2, 0, 1),
    np.arange(6.0)[::2] * 1j,
    np.array([True, False]),
    np.array(["é", "", "long text"]),
    np.array([b"a", b""]),
    np.arange(5, dtype=">f8"),
    np.arange(5, dtype="float32"),
]


@pytest.mark.parametrize("array", ARRAYS, ids=lambda array: f"{array.dtype}{array.shape}")
def test_arrays_are_kept_to_the_last_bit(array):
    found = contents.decompress(*contents.compress(Packed('{"text": "\udce9"}', (array, array)), 6))
    assert found.text == '{"text": "\udce9"}'
    for one in found.arrays:
        assert (one.dtype, one.shape, one.tobytes()) == (array.dtype, array.shape, array.tobytes())
        assert one.flags.writeable


def raw(head, body=b"", length=None):
    content = (len(head) if length is None else length).to_bytes(8, "little") + head + body
    return len(content), zlib.compress(content)


HOSTILE = {
    "a bomb": (1000, zlib.compress(bytes(10**7))),
    "no zlib": (10, b"x" * 10),
    "half of it": (raw(b'["", []]')[0], raw(b'["", []]')[1][:-6]),
    "no JSON": raw(b"[["),
    "a long head": raw(b'["", []]', length=2**63),
    "objects": raw(b'["", [["|O", [1]]]]', bytes(8)),
    "too many numbers": raw(b'["", [["<f8", [100000000000]]]]', bytes(8)),
    "more than it says": raw(b'["", [["<f8", [1]]]]', bytes(9)),
    "too many dimensions": raw(b'["", [["<f8", [' + b"1," * 99 + b"1]]]]", bytes(8)),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_contents_that_no_run_has_written_are_refused(case):
    with pytest.raises(ValueError):  # noqa: PT011 - numpy and json have sentences of their own
        contents.decompress(*HOSTILE[case])


def test_a_first_result_is_written_at_once_and_later_ones_wait_a_moment_for_others(opened, monkeypatch):
    now = 1000.0
    monkeypatch.setattr(store_module.time, "monotonic", lambda: now)
    for number, (seconds, n_written) in enumerate([(0.0, 1), (0.5, 1), (0.6, 3)]):
        put(opened, RESULTS, number)
        now += seconds * SECONDS_A_TRANSACTION
        opened.tick()
        opened._take(wait=True)
        assert len(opened.on_disk(RESULTS)) == n_written


def test_nobody_waits_for_a_slow_disk_unless_it_is_far_behind(opened, monkeypatch):
    synced, own = threading.Event(), contents.compress

    def slow(packed, level):
        synced.wait(60.0)
        return own(packed, level)

    monkeypatch.setattr(entries, "compress", slow)
    monkeypatch.setattr(store_module, "MOST_BYTES_WAITING", 40 * kept(0).n_bytes)
    put(opened, RESULTS, 0)
    opened.tick()
    for number in range(1, 20):
        put(opened, RESULTS, number)
        put(opened, STARTS, number)
        opened.tick()
        # what is on its way is there for who asks
        assert opened.has(STARTS, key(number))
        assert_same(opened.read(STARTS, key(number)), kept(number))
    assert not opened.on_disk(RESULTS)
    threading.Timer(0.2, synced.set).start()
    monkeypatch.setattr(store_module, "_BYTES_A_TRANSACTION", 0.0)
    for number in range(20, 24):
        put(opened, RESULTS, number)
    assert synced.is_set()
    opened.flush()
    assert len(opened.on_disk(RESULTS)) == 24


def test_a_transaction_is_there_as_a_whole_or_not_at_all(path):
    """On a disk without room for all of it."""
    fill(path, range(2))
    with contextlib.closing(Store(path)) as store:
        before = entries_of(store)
        (n_pages,) = store._database.execute("PRAGMA page_count").fetchone()
        store._database.execute(f"PRAGMA max_page_count={n_pages + 1}").fetchall()
        put(store, RESULTS, 7)
        store.put(STARTS, key(7), Packed("", (np.random.default_rng(0).random(10_000),)), {})
        for _ in range(2):
            with pytest.raises(StorageError, match=r"No space left on device: make room there"):
                store.flush()
            assert entries_of(store).keys() == before.keys()
        # what could not be written waits until there is room
        assert store.has(STARTS, key(7))
        store._database.execute("PRAGMA max_page_count=100000").fetchall()
        store.flush()
    with contextlib.closing(Store(path)) as store:
        assert entries_of(store).keys() == before.keys() | {(RESULTS, key(7)), (STARTS, key(7))}


def test_progress_is_replaced_and_goes_with_the_end_of_its_task(path):
    with contextlib.closing(Store(path)) as store:
        assert store.read_progress(key(9)) is None
        store.keep_progress(key(9), kept(1))
        store.flush()
        store.keep_progress(key(9), kept(2))
        assert_same(store.read_progress(key(9)), kept(2))
    with contextlib.closing(Store(path)) as store:
        assert_same(store.read_progress(key(9)), kept(2))
        store.keep_progress(key(9), kept(3))
        put(store, RESULTS, 0, finished=key(9))
        assert store.read_progress(key(9)) is None
    with contextlib.closing(Store(path)) as store:
        assert store.read_progress(key(9)) is None
        assert_same(store.read(RESULTS, key(0)), kept(0))


def test_what_is_computed_once_is_there_for_a_later_run_and_goes_when_none_asks_for_it(path):
    with contextlib.closing(Store(path)) as store:
        assert store.read_computed("natural frequencies") is None
        store.keep_computed("natural frequencies", kept(1))
        store.keep_computed("scene", kept(2))
        store.prune({}, 0.0)
    with contextlib.closing(Store(path)) as store:
        assert_same(store.read_computed("natural frequencies"), kept(1))
        store.prune({}, 0.0)
    with contextlib.closing(Store(path)) as store:
        assert store.on_disk(COMPUTED) == {"natural frequencies"}


def test_what_is_forgotten_is_replaced_by_what_comes(path):
    fill(path)
    with contextlib.closing(Store(path)) as store:
        store.forget(RESULTS, key(1))
        store.forget(STARTS, key(2))
        assert not store.has(RESULTS, key(1))
        assert store.read(RESULTS, key(1)) is None
        store.put(RESULTS, key(1), kept(77), {})
        store.flush()
    with contextlib.closing(Store(path)) as store:
        assert_same(store.read(RESULTS, key(1)), kept(77))
        # nothing took its place, and it was not to be removed
        assert_same(store.read(STARTS, key(2)), kept(2))
        store.forget(STARTS, key(2))
        store.remove_forgotten()
    with contextlib.closing(Store(path)) as store:
        assert not store.has(STARTS, key(2))


def test_room_is_given_back_at_the_end(path):
    with contextlib.closing(Store(path)) as store:
        put(store, RESULTS, 1)
        random_numbers = np.random.default_rng(0).random(10**5)
        store.keep_progress(key(1), Packed("", (random_numbers,)))
        store.flush()
        assert path.stat().st_size > 0.9 * random_numbers.nbytes
        store.forget(UNDER_WAY, key(1))
        store.remove_forgotten()
        store.shrink()
    assert path.stat().st_size < 10**5
    with contextlib.closing(Store(path)) as store:
        assert entries_of(store).keys() == {(RESULTS, key(1))}


def test_a_transaction_survives_a_loss_of_power(opened):
    """By the settings for which SQLite promises this, on a file system that does what it is told."""
    query = opened._database.execute
    settings = {name: query(f"PRAGMA {name}").fetchone()[0] for name in ("synchronous", "journal_mode", "locking_mode")}
    assert settings == {"synchronous": 2, "journal_mode": "delete", "locking_mode": "exclusive"}


# what is damaged


def change_bytes(path, place, content):
    with path.open("rb+") as file:
        file.seek(place)
        file.write(content)


def change_tables(path, *commands):
    with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as changed:
        for command in commands:
            changed.execute(command).fetchall()


DAMAGES = {
    "cut off": lambda path: os.truncate(path, path.stat().st_size // 2),
    "a page": lambda path: change_bytes(path, 4096, os.urandom(4096)),
    "another file": lambda path: path.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(1000)),
    "its tables": lambda path: change_tables(path, "DROP TABLE tasks"),
    "another table": lambda path: change_tables(path, "CREATE TABLE spam (egg)"),
    "a view": lambda path: change_tables(path, "CREATE VIEW spam AS SELECT load_extension('egg')"),
    "a trigger": lambda path: change_tables(
        path, "CREATE TRIGGER spam AFTER DELETE ON tasks BEGIN DELETE FROM results; END"
    ),
    "a write-ahead log": lambda path: change_tables(path, "PRAGMA journal_mode=WAL"),
    "another version": lambda path: change_tables(path, "PRAGMA user_version=99"),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_file_is_kept_aside_and_the_study_begins_anew(damage, path):
    for aside in ("out.nc.progress.damaged", "out.nc.progress.damaged-2"):
        fill(path)
        DAMAGES[damage](path)
        before = path.read_bytes()
        with contextlib.closing(Store(path)) as store:
            (note,) = store.notes
            assert note.startswith("out.nc.progress ")
            assert note.endswith(f": it is kept as {aside}, and the study begins anew")
            assert entries_of(store) == {}
            put(store, RESULTS, 8)
            assert path.with_name(aside).read_bytes() == before
        with contextlib.closing(Store(path)) as store:
            assert store.notes == []
            assert store.on_disk(RESULTS) == {key(8)}
        path.unlink()


def test_a_damaged_entry_is_forgotten_with_a_line_and_nothing_else(path):
    fill(path)
    change_tables(
        path,
        f"UPDATE results SET content=x'00' WHERE key='{key(1)}'",
        f"UPDATE results SET checksum='spam' WHERE key='{key(2)}'",
        f"UPDATE start_states SET content=(SELECT content FROM start_states WHERE key='{key(0)}') WHERE key='{key(3)}'",
        f"UPDATE computed SET content='text' WHERE key='{key(3)}'",
    )
    with contextlib.closing(Store(path)) as store:
        assert store.notes == ["out.nc.progress: 4 damaged entries, which are computed again"]
        assert len(entries_of(store)) == 4 * len(TABLES) - 4
        assert store.on_disk(RESULTS) == {key(0), key(3)}
        put(store, RESULTS, 1)
        store.remove_forgotten()
    with contextlib.closing(Store(path)) as store:
        assert store.notes == []
        assert len(entries_of(store)) == 4 * len(TABLES) - 3


@pytest.mark.slow
def test_any_bit_of_a_file_matters(path):
    """None makes anything but what was there before, or nothing; none ends in a traceback."""
    fill(path, range(2))
    content = path.read_bytes()
    with contextlib.closing(Store(path)) as store:
        expected = entries_of(store)
    chance = random.Random(1)
    for _ in range(100):
        bit = chance.randrange(8 * len(content))
        flipped = bytearray(content)
        flipped[bit // 8] ^= 1 << bit % 8
        path.write_bytes(flipped)
        with contextlib.closing(Store(path)) as store:
            for name, packed in entries_of(store).items():
                if packed is not None:
                    assert_same(packed, expected[name])
            put(store, RESULTS, 8)
        for aside in path.parent.glob("*.damaged*"):
            aside.unlink()


# files that nobody vouches for


@pytest.mark.parametrize("suffix", ["", "-journal"])
@pytest.mark.parametrize("what", ["fifo", "endless", "link", "link to nowhere"])
def test_only_plain_files_are_opened(what, suffix, path, tmp_path):
    precious = tmp_path / "precious"
    fill(precious)
    before = precious.read_bytes()
    odd = path.with_name(path.name + suffix)
    if what == "fifo":
        os.mkfifo(odd)
    else:
        odd.symlink_to({"endless": Path("/dev/zero"), "link": precious, "link to nowhere": tmp_path / "none"}[what])
    with pytest.raises(StorageError, match=r"is no plain file: remove it or give another result file with -o"):
        Store(path)
    assert not (tmp_path / "none").exists()
    assert precious.read_bytes() == before


def test_a_journal_that_names_another_file_does_not_remove_it(path, tmp_path):
    """SQLite removes the journal of several files when the last one of these was restored."""
    fill(path)
    precious = tmp_path / "precious.txt"
    precious.write_text("of value")
    name = str(precious).encode()
    begin = bytes.fromhex("d9d505f920a163d7") + bytes(4) + bytes(4) + (8).to_bytes(4, "big") + (512).to_bytes(4, "big")
    begin = (begin + (4096).to_bytes(4, "big")).ljust(512, b"\0")
    end = len(name).to_bytes(4, "big") + (sum(name) & 0xFFFFFFFF).to_bytes(4, "big") + bytes.fromhex("d9d505f920a163d7")
    journal = path.with_name(f"{path.name}-journal")
    journal.write_bytes(begin + bytes(4) + name + end)
    with contextlib.closing(Store(path)) as store:
        (note,) = store.notes
    assert "has a journal that is none of a run: it is kept as out.nc.progress.damaged" in note
    assert precious.read_text() == "of value"


# faults of the disk


@pytest.mark.parametrize(
    ("code", "said"),
    [
        (sqlite3.SQLITE_IOERR_READ, "Input/output error: see whether the disk"),
        (sqlite3.SQLITE_FULL, "No space left on device: make room there"),
        (sqlite3.SQLITE_READONLY, "Permission denied: see that it may be written"),
    ],
)
def test_a_disk_that_fails_for_now_is_no_reason_to_throw_anything_away(code, said, path, monkeypatch):
    fill(path)

    def fail(*_, **__):
        error = sqlite3.OperationalError("disk I/O error")
        error.sqlite_errorcode = code
        raise error

    with monkeypatch.context() as broken:
        broken.setattr(database, "check", fail)
        with pytest.raises(StorageError, match=said):
            Store(path)
    with contextlib.closing(Store(path)) as store:
        assert (len(entries_of(store)), store.notes) == (4 * len(TABLES), [])


@pytest.mark.parametrize("replaced", [False, True])
def test_a_file_that_was_removed_meanwhile_is_told(replaced, opened, path):
    put(opened, RESULTS, 1)
    opened.flush()
    path.unlink()
    if replaced:
        path.write_bytes(b"of somebody else")
    put(opened, RESULTS, 2)
    with pytest.raises(StorageError, match=r"another file has taken its place|No such file"):
        opened.flush()
    assert not opened.on_disk(RESULTS) >= {key(2)}


# several runs

HOLDER = """
import sys, time
from pathlib import Path
from studyrunner.checkpoint.store import Store
store = Store(Path(sys.argv[1]))
print("locked", flush=True)
time.sleep(float(sys.argv[2]))
"""


@contextlib.contextmanager
def another_run(path, seconds):
    command = [sys.executable, "-c", HOLDER, str(path), str(seconds)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout.readline() == "locked\n"
        yield holder
        holder.kill()


def test_two_runs_are_kept_apart(path):
    fill(path)
    with another_run(path, 60.0) as holder:
        for _ in range(2):
            with pytest.raises(StoreInUseError, match=rf"process {holder.pid} on \S+$"):
                Store(path)
            assert database.read_study(path) is None  # it has not said so, and nobody waits for its lock
    Store(path).close()


def test_the_study_of_a_file_is_read_without_its_lock(path, opened):
    assert database.read_study(path) is None
    opened.note_study(
        "joint", "sdof_slider", ("hash", "layout"), [{"key": key(1), "kind": "sweep", "frequency": 100.0}]
    )
    assert database.read_study(path) == ("joint", "sdof_slider")
    assert database.read_study(path.with_name("none")) is None
    opened.note_study("joint", "two_masses", ("hash", "layout"), [])
    opened.close()
    assert database.read_study(path) == ("joint", "two_masses")
    assert shutil.which("sqlite3") is None or b"two_masses" in subprocess.check_output(
        ["sqlite3", str(path), "SELECT * FROM study"]
    )


def test_a_right_check_sum_does_not_make_a_size_right(path):
    fill(path)
    change_tables(path, "UPDATE results SET size=900000000", "UPDATE start_states SET size=NULL")
    with contextlib.closing(Store(path)) as store:
        assert (store.read(RESULTS, key(1)), store.read(STARTS, key(1))) == (None, None)
        assert not store.has(RESULTS, key(1))


def test_values_beyond_all_measure_are_left_out_where_they_save_time_only(opened, monkeypatch):
    monkeypatch.setattr(store_module, "LARGEST", 10)
    opened.keep_computed("scene", kept(1))
    opened.keep_progress(key(1), kept(1))
    assert (opened.read_computed("scene"), opened.read_progress(key(1))) == (None, None)
    with pytest.raises(StorageError, match="bytes in one entry: use a smaller model"):
        put(opened, RESULTS, 1)


def test_objects_are_not_kept():
    with pytest.raises(TypeError, match="arrays of object are not kept"):
        contents.compress(Packed("", (np.array([{}], dtype=object),)), 1)

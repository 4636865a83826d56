"""The folder of a study: whole files or none, what is damaged or of others, and the lock."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from solver.packing import Packed
from studyrunner.checkpoint import folder_contents, part_writer
from studyrunner.checkpoint import store as store_module
from studyrunner.checkpoint.part_files import KEY, KEY_TYPE
from studyrunner.checkpoint.segment_index import FILES_A_MERGE
from studyrunner.checkpoint.store import SECONDS_A_FILE, SECONDS_A_PROGRESS, Store
from studyrunner.mpi.crashes import count_crashes, forget_crashes, read_tally
from studyrunner.system import folder_lock
from studyrunner.system.folder_lock import StoreInUseError
from studyrunner.user_error import StorageError

KIND = np.dtype([(KEY, KEY_TYPE, ()), ("outcome", "int8", ()), ("values", "float64", (5,))])
OTHER_KIND = np.dtype([(KEY, KEY_TYPE, ()), ("outcome", "int8", ()), ("values", "float64", (6,))])
RECORDS, STARTS, PROGRESS = "*.npy", "*.starts", "*.progress"


def key(number: int) -> str:
    return f"{number:032x}"


def record(number: int, kind: np.dtype[np.void] = KIND) -> np.ndarray:
    found = np.zeros(1, kind)
    found[KEY], found["outcome"], found["values"] = key(number).encode(), number % 3, number / 7.0
    return found


def kept(number: int) -> Packed:
    return Packed(f"é state {number}", (np.arange(3.0) + number, np.full((2, 2), number * 1j)))


def fill(folder: Path, numbers: range = range(4), kind: np.dtype[np.void] = KIND) -> None:
    """A run that finishes some histories and start states and then ends."""
    store = Store(folder, kind)
    for number in numbers:
        store.add_history(key(number), record(number, kind))
        store.add_start(key(number), kept(number))
    store.flush()
    store.close()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "out.nc.parts"


@pytest.fixture
def opened(folder: Path) -> Iterator[Store]:
    store = Store(folder, KIND)
    yield store
    store.close()


def records_of(store: Store) -> dict[str, bytes]:
    return {key: store.read(number)[row].tobytes() for key, (number, row) in store.histories.items()}


def names(folder: Path) -> list[str]:
    """What a folder holds, each file without the part of its name that tells whose it is."""
    return sorted(re.sub("-[0-9a-f]{12}", "", path.name) for path in folder.iterdir())


def settle(store: Store) -> None:
    """What was handed over is written, and what it stands for removed."""
    store.flush()
    store.close()


def assert_same(found: Packed, expected: Packed) -> None:
    assert found.text == expected.text
    for one, other in zip(found.arrays, expected.arrays, strict=True):
        np.testing.assert_array_equal(one, other, strict=True)


def test_what_is_read_is_what_was_added_now_and_in_a_later_run(folder: Path) -> None:
    store = Store(folder, KIND)
    for number in range(7):
        store.add_history(key(number), record(number))
        store.add_start(key(number), kept(number))
        if number % 3 == 1:
            store.flush()
    store.flush()
    store.flush()
    expected = {key(number): record(number).tobytes() for number in range(7)}
    for _ in range(2):
        assert records_of(store) == expected
        for number in range(7):
            assert_same(store.read_start(key(number)), kept(number))
        store.close()
        store = Store(folder, KIND)
    # a later run does not write over what an earlier one has left
    store.add_history(key(7), record(7))
    store.flush()
    assert records_of(store) == expected | {key(7): record(7).tobytes()}
    store.close()


def test_a_first_result_is_written_at_once_and_later_ones_wait_a_moment_for_others(
    opened: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 1000.0
    monkeypatch.setattr(store_module.time, "monotonic", lambda: now)
    for number, (seconds, n_files) in enumerate([(0.0, 1), (0.5, 1), (0.6, 2)]):
        opened.add_history(key(number), record(number))
        now += seconds * SECONDS_A_FILE
        opened.tick()
        opened._take(wait=True)
        assert len(opened.numbers) == n_files
    assert [len(opened.read(number)) for number in opened.numbers] == [1, 2]


def test_the_progress_of_many_tasks_goes_into_one_file(opened: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    now = 1000.0
    monkeypatch.setattr(store_module.time, "monotonic", lambda: now)
    opened.keep_progress(key(0), kept(0))
    for number in range(1, 100):
        opened.keep_progress(key(number), kept(number))
        opened.tick()
        opened._take(wait=True)
        now += SECONDS_A_PROGRESS / 50.0
    assert len(list(opened.folder.glob(PROGRESS))) == 2
    for number in range(100):
        found = opened.read_progress(key(number))
        assert found is not None
        assert_same(found, kept(number))


def test_nobody_waits_for_a_slow_disk_unless_it_is_far_behind(opened: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    synced = threading.Event()
    monkeypatch.setattr(part_writer.files, "sync", lambda _: synced.wait(60.0))
    monkeypatch.setattr(store_module, "MOST_BYTES_WAITING", 20 * KIND.itemsize)
    opened.add_history(key(0), record(0))
    opened.tick()
    began = time.monotonic()
    for number in range(1, 20):
        opened.add_history(key(number), record(number))
        opened.add_start(key(number), kept(number))
        opened._waiting.n_bytes -= kept(number).n_bytes
        opened.tick()
        # what is on its way is there for who asks
        assert opened.has_start(key(number))
        assert_same(opened.read_start(key(number)), kept(number))
    assert time.monotonic() - began < 5.0
    assert opened.histories == {}
    threading.Timer(0.2, synced.set).start()
    monkeypatch.setattr(store_module, "_BYTES_A_FILE", 0.0)
    opened.add_history(key(20), record(20))
    opened.add_history(key(21), record(21))
    assert synced.is_set()
    opened.flush()
    assert len(opened.histories) == 22


def test_little_is_kept_in_memory(opened: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store_module, "_BYTES_A_FILE", 2.5 * KIND.itemsize)
    for number in range(10):
        opened.add_history(key(number), record(number))
        opened._take(wait=True)
        assert len(opened.numbers) == (number + 1) // 3


def test_a_file_appears_whole_or_not_at_all(opened: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    opened.add_history(key(0), record(0))

    def fail(*_: object) -> None:
        assert list(opened.folder.glob(RECORDS)) == []
        raise OSError(28, "No space left on device")

    for name in ("replace", "sync", "sync_folder"):
        with monkeypatch.context() as full:
            module = part_writer.os if name == "replace" else part_writer.files
            if name == "sync_folder":
                full.setattr(module, name, lambda *_: os.close(-1))
            else:
                full.setattr(module, name, fail)
            said = r"No space left on device: make room there|Bad file descriptor: mend that"
            with pytest.raises(StorageError, match=said):
                opened.flush()
        assert opened.numbers == []
        assert names(opened.folder) == ["lock"]
    opened.flush()
    assert records_of(opened) == {key(0): record(0).tobytes()}


def test_start_states_are_there_before_what_came_after_them(opened: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """Otherwise progress of a branch, or a history, would stand there without the states before."""
    written: list[str] = []
    replace = part_writer.os.replace

    def note(source: Path, target: Path) -> None:
        written.append(target.suffix)
        replace(source, target)

    monkeypatch.setattr(part_writer.os, "replace", note)
    opened.add_history(key(0), record(0))
    opened.add_start(key(1), kept(1))
    opened.keep_progress(key(2), kept(2))
    opened.flush()
    assert written == [".starts", ".npy", ".progress"]


def test_progress_is_replaced_and_goes_with_the_end_of_its_task(folder: Path) -> None:
    store = Store(folder, KIND)
    assert store.read_progress(key(9)) is None
    store.keep_progress(key(9), kept(1))
    store.flush()
    store.keep_progress(key(9), kept(2))
    store.close()
    assert len(list(folder.glob(PROGRESS))) == 1
    store = Store(folder, KIND)
    found = store.read_progress(key(9))
    assert found is not None
    assert_same(found, kept(2))
    store.add_history(key(0), record(0), task=key(9))
    assert store.read_progress(key(9)) is not None
    store.flush()
    assert store.read_progress(key(9)) is None
    store.close()
    assert list(folder.glob(PROGRESS)) == []


def test_progress_that_waits_goes_with_the_end_of_its_task(folder: Path) -> None:
    store = Store(folder, KIND)
    store.keep_progress(key(9), kept(1))
    store.add_history(key(0), record(0), task=key(9))
    settle(store)
    assert names(folder) == ["00000001.npy", "lock"]


@pytest.mark.parametrize("pattern", [RECORDS, STARTS])
@pytest.mark.parametrize("damage", ["empty", "truncated", "a bit", "the last bit", "other content", "longer"])
def test_what_is_damaged_is_forgotten_with_a_line_and_nothing_else(pattern: str, damage: str, folder: Path) -> None:
    fill(folder, range(4))
    fill(folder, range(4, 6))
    path = min(folder.glob(pattern))
    content = path.read_bytes()
    # in the middle of the data of the first entry, which no description of it shows
    flipped, last = bytearray(content), bytearray(content)
    place = content.index(np.full(5, 3 / 7.0).tobytes() if pattern == RECORDS else np.arange(3.0).tobytes())
    flipped[place] ^= 1
    last[-1] ^= 1
    path.write_bytes(
        {
            "empty": b"",
            "truncated": content[:-7],
            "a bit": bytes(flipped),
            "the last bit": bytes(last),
            "other content": b"x" * 1000,
            "longer": content + content,
        }[damage]
    )
    store = Store(folder, KIND)
    assert store.notes == [f"out.nc.parts: {path.name} is damaged, what it held is computed again"]
    of_records = pattern == RECORDS
    assert set(store.histories) == {key(number) for number in (range(4, 6) if of_records else range(6))}
    there = [number for number in range(6) if store.has_start(key(number))]
    assert there == list(range(6) if of_records else range(4, 6))
    assert not path.exists()
    for number in there:
        assert_same(store.read_start(key(number)), kept(number))
    store.add_history(key(8), record(8))
    store.flush()
    assert records_of(store)[key(8)] == record(8).tobytes()
    store.close()


@pytest.mark.slow
def test_any_bit_of_a_file_matters(folder: Path) -> None:
    """Of all bits of each sort of file: none makes anything but what was there before, or nothing."""
    store = Store(folder, KIND)
    store.add_history(key(1), record(1))
    store.add_start(key(1), kept(1))
    store.keep_progress(key(1), kept(2))
    settle(store)
    for pattern in (RECORDS, STARTS, PROGRESS):
        (path,) = folder.glob(pattern)
        content = path.read_bytes()
        for bit in range(0, 8 * len(content), 37):
            flipped = bytearray(content)
            flipped[bit // 8] ^= 1 << bit % 8
            path.write_bytes(flipped)
            store = Store(folder, KIND)
            assert len(store.notes) == 1
            store.close()
            assert not path.exists()
        path.write_bytes(content)
    store = Store(folder, KIND)
    assert (store.notes, len(store.histories)) == ([], 1)
    store.close()


@pytest.mark.parametrize("what", ["fifo", "folder", "endless", "link", "link to nowhere"])
@pytest.mark.parametrize("suffix", [".npy", ".starts", ".progress", ".crash", ".died"])
def test_only_plain_files_are_opened(what: str, suffix: str, folder: Path, tmp_path: Path) -> None:
    fill(folder)
    own = min(folder.glob(RECORDS))
    names = {".crash": "rank-0.crash", ".died": f"{'0' * 32}.1.died"}
    odd = folder / names.get(suffix, f"00000007{suffix}")
    if what == "fifo":
        os.mkfifo(odd)
    elif what == "folder":
        odd.mkdir()
    else:
        odd.symlink_to({"endless": Path("/dev/zero"), "link": own, "link to nowhere": tmp_path / "none"}[what])
    store = Store(folder, KIND)
    assert odd.is_symlink() or odd.exists()
    crashes, tally = count_crashes(folder), read_tally(folder)
    store.add_history(key(8), record(8))
    settle(store)
    assert (crashes, tally) == ((), {})
    assert len(store.histories) == 5
    assert not (tmp_path / "none").exists()
    if suffix not in names:
        assert [f"{odd.name} is damaged" in note for note in store.notes] == [True]


@pytest.mark.parametrize("key", ["../precious", "f" * 32 + "/..", "F" * 32, "0" * 31])
def test_what_a_crash_says_of_its_task_leads_nowhere_else(key: str, folder: Path) -> None:
    folder.mkdir()
    (folder / "rank-3.crash").write_text(crash_text(key))
    before = sorted(folder.parent.rglob("*"))
    assert count_crashes(folder) == ()
    assert sorted(folder.parent.rglob("*")) == [path for path in before if path.suffix != ".crash"]


def test_crashes_are_counted_once_each(folder: Path) -> None:
    folder.mkdir()
    for number in (1, 2):
        (folder / "rank-3.crash").write_text(crash_text("a" * 32))
        assert [crash.key for crash in count_crashes(folder, rank=3)] == ["a" * 32]
        assert count_crashes(folder) == count_crashes(folder, rank=3) == ()
        assert {key: len(crashes) for key, crashes in read_tally(folder).items()} == {"a" * 32: number}
    forget_crashes(folder, {"b" * 32})
    assert len(read_tally(folder)) == 1
    forget_crashes(folder, None)
    assert list(folder.iterdir()) == []


def crash_text(key: str) -> str:
    return f'{key}\nFatal Python error: Aborted\n  File "x.py", line 1 in f\n  File "crashes.py", line 2 in noted\n'


def test_a_link_in_place_of_the_lock_is_not_written_through(folder: Path, tmp_path: Path) -> None:
    precious = tmp_path / "precious.txt"
    precious.write_text("of value")
    folder.mkdir()
    (folder / "lock").symlink_to(precious)
    with pytest.raises(StorageError, match=r"lock: lock is no plain file: remove it or give another result file"):
        Store(folder, KIND)
    assert precious.read_text() == "of value"


def test_nothing_is_written_through_a_link(opened: Store, tmp_path: Path) -> None:
    """Whoever knows the name of the next file: one that is there already is not opened."""
    precious = tmp_path / "precious.txt"
    precious.write_text("of value")
    run = opened._writer._do.__self__.run  # type: ignore[attr-defined]
    (opened.folder / f"00000001-{run}.npy.partial").symlink_to(precious)
    opened.add_history(key(0), record(0))
    with pytest.raises(StorageError, match="File exists"):
        opened.flush()
    assert precious.read_text() == "of value"


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 no zip file", b"x" * 99])
def test_damaged_progress_is_forgotten(content: bytes, folder: Path) -> None:
    fill(folder)
    (folder / "00000009.progress").write_bytes(content)
    store = Store(folder, KIND)
    assert store.read_progress(key(1)) is None
    assert list(folder.glob(PROGRESS)) == []
    assert len(store.histories) == 4
    store.close()


def test_files_with_pickles_are_not_read(folder: Path) -> None:
    folder.mkdir()
    np.save(folder / "00000000.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    np.save(folder / "00000001.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    os.replace(folder / "00000001.npy", folder / "00000001.starts")
    store = Store(folder, KIND)
    assert store.histories == {}
    assert not store.has_start("a")
    store.close()


def test_a_disk_that_fails_for_now_is_no_reason_to_throw_anything_away(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fill(folder)

    def fail(*_: object) -> None:
        raise OSError(5, "Input/output error")

    with monkeypatch.context() as broken:
        broken.setattr(folder_contents, "load_record_keys", fail)
        with pytest.raises(StorageError, match="Input/output error"):
            Store(folder, KIND)
    store = Store(folder, KIND)
    assert len(store.histories) == 4
    store.close()


def test_records_of_another_kind_are_not_these_but_are_kept_until_there_is_no_room_for_them(folder: Path) -> None:
    fill(folder, range(3), OTHER_KIND)
    fill(folder, range(3, 5))
    store = Store(folder, KIND)
    assert set(store.histories) == {key(3), key(4)}
    store.prune(set(store.histories), (), (), 1e9)
    store.close()
    store = Store(folder, OTHER_KIND)
    assert set(store.histories) == {key(0), key(1), key(2)}
    store.prune(set(store.histories), (), (), 0.0)
    store.close()
    assert names(folder) == ["00000001.npy", "lock"]


FOREIGN = ("notes.txt", "2024.npy", "00000007.npz", "mine.progress.npz", "x.partial", "rank-0.txt", "lost.starts")


def test_pruning_keeps_what_is_named_and_files_of_others(folder: Path) -> None:
    for first in (0, 2, 4):
        fill(folder, range(first, first + 2))
    store = Store(folder, KIND)
    store.keep_progress(key(7), kept(7))
    store.flush()
    for name in FOREIGN:
        (folder / name).touch()
    store.prune({key(0), key(1), key(3)}, {key(5), key(99)}, (), 0.0)
    store.close()
    left = Store(folder, KIND)
    assert set(left.histories) == {key(0), key(1), key(3)}
    assert [number for number in range(8) if left.has_start(key(number))] == [5]
    assert left.read_progress(key(7)) is None
    left.close()
    assert len(names(folder)) == len(FOREIGN) + len(["lock", "0 and 1", "3", "start 5"])


def test_of_what_is_not_named_the_latest_stays(folder: Path) -> None:
    for number in range(6):
        fill(folder, range(number, number + 1))
    store = Store(folder, KIND)
    sizes = {path.name: path.stat().st_size for path in folder.iterdir()}
    pair = sum(sizes[path.name] for path in (min(folder.glob(RECORDS)), min(folder.glob(STARTS))))
    store.prune({key(1)}, {key(1)}, (), 2.5 * pair)
    store.close()
    left = Store(folder, KIND)
    assert set(left.histories) == {key(number) for number in (1, 4, 5)}
    left.close()


def test_files_that_were_not_finished_are_removed(folder: Path) -> None:
    fill(folder)
    before = names(folder)
    partial = ("00000001.npy.partial", "00000001-0123456789ab.starts.partial", "00000003.progress.partial")
    for name in partial:
        (folder / name).write_bytes(b"half of")
    # of the version before this one
    (folder / f"{key(0)}.progress.npz").write_bytes(b"PK")
    store = Store(folder, KIND)
    store.close()
    assert names(folder) == before
    assert len(store.histories) == 4


@pytest.mark.slow
def test_files_are_put_together_while_more_come(folder: Path) -> None:
    """As many as there may be of each size are all that there are, and the last of several records counts."""
    store = Store(folder, KIND)
    n_records, most, expected = 600, 0, {}
    for number in range(n_records):
        store.add_history(key(number), record(number))
        expected[key(number)] = record(number).tobytes()
        store.add_start(key(number), kept(number))
        store.keep_progress(key(1000 + number % 30), kept(number))
        if number % 7 == 0:
            again = record(number)
            again["values"] = -number
            store.add_history(key(number // 2), again)
            again[KEY] = key(number // 2).encode()
            store.add_history(key(number // 2), again)
            expected[key(number // 2)] = again.tobytes()
        store.flush()
        most = max(most, len(names(folder)))
    for _ in range(2):
        assert records_of(store) == expected
        for number in range(n_records):
            assert_same(store.read_start(key(number)), kept(number))
        for number in range(30):
            found = store.read_progress(key(1000 + number))
            assert found is not None
            assert_same(found, kept(n_records - 30 + number))
        store.close()
        store = Store(folder, KIND)
        assert store.notes == []
    store.close()
    n_sizes = 5  # from less than 1 kB to less than 10 MB
    assert most < 3 * n_sizes * FILES_A_MERGE
    assert len(names(folder)) < 60


def test_a_disk_without_room_for_larger_files_keeps_the_small_ones(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store(folder, KIND)

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as full:
        full.setattr(part_writer, "merge_records", fail)
        for number in range(30):
            store.add_history(key(number), record(number))
            store.flush()
    assert len(records_of(store)) == 30
    assert len(list(folder.glob(RECORDS))) == 30
    monkeypatch.setattr(store_module, "_SECONDS_TO_MORE_ROOM", 0.0)
    store._next_merge = 0.0
    store.add_history(key(30), record(30))
    settle(store)
    assert len(records_of(store)) == 31
    assert len(list(folder.glob(RECORDS))) < 30


def test_what_is_forgotten_is_replaced_by_what_comes(folder: Path) -> None:
    fill(folder)
    store = Store(folder, KIND)
    assert store.select(lambda records: records["outcome"] != 0) == {key(1), key(2)}
    store.forget_history(key(1))
    store.forget_start(key(1))
    assert not store.has_start(key(1))
    new = record(1)
    new["outcome"] = 0
    store.add_history(key(1), new)
    store.add_start(key(1), kept(77))
    store.flush()
    for _ in range(2):
        assert records_of(store)[key(1)] == new.tobytes()
        assert_same(store.read_start(key(1)), kept(77))
        assert store.select(lambda records: records["outcome"] != 0) == {key(2)}
        store.close()
        store = Store(folder, KIND)
    store.close()


def test_two_runs_are_kept_apart(folder: Path, opened: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(folder_lock, "_SECONDS_TO_DIE", 0.1)
    with pytest.raises(StoreInUseError, match=r"process \d+ on "):
        Store(folder, KIND)
    opened.close()
    Store(folder, KIND).close()


HOLDER = """
import sys, time
from pathlib import Path
import numpy as np
from studyrunner.checkpoint.store import Store
store = Store(Path(sys.argv[1]), np.dtype([("key", "S32")]))
print("locked", flush=True)
time.sleep(float(sys.argv[2]))
"""


def test_the_lock_of_a_dead_run_is_open(folder: Path) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(folder), "60"], stdout=subprocess.PIPE, text=True
    ) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "locked\n"
        holder.kill()
    assert "process" in (folder / "lock").read_text(encoding="utf-8")
    Store(folder, KIND).close()


def test_a_run_waits_for_the_end_of_one_that_is_just_dying(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # on a busy machine it may take longer to die
    monkeypatch.setattr(folder_lock, "_SECONDS_TO_DIE", 6.0 * folder_lock._SECONDS_TO_DIE)
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(folder), "0.5"], stdout=subprocess.PIPE, text=True
    ) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "locked\n"
        Store(folder, KIND).close()

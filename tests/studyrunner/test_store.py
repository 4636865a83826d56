"""The folder of a study: whole files or none, what is damaged or of others, and the lock."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from studyrunner import store as store_module
from studyrunner.results import Kept
from studyrunner.store import KEY, KEY_TYPE, SECONDS_A_FILE, Store, StoreInUseError
from studyrunner.user_error import StorageError

KIND = np.dtype([(KEY, KEY_TYPE, ()), ("outcome", "int8", ()), ("values", "float64", (5,))])
OTHER_KIND = np.dtype([(KEY, KEY_TYPE, ()), ("outcome", "int8", ()), ("values", "float64", (6,))])
OWN = ("00000000.npy", "00000000.starts.npz")


def key(number: int) -> str:
    return f"{number:032x}"


def record(number: int, kind: np.dtype[np.void] = KIND) -> np.ndarray:
    found = np.zeros(1, kind)
    found[KEY], found["outcome"], found["values"] = key(number).encode(), number % 3, number / 7.0
    return found


def kept(number: int) -> Kept:
    return Kept(f"é state {number}", (np.arange(3.0) + number, np.full((2, 2), number * 1j)))


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


def assert_same(found: Kept, expected: Kept) -> None:
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
        assert len(opened.files) == n_files
    assert [len(opened.read(number)) for number in range(2)] == [1, 2]


def test_little_is_kept_in_memory(opened: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store_module, "_BYTES_A_FILE", 2.5 * KIND.itemsize)
    for number in range(10):
        opened.add_history(key(number), record(number))
        assert len(opened.files) == (number + 1) // 3


def test_a_file_appears_whole_or_not_at_all(opened: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    opened.add_history(key(0), record(0))

    def fail(*_: object) -> None:
        assert list(opened.folder.glob("*.npy")) == []
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as full:
        full.setattr(store_module.os, "replace", fail)
        with pytest.raises(StorageError, match=r"00000000.npy: No space left on device: make room there"):
            opened.flush()
    assert opened.files == []
    assert sorted(path.name for path in opened.folder.iterdir()) == ["lock"]
    opened.flush()
    assert records_of(opened) == {key(0): record(0).tobytes()}


def test_start_states_are_on_the_disk_before_what_came_after_them(
    opened: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Otherwise progress of a branch, or a history, would stand there without the states before."""
    written: list[str] = []
    replace = store_module.os.replace

    def note(source: Path, target: Path) -> None:
        written.append(target.name)
        replace(source, target)

    monkeypatch.setattr(store_module.os, "replace", note)
    opened.add_history(key(0), record(0))
    opened.add_start(key(1), kept(1))
    opened.keep_progress(key(2), kept(2))
    assert written == ["00000000.starts.npz", "00000000.npy", f"{key(2)}.progress.npz"]


def test_progress_is_replaced_and_goes_with_the_end_of_its_task(folder: Path) -> None:
    store = Store(folder, KIND)
    assert store.read_progress(key(9)) is None
    store.keep_progress(key(9), kept(1))
    store.keep_progress(key(9), kept(2))
    store.close()
    store = Store(folder, KIND)
    found = store.read_progress(key(9))
    assert found is not None
    assert_same(found, kept(2))
    store.add_history(key(0), record(0), task=key(9))
    assert store.read_progress(key(9)) is not None
    store.flush()
    assert store.read_progress(key(9)) is None
    assert list(folder.glob("*.progress*")) == []
    store.close()


@pytest.mark.parametrize("name", OWN)
@pytest.mark.parametrize("damage", ["empty", "truncated", "a bit", "other content", "longer"])
def test_what_is_damaged_is_forgotten_and_nothing_else(name: str, damage: str, folder: Path) -> None:
    fill(folder, range(4))
    fill(folder, range(4, 6))
    path = folder / name
    content = path.read_bytes()
    # in the middle of the data of the first entry, which no description of it shows
    flipped = bytearray(content)
    place = content.index(np.full(5, 3 / 7.0).tobytes() if name.endswith("npy") else np.arange(3.0).tobytes())
    flipped[place] ^= 1
    path.write_bytes(
        {
            "empty": b"",
            "truncated": content[:-7],
            "a bit": bytes(flipped),
            "other content": b"x" * 1000,
            "longer": content + content,
        }[damage]
    )
    store = Store(folder, KIND)
    of_records = name.endswith(".npy")
    assert set(store.histories) == {key(number) for number in (range(4, 6) if of_records else range(6))}
    there = [number for number in range(6) if store.has_start(key(number))]
    if damage != "longer" or of_records:
        assert there == list(range(6) if of_records else range(4, 6))
        assert not path.exists()
    for number in there:
        assert_same(store.read_start(key(number)), kept(number))
    # its number is not used again while it is read
    store.add_history(key(8), record(8))
    store.flush()
    assert records_of(store)[key(8)] == record(8).tobytes()
    store.close()


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 no zip file", b"x" * 99])
def test_damaged_progress_is_forgotten(content: bytes, folder: Path) -> None:
    fill(folder)
    (folder / f"{key(1)}.progress.npz").write_bytes(content)
    store = Store(folder, KIND)
    assert store.read_progress(key(1)) is None
    assert list(folder.glob("*.progress*")) == []
    assert len(store.histories) == 4
    store.close()


def test_files_with_pickles_are_not_read(folder: Path) -> None:
    folder.mkdir()
    np.save(folder / "00000000.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    np.savez(folder / "00000000.starts.npz", keys=np.array([{"a": 1}], dtype=object))
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
        broken.setattr(store_module, "_load_records", fail)
        with pytest.raises(StorageError, match="Input/output error"):
            Store(folder, KIND)
    store = Store(folder, KIND)
    assert len(store.histories) == 4
    store.close()


def test_records_of_another_kind_are_not_these_but_are_kept_until_the_study_is_finished(folder: Path) -> None:
    fill(folder, range(3), OTHER_KIND)
    fill(folder, range(3, 5))
    store = Store(folder, KIND)
    assert set(store.histories) == {key(3), key(4)}
    store.close()
    store = Store(folder, OTHER_KIND)
    assert set(store.histories) == {key(0), key(1), key(2)}
    store.prune(set(store.histories), ())
    assert sorted(path.name for path in folder.iterdir()) == ["00000000.npy", "lock"]
    store.close()


FOREIGN = ("notes.txt", "2024.npy", "00000007.npz", "mine.progress.npz", "x.partial", "rank-0.txt")


def test_pruning_keeps_what_is_named_and_files_of_others(folder: Path) -> None:
    for first in (0, 2, 4):
        fill(folder, range(first, first + 2))
    store = Store(folder, KIND)
    store.keep_progress(key(7), kept(7))
    for name in FOREIGN:
        (folder / name).touch()
    store.prune({key(0), key(1), key(3)}, {key(5), key(99)})
    own = {"lock", "00000000.npy", "00000001.npy", "00000002.starts.npz"}
    assert {path.name for path in folder.iterdir()} == own | set(FOREIGN)
    store.close()
    store = Store(folder, KIND, fresh=True)
    assert store.histories == {}
    assert {path.name for path in folder.iterdir()} == {"lock", *FOREIGN}
    store.close()


def test_files_that_were_not_finished_are_removed(folder: Path) -> None:
    fill(folder)
    partial = ("00000001.npy.partial", "00000001.starts.npz.partial", f"{key(0)}.progress.npz.partial")
    for name in partial:
        (folder / name).write_bytes(b"half of")
    store = Store(folder, KIND)
    assert {path.name for path in folder.iterdir()} == {"lock", *OWN}
    assert len(store.histories) == 4
    store.close()


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
    monkeypatch.setattr(store_module, "_SECONDS_TO_DIE", 0.1)
    with pytest.raises(StoreInUseError, match=r"process \d+ on "):
        Store(folder, KIND)
    opened.close()
    Store(folder, KIND).close()


HOLDER = """
import sys, time
from pathlib import Path
import numpy as np
from studyrunner.store import Store
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
    monkeypatch.setattr(store_module, "_SECONDS_TO_DIE", 6.0 * store_module._SECONDS_TO_DIE)
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(folder), "0.5"], stdout=subprocess.PIPE, text=True
    ) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "locked\n"
        Store(folder, KIND).close()

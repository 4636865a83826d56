"""The folder of a study: everything finished is on the disk at once, and a run goes on from it.

It stands beside the result file. Records of histories are plain arrays of numpy, one element a history; start states
and the progress of long tasks are bundles of arrays with a text that says what they are. No file holds a pickle. Each
is written under a temporary name, flushed to the disk and renamed: it is whole or not there, and a check sum tells
whether it still is. What came in the last moment goes into one file, so that thousands of short tasks do not make as
many. Rank 0 writes all of them, as no other rank need see the folder.
"""

from __future__ import annotations

import fcntl
import io
import math
import os
import re
import socket
import time
import zipfile
import zlib
from collections.abc import Callable, Collection, Iterable, Mapping
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from studyrunner.results import Kept
from studyrunner.user_error import StorageError

SECONDS_A_FILE = 0.25
"""Results wait at most so long for others that go into the same file."""

KEY = "key"
"""Name of the field of a record that holds its hash."""

KEY_TYPE = "S32"

_BYTES_A_FILE = 8e6
_LOCK = "lock"
_RECORDS, _STARTS, _PROGRESS, _PARTIAL = ".npy", ".starts.npz", ".progress.npz", ".partial"
_OWN = re.compile(r"(\d{8}(\.npy|\.starts\.npz)|[0-9a-f]{32}\.progress\.npz)(\.partial)?")
_SECONDS_TO_DIE = 5.0  # after which all ranks of a run that was killed have noticed
_CHECK_SUM_BYTES = 4
_BYTES_AT_ONCE = 2**20


class StoreInUseError(Exception):
    """Another run works in the folder; the text says which."""


class Store:
    """The folder of a run, locked for it. Raises StoreInUseError and StorageError.

    kind: of a record; its field `KEY` is the hash of the history. fresh: forget what an earlier run has left.
    histories: for each hash, the number of the file that holds its record, and the place in it.
    """

    def __init__(self, folder: Path, kind: np.dtype[np.void], *, fresh: bool = False) -> None:
        self.folder = folder
        self.kind = kind
        self.files: list[Path] = []
        self.histories: dict[str, tuple[int, int]] = {}
        self._starts: dict[str, tuple[Path, int]] = {}
        self._new_records: dict[str, NDArray[np.void]] = {}
        self._new_starts: dict[str, Kept] = {}
        self._progress: set[str] = set()
        self._finished: list[str] = []
        self._bytes = 0.0
        self._number = 0
        self._written = -math.inf
        try:
            folder.mkdir(exist_ok=True)
            self._lock = _lock(folder / _LOCK)
        except OSError as error:
            raise StorageError(folder, error) from error
        try:
            if fresh:
                self._remove(self._own_files())
            self._look_round()
        except OSError as error:
            self.close()
            raise StorageError(folder, error) from error

    def add_history(self, key: str, record: NDArray[np.void], task: str = "") -> None:
        """A record (1,) to be written. task: what the progress of a task is known by that this history ends."""
        self._new_records[key] = record
        if task in self._progress:
            self._finished.append(task)
        self._count(self.kind.itemsize)

    def add_start(self, key: str, start: Kept) -> None:
        """A start state to be written."""
        self._new_starts[key] = start
        self._count(start.n_bytes)

    def has_start(self, key: str) -> bool:
        """Whether a start state is on the disk."""
        return key in self._starts

    def read_start(self, key: str) -> Kept:
        """A start state that is on the disk."""
        path, place = self._starts[key]
        try:
            return _read_bundle(path, place)
        except OSError as error:
            raise StorageError(path, error) from error

    def keep_progress(self, key: str, progress: Kept) -> None:
        """Writes how far a task is, in place of what was written of it before; what it has given so far goes first."""
        if self._new_starts:
            self.flush()
        self._write(self.folder / f"{key}{_PROGRESS}", lambda file: _write_bundle(file, {key: progress}))
        self._progress.add(key)

    def read_progress(self, key: str) -> Kept | None:
        """How far a task was; None where that is not known."""
        if key not in self._progress:
            return None
        path = self.folder / f"{key}{_PROGRESS}"
        try:
            return _read_bundle(path, 0)
        except OSError as error:
            raise StorageError(path, error) from error
        except Exception:
            # whatever is wrong with it, it is no loss but of time
            self.forget_progress(key)
            return None

    def forget_progress(self, key: str) -> None:
        """The task is finished, or to be done again."""
        self._remove([self.folder / f"{key}{_PROGRESS}"])
        self._progress.discard(key)

    def tick(self) -> None:
        """Called many times a second: writes what waits, at once where nothing was written a moment ago."""
        if (self._new_records or self._new_starts) and time.monotonic() > self._written + SECONDS_A_FILE:
            self.flush()

    def flush(self) -> None:
        """Writes what waits: start states first, as histories are of no use without them."""
        name = f"{self._number:08d}"
        if self._new_starts:
            path = self.folder / f"{name}{_STARTS}"
            self._write(path, lambda file: _write_bundle(file, self._new_starts))
            self._starts |= {key: (path, place) for place, key in enumerate(self._new_starts)}
            self._new_starts = {}
        if self._new_records:
            path = self.folder / f"{name}{_RECORDS}"
            records = np.concatenate(list(self._new_records.values()))
            self._write(path, lambda file: _write_records(file, records))
            self.histories |= {key: (len(self.files), row) for row, key in enumerate(self._new_records)}
            self.files.append(path)
            self._new_records = {}
            for key in self._finished:
                self.forget_progress(key)
            self._finished = []
        self._number += 1
        self._bytes = 0.0
        self._written = time.monotonic()

    def read(self, number: int) -> NDArray[np.void]:
        """Records of a file; they stay on the disk until they are used."""
        path = self.files[number]
        try:
            records: NDArray[np.void] = np.load(path, mmap_mode="r", allow_pickle=False)
        except (OSError, ValueError) as error:
            raise StorageError(path, error) from error
        return records

    def select(self, chosen: Callable[[NDArray[np.void]], NDArray[np.bool_]]) -> set[str]:
        """Hashes of the histories for whose records `chosen` says so; it is given those of a file at once."""
        found: set[str] = set()
        for number in range(len(self.files)):
            records = self.read(number)
            for row in np.flatnonzero(chosen(records)).tolist():
                key = _text(records[KEY][row])
                if self.histories.get(key) == (number, row):
                    found.add(key)
        return found

    def forget_history(self, key: str) -> None:
        """The history is to be computed again: its new record will stand for it."""
        self.histories.pop(key, None)

    def forget_start(self, key: str) -> None:
        """The start state is to be computed again."""
        self._starts.pop(key, None)

    def prune(self, histories: Collection[str], starts: Collection[str]) -> None:
        """Removes the files that hold nothing of what is named: those of another study under the same name."""
        used = {self.files[self.histories[key][0]] for key in histories}
        used |= {self._starts[key][0] for key in starts if key in self._starts}
        self._remove(path for path in self._own_files() if path not in used)

    def close(self) -> None:
        """Lets other runs into the folder."""
        self._lock.close()

    def _count(self, n_bytes: float) -> None:
        self._bytes += n_bytes
        if self._bytes > _BYTES_A_FILE:
            self.flush()

    def _write(self, path: Path, write: Callable[[IO[bytes]], object]) -> None:
        partial = path.with_name(path.name + _PARTIAL)
        try:
            with partial.open("wb") as file:
                write(file)
                file.flush()
                os.fsync(file.fileno())
            os.replace(partial, path)
        except OSError as error:
            partial.unlink(missing_ok=True)
            raise StorageError(path, error) from error

    def _own_files(self) -> list[Path]:
        return sorted(path for path in self.folder.iterdir() if _OWN.fullmatch(path.name))

    def _remove(self, files: Iterable[Path]) -> None:
        for path in files:
            try:
                path.unlink(missing_ok=True)
            except OSError as error:
                raise StorageError(path, error) from error

    def _look_round(self) -> None:
        """What earlier runs have left; what is damaged is computed again. Raises OSError where the disk fails."""
        for path in self._own_files():
            if not path.name.endswith((_PROGRESS, _PROGRESS + _PARTIAL)):
                self._number = max(self._number, int(path.name[:8]) + 1)
            try:
                if path.name.endswith(_PARTIAL):
                    path.unlink()
                elif path.name.endswith(_PROGRESS):
                    self._progress.add(path.name.removesuffix(_PROGRESS))
                elif path.name.endswith(_STARTS):
                    self._starts |= {key: (path, place) for place, key in enumerate(_keys_of(path))}
                else:
                    records = _load_records(path)
                    if records.dtype == self.kind and records.ndim == 1:
                        keys = map(_text, records[KEY].tolist())
                        self.histories |= {key: (len(self.files), row) for row, key in enumerate(keys)}
                        self.files.append(path)
            except OSError:
                # a disk that fails for now is no reason to throw anything away
                raise
            except Exception:
                path.unlink(missing_ok=True)


def _lock(path: Path) -> IO[str]:
    """The lock file, held until it is closed or the process ends, however it ends."""
    latest = time.monotonic() + _SECONDS_TO_DIE
    file = path.open("a+", encoding="utf-8")
    while True:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            break
        except BlockingIOError:
            if time.monotonic() > latest:
                file.seek(0)
                owner = file.read().strip() or "unknown"
                file.close()
                raise StoreInUseError(owner) from None
            time.sleep(_SECONDS_TO_DIE / 50)
        except OSError:
            # a file system without locks: better to run without one than not at all
            return file
    file.truncate(0)
    file.write(f"process {os.getpid()} on {socket.gethostname()}")
    file.flush()
    return file


def _text(key: bytes) -> str:
    return key.decode("ascii")


def _write_records(file: IO[bytes], records: NDArray[np.void]) -> None:
    """As numpy writes them, and a check sum."""
    buffer = io.BytesIO()
    np.save(buffer, records, allow_pickle=False)
    content = buffer.getbuffer()
    file.write(content)
    file.write(zlib.crc32(content).to_bytes(_CHECK_SUM_BYTES, "little"))


def _load_records(path: Path) -> NDArray[np.void]:
    """Records that stay on the disk until they are used. Raises ValueError where they are damaged."""
    left, found = path.stat().st_size - _CHECK_SUM_BYTES, 0
    with path.open("rb") as file:
        while left > 0:
            some = file.read(min(left, _BYTES_AT_ONCE))
            found, left = zlib.crc32(some, found), left - len(some)
        if found.to_bytes(_CHECK_SUM_BYTES, "little") != file.read():
            raise ValueError("the check sum is another one")
    records: NDArray[np.void] = np.load(path, mmap_mode="r", allow_pickle=False)
    return records


def _write_bundle(file: IO[bytes], entries: Mapping[str, Kept]) -> None:
    """Their keys; the text of each under the name "entry.text", its arrays under "entry.place"."""
    arrays: dict[str, NDArray[np.generic]] = {"keys": np.array(list(entries), KEY_TYPE)}
    for number, entry in enumerate(entries.values()):
        arrays[f"{number}.text"] = np.frombuffer(entry.text.encode(), np.uint8)
        arrays |= {f"{number}.{place}": array for place, array in enumerate(entry.arrays)}
    # into memory first: a zip file is written with many small writes and seeks
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **arrays)
    file.write(buffer.getbuffer())


def _read_bundle(path: Path, number: int) -> Kept:
    # numpy does not close what it opens where that is no bundle
    with path.open("rb") as file, np.load(file, allow_pickle=False) as bundle:
        n_arrays = sum(name.startswith(f"{number}.") for name in bundle.files) - 1
        text = bundle[f"{number}.text"].tobytes().decode()
        return Kept(text, tuple(bundle[f"{number}.{place}"] for place in range(n_arrays)))


def _keys_of(path: Path) -> list[str]:
    """Keys of a bundle. Raises ValueError where it is damaged."""
    with zipfile.ZipFile(path) as file:
        if file.testzip() is not None:
            raise ValueError("a check sum is another one")
    with np.load(path, allow_pickle=False) as bundle:
        return list(map(_text, bundle["keys"].tolist()))

"""The folder of a study: everything finished is on the disk at once, and a run goes on from it.

It stands beside the result file. Records of histories are plain arrays of numpy, one element a history; start states
and the progress of long tasks are bundles of arrays with a text that says what they are. No file holds a pickle. Each
is written under a temporary name, flushed to the disk and renamed: it is whole or not there. What came in the last
moment goes into one file, so that thousands of short tasks do not make as many. Rank 0 writes all of them, as no other
rank need see the folder.
"""

from __future__ import annotations

import fcntl
import io
import json
import math
import os
import socket
import time
import zipfile
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
        if fresh:
            self._remove(self._own_files())
        self._look_round()

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
        return _read_bundle(path, place)

    def keep_progress(self, key: str, progress: Kept) -> None:
        """Writes how far a task is, in place of what was written of it before."""
        self._write(self.folder / f"{key}{_PROGRESS}", lambda file: _write_bundle(file, {key: progress}))
        self._progress.add(key)

    def read_progress(self, key: str) -> Kept | None:
        """How far a task was; None where that is not known."""
        if key not in self._progress:
            return None
        try:
            return _read_bundle(self.folder / f"{key}{_PROGRESS}", 0)
        except _UNREADABLE:
            self.forget_progress(key)
            return None

    def forget_progress(self, key: str) -> None:
        """The task is finished, or to be done again."""
        (self.folder / f"{key}{_PROGRESS}").unlink(missing_ok=True)
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
            self._write(path, lambda file: np.save(file, records, allow_pickle=False))
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
        records: NDArray[np.void] = np.load(self.files[number], mmap_mode="r", allow_pickle=False)
        return records

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
        patterns = (f"[0-9]*{_RECORDS}", f"[0-9]*{_STARTS}", f"*{_PROGRESS}", f"*{_PARTIAL}")
        return sorted(path for pattern in patterns for path in self.folder.glob(pattern))

    def _remove(self, files: Iterable[Path]) -> None:
        for path in files:
            path.unlink(missing_ok=True)

    def _look_round(self) -> None:
        """What earlier runs have left; what cannot be read is no loss, as it is computed again."""
        for path in self._own_files():
            if path.name[:8].isdecimal():
                self._number = max(self._number, int(path.name[:8]) + 1)
            try:
                if path.name.endswith(_PARTIAL):
                    path.unlink()
                elif path.name.endswith(_PROGRESS):
                    self._progress.add(path.name.removesuffix(_PROGRESS))
                elif path.name.endswith(_STARTS):
                    self._starts |= {key: (path, place) for place, key in enumerate(_keys_of(path))}
                elif path.name.endswith(_RECORDS):
                    records = np.load(path, mmap_mode="r", allow_pickle=False)
                    if records.dtype == self.kind and records.ndim == 1:
                        keys = [key.decode("ascii") for key in records[KEY].tolist()]
                        self.histories |= {key: (len(self.files), row) for row, key in enumerate(keys)}
                        self.files.append(path)
            except _UNREADABLE:
                path.unlink(missing_ok=True)


_UNREADABLE = (OSError, ValueError, KeyError, IndexError, TypeError, EOFError, zipfile.BadZipFile)


def _lock(path: Path) -> IO[str]:
    """The lock file, held until it is closed or the process ends, however it ends."""
    file = path.open("a+", encoding="utf-8")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.seek(0)
        owner = file.read().strip() or "unknown"
        file.close()
        raise StoreInUseError(owner) from None
    except OSError:
        # a file system without locks: better to run without one than not at all
        return file
    file.truncate(0)
    file.write(f"process {os.getpid()} on {socket.gethostname()}")
    file.flush()
    return file


def _write_bundle(file: IO[bytes], entries: Mapping[str, Kept]) -> None:
    """Arrays under the names "entry.place", and a text that lists keys and texts of the entries."""
    texts = json.dumps([[key, entry.text, len(entry.arrays)] for key, entry in entries.items()])
    arrays = {
        f"{number}.{place}": array
        for number, entry in enumerate(entries.values())
        for place, array in enumerate(entry.arrays)
    }
    # into memory first: a zip file is written with many small writes and seeks
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, texts=np.frombuffer(texts.encode(), np.uint8), **arrays)
    file.write(buffer.getbuffer())


def _read_bundle(path: Path, number: int) -> Kept:
    with np.load(path, allow_pickle=False) as bundle:
        _, text, n_arrays = json.loads(bundle["texts"].tobytes())[number]
        return Kept(text, tuple(bundle[f"{number}.{place}"] for place in range(n_arrays)))


def _keys_of(path: Path) -> list[str]:
    with np.load(path, allow_pickle=False) as bundle:
        return [key for key, *_ in json.loads(bundle["texts"].tobytes())]

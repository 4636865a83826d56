"""What a study has computed so far, in one SQLite file beside the result, from which a later run goes on.

The file has one table with the columns kind, key and blob. Rank 0 alone uses the file. What arrives within a moment
goes into one transaction.
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import sqlite3
import time
import zlib
from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from solver.packing import Packed
from studyrunner.checkpoint.database import RUN, faults_told, open_file, run_in, transaction
from studyrunner.system.endings import uninterrupted
from studyrunner.user_error import StorageError

STARTS, PROGRESS, RESULTS, COMPUTED = "start", "progress", "result", "computed"
"""Kinds of entries: start states; progress of tasks; finished wear histories; what is computed once for a study."""

LARGEST = 9 * 10**8
"""Largest size of an entry, bytes. SQLite has no larger ones."""

SECONDS_A_TRANSACTION = 0.25
"""Longest time, s, that an entry waits for others that go into the same transaction, on a disk that is fast."""

_SHARE_OF_WRITING = 0.1  # of the time of rank 0, on a disk that is slow
_BYTES_A_TRANSACTION = 8e6
_HEAD_BYTES = 8
_KINDS = frozenset("biufcSU")  # of numpy: numbers and texts, no objects
_LEVEL = 1  # of zlib: the rank that compresses hands out the tasks as well

Name = tuple[str, str]


def to_blob(packed: Packed) -> bytes:
    """The text, type and shape of the arrays of a value as JSON, then their bytes, compressed by zlib.

    Raises TypeError for arrays of anything but numbers and texts: a bug.
    """
    for array in packed.arrays:
        if array.dtype.kind not in _KINDS:
            raise TypeError(f"arrays of {array.dtype} are not kept")
    head = json.dumps([packed.text, [[array.dtype.str, array.shape] for array in packed.arrays]]).encode()
    raw = (len(head).to_bytes(_HEAD_BYTES, "little"), head, *(array.tobytes() for array in packed.arrays))
    return zlib.compress(b"".join(raw), _LEVEL)


def from_blob(blob: bytes) -> Packed:
    """The value of `to_blob`. Raises ValueError where the bytes are no such value."""
    try:
        compressed = zlib.decompressobj()
        raw = compressed.decompress(blob, LARGEST)
        if not compressed.eof:
            raise ValueError("not all of it, or too much")
        place = _HEAD_BYTES + int.from_bytes(raw[:_HEAD_BYTES], "little")
        text, layout = json.loads(raw[_HEAD_BYTES:place])
        arrays = []
        for kind, shape in layout:
            array: NDArray[np.generic] = np.ndarray(tuple(shape), np.dtype(kind), raw, place)
            arrays.append(array.copy())
            place += array.nbytes
        return Packed(text, tuple(arrays))
    except (zlib.error, TypeError, OverflowError) as error:
        raise ValueError("not written by a run") from error


class Store:
    """The open file of a run. Raises StoreInUseError, NoLocksError and StorageError.

    path: of the file.
    notes: lines for the user on what was found.
    ended_hard: whether the run before was killed or has crashed.
    crashes: how many runs in a row have ended so while a task was under way and had given nothing yet, by its key.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.notes: list[str] = []
        self._waiting: dict[Name, bytes | None] = {}
        self._n_bytes = 0  # that wait
        self._used: set[str] = set()
        self._next_write = 0.0
        with faults_told(path):
            self._is_new = not path.exists()
            self._database, said = open_file(path)
            self.notes += [said] if said else []
            self._file = path.stat().st_ino
            self._keys: dict[str, set[str]] = {kind: set() for kind in (STARTS, PROGRESS, RESULTS, COMPUTED, RUN)}
            for kind, key in self._database.execute("SELECT kind, key FROM entries"):
                self._keys.setdefault(kind, set()).add(key)
        before = run_in(self._database)
        self.ended_hard = bool(before.get("open"))
        under_way = frozenset(before.get("under_way", ())) if self.ended_hard else frozenset()
        self.crashes: dict[str, int] = dict(before.get("crashes", {}))
        for key in under_way:
            self.crashes[key] = self.crashes.get(key, 0) + 1
        self._study: dict[str, str] = {name: before[name] for name in ("name", "scene") if name in before}
        self._under_way: set[str] = set()
        self._is_open, self._is_noted = True, False
        self.flush()

    def note_study(self, name: str, scene: str) -> None:
        """Writes which study the file belongs to."""
        self._study = {"name": name, "scene": scene}
        self._is_new = False
        self._is_noted = False
        self.flush()

    def note_begin(self, key: str) -> None:
        """Notes that a rank is about to do a task. After a run that has ended hard this is on the disk at once."""
        self._under_way.add(key)
        self._is_noted = False
        if self.ended_hard:
            self.flush()

    def note_life(self, key: str) -> None:
        """Notes that a task has given something: it has not ended the run, nor the runs before."""
        if key in self._under_way or key in self.crashes:
            self._under_way.discard(key)
            self.crashes.pop(key, None)
            self._is_noted = False

    def put(self, kind: str, key: str, packed: Packed) -> None:
        """Adds an entry, in place of an earlier one. Raises StorageError."""
        if packed.n_bytes > LARGEST:
            raise StorageError(self.path, ValueError(f"{packed.n_bytes:.3g} bytes in one entry"), "use a smaller model")
        self._put(kind, key, to_blob(packed))
        if self._n_bytes > _BYTES_A_TRANSACTION:
            self.flush()

    def put_if_small(self, kind: str, key: str, packed: Packed) -> None:
        """Adds an entry that only saves time; nothing where it is too large."""
        if kind == COMPUTED:
            self._used.add(key)
        if packed.n_bytes <= LARGEST:
            self.put(kind, key, packed)

    def has(self, kind: str, key: str) -> bool:
        """Whether there is an entry, on the disk or on its way."""
        return key in self._keys[kind]

    def keys(self, kind: str) -> Collection[str]:
        """Keys of all entries of a kind."""
        return self._keys[kind]

    def read(self, kind: str, key: str) -> Packed | None:
        """An entry; None where there is none, or a damaged one, which is forgotten. Raises StorageError."""
        if key not in self._keys[kind]:
            return None
        blob = self._waiting.get((kind, key))
        if blob is None:
            with faults_told(self.path):
                query = "SELECT blob FROM entries WHERE kind=? AND key=?"
                (blob,) = self._database.execute(query, [kind, key]).fetchone() or (b"",)
        with contextlib.suppress(ValueError, TypeError):
            return from_blob(blob)
        self.forget(kind, key)
        return None

    def keep_computed(self, key: str, value: Packed) -> None:
        """Keeps what is computed once for a study. key: hash of its inputs."""
        self.put_if_small(COMPUTED, key, value)

    def read_computed(self, key: str) -> Packed | None:
        """What `keep_computed` has kept, in this run or an earlier one; None where there is nothing."""
        self._used.add(key)
        return self.read(COMPUTED, key)

    def forget(self, kind: str, key: str) -> None:
        """Removes an entry with the next transaction."""
        if key in self._keys[kind]:
            self._keys[kind].discard(key)
            self._waiting[kind, key] = None

    def prune(self, used: Mapping[str, Collection[str]], most: float) -> None:
        """Removes the oldest entries without a name in `used` until these have at most `most` bytes together.

        used: keys by kind. What was kept or read by `read_computed` in this run is used as well.
        """
        self.flush()
        named = {RUN: frozenset({""}), COMPUTED: self._used, **used}
        with faults_told(self.path):
            rows = self._database.execute("SELECT kind, key, length(blob) FROM entries ORDER BY rowid").fetchall()
        idle = [(kind, key, size) for kind, key, size in rows if key not in named.get(kind, ())]
        too_much = sum(size for *_, size in idle) - most
        for kind, key, size in idle:
            if too_much <= 0.0:
                break
            too_much -= size
            self.forget(kind, key)
        self.flush()

    def shrink(self) -> None:
        """Gives the room of what was removed back to the disk. A full disk only keeps the file larger."""
        with contextlib.suppress(StorageError), faults_told(self.path), uninterrupted():
            self._database.executescript("PRAGMA incremental_vacuum")

    def tick(self) -> None:
        """Called many times a second: writes what waits, when it has waited long enough. Raises StorageError."""
        if (self._waiting or not self._is_noted) and time.monotonic() > self._next_write:
            self.flush()

    def flush(self) -> None:
        """Writes what waits, in one transaction. Raises StorageError; what waits then still waits."""
        if not self._waiting and self._is_noted:
            return
        if not self._is_noted:
            self._waiting[RUN, ""] = self._describe_run()
        began = time.monotonic()
        with uninterrupted(), faults_told(self.path):
            if self.path.stat().st_ino != self._file:
                raise FileNotFoundError(None, "another file has taken its place")
            with transaction(self._database):
                for (kind, key), blob in self._waiting.items():
                    if blob is None:
                        self._database.execute("DELETE FROM entries WHERE kind=? AND key=?", [kind, key])
                    else:
                        self._database.execute("INSERT OR REPLACE INTO entries VALUES (?, ?, ?)", [kind, key, blob])
            self._waiting, self._n_bytes, self._is_noted = {}, 0, True
        now = time.monotonic()
        self._next_write = now + max(SECONDS_A_TRANSACTION, (now - began) / _SHARE_OF_WRITING)

    def close(self) -> None:
        """Writes what waits, as far as there is room, and closes the file. A new file without a study is removed."""
        self._is_open, self._is_noted = False, False
        # an error was said before, or there is nothing that waits for an answer
        with contextlib.suppress(StorageError):
            self.flush()
        with contextlib.suppress(sqlite3.Error):
            self._database.close()
        if self._is_new and not any(keys for kind, keys in self._keys.items() if kind != RUN):
            # the run has ended before it began: the scene or the disk is at fault
            with contextlib.suppress(OSError):
                self.path.unlink()

    def _put(self, kind: str, key: str, blob: bytes) -> None:
        self._waiting[kind, key] = blob
        self._keys[kind].add(key)
        self._n_bytes += len(blob)

    def _describe_run(self) -> bytes:
        noted = {
            **self._study,
            "run": f"process {os.getpid()} on {socket.gethostname()}",
            "open": self._is_open,
            "under_way": sorted(self._under_way),
            "crashes": self.crashes,
        }
        return json.dumps(noted).encode()

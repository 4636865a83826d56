"""What a study has computed so far, in one SQLite file beside the result, from which a later run goes on.

Rank 0 alone uses the file. What arrives within a moment goes into one transaction. A rollback journal and an exclusive
lock share no memory with other processes, as WAL does: this works on file systems of a network. With `synchronous=FULL`
a finished transaction survives a power cut.
"""

import contextlib
import json
import os
import socket
import sqlite3
import time
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from solver.packing import Packed
from studyrunner.system.machine import remove_leftovers, sync_folder
from studyrunner.system.process import uninterrupted
from studyrunner.user_error import StorageError, UserError, Verbatim

RESULTS, PROGRESS, COMPUTED = "result", "progress", "computed"
"""Kinds of entries: results of tasks, start states among them; progress of tasks; what is computed once for a study, by
the hash of its inputs."""

UNREADABLE = (zlib.error, ValueError, TypeError, LookupError, ArithmeticError, AttributeError, RecursionError)
"""What comes of reading an entry that was damaged or altered."""

_LARGEST = 9 * 10**8  # bytes of an entry: SQLite has no larger ones
_SECONDS_A_TRANSACTION = 0.25  # that an entry waits for others at most, on a disk that is fast
_SHARE_OF_WRITING = 0.1  # of the time of rank 0, on a disk that is slow
_BYTES_A_TRANSACTION = 8e6
_LEVEL = 1  # of zlib: the rank that compresses hands out the tasks as well
_SECONDS_TO_DIE = 5.0  # after which all ranks of a run that was killed have noticed
_FILE, _STUDY, _OPEN = "file", "study", "open"  # kind and keys of the entries about the file: its study, and its run
_CRASHES = "crashes"  # kind of the entries with the number of crashes of a task, by its key
_SCHEMA = "CREATE TABLE entries (kind TEXT NOT NULL, key TEXT NOT NULL, blob BLOB NOT NULL, PRIMARY KEY (kind, key))"
_ONE = "SELECT blob FROM entries WHERE kind=? AND key=?"
_COUNTS = "SELECT key, CAST(CAST(blob AS TEXT) AS INTEGER) FROM entries WHERE kind=?"  # 0 for what is no number
_MARKS = {"application_id": int.from_bytes(b"wear", "big"), "user_version": 6}
_PRAGMAS = ("trusted_schema=OFF", "temp_store=MEMORY", "locking_mode=EXCLUSIVE", "synchronous=FULL")
_DAMAGES = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_FORMAT)


class _OtherFileError(Exception):
    """The file is damaged, or is none of this version."""


def to_blob(packed: Packed) -> bytes:
    """The text, type and shape of the arrays of a value as JSON in a line, then their bytes, compressed by zlib.

    By hand: `numpy.lib.format` takes five times as long for the small arrays of a result. Raises TypeError for arrays
    of objects: a bug.
    """
    if any(array.dtype.hasobject for array in packed.arrays):
        raise TypeError("arrays of objects are not kept")
    head = json.dumps([packed.text, [[array.dtype.str, array.shape] for array in packed.arrays]])
    raw = (head.encode(), b"\n", *(array.tobytes() for array in packed.arrays))
    return zlib.compress(b"".join(raw), _LEVEL)


def from_blob(blob: bytes) -> Packed:
    """The value of `to_blob`. Raises one of UNREADABLE where the bytes are no such value."""
    raw = zlib.decompress(blob)
    arrays, place = [], raw.index(b"\n") + 1
    text, layout = json.loads(raw[:place])
    for kind, shape in layout:
        array: NDArray[np.generic] = np.ndarray(tuple(shape), np.dtype(kind), raw, place)
        arrays.append(array.copy())
        place += array.nbytes
    return Packed(text, tuple(arrays))


class Store:
    """The open file of a run. Raises UserError where another run uses the file, and StorageError.

    path: of the file.
    notes: lines for the user on what was found.
    ended_hard: whether the run before was killed or has crashed.
    crashes: how many runs in a row have ended so while a task was under way and had given nothing yet, by its key.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.notes: list[str] = []
        self._next_write, self._n_bytes = 0.0, 0  # bytes in the open transaction
        self._under_way: set[str] = set()
        self._keys: dict[str, dict[str, str]] = defaultdict(dict)
        with _storage_errors(path):
            try:
                self._database = _open_locked(path)
            except _OtherFileError:
                aside = path.with_name(f"{path.name}.old")
                path.rename(aside)
                path.with_name(f"{path.name}-journal").unlink(missing_ok=True)
                why = "is damaged or of another version of this program"
                self.notes.append(f"{path.name} {why}: it is kept as {aside.name}, and the study begins anew")
                self._database = _open_locked(path)
            self._file = path.stat().st_ino
            for kind, key in self._database.execute("SELECT kind, key FROM entries"):
                self._keys[kind][key] = key
            self.crashes: dict[str, int] = dict(self._database.execute(_COUNTS, [_CRASHES]))
            remove_leftovers(path)
        self.ended_hard = _OPEN in self._keys[_FILE]
        self._write(_FILE, _OPEN, f"process {os.getpid()} on {socket.gethostname()}".encode())
        self.flush()

    def note_study(self, study: str) -> None:
        """Writes which study the file belongs to, in words."""
        self._write(_FILE, _STUDY, study.encode())
        self.flush()

    def note_begin(self, key: str) -> None:
        """Counts a crash of a task that a rank is about to do, until `note_life` or `close` takes it back; on the disk
        at once where the run before has ended hard.
        """
        self._under_way.add(key)
        self._write(_CRASHES, key, b"%d" % (self.crashes.get(key, 0) + 1))
        if self.ended_hard:
            self.flush()

    def note_life(self, key: str) -> None:
        """Notes that a task has given something: it has not ended the run, nor the runs before."""
        self.crashes.pop(key, None)
        self._under_way.discard(key)
        self.forget(_CRASHES, key)

    def put(self, kind: str, key: str, packed: Packed) -> None:
        """Adds an entry, or replaces it; none that only saves time and is too large. Raises StorageError."""
        if packed.n_bytes <= _LARGEST:
            self._write(kind, key, to_blob(packed))
        elif kind == RESULTS:
            raise StorageError(self.path, ValueError(f"{packed.n_bytes:.3g} bytes in one entry"), "use a smaller model")

    def keys(self, kind: str) -> Mapping[str, str]:
        """Keys of all entries of a kind, on the disk or on their way, each by itself."""
        return self._keys[kind]

    def read(self, kind: str, key: str, take: Callable[[Packed], Any] = lambda packed: packed) -> Any:
        """An entry, as `take` gives it; None where there is none. One that is damaged, or that was altered so that
        `take` raises one of UNREADABLE, is forgotten. Raises StorageError.
        """
        if key not in self._keys[kind]:
            return None
        with _storage_errors(self.path):
            (blob,) = self._database.execute(_ONE, [kind, key]).fetchone() or (b"",)
        with contextlib.suppress(*UNREADABLE):
            return take(from_blob(blob))
        self.forget(kind, key)
        return None

    def forget(self, kind: str, key: str) -> None:
        """Removes an entry with the next transaction."""
        if key in self._keys[kind]:
            del self._keys[kind][key]
            self._execute("DELETE FROM entries WHERE kind=? AND key=?", kind, key)

    def _write(self, kind: str, key: str, blob: bytes) -> None:
        self._execute("INSERT OR REPLACE INTO entries VALUES (?, ?, ?)", kind, key, blob)
        self._keys[kind][key] = key
        self._n_bytes += len(blob)
        if self._n_bytes > _BYTES_A_TRANSACTION:
            self.flush()

    def _execute(self, statement: str, *values: object) -> None:
        """Changes the file in the transaction that the next `flush` ends."""
        with uninterrupted(), _storage_errors(self.path):
            self._database.execute(statement, values)

    def tick(self) -> None:
        """Called many times a second: ends a transaction that is open for long enough. Raises StorageError."""
        if time.monotonic() > self._next_write:
            self.flush()

    def flush(self) -> None:
        """Ends the transaction: everything is on the disk when this returns. Raises StorageError."""
        if not self._database.in_transaction:
            return
        began = time.monotonic()
        with uninterrupted(), _storage_errors(self.path):
            if self.path.stat().st_ino != self._file:
                raise FileNotFoundError(None, "another file has taken its place")
            self._database.commit()
            self._n_bytes = 0
        now = time.monotonic()
        self._next_write = now + max(_SECONDS_A_TRANSACTION, (now - began) / _SHARE_OF_WRITING)

    def close(self) -> None:
        """Writes what waits, as far as there is room, and closes the file. A file without a study is removed, and what
        the ranks have mapped.
        """
        # an error was said before, or there is nothing that waits for an answer
        with contextlib.suppress(StorageError):
            for key in self._under_way:
                self.forget(_CRASHES, key)
                if key in self.crashes:
                    self._write(_CRASHES, key, b"%d" % self.crashes[key])
            self.forget(_FILE, _OPEN)
            self.flush()
        with contextlib.suppress(OSError):
            remove_leftovers(self.path)
        with contextlib.suppress(sqlite3.Error, OSError):
            self._database.close()
            if not any(self._keys.values()):
                # the run has ended before it began: the scene or the disk is at fault
                self.path.unlink()


def read_study(path: Path, key: str = _STUDY) -> str | None:
    """The study that a file belongs to, or another entry about itself, without its lock; None where there is none."""
    address = f"file:{quote(os.fsencode(path))}?mode=ro&immutable=1"
    with contextlib.suppress(sqlite3.Error, *UNREADABLE):
        with contextlib.closing(sqlite3.connect(address, uri=True)) as database:
            (blob,) = database.execute(_ONE, [_FILE, key]).fetchone() or (b"",)
        return str(blob.decode()) or None
    return None


def _open_locked(path: Path) -> sqlite3.Connection:
    """The file, new or of an earlier run. Its lock stays until the process ends, however it ends, or closes it."""
    database = sqlite3.connect(path, timeout=_SECONDS_TO_DIE, isolation_level="IMMEDIATE")
    try:
        for pragma in _PRAGMAS:
            database.execute(f"PRAGMA {pragma}").fetchall()
        database.execute("BEGIN EXCLUSIVE")
        _check(database)
        database.commit()
        sync_folder(path.parent)
        return database
    except BaseException as error:
        database.close()
        if _code(error) in _DAMAGES:
            raise _OtherFileError from error
        if _code(error) != sqlite3.SQLITE_BUSY:
            raise
    run = Verbatim(f"by {read_study(path, _OPEN) or 'no run that is known'}")
    remedy = "wait for its end, or give another result file with -o; where no run is at work the disk has no locks"
    raise UserError(str(path), "in use", run, remedy)


def _check(database: sqlite3.Connection) -> None:
    """Checks the table of a file; creates it in an empty file. Raises _OtherFileError and sqlite3.Error."""
    schema = [sql for (sql,) in database.execute("SELECT sql FROM sqlite_master WHERE sql IS NOT NULL")]
    marks = {name: database.execute(f"PRAGMA {name}").fetchone()[0] for name in _MARKS}
    if not schema and not any(marks.values()):
        database.execute(_SCHEMA)
        for name, value in _MARKS.items():
            database.execute(f"PRAGMA {name}={value}")
    elif (schema, marks) != ([_SCHEMA], _MARKS) or database.execute("PRAGMA quick_check(1)").fetchall() != [("ok",)]:
        raise _OtherFileError


@contextlib.contextmanager
def _storage_errors(path: Path) -> Iterator[None]:
    """Raises StorageError where the disk, or what is on it, is at fault."""
    try:
        yield
    except (sqlite3.Error, OSError) as error:
        remedy = "the next run keeps it aside and begins anew" if _code(error) in _DAMAGES else ""
        raise StorageError(path, error, remedy) from error


def _code(error: BaseException) -> int:
    """Primary result code of SQLite; 0 of any other error."""
    return getattr(error, "sqlite_errorcode", 0) & 0xFF

"""The SQLite file of a study: opened by one run at a time, and checked before use.

The file has a rollback journal and an exclusive lock, so that no memory is shared with other processes, as WAL needs
it: this works on file systems of a network. `synchronous=FULL`: a transaction that is finished survives a power cut.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import sqlite3
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

from studyrunner.system import files
from studyrunner.user_error import StorageError

_SECONDS_TO_DIE = 5.0  # after which all ranks of a run that was killed have noticed
_PAUSE = 0.1
RUN = "run"
"""Kind of the only entry about the file itself."""

_SCHEMA = "CREATE TABLE entries (kind TEXT NOT NULL, key TEXT NOT NULL, blob BLOB NOT NULL, PRIMARY KEY (kind, key))"
_APPLICATION = int.from_bytes(b"wear", "big")
_VERSION = 2
_PRAGMAS = ("trusted_schema=OFF", "temp_store=MEMORY", "locking_mode=EXCLUSIVE", "synchronous=FULL")
_DAMAGES = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_FORMAT)
_FAULTS = {
    sqlite3.SQLITE_FULL: errno.ENOSPC,
    sqlite3.SQLITE_IOERR: errno.EIO,
    sqlite3.SQLITE_READONLY: errno.EACCES,
    sqlite3.SQLITE_PERM: errno.EACCES,
    sqlite3.SQLITE_CANTOPEN: errno.EACCES,
    sqlite3.SQLITE_NOMEM: errno.ENOMEM,
}


class StoreInUseError(Exception):
    """Another run works with the file; the text says which."""


class NoLocksError(Exception):
    """The file system has no locks."""


class _OtherFileError(Exception):
    """The file is none of this version, or is damaged; the text says which."""


def open_file(path: Path) -> tuple[sqlite3.Connection, str]:
    """The file of a run, new or with what an earlier run has left, and a sentence where it begins anew.

    Raises StoreInUseError, NoLocksError, OSError and sqlite3.Error.
    """
    if not files.has_locks(path):
        raise NoLocksError
    try:
        return _open_locked(path), ""
    except _OtherFileError as error:
        aside = path.with_name(f"{path.name}.old")
        path.rename(aside)
        with contextlib.suppress(FileNotFoundError):
            _journal_of(path).rename(_journal_of(aside))
        said = f"{path.name} {error}: it is kept as {aside.name}, and the study begins anew"
        return _open_locked(path), said


def read_study(path: Path) -> tuple[str, str] | None:
    """Name and scene of the study that a file belongs to, without its lock; None where the file does not say so."""
    found = _read_run(path)
    return (str(found["name"]), str(found["scene"])) if "name" in found and "scene" in found else None


def _read_run(path: Path) -> dict[str, object]:
    """What a file that another run may use says of itself; nothing where it is none of this version."""
    address = f"file:{quote(os.fsencode(path))}?mode=ro&immutable=1"
    with contextlib.suppress(sqlite3.Error), contextlib.closing(sqlite3.connect(address, uri=True)) as database:
        return run_in(database)
    return {}


def run_in(database: sqlite3.Connection) -> dict[str, Any]:
    """What the file says of its last run; nothing where it does not say so."""
    with contextlib.suppress(sqlite3.Error, ValueError, TypeError):
        (blob,) = database.execute("SELECT blob FROM entries WHERE kind=? AND key=''", [RUN]).fetchone()
        found = json.loads(blob)
        return found if isinstance(found, dict) else {}
    return {}


def _open_locked(path: Path) -> sqlite3.Connection:
    """The file, new or of an earlier run. Its lock stays until the process ends, however it ends, or closes it."""
    latest = time.monotonic() + _SECONDS_TO_DIE
    while True:
        is_empty = not path.exists() or path.stat().st_size == 0
        database = sqlite3.connect(path, timeout=0.0, isolation_level=None)
        try:
            for pragma in (*_PRAGMAS, *(["auto_vacuum=INCREMENTAL"] if is_empty else [])):
                database.execute(f"PRAGMA {pragma}").fetchall()
            database.execute("BEGIN EXCLUSIVE")
            _check(database)
            database.execute("COMMIT")
        except BaseException as error:
            database.close()
            if not isinstance(error, sqlite3.Error):
                raise
            if _code(error) in _DAMAGES:
                raise _OtherFileError("is damaged") from error
            if _code(error) != sqlite3.SQLITE_BUSY:
                raise
        else:
            files.sync_folder(path.parent)
            return database
        if time.monotonic() > latest:
            raise StoreInUseError(str(_read_run(path).get("run", "unknown")))
        time.sleep(_PAUSE)


def _check(database: sqlite3.Connection) -> None:
    """Checks the table of a file; creates it in an empty file. Raises _OtherFileError and sqlite3.Error."""
    found = [sql for (sql,) in database.execute("SELECT sql FROM sqlite_master WHERE sql IS NOT NULL")]
    (version,) = database.execute("PRAGMA user_version").fetchone()
    (application,) = database.execute("PRAGMA application_id").fetchone()
    if not found and (version, application) == (0, 0):
        database.execute(_SCHEMA)
        database.execute(f"PRAGMA application_id={_APPLICATION}")
        database.execute(f"PRAGMA user_version={_VERSION}")
    elif application == _APPLICATION and version != _VERSION:
        raise _OtherFileError("is of another version of this program")
    elif found != [_SCHEMA] or application != _APPLICATION:
        raise _OtherFileError("is no file of a run")
    elif database.execute("PRAGMA integrity_check(1)").fetchall() != [("ok",)]:
        raise _OtherFileError("is damaged")


@contextlib.contextmanager
def transaction(database: sqlite3.Connection) -> Iterator[None]:
    """What is done in the block is on the disk as a whole behind it, or not at all."""
    database.execute("BEGIN IMMEDIATE")
    try:
        yield
        database.execute("COMMIT")
    except BaseException:
        if database.in_transaction:
            database.execute("ROLLBACK")
        raise


@contextlib.contextmanager
def faults_told(path: Path) -> Iterator[None]:
    """Raises StorageError where the disk, or what is on it, is at fault."""
    try:
        yield
    except sqlite3.Error as error:
        if _code(error) in _DAMAGES:
            remedy = "the next run keeps it aside and begins anew"
            raise StorageError(path, ValueError("is damaged"), remedy) from error
        number = _FAULTS.get(_code(error))
        fault = ValueError(str(error)) if number is None else _reason(path) or OSError(number, os.strerror(number))
        raise StorageError(path, fault) from error
    except OSError as error:
        raise StorageError(path, error) from error


def _reason(path: Path) -> OSError | None:
    """Why nothing can be written beside a file, as the system says it: SQLite does not say it."""
    trial = files.new_partial(path)
    try:
        files.create(trial).close()
        return files.find_fault(trial)
    except OSError as error:
        return error
    finally:
        with contextlib.suppress(OSError):
            trial.unlink()


def _journal_of(path: Path) -> Path:
    return path.with_name(f"{path.name}-journal")


def _code(error: sqlite3.Error) -> int:
    """Primary result code of SQLite."""
    return getattr(error, "sqlite_errorcode", 0) & 0xFF

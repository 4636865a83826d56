"""The SQLite file of a study: opened by one run at a time, checked before use, readable with the program `sqlite3`.

The file has a rollback journal and an exclusive lock, so that no memory is shared with other processes, as WAL needs
it: this works on file systems of a network. `synchronous=FULL`: a transaction that is finished survives a power cut.
"""

from __future__ import annotations

import contextlib
import errno
import os
import sqlite3
import time
import zlib
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

from studyrunner.checkpoint.contents import LARGEST
from studyrunner.system import files
from studyrunner.user_error import StorageError

STARTS, UNDER_WAY, RESULTS, COMPUTED = "start_states", "under_way", "results", "computed"
"""Tables with contents: start states; sweeps and integrations under way; finished wear histories; what is computed once
for a study.
"""

_CONTENT = "written TEXT, size INTEGER, checksum INTEGER, content BLOB"
_KEY = "key TEXT PRIMARY KEY NOT NULL"
_CASE = "sweep TEXT, excitation_amplitude REAL, frequency REAL"
_HISTORY = "scheme TEXT, wear_coefficient REAL, step REAL"
_COLUMNS = {
    "study": "name TEXT, scene TEXT, run TEXT",
    "layouts": "hash TEXT PRIMARY KEY NOT NULL, layout TEXT",
    "tasks": f"{_KEY}, kind TEXT, {_CASE}, {_HISTORY}, points INTEGER",
    STARTS: f"{_KEY}, {_CASE}, unknowns INTEGER, moves INTEGER, {_CONTENT}",
    UNDER_WAY: f"{_KEY}, kind TEXT, {_CASE}, {_HISTORY}, {_CONTENT}",
    RESULTS: f"{_KEY}, {_CASE}, {_HISTORY}, outcome TEXT, last_cycle REAL, worn_volume REAL, error_estimate REAL,"
    f" run_time REAL, message TEXT, {_CONTENT}",
    COMPUTED: f"{_KEY}, {_CONTENT}",
}
_SCHEMA = {table: f"CREATE TABLE {table} ({columns})" for table, columns in _COLUMNS.items()}
TABLES = (STARTS, UNDER_WAY, RESULTS, COMPUTED)

_APPLICATION = int.from_bytes(b"wear", "big")
_VERSION = 1
_HEADER = b"SQLite format 3\0"
_ROLLBACK = b"\1\1"  # at 18: no WAL, for which files would be read that are not checked here
_SUPER_JOURNAL = bytes.fromhex("d9d505f920a163d7")
_NO_LIMIT = 2**62
_SECONDS_TO_DIE = 5.0  # after which all ranks of a run that was killed have noticed
_PAUSE = 0.1

_FAULTS = {
    sqlite3.SQLITE_FULL: errno.ENOSPC,
    sqlite3.SQLITE_IOERR: errno.EIO,
    sqlite3.SQLITE_READONLY: errno.EACCES,
    sqlite3.SQLITE_PERM: errno.EACCES,
    sqlite3.SQLITE_CANTOPEN: errno.EACCES,
    sqlite3.SQLITE_AUTH: errno.EACCES,
    sqlite3.SQLITE_NOMEM: errno.ENOMEM,
}
_PRAGMAS = (
    "trusted_schema=OFF",
    "cell_size_check=ON",
    "mmap_size=0",
    "temp_store=MEMORY",
    "locking_mode=EXCLUSIVE",
    "synchronous=FULL",
    "secure_delete=OFF",
)

_open: set[str] = set()  # in this process, whose locks end where any other descriptor of the file is closed


class StoreInUseError(Exception):
    """Another run works with the file; the text says which."""


class NoLocksError(Exception):
    """The file system has no locks."""


class DamagedError(Exception):
    """A file is none that a run has written, or does not contain any more what was written."""


def connect(path: Path, options: str) -> sqlite3.Connection:
    """A connection to a file that was checked by `check_plain`. Raises sqlite3.Error."""
    address = f"file:{quote(os.fsencode(path))}?{options}"
    database = sqlite3.connect(address, uri=True, timeout=0.0, isolation_level=None, check_same_thread=False)
    database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST + 2**20)
    database.setlimit(sqlite3.SQLITE_LIMIT_ATTACHED, 0)
    database.text_factory = lambda text: text.decode("utf-8", "replace")
    return database


def _set_up(database: sqlite3.Connection) -> None:
    for pragma in _PRAGMAS:
        database.execute(f"PRAGMA {pragma}").fetchall()


def open_locked(path: Path) -> tuple[sqlite3.Connection, str]:
    """The file of a run, new or with what an earlier run has left, and a sentence on a file that was damaged.

    Parameters
    ----------
    path
        The file, in a folder that exists.

    Raises
    ------
    StoreInUseError
        Where another run uses the file.
    OSError, sqlite3.Error, files.NotPlainError
        Where the file cannot be read or written. A fault of a disk is no damage of the file.
    """
    name = os.path.realpath(path)
    if name in _open:
        raise StoreInUseError(_user_of(path))
    try:
        return _open_file(path), ""
    except DamagedError as error:
        aside = _set_aside(path)
        said = f"{path.name} {error}: it is kept as {aside.name}, and the study begins anew"
        return _open_file(path), said


def _open_file(path: Path) -> sqlite3.Connection:
    is_new = not os.path.lexists(path)
    check_plain(path)
    database = connect(path, "mode=rwc")
    try:
        with damage_told():
            _lock(database, path)
            check(database)
            database.execute("COMMIT")
    except BaseException:
        database.close()
        raise
    if is_new:
        files.sync_folder(path.parent)
    _open.add(os.path.realpath(path))
    return database


def close(database: sqlite3.Connection, path: Path) -> None:
    """Closes the file of a run."""
    _open.discard(os.path.realpath(path))
    database.close()


def _lock(database: sqlite3.Connection, path: Path) -> None:
    """Begins a transaction; the lock stays until the connection is closed or the process ends, however it ends."""
    latest = time.monotonic() + _SECONDS_TO_DIE
    while True:
        try:
            _set_up(database)
            if path.stat().st_size == 0:
                database.execute("PRAGMA auto_vacuum=INCREMENTAL").fetchall()
            database.execute("BEGIN EXCLUSIVE")
        except sqlite3.OperationalError as error:
            if _code(error) != sqlite3.SQLITE_BUSY:
                raise
            if time.monotonic() > latest:
                raise StoreInUseError(_user_of(path)) from None
            time.sleep(_PAUSE)
        else:
            return


def check_plain(path: Path) -> None:
    """Checks what SQLite does not check: that the files are plain and lead to no other files.

    A missing file is none that does harm. Raises DamagedError, files.NotPlainError and OSError.
    """
    journal = path.with_name(f"{path.name}-journal")
    for found in (path, journal):
        with contextlib.suppress(FileNotFoundError), files.open_plain(found, _NO_LIMIT) as file:
            head = file.read(len(_HEADER) + 4)
            if found == path and head and (not head.startswith(_HEADER) or head[-2:] != _ROLLBACK):
                raise DamagedError("is no file of a run")
            # where the journal is that of several files, SQLite may remove one that is named at its end
            file.seek(max(0, os.fstat(file.fileno()).st_size - len(_SUPER_JOURNAL)))
            if found == journal and file.read() == _SUPER_JOURNAL:
                raise DamagedError("has a journal that is none of a run")


def check(database: sqlite3.Connection, *, create: bool = True) -> None:
    """Checks the tables of a file; creates them in an empty file. Raises DamagedError and sqlite3.Error."""
    found = dict(database.execute("SELECT name, sql FROM sqlite_master WHERE sql IS NOT NULL"))
    (version,) = database.execute("PRAGMA user_version").fetchone()
    (application,) = database.execute("PRAGMA application_id").fetchone()
    if not found and create and (version, application) == (0, 0):
        for command in _SCHEMA.values():
            database.execute(command)
        database.execute(f"PRAGMA application_id={_APPLICATION}")
        database.execute(f"PRAGMA user_version={_VERSION}")
        return
    if application == _APPLICATION and version != _VERSION:
        raise DamagedError("was written by another version of this program")
    if found != _SCHEMA or application != _APPLICATION:
        raise DamagedError("is no file of a run")
    if database.execute("PRAGMA integrity_check(1)").fetchall() != [("ok",)]:
        raise DamagedError("is damaged")


def checksum(key: str, content: bytes) -> int:
    """Check sum of an entry; includes the key."""
    return zlib.crc32(content, zlib.crc32(key.encode("utf-8", "surrogateescape")))


def is_whole(key: object, sum_: object, content: object) -> bool:
    """Whether an entry contains what was written."""
    return isinstance(key, str) and isinstance(content, bytes) and sum_ == checksum(key, content)


def columns(table: str) -> tuple[str, ...]:
    """Names of the columns of a table."""
    return tuple(column.split()[0] for column in _COLUMNS[table].split(", "))


def read_study(path: Path) -> tuple[str, str] | None:
    """Name and scene of the study that a file belongs to, without waiting for a run that uses the file; None where the
    file does not say so.
    """
    found = _read_row(path, "SELECT name, scene FROM study")
    return None if found is None or None in found else (str(found[0]), str(found[1]))


@contextlib.contextmanager
def reading(path: Path) -> Iterator[sqlite3.Connection]:
    """A file that another run may use, as it is on the disk now. Raises DamagedError, OSError and sqlite3.Error."""
    if os.path.realpath(path) not in _open:
        check_plain(path)
    with contextlib.closing(connect(path, "mode=ro&immutable=1")) as database, damage_told():
        _set_up(database)
        yield database


def _read_row(path: Path, query: str) -> tuple[object, ...] | None:
    with contextlib.suppress(OSError, sqlite3.Error, DamagedError, files.NotPlainError), reading(path) as database:
        schema = database.execute("SELECT sql FROM sqlite_master WHERE name='study'").fetchall()
        if schema == [(_SCHEMA["study"],)]:
            row: tuple[object, ...] | None = database.execute(query).fetchone()
            return row
    return None


def _user_of(path: Path) -> str:
    (run,) = _read_row(path, "SELECT run FROM study") or (None,)
    return str(run or "unknown")


def _set_aside(path: Path) -> Path:
    """Gives a file another name, its journal as well; the new path."""
    aside, number = path.with_name(f"{path.name}.damaged"), 1
    while os.path.lexists(aside):
        number += 1
        aside = path.with_name(f"{path.name}.damaged-{number}")
    path.rename(aside)
    with contextlib.suppress(FileNotFoundError):
        path.with_name(f"{path.name}-journal").rename(aside.with_name(f"{aside.name}-journal"))
    return aside


@contextlib.contextmanager
def damage_told() -> Iterator[None]:
    """Raises DamagedError where SQLite finds that a file is damaged."""
    try:
        yield
    except sqlite3.DatabaseError as error:
        if _code(error) not in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_FORMAT):
            raise
        raise DamagedError("is damaged") from error


@contextlib.contextmanager
def faults_told(path: Path) -> Iterator[None]:
    """Raises StorageError where the disk, or what is on it, is at fault."""
    try:
        with damage_told():
            yield
    except DamagedError as error:
        raise StorageError(path, error, "the next run keeps it aside and begins anew") from error
    except sqlite3.Error as error:
        number = _FAULTS.get(_code(error))
        fault = ValueError(str(error)) if number is None else _reason(path) or OSError(number, os.strerror(number))
        raise StorageError(path, fault) from error
    except files.NotPlainError as error:
        raise StorageError(path, error, "remove it or give another result file with -o") from error
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


def _code(error: sqlite3.Error) -> int:
    """Primary result code of SQLite."""
    return getattr(error, "sqlite_errorcode", 0) & 0xFF

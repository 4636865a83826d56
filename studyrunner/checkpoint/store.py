"""What a study has computed so far, in one file beside the result: written within a second or so, read by a later run.

Rank 0 alone uses the file. A thread writes, as a transaction waits for the disk; what arrives meanwhile goes into the
next transaction. The connection is used by one thread at a time: who reads waits until the writer has ended.

By hand is what goes into one transaction: all else is SQLite's.
"""

from __future__ import annotations

import contextlib
import os
import socket
import sqlite3
import time
from collections.abc import Collection, Iterable, Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path

from solver.packing import Packed
from studyrunner.checkpoint import database
from studyrunner.checkpoint.contents import LARGEST, decompress
from studyrunner.checkpoint.database import COMPUTED, TABLES, UNDER_WAY, NoLocksError, faults_told
from studyrunner.checkpoint.entries import Batch, Entry, Name, row_of
from studyrunner.checkpoint.writer import Writer
from studyrunner.system.endings import uninterrupted
from studyrunner.system.files import has_locks
from studyrunner.user_error import StorageError

SECONDS_A_TRANSACTION = 0.25
"""Longest time, s, that a result or progress waits for others that go into the same transaction."""

MOST_BYTES_WAITING = 32e6
"""Bytes that may wait for the disk. Beyond this size a new result waits until there is room again."""

_BYTES_A_TRANSACTION = 8e6


class Store:
    """The open file of a run. Raises database.StoreInUseError, database.NoLocksError and StorageError.

    path: of the file.
    notes: lines for the user on what was found.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.notes: list[str] = []
        self._waiting: Batch = {}
        self._handed_over: Batch = {}
        self._n_bytes = 0.0  # that wait
        self._forgotten: set[Name] = set()
        self._used: set[str] = set()
        self._written = 0.0
        with faults_told(path):
            if not has_locks(path):
                raise NoLocksError
            self._is_new = not self.path.exists()
            self._database, damage = database.open_locked(path)
            try:
                self.notes += [damage] if damage else []
                self._file = self.path.stat().st_ino
                self._keys = self._read_keys()
                run = f"process {os.getpid()} on {socket.gethostname()}"
                with self._transaction():
                    if self._database.execute("UPDATE study SET run=?", [run]).rowcount != 1:
                        self._database.execute("DELETE FROM study")
                        self._database.execute("INSERT INTO study (run) VALUES (?)", [run])
            except BaseException:
                database.close(self._database, self.path)
                raise
        self._writer = Writer(self._write)

    def note_study(self, name: str, scene: str, layout: tuple[str, str], tasks: Iterable[Mapping[str, object]]) -> None:
        """Writes the study that the file belongs to, and for people its tasks and the layout of its results."""
        columns = database.columns("tasks")
        self._take(wait=True)
        with faults_told(self.path), self._transaction():
            self._database.execute("UPDATE study SET name=?, scene=?", [name, scene])
            self._database.execute("INSERT OR REPLACE INTO layouts VALUES (?, ?)", layout)
            self._database.execute("DELETE FROM tasks")
            self._database.executemany(
                f"INSERT OR REPLACE INTO tasks VALUES ({', '.join('?' * len(columns))})",
                ([task.get(column) for column in columns] for task in tasks),
            )
        self._is_new = False

    def put(self, table: str, key: str, packed: Packed, shown: Mapping[str, object], finished: str = "") -> None:
        """Adds an entry, in place of an earlier one.

        Parameters
        ----------
        table, key
            Name of the entry.
        packed, shown
            Its contents, and columns that a person can read.
        finished
            Key of a task whose progress is no longer needed with this entry.
        """
        if packed.n_bytes > LARGEST:
            raise StorageError(self.path, ValueError(f"{packed.n_bytes:.3g} bytes in one entry"), "use a smaller model")
        self._waiting[table, key] = Entry(packed, shown)
        if finished:
            self._waiting[UNDER_WAY, finished] = None
        self._n_bytes += packed.n_bytes
        if self._n_bytes > _BYTES_A_TRANSACTION:
            self._take(wait=self._n_bytes > MOST_BYTES_WAITING)
            if not self._writer.busy:
                self._begin()

    def has(self, table: str, key: str) -> bool:
        """Whether there is an entry, on the disk or on its way."""
        for batch in (self._waiting, self._handed_over):
            if (table, key) in batch:
                return batch[table, key] is not None
        return key in self._keys[table]

    def on_disk(self, table: str) -> Collection[str]:
        """Keys of all entries on the disk."""
        return self._keys[table]

    def read(self, table: str, key: str) -> Packed | None:
        """Contents of an entry; None where there is none, or a damaged one. Raises StorageError."""
        for batch in (self._waiting, self._handed_over):
            if (table, key) in batch:
                entry = batch[table, key]
                return None if entry is None else entry.packed
        if key not in self._keys[table]:
            return None
        self._take(wait=True)
        query = f"SELECT size, checksum, content FROM {table} WHERE key=?"
        try:
            with faults_told(self.path):
                size, sum_, content = self._database.execute(query, [key]).fetchone() or (0, 0, None)
            if isinstance(size, int) and isinstance(content, bytes) and database.is_whole(key, sum_, content):
                return decompress(size, content)
        except ValueError:
            pass
        self.forget(table, key)
        return None

    def keep_progress(self, key: str, progress: Packed, shown: Mapping[str, object] | None = None) -> None:
        """Adds the progress of a task, in place of an earlier one; more than `LARGEST` bytes are left out."""
        if progress.n_bytes <= LARGEST:
            self.put(UNDER_WAY, key, progress, shown or {})

    def read_progress(self, key: str) -> Packed | None:
        """Progress of a task; None where there is none."""
        return self.read(UNDER_WAY, key)

    def keep_computed(self, key: str, value: Packed) -> None:
        """Keeps what is computed once for a study; more than `LARGEST` bytes are left out. key: hash of its inputs."""
        self._used.add(key)
        if value.n_bytes <= LARGEST:
            self.put(COMPUTED, key, value, {})
            self.tick()

    def read_computed(self, key: str) -> Packed | None:
        """What `keep_computed` has kept, in this run or an earlier one; None where there is nothing."""
        self._used.add(key)
        return self.read(COMPUTED, key)

    def forget(self, table: str, key: str) -> None:
        """Makes an entry invalid in this run. A new entry replaces it, `remove_forgotten` removes it.

        Raises StorageError.
        """
        self._take(wait=True)
        self._waiting.pop((table, key), None)
        if key in self._keys[table]:
            self._keys[table].discard(key)
            self._forgotten.add((table, key))

    def remove_forgotten(self) -> None:
        """Removes what was forgotten from the disk, so that no later run finds it. Raises StorageError."""
        self._waiting.update(dict.fromkeys(self._forgotten.difference(self._waiting)))
        self.flush()

    def with_outcome(self, outcomes: Collection[str], *, other: bool = False) -> set[str]:
        """Keys of the results with one of these outcomes, or with any other one."""
        self.flush()
        with faults_told(self.path):
            rows = self._database.execute("SELECT key, outcome FROM results").fetchall()
        keys = self._keys[database.RESULTS]
        return {key for key, outcome in rows if key in keys and (outcome in outcomes) != other}

    def prune(self, used: Mapping[str, Collection[str]], most: float) -> None:
        """Removes the oldest entries without a name in `used` until these have at most `most` bytes together.

        used: keys by table. What was kept or read by `read_computed` in this run is used as well.
        """
        self.flush()
        named = {table: frozenset(used.get(table, ())) for table in TABLES}
        named[COMPUTED] |= self._used
        idle: list[tuple[str, int, int, Name]] = []
        with faults_told(self.path):
            for table in TABLES:
                rows = self._database.execute(f"SELECT key, written, rowid, length(content) FROM {table}")
                idle += [
                    (str(when), row, size, (table, key)) for key, when, row, size in rows if key not in named[table]
                ]
        too_much = sum(size for _, _, size, _ in idle) - most
        for _, _, n_bytes, (table, key) in sorted(idle):
            if too_much <= 0.0:
                break
            too_much -= n_bytes
            self.forget(table, key)
        self.remove_forgotten()

    def shrink(self) -> None:
        """Gives the room of what was removed back to the disk. A full disk only keeps the file larger."""
        self._take(wait=True)
        with contextlib.suppress(StorageError), faults_told(self.path), uninterrupted():
            self._database.executescript("PRAGMA incremental_vacuum")

    def tick(self) -> None:
        """Called many times a second: hands over to the writer what waits, without delay after a pause.

        Raises
        ------
        StorageError
            Where an earlier transaction has failed.
        """
        self._take()
        late = time.monotonic() > self._written + SECONDS_A_TRANSACTION
        if self._waiting and late and not self._writer.busy:
            self._begin()

    def flush(self) -> None:
        """Waits until everything is on the disk. Raises StorageError."""
        self._take(wait=True)
        while self._waiting:
            self._begin()
            self._take(wait=True)

    def close(self) -> None:
        """Writes what waits, as far as there is room, and closes the file. A new file without a study is removed."""
        try:
            # an error was said before, or there is nothing that waits for an answer
            with contextlib.suppress(StorageError):
                self.flush()
        finally:
            self._writer.close()
            with contextlib.suppress(sqlite3.Error):
                database.close(self._database, self.path)
            if self._is_new and not any((*self._keys.values(), self._waiting, self._handed_over)):
                # the run has ended before it began: the scene or the disk is at fault
                with contextlib.suppress(OSError):
                    self.path.unlink()

    def _begin(self) -> None:
        """Makes everything that waits a job of the idle writer."""
        with uninterrupted():
            self._handed_over, self._waiting, self._n_bytes = self._waiting, {}, 0.0
            self._writer.begin(self._handed_over)
            self._written = time.monotonic()

    def _take(self, *, wait: bool = False) -> None:
        self._writer.take(self._accept, self._refuse, wait=wait)

    def _accept(self, batch: Batch, _: None) -> None:
        """Notes what is on the disk now."""
        self._forgotten.difference_update(batch)
        for (table, key), entry in batch.items():
            if entry is None:
                self._keys[table].discard(key)
            else:
                self._keys[table].add(key)
        self._handed_over = {}

    def _refuse(self, batch: Batch) -> None:
        """Puts a failed batch back to those that wait."""
        self._waiting, self._handed_over = batch | self._waiting, {}

    def _write(self, batch: Batch) -> None:
        """The job of the writer: one transaction with all of a batch, or nothing of it. Raises StorageError."""
        now = datetime.now(UTC).isoformat(" ", "seconds")[:19]
        with faults_told(self.path):
            rows = [(*name, None if entry is None else row_of(name, entry, now)) for name, entry in batch.items()]
            if self.path.stat().st_ino != self._file:
                raise FileNotFoundError(None, "another file has taken its place")
            with self._transaction():
                for table, key, row in rows:
                    if row is None:
                        self._database.execute(f"DELETE FROM {table} WHERE key=?", [key])
                    else:
                        self._insert(table, row)

    def _insert(self, table: str, row: Mapping[str, object]) -> None:
        places = ", ".join("?" * len(row))
        self._database.execute(
            f"INSERT OR REPLACE INTO {table} ({', '.join(row)}) VALUES ({places})", list(row.values())
        )

    @contextlib.contextmanager
    def _transaction(self) -> Iterator[None]:
        self._database.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._database.execute("COMMIT")
        except BaseException:
            if self._database.in_transaction:
                self._database.execute("ROLLBACK")
            raise

    def _read_keys(self) -> dict[str, set[str]]:
        """Keys of all entries. Damaged ones, which only a fault of the disk leaves, are to be removed."""
        keys: dict[str, set[str]] = {table: set() for table in TABLES}
        for table in TABLES:
            for key, sum_, content in self._database.execute(f"SELECT key, checksum, content FROM {table}"):
                if database.is_whole(key, sum_, content):
                    keys[table].add(key)
                else:
                    self._forgotten.add((table, key))
        if self._forgotten:
            number = len(self._forgotten)
            self.notes.append(f"{self.path.name}: {number} damaged entries, which are computed again")
        return keys

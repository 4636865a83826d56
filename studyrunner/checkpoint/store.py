"""The folder of a study: finished results are saved a moment later, and a later run continues from them.

The folder stands beside the result file. Rank 0 writes all files, as other ranks may not see the folder. A thread
writes; results that arrive meanwhile go into the next files together, so that a slow disk gets fewer and larger files.
Files of about one size are merged during the run. File names differ from those of any other run: on a file system
without locks two runs in one folder do not damage each other's files.
"""

from __future__ import annotations

import math
import secrets
import time
from collections.abc import Callable, Collection, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from solver.packing import Packed
from studyrunner.checkpoint.folder_contents import read_folder
from studyrunner.checkpoint.packed_files import PACKED
from studyrunner.checkpoint.part_files import load_records, read_entry
from studyrunner.checkpoint.part_writer import PROGRESS, RECORDS, STARTS, Batch, Job, Merge, PartWriter, Written
from studyrunner.checkpoint.segment_index import PartFile, Place, SegmentIndex
from studyrunner.checkpoint.writer import Writer
from studyrunner.system.files import NotPlainError, sync_folder
from studyrunner.system.folder_lock import FolderLock
from studyrunner.user_error import StorageError

SECONDS_A_FILE = 0.25
"""Longest time, s, that a result waits for others that go into the same file."""

SECONDS_A_PROGRESS = 1.0
"""Longest time, s, that the progress of a task waits for the progress of other tasks."""

MOST_BYTES_WAITING = 32e6
"""Bytes that may wait for the disk. Beyond this size a new result waits until there is room again."""

_BYTES_A_FILE = 8e6
_SECONDS_TO_MORE_ROOM = 60.0
_LOCK = "lock"


class Store:
    """The locked folder of a run. Raises StoreInUseError and StorageError.

    kind: data type of a record; the field `KEY` is the hash of the history.
    notes: lines for the user on what was found in the folder.
    """

    def __init__(self, folder: Path, kind: np.dtype[np.void]) -> None:
        self.folder = folder
        self.kind = kind
        self.notes: list[str] = []
        self._waiting, self._handed_over = Batch(), Batch()
        self._obsolete: list[Path] = []
        self._merges: list[Merge] = []
        self._next_merge = self._written = -math.inf
        try:
            if not folder.is_dir():
                folder.mkdir(exist_ok=True)
                sync_folder(folder.parent)
            self._lock = FolderLock(folder / _LOCK)
        except NotPlainError as error:
            raise StorageError(folder / _LOCK, error, "remove it or give another result file with -o") from error
        except OSError as error:
            raise StorageError(folder, error) from error
        try:
            self._part_writer = PartWriter(folder, secrets.token_hex(6))
            found = read_folder(self._part_writer, kind, alone=self._lock.holds)
        except OSError as error:
            self._lock.close()
            raise StorageError(folder, error) from error
        self._indexes, self._others, self._number = found.indexes, found.others, found.last_number
        self._records, self._starts, self._progress = (self._indexes[sort] for sort in (RECORDS, STARTS, PROGRESS))
        self._obsolete += found.left_over
        self.notes += [f"{folder.name}: {name} is damaged, what it held is computed again" for name in found.damaged]
        if not self._lock.holds:
            self.notes.append(
                f"{folder.name}: there are no locks on this file system, so nothing keeps a second run out: give each"
                " run a result file of its own with -o"
            )
        self._writer = Writer(self._part_writer.write)

    @property
    def locked(self) -> bool:
        """Whether no other run uses the folder."""
        return self._lock.holds

    @property
    def histories(self) -> dict[str, Place]:
        """Number of the file and row, for each hash of a history on the disk."""
        return self._records.places

    def path(self, number: int) -> Path:
        """Path of a file of records."""
        return self._records.files[number].path

    @property
    def numbers(self) -> list[int]:
        """Numbers of all files of records."""
        return sorted(self._records.files)

    def add_history(self, key: str, record: NDArray[np.void], task: str = "") -> None:
        """Adds a record (1,). task: hash of the task whose progress is no longer needed with this history."""
        self._waiting.records[key] = record
        if task:
            self._waiting.progress.pop(task, None)
            self._waiting.finished.add(task)
        self._count(self.kind.itemsize)

    def add_start(self, key: str, start: Packed) -> None:
        """Adds a start state."""
        self._waiting.starts[key] = start
        self._count(start.n_bytes)

    def has_start(self, key: str) -> bool:
        """Whether a start state is in the folder."""
        return key in self._starts.places or any(key in batch.starts for batch in self._unwritten())

    def read_start(self, key: str) -> Packed:
        """A start state in the folder."""
        for batch in self._unwritten():
            if key in batch.starts:
                return batch.starts[key]
        return self._read(self._starts, key)

    def keep_progress(self, key: str, progress: Packed) -> None:
        """Adds the progress of a task, in place of an earlier one."""
        self._waiting.progress[key] = progress
        self._waiting.finished.discard(key)
        self._count(progress.n_bytes)

    def read_progress(self, key: str) -> Packed | None:
        """Progress of a task; None where there is none."""
        for batch in self._unwritten():
            if key in batch.progress:
                return batch.progress[key]
        if key not in self._progress.places:
            return None
        try:
            return self._read(self._progress, key)
        except StorageError:
            # Damaged progress costs only time: the task begins anew.
            self.forget_progress(key)
            return None

    def forget_progress(self, key: str) -> None:
        """Removes the progress of a task that is finished, or has to be done again."""
        for batch in self._unwritten():
            batch.progress.pop(key, None)
        self._progress.forget(key)

    def tick(self) -> None:
        """Called many times a second: hands over to the writer what waits, without delay after a pause.

        Raises
        ------
        StorageError
            Where an earlier job could not be written.
        """
        self._take()
        if self._waiting.empty or self._writer.busy:
            return
        small = not (self._waiting.records or self._waiting.starts)
        if time.monotonic() > self._written + (SECONDS_A_PROGRESS if small else SECONDS_A_FILE):
            self._write()

    def flush(self) -> None:
        """Waits until everything is on the disk. Raises StorageError."""
        self._take(wait=True)
        while not self._waiting.empty:
            self._write()
            self._take(wait=True)

    def read(self, number: int) -> NDArray[np.void]:
        """Records of a file; they stay on the disk until they are used."""
        path = self.path(number)
        try:
            return load_records(path)
        except (OSError, ValueError) as error:
            raise StorageError(path, error) from error

    def select(self, chosen: Callable[[NDArray[np.void]], NDArray[np.bool_]]) -> set[str]:
        """Hashes of the histories that `chosen` selects; `chosen` gets all records of a file at once."""
        found: set[str] = set()
        for number, file in self._records.files.items():
            for row in np.flatnonzero(chosen(self.read(number))).tolist():
                if self.histories.get(file.keys[row]) == (number, row):
                    found.add(file.keys[row])
        return found

    def forget_history(self, key: str) -> None:
        """Marks a history as not computed; a new record replaces the old one."""
        self._records.forget(key)

    def forget_start(self, key: str) -> None:
        """Marks a start state as not computed."""
        for batch in self._unwritten():
            batch.starts.pop(key, None)
        self._starts.forget(key)

    def remove_forgotten(self) -> None:
        """Removes everything that was forgotten from the disk, so that no later run finds it."""
        self.flush()
        for sort, index in self._indexes.items():
            self._obsolete += [file.path for file in index.take_dead()]
            for file in index.with_dead_entries():
                self._merges.append(Merge(sort, self._next_number(), [(file, index.live_rows(file))]))
        for _ in range(2):  # what takes their place comes first
            self._write()
            self._take(wait=True)

    def prune(self, histories: Collection[str], starts: Collection[str], tasks: Collection[str], most: float) -> None:
        """Removes the oldest files without named entries until such files have at most `most` bytes together.

        With 0 bytes only named entries stay.
        """
        used = ((self._records, histories), (self._starts, starts), (self._progress, tasks))
        idle: list[tuple[SegmentIndex | None, PartFile]] = [(None, file) for file in self._others if file.ours]
        for index, keys in used:
            numbers = {index.places[key][0] for key in keys if key in index.places}
            idle += [(index, file) for number, file in index.files.items() if file.ours and number not in numbers]
        too_much = sum(file.n_bytes for _, file in idle) - most
        for holder, file in sorted(idle, key=lambda entry: entry[1].number):
            if too_much <= 0.0:
                break
            too_much -= file.n_bytes
            self._obsolete.append(file.path)
            if holder is None:
                self._others.remove(file)
            else:
                holder.drop(file)
        if most == 0.0:
            for index, keys in used:
                for key in set(index.places).difference(keys):
                    index.forget(key)
            self.remove_forgotten()

    def pack(self) -> None:
        """Packs all files, where no other run uses the folder; the last call before `close`."""
        self.remove_forgotten()
        if not self.locked:
            return
        packed = [(sort, file) for sort, index in self._indexes.items() for file in index.files.values()]
        of_others = [(RECORDS, file) for file in self._others if not file.path.name.endswith(PACKED)]
        for sort, file in (*packed, *of_others):
            self._part_writer.pack(sort, file)

    def close(self) -> None:
        """Writes what waits, as far as there is room, and unlocks the folder."""
        try:
            self.flush()
            if self._obsolete:
                self._write()
                self._take(wait=True)
        except StorageError:
            # said before, or there is nothing that waits for an answer
            pass
        finally:
            self._writer.close()
            self._lock.close()

    def _unwritten(self) -> Iterator[Batch]:
        """Batches that are not, or may not be, on the disk yet, latest first."""
        yield self._waiting
        yield self._handed_over

    def _count(self, n_bytes: float) -> None:
        self._waiting.n_bytes += n_bytes
        if self._waiting.n_bytes > _BYTES_A_FILE:
            self._take(wait=self._waiting.n_bytes > MOST_BYTES_WAITING)
            if not self._writer.busy:
                self._write()

    def _write(self) -> None:
        """Makes everything that waits a job of the idle writer."""
        # numbered before the batch: what comes now is later than what stands in a merged file
        merges = self._merges or self._due_merges()
        job = Job(self._next_number(), self._waiting, merges, self._obsolete)
        self._handed_over = job.batch
        self._writer.begin(job)
        self._waiting, self._merges, self._obsolete = Batch(), [], []
        self._written = time.monotonic()

    def _take(self, *, wait: bool = False) -> None:
        self._writer.take(self._accept, self._refuse, wait=wait)

    def _accept(self, job: Job, written: Written) -> None:
        """Notes what is on the disk now."""
        for sort, file in written.new.items():
            self._indexes[sort].put(file)
        for merge, file in written.merged:
            self._indexes[merge.sort].put_merged(file, merge.sources)
        if len(written.merged) < len(job.merges):
            self._next_merge = time.monotonic() + _SECONDS_TO_MORE_ROOM
        for key in job.batch.finished:
            self._progress.forget(key)
        for index in self._indexes.values():
            self._obsolete += [file.path for file in index.take_dead()]
        self._handed_over = Batch()

    def _refuse(self, job: Job) -> None:
        """Puts a failed batch back to those that wait."""
        self._waiting, self._handed_over = self._waiting.behind(job.batch), Batch()
        self._obsolete += job.remove

    def _due_merges(self) -> list[Merge]:
        if time.monotonic() < self._next_merge:
            return []
        due = ((sort, index, index.to_merge()) for sort, index in self._indexes.items())
        return [
            Merge(sort, self._next_number(), [(file, index.live_rows(file)) for file in found])
            for sort, index, found in due
            if found
        ]

    def _next_number(self) -> int:
        self._number += 1
        return self._number

    def _read(self, index: SegmentIndex, key: str) -> Packed:
        number, row = index.places[key]
        path = index.files[number].path
        try:
            return read_entry(path, row)
        except (OSError, ValueError) as error:
            raise StorageError(path, error) from error

"""Writes files into the folder of a run: new files first, then merged files; at last files without use are removed.

A run unpacks the folder at the beginning and packs the folder at the end.

A new file is written under a temporary name, synced and renamed, and the folder is synced. Only then other parts of the
program hear of the file, and only then the files that it replaces are removed. Therefore a kill or a loss of power
loses nothing that was reported as written.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from solver.packing import Packed
from studyrunner.checkpoint.packed_files import (
    pack_file,
    pack_records,
    packed_path,
    unpack_file,
    unpack_records,
    unpacked_path,
)
from studyrunner.checkpoint.part_files import Rows, merge_bundles, merge_records, write_bundle, write_records
from studyrunner.checkpoint.segment_index import PartFile
from studyrunner.system import files
from studyrunner.user_error import StorageError

RECORDS, STARTS, PROGRESS = ".npy", ".starts", ".progress"
"""How the names of files end: sorts of entries."""

PARTIAL = ".partial"


@dataclass
class Batch:
    """Entries that are written together, by key. finished: keys of tasks whose progress is no longer needed."""

    records: dict[str, NDArray[np.void]] = field(default_factory=dict)
    starts: dict[str, Packed] = field(default_factory=dict)
    progress: dict[str, Packed] = field(default_factory=dict)
    finished: set[str] = field(default_factory=set)
    n_bytes: float = 0.0

    @property
    def empty(self) -> bool:
        """Whether there is nothing to write."""
        return not (self.records or self.starts or self.progress)

    def behind(self, earlier: Batch) -> Batch:
        """One batch of two; entries of the later one replace those of the earlier one."""
        # what an earlier one has said of a task that is finished meanwhile is not said again
        progress = {key: kept for key, kept in earlier.progress.items() if key not in self.finished}
        return Batch(
            earlier.records | self.records,
            earlier.starts | self.starts,
            progress | self.progress,
            earlier.finished | self.finished,
            earlier.n_bytes + self.n_bytes,
        )


@dataclass(frozen=True)
class Merge:
    """Entries (rows) of files that are merged into one file. number: of the new file."""

    sort: str
    number: int
    sources: Sequence[tuple[PartFile, Rows]]


@dataclass(frozen=True)
class Job:
    """One job of the writer. number: of the new files. remove: files without use."""

    number: int
    batch: Batch
    merges: Sequence[Merge] = ()
    remove: Sequence[Path] = ()


@dataclass(frozen=True)
class Written:
    """New files by sort of entry, and merged files; merged files are missing where the disk had no room."""

    new: Mapping[str, PartFile]
    merged: Sequence[tuple[Merge, PartFile]]


@dataclass(frozen=True)
class PartWriter:
    """Writes into a folder. run: part of all file names that no other run uses."""

    folder: Path
    run: str

    def write(self, job: Job) -> Written:
        """Does a job. Raises StorageError where the batch cannot be written; then nothing of the batch is in the
        folder.
        """
        batch, new = job.batch, {}
        sorts: list[tuple[str, list[str], Callable[[IO[bytes]], None]]] = [
            # histories and progress are of no use without the start states before
            (STARTS, list(batch.starts), lambda file: write_bundle(file, batch.starts)),
            (RECORDS, list(batch.records), lambda file: write_records(file, list(batch.records.values()))),
            (PROGRESS, list(batch.progress), lambda file: write_bundle(file, batch.progress)),
        ]
        try:
            for sort, keys, write in sorts:
                if keys:
                    new[sort] = self._write(sort, job.number, keys, write)
            if new:
                files.sync_folder(self.folder)
        except OSError as error:
            self._remove(file.path for file in new.values())
            raise StorageError(Path(error.filename or self.folder), error) from error
        # a file that stays is no harm, nor is one whose merge has to wait for more room
        with contextlib.suppress(OSError):
            self._remove(job.remove)
        with contextlib.suppress(OSError, ValueError):
            merged = [(merge, self._merge(merge)) for merge in job.merges]
            if merged:
                files.sync_folder(self.folder)
            return Written(new, merged)
        return Written(new, ())

    def pack(self, sort: str, file: PartFile) -> None:
        """Replaces a file by its packed form. The file stays where the disk has no room or the file cannot be read."""
        put, target = pack_records if sort == RECORDS else pack_file, packed_path(file.path)
        with contextlib.suppress(OSError, ValueError):
            self._write_as(target, sort, file.number, lambda packed: put(packed, file.path))
            files.sync_folder(self.folder)
            self._remove([file.path])

    def unpack(self, sort: str, number: int, packed: Path) -> None:
        """Writes an unpacked file beside a packed one.

        Raises OSError, or ValueError where the packed file is damaged.
        """
        put = unpack_records if sort == RECORDS else unpack_file
        self._write_as(unpacked_path(packed), sort, number, lambda file: put(file, packed))

    def _merge(self, merge: Merge) -> PartFile:
        put_together = merge_records if merge.sort == RECORDS else merge_bundles
        keys = [source.keys[row] for source, rows in merge.sources for row in rows]
        sources = [(source.path, rows) for source, rows in merge.sources if rows]
        return self._write(merge.sort, merge.number, keys, lambda file: put_together(file, sources))

    def _write(self, sort: str, number: int, keys: Sequence[str], write: Callable[[IO[bytes]], None]) -> PartFile:
        path = self.folder / self._name(sort, number)
        return PartFile(number, path, keys, self._write_as(path, sort, number, write), ours=True)

    def _name(self, sort: str, number: int) -> str:
        return f"{number:08d}-{self.run}{sort}"

    def _write_as(self, path: Path, sort: str, number: int, write: Callable[[IO[bytes]], None]) -> int:
        """Writes a file; number of bytes written."""
        partial = self.folder / (self._name(sort, number) + PARTIAL)
        try:
            with files.create(partial) as file:
                write(file)
                files.sync(file)
                n_bytes = file.tell()
            os.replace(partial, path)
        except OSError as error:
            partial.unlink(missing_ok=True)
            raise OSError(error.errno, error.strerror, str(path)) from error
        except ValueError:
            partial.unlink(missing_ok=True)
            raise
        return n_bytes

    def _remove(self, paths: Iterable[Path]) -> None:
        for path in paths:
            path.unlink(missing_ok=True)

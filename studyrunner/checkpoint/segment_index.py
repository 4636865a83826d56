"""Index of the segments of a run's folder: which file holds which entry, and which files can be merged.

A segment is a file with several entries of one sort: records, start states or progress.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from studyrunner.checkpoint.part_files import Rows

FILES_A_MERGE = 10
"""Number of files of about one size that are merged. An entry is written once for each size that it passes through."""

_LARGEST_MERGED = 10**8  # bytes of a file that is not merged any more

Place = tuple[int, int]
"""Number of a file, and row of an entry in the file."""


@dataclass(frozen=True)
class PartFile:
    """A file of the folder.

    number: unique; a later file has a larger number. keys: of the entries. n_bytes: size of the file.
    ours: whether no other run can use the file.
    """

    number: int
    path: Path
    keys: Sequence[str]
    n_bytes: int
    ours: bool


class SegmentIndex:
    """The files with entries of one sort. Of several entries with one key the entry in the last file is valid."""

    def __init__(self) -> None:
        self.files: dict[int, PartFile] = {}
        self.places: dict[str, Place] = {}
        self._n_live: dict[int, int] = {}

    def put(self, file: PartFile) -> None:
        """Adds a file that is later than all others. A second call with the same file changes nothing."""
        if file.number in self.files:
            self.drop(file)
        self.files[file.number] = file
        self._n_live[file.number] = 0
        for row, key in enumerate(file.keys):
            self._move(key, (file.number, row))

    def put_merged(self, file: PartFile, sources: Iterable[tuple[PartFile, Rows]]) -> None:
        """Adds a file with the entries of merged files, in their order.

        Entries that were forgotten or replaced since the merge began stay invalid.
        """
        self.files[file.number] = file
        self._n_live.setdefault(file.number, 0)
        before = ((source.number, row) for source, rows in sources for row in rows)
        for row, (key, place) in enumerate(zip(file.keys, before, strict=True)):
            if self.places.get(key) == place:
                self._move(key, (file.number, row))

    def forget(self, key: str) -> None:
        """Makes an entry invalid."""
        place = self.places.pop(key, None)
        if place is not None:
            self._n_live[place[0]] -= 1

    def live_rows(self, file: PartFile) -> list[int]:
        """Rows of the valid entries of a file."""
        return [row for row, key in enumerate(file.keys) if self.places.get(key) == (file.number, row)]

    def take_dead(self) -> list[PartFile]:
        """Removes files without a valid entry that no other run can use from the index, and returns them."""
        dead = [file for file in self.files.values() if file.ours and self._n_live[file.number] == 0]
        for file in dead:
            self.drop(file)
        return dead

    def drop(self, file: PartFile) -> None:
        """Removes a file and its entries from the index."""
        for row in self.live_rows(file):
            self.forget(file.keys[row])
        del self.files[file.number], self._n_live[file.number]

    def with_dead_entries(self) -> list[PartFile]:
        """Files that no other run can use and that have an invalid entry."""
        return [file for file in self.files.values() if file.ours and self._n_live[file.number] < len(file.keys)]

    def to_merge(self) -> list[PartFile]:
        """Files that are to be merged; none where there are fewer than `FILES_A_MERGE` of every size.

        Sizes are counted in powers of ten. Ten files of one size make a file of the next size, so that the number of
        files stays below ten times the number of sizes.
        """
        sizes: dict[int, list[PartFile]] = {}
        for file in self.files.values():
            if file.ours and file.n_bytes < _LARGEST_MERGED:
                alike = sizes.setdefault(len(str(file.n_bytes)), [])
                alike.append(file)
                if len(alike) == FILES_A_MERGE:
                    return sorted(alike, key=lambda found: found.number)
        return []

    def _move(self, key: str, place: Place) -> None:
        self.forget(key)
        self.places[key] = place
        self._n_live[place[0]] += 1

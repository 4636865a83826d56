"""Where the entries of one sort are among the files of a run's folder, and which files can be put together."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from studyrunner.checkpoint.part_files import Rows

FILES_A_MERGE = 10
"""So many files of about one size become one, which is then of the next size: an entry is written once for each."""

_LARGEST_MERGED = 10**8  # bytes from which on a file is left as it is

Place = tuple[int, int]
"""Number of a file, and place of an entry in it."""


@dataclass(frozen=True)
class PartFile:
    """A file of the folder. number: that of no other; a later file has a larger one. keys: of its entries.

    ours: whether no other run can have a use for it.
    """

    number: int
    path: Path
    keys: Sequence[str]
    n_bytes: int
    ours: bool


class Shelf:
    """The files that hold entries of one sort. Of several entries with one key, that of the last file counts."""

    def __init__(self) -> None:
        self.files: dict[int, PartFile] = {}
        self.places: dict[str, Place] = {}
        self._n_live: dict[int, int] = {}

    def put(self, file: PartFile) -> None:
        """A file that is on the disk, later than all others. Said again it is no harm."""
        if file.number in self.files:
            self.drop(file)
        self.files[file.number] = file
        self._n_live[file.number] = 0
        for row, key in enumerate(file.keys):
            self._move(key, (file.number, row))

    def put_merged(self, file: PartFile, sources: Iterable[tuple[PartFile, Rows]]) -> None:
        """A file that holds entries of others, in their order; but for those that were forgotten or came anew since."""
        self.files[file.number] = file
        self._n_live.setdefault(file.number, 0)
        before = ((source.number, row) for source, rows in sources for row in rows)
        for row, (key, place) in enumerate(zip(file.keys, before, strict=True)):
            if self.places.get(key) == place:
                self._move(key, (file.number, row))

    def forget(self, key: str) -> None:
        """The entry counts no more."""
        place = self.places.pop(key, None)
        if place is not None:
            self._n_live[place[0]] -= 1

    def live_rows(self, file: PartFile) -> list[int]:
        """Places of the entries of a file that count."""
        return [row for row, key in enumerate(file.keys) if self.places.get(key) == (file.number, row)]

    def take_dead(self) -> list[PartFile]:
        """Files no entry of which counts: those of this run are of no use to anybody."""
        dead = [file for file in self.files.values() if file.ours and self._n_live[file.number] == 0]
        for file in dead:
            self.drop(file)
        return dead

    def drop(self, file: PartFile) -> None:
        """Forgets a file and all its entries."""
        for row in self.live_rows(file):
            self.forget(file.keys[row])
        del self.files[file.number], self._n_live[file.number]

    def with_dead_entries(self) -> list[PartFile]:
        """Files of this run some entries of which do not count."""
        return [file for file in self.files.values() if file.ours and self._n_live[file.number] < len(file.keys)]

    def to_merge(self) -> list[PartFile]:
        """Files that are to become one; none where no size has enough of them.

        Sizes are counted in powers of ten: ten files of one make a file of the next, so that as many as there are of
        each size are all that there are.
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

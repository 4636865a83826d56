"""An object that rank 0 hands to other ranks: its arrays are in a file that the ranks map, once in memory on a machine.

By hand: a broadcast of MPI waits for all ranks, cannot be interrupted, and gives each rank a copy of its own; memory
that `multiprocessing` shares has a name that a kill leaves behind.
"""

from __future__ import annotations

import contextlib
import mmap
import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import Any

_ALIGNED = 64  # bytes: no array shares a line of the cache with another one


class UnseenFileError(Exception):
    """A rank does not see a file of rank 0, as on another machine without a common folder."""


@dataclass(frozen=True)
class MappedFile:
    """An object whose arrays are in a file.

    head: the object without the contents of its arrays. places: begin and end of each content in the file, bytes.
    """

    path: Path
    head: bytes
    places: tuple[tuple[int, int], ...]

    def remove(self) -> None:
        """Removes the file; ranks that have mapped it keep the object."""
        with contextlib.suppress(OSError):
            self.path.unlink()


def write_mapped(thing: object, path: Path) -> MappedFile:
    """Writes the arrays of an object to a new file. Raises OSError; nothing is left then."""
    buffers: list[pickle.PickleBuffer] = []
    head = pickle.dumps(thing, protocol=5, buffer_callback=buffers.append)
    places, end = [], 0
    with path.open("xb") as file:
        try:
            for buffer in buffers:
                begin = -(-end // _ALIGNED) * _ALIGNED
                file.seek(begin)
                end = begin + file.write(buffer.raw())
                places.append((begin, end))
            file.truncate(end + 1)  # an empty file cannot be mapped
        except BaseException:
            path.unlink()
            raise
    return MappedFile(path, head, tuple(places))


def open_mapped(given: MappedFile) -> Any:  # a type that rank 0 knows
    """The object. Its arrays are as any others: what one process changes in them, no other process sees.

    Raises UnseenFileError where the file is not there.
    """
    try:
        with given.path.open("rb") as file:
            memory = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY))
    except OSError as error:
        raise UnseenFileError(str(given.path)) from error
    return pickle.loads(given.head, buffers=[memory[begin:end] for begin, end in given.places])

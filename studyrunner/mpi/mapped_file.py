"""An object that rank 0 hands to other ranks: its arrays are in a file that the ranks map, once in memory on a machine.

By hand: a broadcast of MPI waits for all ranks, cannot be interrupted, and gives each rank a copy of its own; memory
that `multiprocessing` shares has a name that a kill leaves behind.
"""

from __future__ import annotations

import contextlib
import mmap
import pickle
import secrets
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from studyrunner.mpi.ranks import RankInterrupted, Ranks, wait_for_message

_ALIGNED = 64  # bytes: no array shares a line of the cache with another one


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

    Raises OSError where the file is not there.
    """
    with given.path.open("rb") as file:
        memory = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY))
    return pickle.loads(given.head, buffers=[memory[begin:end] for begin, end in given.places])


@dataclass(frozen=True)
class WhetherSeen:
    """Question of rank 0: whether a rank sees a file with these contents."""

    path: Path
    mark: bytes

    def answer(self) -> bool:
        """Whether this process does."""
        with contextlib.suppress(OSError):
            return self.path.read_bytes() == self.mark
        return False


def ranks_that_see(ranks: Ranks, path: Path) -> frozenset[int]:
    """Rank 0: the other ranks that see a file which it writes; none where the disk is full.

    Raises KeyboardInterrupt where a rank was interrupted.
    """
    if ranks.size == 1:
        return frozenset()
    question = WhetherSeen(path, secrets.token_bytes())
    try:
        with path.open("xb") as file:
            file.write(question.mark)
        for rank in range(1, ranks.size):
            ranks.send(question, rank)
        answers = [wait_for_message(ranks) for _ in range(1, ranks.size)]
    except OSError:
        return frozenset()
    finally:
        path.unlink(missing_ok=True)
    if any(isinstance(is_seen, RankInterrupted) for _, is_seen in answers):
        raise KeyboardInterrupt
    return frozenset(rank for rank, is_seen in answers if is_seen)

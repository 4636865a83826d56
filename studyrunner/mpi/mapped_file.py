"""An object that rank 0 hands to all ranks: its arrays are in a file that the ranks map, once in memory on a machine.

The file stands beside the result while the run lasts. A rank that does not see the file gets the object by message.

By hand: a broadcast of MPI waits for all ranks, cannot be interrupted, and gives each rank a copy of its own; memory
that `multiprocessing` shares has a name that a kill leaves behind.
"""

from __future__ import annotations

import contextlib
import mmap
import os
import pickle
import secrets
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from studyrunner.mpi.ranks import POLL_SECONDS, Ranks, wait_for_message
from studyrunner.system.files import create

_ALIGNED = 64  # bytes: no array shares a line of the cache with another one

Thing = TypeVar("Thing")


@dataclass(frozen=True)
class MappedFile:
    """An object whose arrays are in a file.

    mark: the first bytes of the file, by which another machine knows that it sees this file.
    head: the object without the contents of its arrays.
    lengths: of these contents, bytes.
    """

    path: Path
    mark: bytes
    head: bytes
    lengths: tuple[int, ...]

    def remove(self) -> None:
        """Removes the file; ranks that have mapped it keep the object."""
        with contextlib.suppress(OSError):
            self.path.unlink()


@dataclass(frozen=True)
class _Seen:
    """Whether a rank has mapped the file."""

    done: bool


def write_mapped(thing: object, path: Path) -> MappedFile:
    """Writes the arrays of an object to a new file. Raises OSError; nothing is left then."""
    buffers: list[pickle.PickleBuffer] = []
    head = pickle.dumps(thing, protocol=5, buffer_callback=buffers.append)
    contents = [buffer.raw() for buffer in buffers]
    written = MappedFile(path, secrets.token_bytes(_ALIGNED), head, tuple(content.nbytes for content in contents))
    with create(path) as file:
        try:
            file.write(written.mark)
            for content, place in zip(contents, _places(written.lengths), strict=False):
                file.seek(place)
                file.write(content)
            file.truncate(_places(written.lengths)[-1])
        except BaseException:
            written.remove()
            raise
    return written


def open_mapped(given: MappedFile) -> Any:  # a type that rank 0 knows
    """The object. Its arrays are as any others: what one process changes in them, no other process sees.

    Raises OSError where this process does not see the file.
    """
    with given.path.open("rb") as file:
        places = _places(given.lengths)
        if file.read(_ALIGNED) != given.mark or os.fstat(file.fileno()).st_size != places[-1]:
            raise OSError(f"{given.path} is another file here")
        memory = memoryview(mmap.mmap(file.fileno(), places[-1], access=mmap.ACCESS_COPY))
    buffers = [memory[place : place + length] for place, length in zip(places, given.lengths, strict=False)]
    return pickle.loads(given.head, buffers=buffers)


def hand_out(ranks: Ranks, thing: Thing, path: Path) -> tuple[Thing, frozenset[int]]:
    """Rank 0: gives an object to every other rank, which calls `take_over`.

    Parameters
    ----------
    ranks
        All ranks.
    thing
        The object.
    path
        Where the file is written.

    Returns
    -------
    Thing
        The object of rank 0, with its arrays in the file where another rank has mapped the file.
    frozenset of int
        Ranks that see the file, rank 0 included; empty where no other rank does.

    Raises
    ------
    KeyboardInterrupt
        Where another rank was interrupted.
    """
    others = range(1, ranks.size)
    written = None
    if others:
        # a full disk costs memory: each rank gets the object by message
        with contextlib.suppress(OSError):
            written = write_mapped(thing, path)
    seeing = frozenset() if written is None else _ask(ranks, written)
    for rank in others:
        if rank not in seeing:
            ranks.send((thing,), rank)
            # one copy of it is on its way at a time
            ranks.flush()
    if written is None or not seeing:
        return thing, frozenset()
    return open_mapped(written), seeing | {0}


def take_over(ranks: Ranks) -> Any:  # a type that rank 0 knows
    """Any other rank: the object of `hand_out`; None where rank 0 sends None, as there is nothing to compute."""
    message = wait_for_message(ranks)
    if isinstance(message, MappedFile):
        try:
            thing = open_mapped(message)
        except OSError:
            ranks.send(_Seen(False), 0)
            message = wait_for_message(ranks)
        else:
            ranks.send(_Seen(True), 0)
            ranks.flush()
            return thing
    return None if message is None else message[0]  # type: ignore[index]


def _ask(ranks: Ranks, written: MappedFile) -> frozenset[int]:
    """The other ranks that see the file."""
    for rank in range(1, ranks.size):
        ranks.send(written, rank)
    answers: dict[int, bool] = {}
    while len(answers) < ranks.size - 1:
        received = ranks.receive()
        if received is None:
            time.sleep(POLL_SECONDS)
        elif isinstance(received[1], _Seen):
            answers[received[0]] = received[1].done
        else:
            raise KeyboardInterrupt
    return frozenset(rank for rank, done in answers.items() if done)


def _places(lengths: Sequence[int]) -> list[int]:
    """Begin of each content in the file, and end of all, bytes."""
    places = [_ALIGNED]
    for length in lengths:
        places.append(places[-1] + -(-length // _ALIGNED) * _ALIGNED)
    return places

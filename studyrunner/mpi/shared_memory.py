"""An object whose arrays stand in memory once on a machine, however many of its processes read them.

The memory is a file without a name (`memfd_create` of Linux): it is gone with the last process that holds it, however
that ends, and the end of one process takes nothing from the others.
"""

from __future__ import annotations

import mmap
import os
import pickle
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

_ALIGNED = 64  # bytes: no array shares a line of the cache with another one


Thing = TypeVar("Thing")


@dataclass(frozen=True)
class Address:
    """Where another process of the machine finds a shared object.

    process, descriptor: who holds the memory, and under which number. inode: of the memory, by which it is known.
    head: the object without what its arrays hold. lengths: of these, bytes.
    """

    process: int
    descriptor: int
    inode: int
    head: bytes
    lengths: tuple[int, ...]


class SharedObject(Generic[Thing]):
    """A copy of an object whose arrays stand in memory that others on this machine can map.

    value: the copy. What a process writes into its arrays is seen by that process alone.

    Raises OSError where the system has no such memory, or not enough of it.
    """

    def __init__(self, thing: Thing) -> None:
        if not hasattr(os, "memfd_create"):
            raise OSError("no memory without a name on this system")
        buffers: list[pickle.PickleBuffer] = []
        head = pickle.dumps(thing, protocol=5, buffer_callback=buffers.append)
        contents = [buffer.raw() for buffer in buffers]
        lengths = tuple(content.nbytes for content in contents)
        self._descriptor = os.memfd_create("fretwear-scene", os.MFD_CLOEXEC)
        try:
            _reserve(self._descriptor, _places(lengths)[-1])
            for content, place in zip(contents, _places(lengths), strict=False):
                _write(self._descriptor, content, place)
            inode = os.fstat(self._descriptor).st_ino
            self.address = Address(os.getpid(), self._descriptor, inode, head, lengths)
            self.value: Thing = _map(self._descriptor, self.address)
        except BaseException:
            os.close(self._descriptor)
            raise

    def close(self) -> None:
        """No further process can find it; those that have it, this one as well, keep it."""
        os.close(self._descriptor)


def open_shared(address: Address) -> object:
    """The object that another process of this machine shares.

    Raises OSError where it cannot be reached: another machine or container, or a system that does not let us.
    """
    descriptor = os.open(f"/proc/{address.process}/fd/{address.descriptor}", os.O_RDONLY | os.O_CLOEXEC)
    try:
        return _map(descriptor, address)
    finally:
        os.close(descriptor)


def _places(lengths: Sequence[int]) -> list[int]:
    """Where each begins, and where all end, bytes."""
    places = [0]
    for length in lengths:
        places.append(places[-1] + -(-length // _ALIGNED) * _ALIGNED)
    return places


def _reserve(descriptor: int, n_bytes: int) -> None:
    """Takes the memory now: a write to what is not there later on would end the process."""
    if n_bytes:
        os.posix_fallocate(descriptor, 0, n_bytes)


def _write(descriptor: int, content: memoryview, place: int) -> None:
    done = 0
    while done < content.nbytes:
        done += os.pwrite(descriptor, content[done:], place + done)


def _map(descriptor: int, address: Address) -> Any:
    n_bytes = _places(address.lengths)[-1]
    found = os.fstat(descriptor)
    if (found.st_ino, found.st_size) != (address.inode, n_bytes):
        raise OSError("another file has this number")
    # copied on writing: arrays as any others, which a fault in one process cannot spoil for all
    memory = memoryview(mmap.mmap(descriptor, n_bytes, access=mmap.ACCESS_COPY) if n_bytes else b"")
    places = _places(address.lengths)
    buffers = [memory[place : place + length] for place, length in zip(places, address.lengths, strict=False)]
    return pickle.loads(address.head, buffers=buffers)

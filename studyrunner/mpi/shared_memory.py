"""An object whose arrays are in memory once on a machine, whatever the number of processes that read them.

The memory is a file without a name (`memfd_create` of Linux). It exists until the last process that holds it ends, in
whatever way. The end of one process does not disturb the others.

By hand: all ranks together free a window of MPI, also after one was killed; `multiprocessing.shared_memory` leaves a
name behind.
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

    process, descriptor: the process that holds the memory, and the number of the file there.
    inode: identity of the memory.
    head: the object without the contents of its arrays.
    lengths: lengths of the contents, bytes.
    """

    process: int
    descriptor: int
    inode: int
    head: bytes
    lengths: tuple[int, ...]


class SharedObject(Generic[Thing]):
    """A copy of an object whose arrays other processes of this machine can map.

    value: the copy. Changes of its arrays are seen by the process alone that makes them.

    Raises OSError where the system has no such memory, or not enough.
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
        """No further process can map the object; processes that have mapped it, this one included, keep it."""
        os.close(self._descriptor)


def open_shared(address: Address) -> object:
    """The object that another process of this machine shares.

    Raises OSError where the object cannot be mapped: another machine or container, or no permission.
    """
    descriptor = os.open(f"/proc/{address.process}/fd/{address.descriptor}", os.O_RDONLY | os.O_CLOEXEC)
    try:
        return _map(descriptor, address)
    finally:
        os.close(descriptor)


def _places(lengths: Sequence[int]) -> list[int]:
    """Begin of each content, and end of all, bytes."""
    places = [0]
    for length in lengths:
        places.append(places[-1] + -(-length // _ALIGNED) * _ALIGNED)
    return places


def _reserve(descriptor: int, n_bytes: int) -> None:
    """Reserves the memory now: a later write to memory that does not exist would end the process."""
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

"""The machine: files as a run writes them, objects that ranks map, faults, and a hash of the software that computes."""

import contextlib
import errno
import functools
import hashlib
import json
import mmap
import os
import pickle
import platform
import re
import secrets
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from typing import Any

_BYTES_OF_TRIAL = 2**22  # a disk is full for a library that writes a part of a result, not for a few bytes
_NO_SYNC = (errno.EINVAL, errno.ENOTSUP)
_ALIGNED = 64  # bytes: no array shares a line of the cache with another one
_COMPUTING = ("fretwear", "numba", "numpy", "scipy")


# --- files: under a name that no other has, and on the disk before they get their own name ---


def sync_folder(folder: Path) -> None:
    """The names in a folder are on the disk when this returns: a file that was renamed is there under its new name."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    except OSError as error:
        # some file systems on the network do so by themselves, and know no such call
        if error.errno not in _NO_SYNC:
            raise
    finally:
        os.close(descriptor)


def new_partial(path: Path) -> Path:
    """Where a file that is to stand under `path` can be written: beside it, under a name that no other has."""
    return path.with_name(f".{path.name}.{secrets.token_hex(6)}.partial")


def remove_leftovers(path: Path) -> None:
    """Removes the files of `new_partial` that killed runs have left beside `path`, where no other run is at work."""
    name = re.compile(rf"\.{re.escape(path.name)}\.[0-9a-f]*\.partial")
    for found in path.parent.iterdir():
        if name.fullmatch(found.name) and found.is_file() and not found.is_symlink():
            # one that stays is no harm
            with contextlib.suppress(OSError):
                found.unlink()


@contextlib.contextmanager
def replacing(path: Path, old: Path | None = None) -> Iterator[Path]:
    """Gives the name of an empty new file beside `path`, which takes its place at the end, whole and on the disk.

    Where the block raises, or what follows it, `path` is as it was. Raises OSError. old: name that what was at `path`
    has then; None where it is not kept.
    """
    partial = new_partial(path)
    partial.touch(exist_ok=False)
    try:
        yield partial
        with partial.open("rb+") as file:
            os.fsync(file.fileno())
        if old is not None and path.exists():
            os.replace(path, old)
        os.replace(partial, path)
        sync_folder(path.parent)
    finally:
        partial.unlink(missing_ok=True)


def find_fault(path: Path, n_bytes: int = _BYTES_OF_TRIAL) -> OSError | None:
    """Why a file that is there cannot be written, as the system says it; None where it can be."""
    try:
        with path.open("ab") as file:
            file.write(bytes(n_bytes))
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        return error
    return None


# --- an object that rank 0 hands to other ranks: they map a file with its arrays, once in memory on a machine ---
# By hand: a broadcast of MPI waits for all ranks, cannot be interrupted, and gives each rank a copy of its own; memory
# that `multiprocessing` shares has a name that a kill leaves behind.


class UnseenFileError(Exception):
    """A rank does not see a file of rank 0, as on another machine without a common folder."""


@dataclass(frozen=True)
class MappedFile:
    """An object whose arrays are in a file.

    head: the object without the contents of its arrays. places: begin and end of each content in the file, bytes. Ranks
    that have mapped the file keep the object when it is removed.
    """

    path: Path
    head: bytes
    places: tuple[tuple[int, int], ...]


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
    # no file on disk is a pickle: what ranks of one run send each other is, and of this arrays alone are on a disk
    return pickle.loads(given.head, buffers=[memory[begin:end] for begin, end in given.places])  # noqa: S301


# --- faults and software ---


class MachineFaultError(Exception):
    """A fault of the machine (`solver.outcome.is_machine_fault`) in the words of a rank, with which the run ends."""


@functools.cache
def package_digest(package: str) -> str:
    """Hash of all source files of a package, with their paths, and of the versions. Raises ModuleNotFoundError.

    By hand: the hashes in the metadata of a package are missing where the package is installed in editable form.
    """
    specification = find_spec(package)
    if specification is None or not specification.submodule_search_locations:
        raise ModuleNotFoundError(f"the package {package} is not installed")
    folder = Path(next(iter(specification.submodule_search_locations)))
    versions = [platform.python_version(), *(metadata.version(name) for name in _COMPUTING)]
    hashes = [
        (path.relative_to(folder).as_posix(), hashlib.sha256(path.read_bytes()).hexdigest())
        for path in sorted(folder.rglob("*.py"))
    ]
    return hashlib.sha256(json.dumps((versions, hashes)).encode()).hexdigest()[:32]

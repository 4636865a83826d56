"""Files as a run writes them: under a name that no other has, and put on the disk before they get their own name."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import IO

_BYTES_OF_TRIAL = 2**22  # a disk is full for a library that writes a part of a result, not for a few bytes
_NO_SYNC = (errno.EINVAL, errno.ENOTSUP)


def sync(file: IO[bytes]) -> None:
    """What was written is on the disk when this returns."""
    file.flush()
    os.fsync(file.fileno())


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
def replacing(path: Path) -> Iterator[Path]:
    """Gives the name of an empty new file beside `path`, which takes its place at the end, whole and on the disk.

    Where the block raises, or what follows it, `path` is as it was. Raises OSError.
    """
    partial = new_partial(path)
    partial.touch(exist_ok=False)
    try:
        yield partial
        with partial.open("rb+") as file:
            os.fsync(file.fileno())
        os.replace(partial, path)
        sync_folder(path.parent)
    finally:
        partial.unlink(missing_ok=True)


def find_fault(path: Path) -> OSError | None:
    """Why a file that is there cannot be written, as the system says it; None where it can be."""
    try:
        with path.open("ab") as file:
            file.write(bytes(_BYTES_OF_TRIAL))
            sync(file)
    except OSError as error:
        return error
    return None

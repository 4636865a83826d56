"""The lock of a run's folder: one run at a time, where the file system can tell."""

from __future__ import annotations

import errno
import fcntl
import os
import socket
import time
from pathlib import Path
from typing import IO

from studyrunner.system.files import open_plain

_SECONDS_TO_DIE = 5.0  # after which all ranks of a run that was killed have noticed
_LONGEST = 1000


class StoreInUseError(Exception):
    """Another run works in the folder; the text says which."""


class FolderLock:
    """Held until it is closed or the process ends, however it ends.

    holds: whether it keeps others away. Some file systems have no locks: better to run without one than not at all.
    Raises StoreInUseError, NotPlainError where something else than a lock stands in its place, and OSError.
    """

    def __init__(self, path: Path) -> None:
        latest = time.monotonic() + _SECONDS_TO_DIE
        self._file: IO[bytes] = open_plain(path, _LONGEST, os.O_RDWR | os.O_CREAT)
        try:
            while not (held := _take(self._file)):
                if held is None:
                    break
                if time.monotonic() > latest:
                    raise StoreInUseError(self._file.read().decode("utf-8", "replace").strip() or "unknown")
                time.sleep(_SECONDS_TO_DIE / 50)
            self.holds = held is True
            if self.holds:
                self._file.truncate(0)
                self._file.write(f"process {os.getpid()} on {socket.gethostname()}".encode())
                self._file.flush()
        except BaseException:
            self._file.close()
            raise

    def close(self) -> None:
        """Lets others in."""
        self._file.close()


def _take(file: IO[bytes]) -> bool | None:
    """Whether the lock is ours now; None where there are no locks. Raises OSError where the disk is at fault."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno == errno.EIO:
            raise
        return None
    return True

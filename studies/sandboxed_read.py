"""Reads a file of unknown origin in a separate process before this process reads it.

The HDF5 library was not made for manipulated bytes: some crash it, some keep it busy for ever, a few unpack to any
size. The separate process has limits of time and memory. Exit status 0 means a readable file, 3 an unreadable one
with a reason, anything else a crash or a limit.
"""

from __future__ import annotations

import json
import resource
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from studies.guards.limited_process import REFUSED, limit_this_process, run_limited
from studies.scene_error import SceneError

LARGEST_MEMORY = 2**31
"""Address space for reading a file, bytes."""

LONGEST = 2
"""CPU time for reading a file, s; one second more for every _BYTES_A_SECOND of the file."""

_BYTES_A_SECOND = 2**25
_WHOLE_RESULT = "*"
_WALL_SECONDS = 60.0  # a folder on the network may be slow, which is no fault of the file


def is_hdf5(path: Path) -> bool:
    """Whether a file begins as HDF5 files do. Raises OSError where it cannot be read."""
    with path.open("rb") as file:
        return file.read(8) == b"\x89HDF\r\n\x1a\n"


def check_scene_readable(path: Path, group: str = "", attributes: Sequence[str] = ()) -> None:
    """Raises SceneError where reading all of a scene fails, would crash, or take too long or too much memory.

    Whether the numbers make a model is not found here.

    Parameters
    ----------
    path
        A scene file, or one that holds a scene.
    group
        Where the scene stands in a file that holds more than one.
    attributes
        Of the file, which are read as well.
    """
    _check(path, [group, *attributes])


def check_result_readable(path: Path) -> None:
    """Raises SceneError where opening a result file would do harm."""
    _check(path, [_WHOLE_RESULT])


def _check(path: Path, what: Sequence[str]) -> None:
    status, said = run_sandbox([str(path.absolute()), *what])
    if status == REFUSED:
        raise SceneError(*json.loads(said))
    if status != 0:
        found = f"{path.name} is damaged: it cannot be read in a reasonable time and {LARGEST_MEMORY / 2**30:g} GiB"
        raise SceneError("model", found, "write the scene file again")


def run_sandbox(arguments: Sequence[str]) -> tuple[int, str]:
    """Exit status and output of the process that reads a file."""
    return run_limited(__name__, arguments, _WALL_SECONDS)


def read_within_limits(path: Path, group: str = "", attributes: Sequence[str] = ()) -> tuple[int, str]:
    """Reads a whole scene; exit status and output. Afterwards this process can do nothing else."""
    # loaded before there are limits, as it is no fault of the file how long that takes
    from studies.guards.hdf5_guard import LARGEST_RESULT, open_hdf5, read_attribute
    from studies.scene_file import read_through

    if group == _WHOLE_RESULT:
        from studies.guards.netcdf_guard import read_result_through

    seconds = int(resource.getrusage(resource.RUSAGE_SELF).ru_utime) + LONGEST
    if path.is_file():
        seconds += min(path.stat().st_size, 2**31) // _BYTES_A_SECOND
    limit_this_process(LARGEST_MEMORY, seconds)
    try:
        if group == _WHOLE_RESULT:
            read_result_through(path)
            return 0, ""
        if attributes:
            with open_hdf5(path, LARGEST_RESULT) as file:
                for name in attributes:
                    read_attribute(file, name)
                if group not in file:
                    return 0, ""
        read_through(path, group)
    except SceneError as error:
        return REFUSED, json.dumps([error.key, error.value, error.remedy])
    except OSError:
        # a missing file, which the process that asks finds as well
        return 0, ""
    return 0, ""


def main(arguments: Sequence[str]) -> NoReturn:
    """The separate process. arguments: path, group, names of attributes."""
    exit_status, answer = read_within_limits(Path(arguments[0]), arguments[1], arguments[2:])
    print(answer, flush=True)
    sys.exit(exit_status)

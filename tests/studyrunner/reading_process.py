"""One process that reads files of unknown origin for many tests: each in a fork of it, with the limits of a new one.

A new process is what `studies.sandboxed_read` starts; most of what it takes is its start. This one has loaded what that
one loads, and nothing else, when it forks.
"""

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from studies import sandboxed_read
from tests.studyrunner.own_time import seconds_waited


@dataclass(frozen=True)
class Reading:
    """How the process that read a file ended. waited: s for a processor. largest: KiB that it had in memory."""

    status: int
    said: str
    waited: float
    largest: int


class ReadingProcess:
    """What stands for `studies.sandboxed_read.run_sandbox`. waited: s for a processor, all readings together."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.waited = 0.0
        self._process = process

    def read(self, arguments: Sequence[str]) -> tuple[int, str]:
        """Exit status of the process that reads a file, and what it says."""
        assert self._process.stdin is not None
        print(json.dumps(arguments), file=self._process.stdin, flush=True)
        status, said, waited = json.loads(self._process.stdout.readline())
        self.waited += waited
        return status, said


@contextlib.contextmanager
def reading_process() -> Iterator[ReadingProcess]:
    """The process, ended in the end."""
    root = str(Path(__file__).parents[2])
    with subprocess.Popen(
        [sys.executable, "-m", __name__],
        env={**os.environ, "PYTHONPATH": root, "OPENBLAS_NUM_THREADS": "1"},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        yield ReadingProcess(process)


def read_in_a_fork(arguments: Sequence[str], own: int = 0) -> Reading:
    """As the main function of `studies.sandboxed_read`, in a copy of this process.

    own: bytes of address space that this process has more than a new one, and that are none of the file's.
    """
    receive, send = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(receive)
        nothing = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(nothing, stream)
        with contextlib.suppress(BaseException):
            sandboxed_read.LARGEST_MEMORY += own
            status, said = sandboxed_read.read_within_limits(Path(arguments[0]), arguments[1], arguments[2:])
            os.write(send, said.encode())
            os._exit(status)
        os._exit(99)
    os.close(send)
    with os.fdopen(receive, "rb") as pipe:
        said = pipe.read().decode()
    # it has ended, but there is still word of it
    os.waitid(os.P_PID, child, os.WEXITED | os.WNOWAIT)
    waited = seconds_waited(str(child))
    _, status, used = os.wait4(child, 0)
    return Reading(os.waitstatus_to_exitcode(status), said, waited, used.ru_maxrss)


def main() -> None:
    """Reads a file for every line of its input."""
    # loaded as a process of its own does it, before there are limits
    import studies.guards.netcdf_guard
    import studies.scene_file  # noqa: F401

    for line in sys.stdin:
        before = seconds_waited()
        found = read_in_a_fork(json.loads(line))
        print(json.dumps([found.status, found.said, found.waited + seconds_waited() - before]), flush=True)


if __name__ == "__main__":
    main()

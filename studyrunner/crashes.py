"""What a crash of a computing process leaves behind: which task it was at, and where in it.

Every rank that sees the folder of the run has a file there. The key of its task stands in the first line; Python's
fault handler writes behind it where the process was. A process that is killed from outside leaves no such text.
"""

from __future__ import annotations

import contextlib
import faulthandler
import os
import re
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from studyrunner.files import NotPlainError, create, open_plain
from studyrunner.results import Kept, MarchResult, StartResult
from studyrunner.tasks import BranchTask, MarchTask

Keep = Callable[[Kept], None]
"""Takes note of how far a task is."""

Evaluate = Callable[[BranchTask | MarchTask, Keep], Iterator[StartResult | MarchResult]]
"""Does a task: gives its results one by one, and hands over now and then how far it is."""

_LINE = 64  # bytes of the first line, which is written anew for each task: behind it the fault handler writes
_LARGEST = 1_000_000
_FATAL = re.compile(r"Fatal Python error: (.*)")
_FRAME = re.compile(r'File "(.*)", line (\d+) in (.*)')


@dataclass(frozen=True)
class Crash:
    """A task that ended its process. position: place on a branch that it was on the way to, None for a march."""

    key: str
    position: int | None
    message: str


@contextlib.contextmanager
def note_tasks(evaluate: Evaluate, folder: Path, rank: int) -> Iterator[Evaluate]:
    """`evaluate`, which leaves word of what it is at in `folder`; as it is where this rank does not see the folder."""
    path = folder / f"rank-{rank}.crash"
    file = None
    if folder.is_dir():
        # a full disk or one that is write-protected here is no reason to stop
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)
            file = create(path)
    if file is None:
        yield evaluate
        return
    # The computing thread of rank 0 may go on for a while when the file is closed: it must not write into another one.
    lock = threading.Lock()

    def note(text: str) -> None:
        with lock, contextlib.suppress(OSError):
            if not file.closed:
                os.pwrite(file.fileno(), text.ljust(_LINE - 1).encode() + b"\n", 0)

    def noted(task: BranchTask | MarchTask, keep: Keep) -> Iterator[StartResult | MarchResult]:
        wanted = [place for place in task.order if place not in task.known] if isinstance(task, BranchTask) else []
        note(" ".join([task.key, *map(str, wanted[:1])]))
        for n_given, result in enumerate(evaluate(task, keep), start=1):
            yield result
            if n_given < len(wanted):
                note(f"{task.key} {wanted[n_given]}")

    had_before = faulthandler.is_enabled()
    file.seek(_LINE)
    faulthandler.enable(file, all_threads=False)
    try:
        yield noted
    finally:
        faulthandler.disable()
        if had_before and sys.__stderr__ is not None:
            faulthandler.enable(sys.__stderr__)
        with lock:
            file.close()
        path.unlink(missing_ok=True)


def forget_crash(folder: Path, rank: int) -> None:
    """Removes what a rank that is lost has left."""
    with contextlib.suppress(OSError):
        (folder / f"rank-{rank}.crash").unlink()


def read_crashes(folder: Path) -> tuple[Crash, ...]:
    """The crashes of an earlier run."""
    return tuple(found for path in crash_files(folder) if (found := _read_crash(path)) is not None)


def crash_files(folder: Path) -> Iterable[Path]:
    """The files of the ranks of an earlier run."""
    return sorted(folder.glob("rank-*.crash"))


def _read_crash(path: Path) -> Crash | None:
    try:
        with open_plain(path, _LARGEST) as file:
            first, *lines = file.read().decode("utf-8", "replace").splitlines() or [""]
    except (OSError, NotPlainError):
        return None
    match first.split():
        case [key]:
            position = None
        case [key, place] if place.isdecimal():
            position = int(place)
        case _:
            return None
    fatal = next((found for line in lines if (found := _FATAL.search(line))), None)
    frames = [found for line in lines if (found := _FRAME.search(line))]
    # A crash elsewhere in the process, in the MPI library for one, is not that of a task.
    if fatal is None or not any(Path(frame[1]).name == Path(__file__).name for frame in frames):
        return None
    name, number, function = frames[0].groups()
    return Crash(key, position, f"{fatal[1]} ({Path(name).name}, line {number}, in {function})")

"""Traces of a crash: which task ended a process, and where the process was.

Every rank that sees the folder of these notes beside the result has a file there: plain files, as only these can be
written while a process crashes. The first line is the hash of the task. Python's fault handler writes the position in
the code behind it. A process that is killed from outside leaves no such text.

The signal of a crash may also come from outside or from a faulty machine, so that one crash says nothing about the
task. Therefore the text is kept under the hash of the task, and the crashes of each task are counted.

By hand: `faulthandler` writes where a process was; no library notes which task the process had, and counts.
"""

from __future__ import annotations

import contextlib
import faulthandler
import os
import re
import sys
import threading
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

from studyrunner.plan.results import Evaluate, Keep, MarchResult, StartResult
from studyrunner.plan.tasks import BranchTask, MarchTask
from studyrunner.system.files import NotPlainError, create, open_plain, sync_folder

MOST_DEATHS = 2
"""A task that has ended so many processes is not tried again."""

_LINE = 64  # bytes of the first line, which is written anew for each task: behind it the fault handler writes
_LARGEST = 1_000_000
_OF_A_RANK = "rank-*.crash"
_OF_A_TASK = re.compile(r"([0-9a-f]{32})\.\d+\.died")
_KEY = re.compile(r"[0-9a-f]{32}")
_FATAL = re.compile(r"Fatal Python error: (.*)")
_FRAME = re.compile(r'File "(.*)", line (\d+) in (.*)')


@dataclass(frozen=True)
class Crash:
    """A task that ended its process. position: index of the frequency in a branch; None for a wear history."""

    key: str
    position: int | None
    message: str


@contextlib.contextmanager
def note_tasks(evaluate: Evaluate, folder: Path, rank: int) -> Iterator[Evaluate]:
    """`evaluate` that notes its task in `folder`; `evaluate` itself where this rank does not see the folder."""
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
        wanted = task.order_left if isinstance(task, BranchTask) else ()
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
        # Rank 0 may have ended already, and could not remove the folder then.
        if rank:
            with contextlib.suppress(OSError):
                folder.rmdir()


def count_crashes(folder: Path, rank: int | None = None) -> tuple[Crash, ...]:
    """Adds the notes of ranks that have ended, or of one of them, to the tally; returns the crashes among them."""
    crashes = []
    for path in sorted(folder.glob(_OF_A_RANK)) if rank is None else [folder / f"rank-{rank}.crash"]:
        with contextlib.suppress(OSError):
            crash = _read_crash(path)
            if crash is None:
                path.unlink()
                continue
            number = 1
            while os.path.lexists(counted := folder / f"{crash.key}.{number}.died"):
                number += 1
            # at once, so that a run that is killed here counts no crash twice
            path.rename(counted)
            crashes.append(crash)
    if crashes:
        with contextlib.suppress(OSError):
            sync_folder(folder)
    return tuple(crashes)


def read_tally(folder: Path) -> dict[str, tuple[Crash, ...]]:
    """Crashes of each task so far, by hash, in their order."""
    tally: dict[str, tuple[Crash, ...]] = {}
    for path, key in _tally_files(folder):
        crash = _read_crash(path)
        if crash is not None and crash.key == key:
            tally[key] = (*tally.get(key, ()), crash)
    return tally


def forget_crashes(folder: Path, keys: Collection[str] | None) -> None:
    """Removes tasks from the tally; all tasks for None."""
    for path, key in _tally_files(folder):
        if keys is None or key in keys:
            with contextlib.suppress(OSError):
                path.unlink()


def _tally_files(folder: Path) -> list[tuple[Path, str]]:
    return [(path, found[1]) for path in sorted(folder.glob("*.died")) if (found := _OF_A_TASK.fullmatch(path.name))]


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
    # it becomes the name of a file
    if not _KEY.fullmatch(key):
        return None
    fatal = next((found for line in lines if (found := _FATAL.search(line))), None)
    frames = [found for line in lines if (found := _FRAME.search(line))]
    # A crash elsewhere in the process, in the MPI library for one, is not that of a task.
    if fatal is None or not any(Path(frame[1]).name == Path(__file__).name for frame in frames):
        return None
    name, number, function = frames[0].groups()
    return Crash(key, position, f"{fatal[1]} ({Path(name).name}, line {number}, in {function})")

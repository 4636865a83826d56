"""Tasks that have ended the processes of earlier runs: which have failed, which are tried once more."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from solver.outcome import Outcome
from studyrunner.checkpoint.completion_index import CompletionIndex
from studyrunner.mpi.crashes import MOST_DEATHS, Crash, count_crashes, forget_crashes, read_tally


@contextlib.contextmanager
def crash_notes(folder: Path) -> Iterator[None]:
    """The folder of the notes on crashes, which goes with the run where no task has crashed."""
    # a disk that is full is met by what is written next
    with contextlib.suppress(OSError):
        folder.mkdir(exist_ok=True)
    try:
        yield
    finally:
        # A rank that is interrupted may end later than this one, or be ended before it removes its note.
        count_crashes(folder)
        with contextlib.suppress(OSError):
            folder.rmdir()


def take_crashes(completion: CompletionIndex, folder: Path, *, fresh: bool = False) -> list[Crash]:
    """Marks the points of tasks as failed that have ended two processes in earlier runs.

    Parameters
    ----------
    completion
        The finished tasks.
    folder
        Folder of the notes on crashes.
    fresh
        Whether earlier crashes of the tasks of this study do not count.

    Returns
    -------
    list of Crash
        New crashes of tasks that have crashed once.
    """
    own = completion.keys
    new = count_crashes(folder)
    if fresh:
        forget_crashes(folder, own)
    for key, crashes in read_tally(folder).items():
        if key in own and len(crashes) >= MOST_DEATHS:
            completion.take_as_failed(key, crashes[-1].position, Outcome.CRASHED, crashes[-1].message)
            # The failure is on the disk. With --retry-failed counting begins anew.
            forget_crashes(folder, {key})
    tally = read_tally(folder)
    return [crash for crash in new if crash.key in tally]


def tried_again(completion: CompletionIndex, folder: Path) -> set[str]:
    """Tasks that had crashed too often, were tried again and have crashed once more."""
    tally = {key for key, crashes in read_tally(folder).items() if len(crashes) < MOST_DEATHS}
    return tally & completion.tasks_with(Outcome.CRASHED) if tally else set()

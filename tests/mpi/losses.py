"""What was lost with the runs that were killed in a folder: what was finished before, and was done again afterwards."""

import itertools
import time
from bisect import bisect_left
from pathlib import Path

DONE = "done.txt"
"""A line for each step and each result that the runs of a folder have finished: time (s), what, task and number."""

_KILLED = "killed.txt"

PROMISED = 5.0
"""Seconds: what was finished longer before a kill is not lost."""


def note(folder: Path, what: str) -> None:
    """`kill`: a run in this folder is killed now; `end`: its last process has ended. Only the last is not killed."""
    with (folder / _KILLED).open("a", encoding="ascii") as file:
        file.write(f"{what} {time.time()}\n")


def ages_of_losses(folder: Path) -> list[float]:
    """How long before a kill that was finished which was done again after it, s; nothing of what was not lost."""
    noted = [(what, float(when)) for what, when in _lines(folder / _KILLED)]
    kills = [when for what, when in noted if what == "kill"]
    # the first kill is to blame for what it takes long to do again; a rank may outlive it for a moment
    ends = [when for what, when in noted if what == "end"][: len(kills)]
    times: dict[tuple[str, ...], list[float]] = {}
    for when, *thing in _lines(folder / DONE):
        times.setdefault(tuple(thing), []).append(float(when))
    ages = []
    for finished in times.values():
        for before, again in itertools.pairwise(sorted(finished)):
            run = bisect_left(ends, before)
            if run < len(ends) and again > ends[run]:
                ages.append(max(0.0, kills[run] - before))
    return ages


def _lines(path: Path) -> list[list[str]]:
    return [line.split() for line in path.read_text(encoding="ascii").splitlines()] if path.exists() else []

"""What was lost with the runs that were killed in a folder: what was finished before, and was done again afterwards."""

import itertools
import math
import time
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

DONE = "done.txt"
"""A line for each step and each result that the runs of a folder have finished: time (s), what, task and number."""

_RUNS = "runs.txt"

PROMISED = 5.0
"""Seconds: what was finished longer before a kill is not lost."""


@dataclass(frozen=True)
class Losses:
    """What kills have cost, by what it is: a step or a result.

    at_risk: how many were finished more than `PROMISED` before a kill. broken: how many of these were done again.
    oldest: how long before the kill what was done again had been finished at most, s; 0 where nothing was.
    """

    at_risk: Counter[str] = field(default_factory=Counter)
    broken: Counter[str] = field(default_factory=Counter)
    oldest: dict[str, float] = field(default_factory=dict)

    def __str__(self) -> str:
        """A line for each sort."""
        return "\n".join(
            f"{self.broken[what]} of {self.at_risk[what]} {what}s finished more than {PROMISED:g} s before a kill were"
            f" lost; the oldest {what} that was lost had been finished {oldest:.1f} s before"
            for what, oldest in sorted(self.oldest.items())
        )


def note_kill(folder: Path) -> None:
    """A run in this folder is killed now: the first thing to end it."""
    _note(folder, "kill")


def note_end(folder: Path) -> None:
    """The last process of a run in this folder has ended."""
    _note(folder, "end")


def find_losses(folder: Path) -> Losses:
    """Those of the runs in a folder, one after the other; none where nothing was finished or killed there."""
    kills, ends = _read_runs(folder)
    times: dict[tuple[str, ...], list[float]] = {}
    for when, *thing in _lines(folder / DONE):
        times.setdefault(tuple(thing), []).append(float(when))
    found = Losses(oldest={thing[0]: 0.0 for thing in times})
    for (what, *_), finished in times.items():
        finished.sort()
        for when, again in itertools.pairwise((*finished, math.inf)):
            # the first kill is to blame for what it takes long to do again; a rank may outlive it for a moment
            run = bisect_left(ends, when)
            if run < len(ends) and kills[run] is not None and again > ends[run]:
                age = max(0.0, kills[run] - when)
                found.at_risk[what] += age > PROMISED
                if again < math.inf:
                    found.broken[what] += age > PROMISED
                    found.oldest[what] = max(found.oldest[what], age)
    return found


def all_losses(parts: Iterable[Losses]) -> Losses:
    """Of several folders."""
    whole = Losses()
    for part in parts:
        whole.at_risk.update(part.at_risk)
        whole.broken.update(part.broken)
        for what, oldest in part.oldest.items():
            whole.oldest[what] = max(oldest, whole.oldest.get(what, 0.0))
    return whole


def _read_runs(folder: Path) -> tuple[list[float | None], list[float]]:
    """When each run was killed, None for one that was not, and when it had ended."""
    kills: list[float | None] = []
    ends: list[float] = []
    kill = None
    for what, when in _lines(folder / _RUNS):
        if what == "kill":
            kill = float(when)
        else:
            kills.append(kill)
            ends.append(float(when))
            kill = None
    return kills, ends


def _note(folder: Path, what: str) -> None:
    with (folder / _RUNS).open("a", encoding="ascii") as file:
        file.write(f"{what} {time.time()}\n")


def _lines(path: Path) -> list[list[str]]:
    return [line.split() for line in path.read_text(encoding="ascii").splitlines()] if path.exists() else []

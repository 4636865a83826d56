"""Progress of a run on stderr: a bar with the time left on a terminal, a plain line now and then elsewhere."""

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from studyrunner.system.process import raise_ending

if TYPE_CHECKING:
    from rich.progress import Progress

FIRST_LINE, LONGEST_SILENCE = 2.0, 30.0
"""Seconds to the first plain line, and between two of them at most."""

_SECONDS_WITHOUT_A_WORD = 3.0
_GROWTH = 0.5  # of the time since the start: later lines are rarer
_SECONDS_A_PICTURE = 0.1
_MOST_NAMED = 3
_MOST_SHOWN = 0.99  # before every point is done
_YEAR = 8766.0 * 3600.0  # s


@dataclass(frozen=True)
class Standing:
    """How far the tasks of a run are. n_done, n_points: points. share: of the work that is done, 0 to 1, with parts of
    points. running: what is computed at the moment, longest first.
    """

    n_done: int
    n_points: int
    share: float
    seconds_left: float
    running: tuple[str, ...]


class ProgressDisplay:
    """What the user sees while a study runs. Only rank 0 has one. quiet: nothing is shown."""

    def __init__(self, *, quiet: bool = False) -> None:
        self._began, self._quiet, self._share = time.monotonic(), quiet, 0.0
        self._bar = _new_bar() if sys.stderr.isatty() and not quiet else None
        self._next = FIRST_LINE if self._bar is None else 0.0  # seconds

    def __enter__(self) -> Self:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def say(self, text: str) -> None:
        """Shows a line: what is done from now on, or what the user has to know."""
        if self._bar is not None:
            self._bar.console.print(text, markup=False, highlight=False)
        elif not self._quiet:
            print(f"[{format_seconds(self.seconds):>7}] {text}", file=sys.stderr, flush=True)

    def step(self, text: str) -> None:
        """Shows a line on a step before the tasks, where these steps take long: a wrong scene is one line, no more."""
        raise_ending()
        if self.seconds > _SECONDS_WITHOUT_A_WORD:
            self.say(text)

    def tick(self, look: Callable[[], Standing]) -> None:
        """Called many times a second: shows how far the tasks are where that is due, and only then looks."""
        elapsed = self.seconds
        if elapsed < self._next or self._quiet:
            return
        text = self._describe(look())
        if self._bar is not None:
            self._next = elapsed + _SECONDS_A_PICTURE
            self._bar.update(self._bar.task_ids[0], completed=self._share, description=text)
        else:
            self._next = elapsed + min(max(FIRST_LINE, _GROWTH * elapsed), LONGEST_SILENCE)
            self.say(text)

    def _describe(self, found: Standing) -> str:
        """Points and percent that are done, the time left, and what runs. The percentage never falls."""
        done = found.n_done == found.n_points
        self._share = 1.0 if done else max(self._share, min(found.share, _MOST_SHOWN))
        parts = [f"{found.n_done} of {count(found.n_points, 'point')}", f"{100.0 * self._share:.0f} %"]
        if not done:
            parts.append(f"about {format_seconds(max(1.0, found.seconds_left))} left")
        if found.running:
            more = len(found.running) - _MOST_NAMED
            named = ", ".join(found.running[:_MOST_NAMED])
            parts.append(f"running: {named}" + (f" and {more} more" if more > 0 else ""))
        return ", ".join(parts)

    @property
    def seconds(self) -> float:
        """Time since the start."""
        return time.monotonic() - self._began


def _new_bar() -> "Progress | None":
    """A bar on stderr; None where it is no terminal that shows one."""
    from rich.console import Console  # where it is used: it takes a while to load
    from rich.progress import BarColumn, Progress, SpinnerColumn, TaskProgressColumn, TextColumn

    console = Console(stderr=True)
    # the text comes last: it is cut where the terminal is narrow
    columns = (SpinnerColumn(), BarColumn(20), TaskProgressColumn(), TextColumn("{task.description}", markup=False))
    bar = Progress(*columns, console=console, transient=True)
    bar.add_task("", total=1.0)
    return bar if console.is_terminal else None


def format_seconds(seconds: float) -> str:
    """A time as a person says it."""
    if seconds < 60.0:
        return f"{seconds:.0f} s"
    if seconds < 3600.0:
        return f"{seconds / 60.0:.1f} min"
    return f"{seconds / 3600.0:.1f} h" if seconds < _YEAR else f"{seconds / _YEAR:.3g} years"


def count(number: int, one: str, many: str | None = None) -> str:
    """A number with its noun."""
    return f"{number} {one if number == 1 else many or one + 's'}"

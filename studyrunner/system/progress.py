"""Progress of a run on stderr: a bar with the time left on a terminal, a plain line now and then elsewhere.

By hand are the words alone: `rich` draws the bar.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from rich.progress import Progress

FIRST_LINE = 2.0
"""Seconds to the first plain line."""

LONGEST_SILENCE = 30.0
"""Seconds between two plain lines, at most."""

_GROWTH = 1.5
_SECONDS_A_PICTURE = 0.1
_MOST_NAMED = 3
_MOST_SHOWN = 0.99  # before every point is done


@dataclass(frozen=True)
class Standing:
    """How far the tasks of a run are.

    n_done, n_points: points. share: of the work that is done, 0 to 1, parts of points included. seconds_left: expected.
    running: what is computed at the moment, longest first.
    """

    n_done: int
    n_points: int
    share: float
    seconds_left: float
    running: tuple[str, ...]

    def describe(self, share: float) -> str:
        """Points and percent that are done, the time left, and what runs, in one line; share: that is shown."""
        parts = [f"{self.n_done} of {count(self.n_points, 'point')}", f"{100.0 * share:.0f} %"]
        if self.n_done < self.n_points:
            parts.append(f"about {format_seconds(self.seconds_left)} left")
        if self.running:
            named = ", ".join(self.running[:_MOST_NAMED])
            more = f" and {len(self.running) - _MOST_NAMED} more" if len(self.running) > _MOST_NAMED else ""
            parts.append(f"running: {named}{more}")
        return ", ".join(parts)


class ProgressDisplay:
    """What the user sees while a study runs. Only rank 0 has one."""

    def __init__(self) -> None:
        self._began = time.monotonic()
        self._next_line = FIRST_LINE
        self._next_picture = 0.0
        self._share = 0.0
        self._bar = _new_bar() if sys.stderr.isatty() else None
        if self._bar is not None:
            self._bar_task = self._bar.add_task("", total=1.0)

    def __enter__(self) -> Self:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def say(self, doing: str) -> None:
        """What is done from now on."""
        if self._bar is None:
            print(f"{self._clock()} {doing}", file=sys.stderr, flush=True)
        else:
            self._bar.update(self._bar_task, description=doing)

    def note(self, happened: str) -> None:
        """Something that the user has to know; what is done stays the same."""
        if self._bar is None:
            print(f"{self._clock()} {happened}", file=sys.stderr, flush=True)
        else:
            self._bar.console.print(happened)

    def tick(self, look: Callable[[], Standing]) -> None:
        """Called many times a second: shows how far the tasks are where that is due, and only then looks.

        On a terminal the bar moves; elsewhere a plain line is printed, often at first, then every half minute.
        """
        elapsed = self.seconds
        if self._bar is not None:
            if elapsed >= self._next_picture:
                self._next_picture = elapsed + _SECONDS_A_PICTURE
                text = self._describe(look())
                self._bar.update(self._bar_task, completed=self._share, description=text)
        elif elapsed >= self._next_line:
            self._next_line = elapsed + min(max(FIRST_LINE, (_GROWTH - 1.0) * elapsed), LONGEST_SILENCE)
            print(f"{self._clock()} {self._describe(look())}", file=sys.stderr, flush=True)

    def _describe(self, standing: Standing) -> str:
        """The line that is shown. What is done never falls, be it that more is left than was expected before."""
        done = standing.n_done == standing.n_points
        self._share = 1.0 if done else max(self._share, min(standing.share, _MOST_SHOWN))
        return standing.describe(self._share)

    @property
    def seconds(self) -> float:
        """Time since the start."""
        return time.monotonic() - self._began

    def _clock(self) -> str:
        return f"[{format_seconds(self.seconds):>7}]"


class SilentProgress(ProgressDisplay):
    """Nobody sees how far it is."""

    def __init__(self) -> None:
        super().__init__()
        self._bar = None

    def say(self, doing: str) -> None:
        """Nothing."""

    def note(self, happened: str) -> None:
        """Nothing."""

    def tick(self, look: Callable[[], Standing]) -> None:
        """Nothing."""


def _new_bar() -> Progress | None:
    """A bar on stderr; None where it is no terminal that shows one."""
    from rich.console import Console  # where it is used: it takes a while to load
    from rich.progress import BarColumn, Progress, SpinnerColumn, TaskProgressColumn, TextColumn

    console = Console(stderr=True)
    # the text comes last: it is cut where the terminal is narrow
    columns = (SpinnerColumn(), BarColumn(20), TaskProgressColumn(), TextColumn("{task.description}"))
    return Progress(*columns, console=console, transient=True) if console.is_terminal else None


_YEAR = 8766.0 * 3600.0  # s


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

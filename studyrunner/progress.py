"""Progress of a run on stderr: a bar with the time left on a terminal, a plain line now and then elsewhere."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TaskProgressColumn, TextColumn

_FIRST_LINE = 2.0
_LONGEST_SILENCE = 60.0
_GROWTH = 1.5


class RunProgress:
    """What the user sees while a study runs. Only rank 0 has one."""

    def __init__(self) -> None:
        self._began = time.monotonic()
        self._doing = ""
        self._next_line = _FIRST_LINE
        self._done_cost = 0.0
        self._total_cost = 0.0
        self._points = (0, 0)
        console = Console(stderr=True)
        self._bar: Progress | None = None
        if console.is_terminal:
            columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TaskProgressColumn())
            self._bar = Progress(*columns, TextColumn("{task.fields[left]}"), console=console, transient=True)
            self._bar_task = self._bar.add_task("", total=1.0, left="")

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
        self._doing = doing
        if self._bar is None:
            print(f"{self._clock()} {doing}", file=sys.stderr, flush=True)
        else:
            self._show()

    def note(self, happened: str) -> None:
        """Something that the user has to know; what is done stays the same."""
        if self._bar is None:
            print(f"{self._clock()} {happened}", file=sys.stderr, flush=True)
        else:
            self._bar.console.print(happened)

    def report(self, done_cost: float, total_cost: float, done_points: int, n_points: int) -> None:
        """How far the tasks are, in estimated seconds and in points."""
        self._done_cost, self._total_cost, self._points = done_cost, total_cost, (done_points, n_points)
        if self._bar is not None:
            self._show()

    def tick(self) -> None:
        """Called many times a second: prints a plain line when one is due."""
        elapsed = time.monotonic() - self._began
        if self._bar is not None or elapsed < self._next_line:
            return
        self._next_line = elapsed + min(max(_FIRST_LINE, (_GROWTH - 1.0) * elapsed), _LONGEST_SILENCE)
        done, total = self._points
        print(f"{self._clock()} {self._doing}: {done} of {total} points{self._left()}", file=sys.stderr, flush=True)

    @property
    def seconds(self) -> float:
        """Time since the start."""
        return time.monotonic() - self._began

    def _show(self) -> None:
        if self._bar is not None:
            total = self._total_cost or 1.0
            self._bar.update(
                self._bar_task,
                description=self._doing,
                completed=self._done_cost,
                total=total,
                left=self._left().lstrip(", "),
            )

    def _clock(self) -> str:
        return f"[{format_seconds(self.seconds):>7}]"

    def _left(self) -> str:
        # Before, hardly more is known than what the plan said.
        if self._done_cost <= 0.0 or self._points[0] == 0:
            return ""
        left = self.seconds * (self._total_cost / self._done_cost - 1.0)
        return f", about {format_seconds(left)} left"


def format_seconds(seconds: float) -> str:
    """A time as a person says it."""
    if seconds < 60.0:
        return f"{seconds:.0f} s"
    if seconds < 3600.0:
        return f"{seconds / 60.0:.1f} min"
    return f"{seconds / 3600.0:.1f} h"


def count(number: int, one: str, many: str | None = None) -> str:
    """A number with its noun."""
    return f"{number} {one if number == 1 else many or one + 's'}"

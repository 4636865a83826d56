"""Signals that end a run in good order: what there is gets written first, which the next signal must not disturb."""

from __future__ import annotations

import signal
from types import FrameType

_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1)
"""Ctrl-C, the end of a job's time, of a terminal, and what batch systems send before that."""


def take_endings() -> None:
    """From here on each of them raises KeyboardInterrupt in the main thread, once; those that are ignored stay so."""
    for number in _ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt)


def ignore_endings() -> None:
    """The run is ending already, for whatever reason: the signals that would end it do not disturb that.

    A launcher sends its signal to all ranks, and rank 0 may hear of it from another rank first.
    """
    for number in _ENDING:
        if signal.getsignal(number) is _interrupt:
            signal.signal(number, signal.SIG_IGN)


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    ignore_endings()
    raise KeyboardInterrupt

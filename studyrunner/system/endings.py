"""Signals that end a run in good order: what there is gets written first, which the next signal must not disturb."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator
from types import FrameType

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1)
"""Ctrl-C, the end of a job's time, of a terminal, and what batch systems send before that."""

_n_uninterrupted = 0
_came_meanwhile = False


def take_endings() -> None:
    """From here on each of them raises KeyboardInterrupt in the main thread, once; those that are ignored stay so."""
    for number in ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt)


def ignore_endings() -> None:
    """The run is ending already, for whatever reason: the signals that would end it do not disturb that.

    A launcher sends its signal to all ranks, and rank 0 may hear of it from another rank first.
    """
    for number in ENDING:
        if signal.getsignal(number) is _interrupt:
            signal.signal(number, signal.SIG_IGN)


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """What is done in here is done as a whole: an ending that comes meanwhile raises KeyboardInterrupt behind it.

    For steps of the main thread that an exception between two of their instructions would leave half done: a message
    whose memory is given back before it is sent, a lock that is taken and never released.
    """
    global _n_uninterrupted, _came_meanwhile
    _n_uninterrupted += 1
    try:
        yield
    finally:
        _n_uninterrupted -= 1
        if _came_meanwhile and _n_uninterrupted == 0:
            _came_meanwhile = False
            raise KeyboardInterrupt


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    global _came_meanwhile
    ignore_endings()
    if _n_uninterrupted:
        _came_meanwhile = True
    else:
        raise KeyboardInterrupt

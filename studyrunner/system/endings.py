"""Signals that end a run: finished points are written first, and the next signal must not disturb this.

The first signal raises KeyboardInterrupt in the main thread. A callback of an import or of a library may lose this
exception; then the next call of `raise_ending` raises it again, until `begin_ending` was called. A run that takes
longer than `SECONDS_OF_GRACE` to end is ended at once by one more signal.

By hand: `signal` of Python raises at any instruction, and nothing in it defers a signal or keeps a lost one.
"""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections.abc import Iterator
from types import FrameType

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1)
"""Ctrl-C, the end of the time of a job or of a terminal, and signals that batch systems send before the end."""

SECONDS_OF_GRACE = 10.0
"""Time after the first signal in which further signals do nothing, s. A launcher sends its signal more than once, and a
user may press Ctrl-C again. A result of 200 MB is written in 3 s.
"""

INTERRUPTED = 130
"""Exit status after an end from outside."""

_n_uninterrupted = 0
_came: float | None = None  # when the first one did
_begun = False
_last_words = b""


def take_endings() -> None:
    """From now on each of these signals raises KeyboardInterrupt in the main thread, once; ignored signals stay
    ignored.
    """
    global _came, _begun, _last_words
    _came, _begun, _last_words = None, False, b""
    for number in ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt)


def say_at_last(line: str) -> None:
    """Text for stderr where a further signal ends the process at once; empty at first."""
    global _last_words
    _last_words = f"{line}\n".encode()


def begin_ending() -> None:
    """The run is ending now: further signals do not disturb this for some time.

    A launcher sends its signal to all ranks, and rank 0 may hear of it from another rank first.
    """
    global _came, _begun
    _begun = True
    _came = time.monotonic() if _came is None else _came


def ending_waits() -> bool:
    """Whether a signal has come that nothing was done about."""
    return _came is not None and not _begun


def is_ending(error: BaseException) -> bool:
    """Whether an exception is the end from outside, or may be an exception that a library has made of it."""
    return isinstance(error, KeyboardInterrupt) or ending_waits()


def raise_ending() -> None:
    """Raises KeyboardInterrupt where a signal has come that nothing was done about.

    For use between steps that may have lost the exception.
    """
    if ending_waits():
        raise KeyboardInterrupt


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """A block that is done as a whole: a signal during the block raises KeyboardInterrupt after the block.

    For steps of the main thread that an exception between two instructions would leave half done: a message whose
    memory is freed before it is sent, or a lock that is never released.
    """
    global _n_uninterrupted
    _n_uninterrupted += 1
    try:
        yield
    finally:
        _n_uninterrupted -= 1
        if _n_uninterrupted == 0:
            raise_ending()


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    global _came
    now = time.monotonic()
    if _came is not None:
        if now > _came + SECONDS_OF_GRACE:
            with contextlib.suppress(OSError):
                os.write(2, _last_words)
            os._exit(INTERRUPTED)
        return
    _came = now
    if not _n_uninterrupted and not _begun:
        raise KeyboardInterrupt

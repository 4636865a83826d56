"""Signals that end a run in good order: what there is gets written first, which the next signal must not disturb.

The first one raises KeyboardInterrupt in the main thread. Where that comes to nothing, as in a callback of an import or
of a library, it is raised again at the next look (`raise_ending`), until somebody has taken it (`begin_ending`). A run
that takes longer than `SECONDS_OF_GRACE` to end is ended at once by one more.
"""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections.abc import Iterator
from types import FrameType

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1)
"""Ctrl-C, the end of a job's time, of a terminal, and what batch systems send before that."""

SECONDS_OF_GRACE = 10.0
"""A launcher sends its signal more than once, and a user who does not wait presses Ctrl-C again: a second one ends the
process at once only so long after the first. A result of 200 MB is written in 3 s."""

INTERRUPTED = 130
"""Exit status of what was ended from outside."""

_n_uninterrupted = 0
_came: float | None = None  # when the first one did
_begun = False
_last_words = b""


def take_endings() -> None:
    """From here on each of them raises KeyboardInterrupt in the main thread, once; those that are ignored stay so."""
    global _came, _begun, _last_words
    _came, _begun, _last_words = None, False, b""
    for number in ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt)


def say_at_last(line: str) -> None:
    """What is said on stderr where one more of them ends the process at once; nothing by itself."""
    global _last_words
    _last_words = f"{line}\n".encode()


def begin_ending() -> None:
    """The run is ending now, for whatever reason: the signals that would end it do not disturb that for a while.

    A launcher sends its signal to all ranks, and rank 0 may hear of it from another rank first.
    """
    global _came, _begun
    _begun = True
    _came = time.monotonic() if _came is None else _came


def ending_waits() -> bool:
    """Whether an ending has come that nothing was done about."""
    return _came is not None and not _begun


def is_ending(error: BaseException) -> bool:
    """Whether an error is an ending, or may be what a library has made of one."""
    return isinstance(error, KeyboardInterrupt) or ending_waits()


def raise_ending() -> None:
    """Raises KeyboardInterrupt where an ending has come that nothing was done about.

    Between steps that may hide what was raised when it came.
    """
    if ending_waits():
        raise KeyboardInterrupt


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """What is done in here is done as a whole: an ending that comes meanwhile raises KeyboardInterrupt behind it.

    For steps of the main thread that an exception between two of their instructions would leave half done: a message
    whose memory is given back before it is sent, a lock that is taken and never released.
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

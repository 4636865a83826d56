"""The process of a command: signals that end it, and streams that nobody reads.

The first signal raises KeyboardInterrupt in the main thread. A callback of an import or of a library may lose this
exception; then the next call of `raise_ending` raises it again, until `begin_ending` was called. By hand: nothing in
`signal` of Python defers a signal or keeps a lost one, and its streams raise an error where nobody reads.
"""

import contextlib
import io
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from types import FrameType

TYPE_CHECKING = False  # without `typing`, which takes long to load
if TYPE_CHECKING:
    from typing import Any, TextIO

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1)
"""Ctrl-C, the end of the time of a job or of a terminal, and signals that batch systems send before the end."""

SECONDS_OF_GRACE = 10.0
"""Time after the first signal in which further signals do nothing, s, as a launcher sends its signal more than once;
later ones end the process at once. A result of 200 MB is written in 3 s."""

INTERRUPTED = 130  # exit status after an end from outside

_LAST_STREAM = 2

_n_uninterrupted = 0
_came: float | None = None  # when the first signal came
_handled = False


def leave_endings() -> None:
    """From now on each of these signals ends the process at once: while modules are loaded, and while a call of a
    library waits for other processes, no handler of Python runs. Ignored ones stay so.
    """
    _handle_endings(signal.SIG_DFL)


def take_endings() -> None:
    """From now on each of these signals raises KeyboardInterrupt in the main thread, once; ignored ones stay so."""
    global _came, _handled
    _came, _handled = None, False
    _handle_endings(_interrupt)


def _handle_endings(handler: Callable[[int, FrameType | None], None] | signal.Handlers) -> None:
    for number in ENDING:
        # written anew where nothing changes: libraries take signals without a word to Python
        signal.signal(number, signal.SIG_IGN if signal.getsignal(number) is signal.SIG_IGN else handler)


def die() -> None:
    """Ends the process by a signal: its launcher then ends the others, which some do not at an exit status."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    os.kill(os.getpid(), signal.SIGTERM)


def begin_ending() -> None:
    """The process comes to its end now: a signal, which may come from the launcher and from a rank, is too late."""
    global _handled
    _handled = True


def is_ending(error: BaseException) -> bool:
    """Whether an exception is the end from outside, or may be an exception that a library has made of it."""
    return isinstance(error, KeyboardInterrupt) or _ending_waits()


def raise_ending() -> None:
    """Raises KeyboardInterrupt where a signal has come that nothing was done about; between steps that may lose it."""
    if _ending_waits():
        raise KeyboardInterrupt


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """A block of the main thread that is done as a whole: a signal during it raises KeyboardInterrupt after it."""
    global _n_uninterrupted
    _n_uninterrupted += 1
    try:
        yield
    finally:
        _n_uninterrupted -= 1
        if _n_uninterrupted == 0:
            raise_ending()


def _ending_waits() -> bool:
    return _came is not None and not _handled


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    global _came
    now = time.monotonic()
    if _came is not None:
        if now > _came + SECONDS_OF_GRACE:
            os._exit(INTERRUPTED)
        return
    _came = now
    if not _n_uninterrupted and not _handled:
        raise KeyboardInterrupt


class _Patient(io.FileIO):
    """A stream of the process that takes what it cannot write as well. error: why it could not, the first time."""

    error: OSError | None = None

    def write(self, data: memoryview) -> int:  # type: ignore[override]
        """Length of the data, whatever became of them."""
        left = memoryview(data).cast("B")
        try:
            # nothing at all is written where the other end is slow and must not be waited for
            while left and (written := super().write(left)):
                left = left[written:]
        except OSError as error:
            self.error = self.error or error
        return len(data)


def keep_talking() -> None:
    """From here on stdout and stderr, if no others stand in for them, take what they are given: a closed pipe or a full
    log does not end a run.
    """
    # Closed streams leave their numbers to files that are opened later, and libraries write to these numbers.
    while (nowhere := os.open(os.devnull, os.O_RDWR)) <= _LAST_STREAM:
        pass
    os.close(nowhere)
    for number, name in enumerate(("stdout", "stderr"), 1):
        if (stream := getattr(sys, name)) is getattr(sys, f"__{name}__"):
            raw: Any = _Patient(number, "w", closefd=False)
            encoding = None if stream is None else stream.encoding
            # line by line: those of several processes do not get mixed; what the encoding lacks is shown by its number
            setattr(sys, name, io.TextIOWrapper(raw, encoding, "backslashreplace", line_buffering=True))


def last_error(stream: "TextIO") -> OSError | None:
    """Why something that was written to a stream did not arrive; None where it did, or where nobody can know."""
    buffer = getattr(stream, "buffer", None)
    return buffer.error if isinstance(buffer, _Patient) else None

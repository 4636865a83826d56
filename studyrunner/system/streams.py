"""What a command says, and nobody hears: a terminal that is gone, a closed pipe or a full log does not end a run.

By hand: the streams of Python raise an error where nobody reads, at the end of the process as well.
"""

from __future__ import annotations

import io
import os
import sys
from typing import Any, TextIO

_LAST_STREAM = 2


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
    """From here on stdout and stderr take what they are given; one that is closed leads nowhere.

    What stands in for them, as in a test or a notebook, is left alone.
    """
    # Closed streams leave their numbers to files that are opened later, and libraries write to these numbers.
    while (nowhere := os.open(os.devnull, os.O_RDWR)) <= _LAST_STREAM:
        pass
    os.close(nowhere)
    if sys.stdout is sys.__stdout__:
        sys.stdout = _open_patiently(1, sys.stdout)
    if sys.stderr is sys.__stderr__:
        sys.stderr = _open_patiently(_LAST_STREAM, sys.stderr)


def last_error(stream: TextIO) -> OSError | None:
    """Why something that was written to a stream did not arrive; None where it did, or where nobody can know."""
    buffer = getattr(stream, "buffer", None)
    return buffer.error if isinstance(buffer, _Patient) else None


def _open_patiently(number: int, stream: TextIO | None) -> TextIO:
    encoding = None if stream is None else stream.encoding
    raw: Any = _Patient(number, "w", closefd=False)
    # line by line: those of several processes do not get mixed
    # a name that the encoding does not have is shown by its numbers
    return io.TextIOWrapper(raw, encoding, "backslashreplace", line_buffering=True)

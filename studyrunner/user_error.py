"""Errors that a user can cause: one line that names the file, the key, the value and what would be right."""

from __future__ import annotations

from pathlib import Path

_LONGEST_VALUE = 80


class UserError(Exception):
    """Bad input: ends a run with exit status 2 and one line, before anything is computed.

    place: the file (or the command line) that holds the mistake. key: dotted name of the key or option. value: what
    stands there, None where nothing does. remedy: one clause that says what would be right.
    """

    def __init__(self, place: str, key: str, value: object, remedy: str) -> None:
        super().__init__(place, key, value, remedy)
        self.place = place
        self.key = key
        self.value = value
        self.remedy = remedy

    def __str__(self) -> str:
        """The line that the user reads."""
        shown = self.key if self.value is None else f"{self.key} = {show_value(self.value)}"
        return " ".join(f"{self.place}: {shown}: {self.remedy}".split())


class StorageError(Exception):
    """A file of a run cannot be written or read: ends the run with exit status 1 and one line.

    What was written before is kept, and the same command goes on from there.
    """

    def __init__(self, path: Path, error: Exception) -> None:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        super().__init__(
            f"{path}: {reason}: make room there or give another result file with -o; what was computed is kept, and the"
            " same command goes on from it"
        )


class Verbatim(str):
    """A value that is shown to the user as it is: a description rather than what stands in the file."""


class WrongValueError(ValueError):
    """A value that a check of one key refuses; the reader of the study adds the file and the key.

    value: the offending part of what stands there. remedy: what would be right.
    key: dotted name where the check knows it better than the reader (a rule between two keys).
    """

    def __init__(self, value: object, remedy: str, key: str | None = None) -> None:
        super().__init__(remedy)
        self.value = value
        self.remedy = remedy
        self.key = key


def show_value(value: object) -> str:
    """`value` as it would stand in a TOML file, on one line and cut where it is long."""
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    if isinstance(value, Verbatim):
        text = str(value)
    elif isinstance(value, str):
        text = '"' + value + '"'
    text = " ".join(text.split())
    return text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 3] + "..."

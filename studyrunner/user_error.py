"""Errors that a user can cause: one line that names the file, the key, the value and what would be right.

By hand: `rich` takes five control characters out of a text, and leaves those that move the cursor.
"""

import argparse
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date, time
from pathlib import Path
from typing import NoReturn

_LONGEST_VALUE, _LONGEST_VERBATIM, _LONGEST_REMEDY = 80, 240, 600
_MOST_LINES, _MOST_LISTED = 20, 12
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


@dataclass(eq=False, repr=False)
class UserError(Exception):
    """Bad input: ends a run with exit status 2 and one line for each mistake, before anything is computed.

    place: the file (or the command line) that holds the mistake. key: dotted name of the key or option. value: what
    stands there, None where nothing does. remedy: one clause that says what would be right. others: further mistakes.
    """

    place: str
    key: str
    value: object
    remedy: str
    others: tuple["UserError", ...] = ()

    @property
    def mistakes(self) -> tuple["UserError", ...]:
        """All mistakes, one by one."""
        return (UserError(self.place, self.key, self.value, self.remedy), *self.others)

    def __str__(self) -> str:
        """The lines that the user reads, one for each mistake."""
        lines = [mistake._line() for mistake in (self, *self.others)]
        more = [f"and {len(lines) - _MOST_LINES} more"] if len(lines) > _MOST_LINES else []
        return "\n".join(lines[:_MOST_LINES] + more)

    def _line(self) -> str:
        key = _cut(show_text(self.key), _LONGEST_VERBATIM)
        # a sentence stands for itself, a value stands behind its key
        is_sentence = isinstance(self.value, Verbatim) and (" " in self.value or self.value == "missing")
        is_sentence = is_sentence and str(self.value)[0].isalpha()
        shown = key if self.value is None else f"{key}{':' if is_sentence else ' ='} {show_value(self.value)}"
        remedy = _cut(show_text(self.remedy), _LONGEST_REMEDY)
        return " ".join(f"{show_text(self.place)}: {shown}: {remedy}".split())


class StorageError(Exception):
    """A file of a run cannot be written or read: ends the run with exit status 1 and one line. What was written before
    is kept. remedy: what would help, where it is not what mostly helps.
    """

    def __init__(self, path: Path, error: Exception, remedy: str = "") -> None:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        remedy = remedy or "see that there is room, and that it may be written, or give another result file with -o"
        super().__init__(
            f"{show_text(str(path))}: {show_text(reason)}: {remedy};"
            " what was computed is kept, and the same command goes on from it"
        )


class Parser(argparse.ArgumentParser):
    """Options of a command. A wrong one raises UserError."""

    def __init__(self, command: str, description: str, epilog: str) -> None:
        look = argparse.RawDescriptionHelpFormatter
        super().__init__(command, None, description, epilog, formatter_class=look, allow_abbrev=False)

    def error(self, message: str) -> NoReturn:
        """Raises UserError."""
        raise UserError("command line", "options", None, f"{message}; {self.prog} --help lists them")


class Verbatim(str):
    """A value that is shown to the user as it is: a description rather than what stands in the file."""


def show_value(value: object) -> str:
    """`value` as it would stand in a TOML file, on one line and cut where it is long."""
    if isinstance(value, Verbatim):
        return _cut(show_text(" ".join(value.split())), _LONGEST_VERBATIM)
    try:
        text = toml_value(value)
    except (ValueError, RecursionError):
        # whole numbers of more digits than Python writes
        text = "too long to be shown"
    return _cut(show_text(" ".join(text.split())), _LONGEST_VALUE)


def toml_value(value: object) -> str:
    """A value on one line, as TOML, without keys that are None."""
    if isinstance(value, Mapping):
        items = (f"{toml_key(str(key))} = {toml_value(item)}" for key, item in value.items() if item is not None)
        return "{" + ", ".join(items) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    if isinstance(value, date | time):
        return value.isoformat()
    return json.dumps(value, ensure_ascii=False) if isinstance(value, bool | str) else repr(value)


def toml_key(key: str) -> str:
    """A key, in quotes where it is no bare one: labels of surfaces are any text."""
    return key if _BARE_KEY.fullmatch(key) else json.dumps(key, ensure_ascii=False)


def show_text(text: str) -> str:
    """`text` with everything escaped that a terminal would obey instead of showing it, but for line ends."""
    return "".join(
        letter
        if letter.isprintable() or letter in "\n\t"
        else letter.encode("unicode_escape", "backslashreplace").decode()
        for letter in text
    )


def listing(values: Sequence[object]) -> str:
    """The first of some values, and that there are more."""
    return ", ".join(map(str, values[:_MOST_LISTED])) + ", ..." * (len(values) > _MOST_LISTED)


def _cut(text: str, longest: int) -> str:
    return text if len(text) <= longest else text[: longest - 3] + "..."

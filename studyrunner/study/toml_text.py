"""Text of a study file -> table; what is wrong in one sentence."""

from __future__ import annotations

import tomllib
from pathlib import Path

from studyrunner.user_error import UserError

_LARGEST = 5 * 2**19  # bytes: an axis of 100 000 values


class NoTomlError(UserError):
    """A text that is no TOML."""


def read_toml_file(path: Path, source: str) -> dict[str, object]:
    """The table in a file. Raises UserError, and OSError where it cannot be read."""
    with path.open("rb") as file:
        return read_toml(file.read(_LARGEST + 1), source)


def read_toml(content: bytes, source: str) -> dict[str, object]:
    """The table. source: the file as the user named it. Raises UserError."""

    def wrong(remedy: str) -> UserError:
        return UserError(source, "the file", None, remedy)

    if len(content) > _LARGEST:
        raise wrong(f"give a study file of at most {_LARGEST / 2**20:g} MiB; an axis can be {{start, stop, num}}")
    try:
        text = content.decode("utf-8-sig")  # editors of Windows begin with a byte order mark
    except UnicodeDecodeError:
        raise wrong("give a text file in UTF-8") from None
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise NoTomlError(source, "the file", None, f"give valid TOML: {error}") from None
    except RecursionError:
        raise wrong("give valid TOML: this is nested too deeply") from None
    except ValueError as error:
        # whole numbers of thousands of digits, dates that no calendar has
        raise wrong(f"give valid TOML: {error}") from None

"""Text of a study file -> table, with what is wrong in one sentence, and tables -> text.

By hand: `tomli_w` gives each value of a list a line of its own, and axes have up to 100 000 values.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from studyrunner.user_error import UserError, toml_key, toml_value

_LARGEST = 5 * 2**19  # bytes: an axis of 100 000 values


def read_toml_file(path: Path, source: str) -> dict[str, object]:
    """The table in a file. Raises UserError, and OSError where it cannot be read."""
    with path.open("rb") as file:
        return read_toml(file.read(_LARGEST + 1), source)


def read_toml(content: bytes, source: str) -> dict[str, object]:
    """The table. source: the file as the user named it. Raises UserError."""
    remedy = f"give a study file of at most {_LARGEST / 2**20:g} MiB; an axis can be {{start, stop, num}}"
    if len(content) <= _LARGEST:
        try:
            return tomllib.loads(content.decode("utf-8-sig"))  # editors of Windows begin with a byte order mark
        except UnicodeDecodeError:
            remedy = "give a text file in UTF-8"
        except (ValueError, RecursionError) as error:
            # no TOML, but also whole numbers of thousands of digits, dates that no calendar has
            remedy = f"give valid TOML: {error}"
    raise UserError(source, "the file", None, remedy)


def format_toml(tables: Mapping[str, Any]) -> str:
    """Tables, or lists of tables, as TOML, without empty tables and without keys that are None."""
    lines = []
    for name, section in tables.items():
        for table in section if isinstance(section, list | tuple) else [section] if section else []:
            lines.append(f"[[{name}]]" if table is not section else f"[{name}]")
            lines += [f"{toml_key(key)} = {toml_value(value)}" for key, value in table.items() if value is not None]
    return "\n".join(lines) + "\n"

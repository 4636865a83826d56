"""An entry of the file of a run, and the row of a table that it becomes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from solver.packing import Packed
from studyrunner.checkpoint import database
from studyrunner.checkpoint.contents import compress
from studyrunner.checkpoint.database import COMPUTED, UNDER_WAY

_LEVELS = {UNDER_WAY: 1, COMPUTED: 1}  # compressed fast: what is replaced after seconds, and what is large
_LEVEL = 6

Name = tuple[str, str]
"""Table and key of an entry."""


@dataclass(frozen=True)
class Entry:
    """A new entry. shown: columns that a person can read."""

    packed: Packed
    shown: Mapping[str, object]


Batch = dict[Name, Entry | None]
"""Entries that are written in one transaction; None for one that is removed."""


def row_of(name: Name, entry: Entry, now: str) -> dict[str, object]:
    """The row of an entry by column, compressed. now: the time that the row tells."""
    table, key = name
    size, content = compress(entry.packed, _LEVELS.get(table, _LEVEL))
    own = {"key": key, "written": now, "size": size, "checksum": database.checksum(key, content)}
    return {**entry.shown, **own, "content": content}

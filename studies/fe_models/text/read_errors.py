"""Places in foreign files, and the sentences about what is wrong there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from studies.scene_error import SceneError

LARGEST_DECK = 2**28
"""Bytes of a deck together with all that it includes: a mesh of about two million nodes."""


@dataclass(frozen=True)
class Place:
    """A line of a file, counted from 1; as a text "sector.inp, line 12". keyword: of this line, or the one above it."""

    file: str
    line: int
    keyword: str = ""

    def __str__(self) -> str:
        return f"{self.file}, line {self.line}"

    def wrong(self, found: str, remedy: str) -> SceneError:
        """The error about this place: what stands there, and what would be right (a clause without a full stop)."""
        if self.keyword and f"*{self.keyword}" not in found:
            found = f"{found}, at *{self.keyword}"
        return SceneError("model", f"{self}: {found}", remedy)


def shown(text: str) -> str:
    """A text out of a file as it may stand in a message: at most 40 characters, all of them printable."""
    clean = "".join(letter if letter.isprintable() else "?" for letter in text.strip())
    return clean if len(clean) <= 40 else f"{clean[:37]}..."


def check_file(path: Path, largest: int, key: str = "model") -> int:
    """Bytes of a file that is there, is a file, and is at most `largest` bytes. Raises SceneError, about `key`."""
    try:
        there = path.is_file()
        size = path.stat().st_size if there else 0
        if there:
            with path.open("rb"):
                pass
    except (OSError, ValueError) as error:
        said = getattr(error, "strerror", None) or "no name of a file"
        raise SceneError(key, f"{shown(path.name)}: {said}", "give a file that can be read") from None
    if not there:
        raise SceneError(key, f"{shown(path.name)}: there is no such file", "give a path from the study file")
    if size > largest:
        found = f"{shown(path.name)}: {size / 2**20:.0f} MiB are more than {largest / 2**20:.0f} MiB"
        raise SceneError(key, found, "reduce the model")
    if size == 0:
        raise SceneError(key, f"{shown(path.name)}: the file is empty", "write it again")
    return size

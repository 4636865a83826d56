"""The files of a finite-element model."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class ModelFiles:
    """mesh: the deck or mesh. matrices: the files with the matrices, none where they are assembled here."""

    mesh: Path
    matrices: tuple[Path, ...] = ()

    @property
    def all(self) -> tuple[Path, ...]:
        """All of them but what the deck includes."""
        return (self.mesh, *self.matrices)


def file_digest(path: Path) -> str:
    """SHA-256 of a file, hexadecimal. Raises OSError."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()

"""The files of a finite-element model."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class ModelFiles:
    """Files of a model.

    mesh: the deck, mesh or table of nodes. matrices: the files with the matrices, none where they are assembled here.
    recovery: the table of further responses; None of none.
    """

    mesh: Path
    matrices: tuple[Path, ...] = ()
    recovery: Path | None = None

    @property
    def has_faces(self) -> bool:
        """Whether the mesh has faces that can be drawn."""
        return self.mesh.suffix.lower() != ".csv"

    @property
    def all(self) -> tuple[Path, ...]:
        """All of them but what the deck includes."""
        return (self.mesh, *self.matrices, *((self.recovery,) if self.recovery is not None else ()))


def file_digest(path: Path) -> str:
    """SHA-256 of a file, hexadecimal. Raises OSError."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()

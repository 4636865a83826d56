"""The files of a finite-element model, and the systems of units in which they are written."""

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


@dataclass(frozen=True)
class Units:
    """A system of units by its length (m), mass (kg) and time (s); what is derived from them follows.

    label_of_length, label_of_mass: for messages.
    """

    name: str
    length: float
    mass: float
    label_of_length: str
    label_of_mass: str

    @property
    def stiffness(self) -> float:
        """N/m."""
        return self.mass  # mass / s2

    @property
    def force(self) -> float:
        """N."""
        return self.mass * self.length  # mass length / s2

    @property
    def density(self) -> float:
        """kg/m3."""
        return self.mass / self.length**3

    @property
    def stress(self) -> float:
        """Pa."""
        return self.mass / self.length


UNITS = {"SI": Units("SI", 1.0, 1.0, "m", "kg"), "mm-t-s": Units("mm-t-s", 1e-3, 1e3, "mm", "t")}
"""Systems of units by their names."""

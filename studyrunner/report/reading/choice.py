"""Combinations of axes that a figure shows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Choice:
    """Combinations of the axes that a figure shows, with labels.

    sentence: on combinations that are left out; empty where there are none.
    """

    points: tuple[dict[str, int], ...]
    labels: tuple[str, ...]
    sentence: str

    def __iter__(self) -> Iterator[tuple[dict[str, int], str]]:
        """Combinations with their labels."""
        return iter(zip(self.points, self.labels, strict=True))

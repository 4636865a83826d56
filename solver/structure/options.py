"""Tuning constants of the products in single precision."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class StructureOptions:
    """Ratios, each with its meaning and the evidence for its value."""

    rough_directions: int = 48
    """Largest number of motions that carry mass, and damping not proportional to stiffness, in rough products."""
    rough: float = 1e-3
    """Part of the stiffness that a rough product may leave out. Does not change results."""


STRUCTURE = StructureOptions()

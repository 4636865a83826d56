"""Tuning constants of the stability tests."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class StabilityOptions:
    """Resolution and size with which period doubling is looked for, with the evidence."""

    doubling_harmonics: int = 19
    """Harmonics with which a state is judged at least: the sharpness of the contact decides, and with fewer a stable
    mass at a wall is taken for one that doubles its period."""
    doubling_samples: int = 256
    """Samples of a period, at least, with so many harmonics."""
    doubling_unknowns: int = 1500
    """Of the balance over two periods, whose Jacobian is factorised as it is: 1584 take 0.1 s."""


STABILITY = StabilityOptions()

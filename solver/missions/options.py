"""Tuning constants of the integration over missions."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MissionOptions:
    """Lengths and limits: for each its meaning, its unit (none: a ratio) and the evidence for its value."""

    first_step: int = 2
    """Missions of the first step: the shortest that has an estimated error."""

    # passages
    first_frequencies: int = 17
    """Frequencies before those that are added."""
    most_frequencies: int = 400
    """Most frequencies of a passage."""
    frequency_error: float = 0.25
    """Allowed error of the wear of a passage by its frequencies, as a fraction of rtol."""
    largest_sweep_rate: float = 0.3
    """|df/dt| / (zeta f)^2 above which a message says that a passage is too fast for steady states."""


MISSIONS = MissionOptions()

"""Tuning constants of the integration over missions."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MissionOptions:
    """Lengths and limits: for each its meaning, its unit (none: a ratio) and the evidence for its value."""

    step_error_fraction: float = 0.5
    """Allowed error of a step over its wear, or over its wear at the mean rate so far if larger, as a fraction of
    rtol, as in `WearOptions`."""
    largest_step_ratio: int = 4
    """Largest ratio of two successive steps."""
    smallest_step_ratio: int = 4
    """Largest division of a step that was refused."""
    step_safety: float = 0.85
    """Length of a step over the length with the allowed error."""
    first_step: int = 2
    """Missions of the first step: the shortest that has an estimated error."""

    # passages
    first_frequencies: int = 17
    """Frequencies before those that are added."""
    most_frequencies: int = 400
    """Most frequencies of a passage."""
    frequency_error: float = 0.25
    """Allowed error of the wear of a passage by its frequencies, as a fraction of rtol."""
    beside_jump: float = 1e-6
    """Fraction of the frequency of a jump: distance of the states before and behind it."""
    largest_sweep_rate: float = 0.3
    """|df/dt| / (zeta f)^2 above which a message says that a passage is too fast for steady states."""


MISSIONS = MissionOptions()

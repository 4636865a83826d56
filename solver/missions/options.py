"""Tuning constants of the integration over missions."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MissionOptions:
    """Lengths and limits: for each its meaning, its unit (none: a ratio) and the evidence for its value."""

    step_iterations: int = 6
    """Most missions flown for a step, whose depth is found by Newton's method. Sliders and roots need 1 to 3."""
    depth_tolerance: float = 0.1
    """Last correction of this depth, as worn volume, over the allowed error of the step."""

    # passages
    first_frequencies: int = 17
    """Frequencies before those that are added."""
    most_frequencies: int = 400
    """Most frequencies of a passage."""
    frequency_error: float = 0.25
    """Allowed error of the wear of a passage by its frequencies, as a fraction of rtol."""
    largest_sweep_rate: float = 0.3
    """|df/dt| / (zeta f)^2 above which a message says that a passage is too fast for steady states. Wear over that of
    the steady states, integrated in time: slider 0.9986 to 1.0001 at 0.3 and 0.991 at 1; dovetail (mesh 1) 0.95 at 0.1,
    0.91 at 0.3, 0.95 at 1, 1.11 at 3."""


MISSIONS = MissionOptions()

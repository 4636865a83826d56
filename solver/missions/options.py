"""Tuning constants of the integration over missions."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MissionOptions:
    """Lengths and limits: for each its meaning, its unit (none: a ratio) and the evidence for its value."""

    step_error_fraction: float = 0.5
    """Allowed error of a step over its wear, or over its wear at the mean rate so far if larger, as a fraction of
    rtol. Missions of a slider: estimated over true error at least 1.7. With 0.25 two cases of the tests compute 21.5
    and 33 of 2000 missions, with 0.5 fewer than 20 and 30."""
    step_iterations: int = 6
    """Most missions computed for a step, whose depth is found by Newton's method. Sliders and roots need 1 to 3."""
    depth_tolerance: float = 0.1
    """Last correction of this depth, as worn volume, over the allowed error of the step."""

    # passages
    first_frequencies: int = 17
    """Frequencies before those that are added."""
    most_frequencies: int = 400
    """Most frequencies of a passage."""
    finest_interval: float = 0.1
    """Longest interval of frequencies that is never divided, over sqrt(|df/dt|): a tenth of zeta f where the sweep rate
    is 1. Slider without damping, 1 to 10 000 Hz at 10 Hz/s, once: a result after 89 CPU seconds; without this limit
    the first of two solutions was not finished after 100."""
    frequency_error: float = 0.25
    """Allowed error of the wear of a passage by its frequencies, as a fraction of rtol."""
    largest_sweep_rate: float = 1.0
    """|df/dt| / (zeta f)^2 above which a message says how fast a passage is. Wear over that of the steady states,
    integrated in time, and the error told: slider 0.999 to 1.000 and 3.4 % at 1, 0.994 to 0.996 and 9 % at 3, 0.967 to
    0.972 and 29 % at 10; dovetail (mesh 1) 0.983 and 5 % at 1.9, 0.95 and 15 % at 6.3, 0.91 and 45 % at 19, 0.95 and
    100 % at 63."""


MISSIONS = MissionOptions()

"""Tuning constants of the reported results."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ResultOptions:
    """Thresholds: for each its meaning, its unit (none: a ratio) and the evidence for its value."""

    edge_load: float = 1e-6
    """Fraction of the largest pressure or depth of all pairs: more at an edge of the modelled contact is no round-off.
    Open strips carry exactly 0. Where a stroke is cut off, the last strip has 0.96 of the largest pressure and 0.88 of
    the largest depth."""
    held_force: float = 1e-6
    """Largest force of a hold of the mean position, as a fraction of the friction of all pairs. This fraction is the
    relative error of motion and wear by the hold. Measured where a hold is needed: up to 5e-7."""


RESULTS = ResultOptions()

"""Tuning constants of the reported results."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ResultOptions:
    """Thresholds; each with its meaning, unit (none: a ratio) and the evidence for its value."""

    edge_load: float = 1e-6
    """Of the largest pressure or depth of all pairs: more than this at an edge of the modelled contact is no round-off.
    Strips that are open carry exactly 0; under a stroke whose scar is cut off the last one carries 0.96 of the largest
    pressure and has 0.88 of the largest depth."""
    held_force: float = 1e-5
    """Fraction of the friction of all pairs that a hold of the mean position takes up at most. Motion and wear change
    by this fraction at most, far below any rtol. Dovetail, friction 0.3, 1 N: 5e-7 to 2e-6 after 20 000 cycles."""


RESULTS = ResultOptions()

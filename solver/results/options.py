"""Tuning constants of the reported results."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ResultOptions:
    """Thresholds; each with its meaning, unit (none: a ratio) and the evidence for its value."""

    held_force: float = 1e-5
    """Fraction of the friction of all pairs that a hold of the mean position takes up at most. Motion and wear change
    by this fraction at most, far below any rtol. Dovetail, friction 0.3, 1 N: 5e-7 to 2e-6 after 20 000 cycles."""


RESULTS = ResultOptions()

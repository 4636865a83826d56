"""Safety factors and fractions of rtol of wear histories."""

from __future__ import annotations

from dataclasses import dataclass

from solver.accuracy.refinement import KEPT_FRACTION, VIBRATION_RECHECK
from solver.accuracy.resolved_state import FAINT_SHARE


@dataclass(frozen=True)
class AccuracyOptions:
    """Safety factors: for each its meaning, its unit (none: a ratio) and the evidence for its value."""

    negligible: float = FAINT_SHARE
    kept_fraction: float = KEPT_FRACTION
    vibration_recheck: float = VIBRATION_RECHECK
    history_safety: float = 1.5
    """Error of a history over its difference to the reference solution. Dovetail, 16 and 48 pairs, all schemes, steps
    of 250 to 2000 cycles: 0.02 to 1.4, in the median 0.3."""
    pair_over_volume: float = 2.0
    """Relative error of the depth of a pair over that of the worn volume, at least, where four or more pairs wear. With
    1 the deepest pairs of the dovetail at mu = 0.3 are outside of their errors by 2.7 times, and explicit steps at
    212.5 Hz, 48 pairs, by 3.2 times."""
    crossing_window: float = 0.5
    """Fraction of the cycle count. Two histories in which an event happens at different counts cross each other. So the
    error is the largest difference from this fraction of the count on (dovetail, 211.25 Hz, steps of 2000 cycles:
    without it the estimate at the crossing is a quarter of the true error). Later differences are not used: an error
    does not depend on the length of the study."""


ACCURACY = AccuracyOptions()

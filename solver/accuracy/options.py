"""Safety factors and fractions of rtol that several parts of the accuracy control share."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class AccuracyOptions:
    """Safety factors: for each its meaning, its unit (none: a ratio) and the evidence for its value."""

    two_levels_safety: float = 1.5
    """Error over the difference to the state two levels of harmonics up, 2 to 1.2 where the error falls as 1/H to
    1/H^3, and over the difference to twice the samples, 2 to 1.3 for an error as the time step or its square."""
    one_level_safety: float = 2.5
    """Error over the difference to the state one level up: 3.4 to 1.5 for an error as 1/H to 1/H^3."""
    triple_samples_safety: float = 2.0
    """Error over the difference to three times the samples: 1.5 to 1.1, but the errors of single events scatter."""
    negligible: float = 0.1
    """Fraction of rtol: part of the slip work that may be creep, and normal force over the largest one below which a
    contact need not be resolved."""
    kept_fraction: float = 0.5
    """Fraction of rtol: error up to which harmonics are removed, so that the next state does not add them at once. A
    state with less than this fraction of the kept error is tried with fewer harmonics and samples."""
    vibration_recheck: float = 0.3
    """Relative change of the vibration after which errors are estimated and harmonics chosen again. Error of the motion
    of the dovetail on the far side of the resonance: 5 % with 1.0, 0.5 % with 0.3."""

    # wear histories
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

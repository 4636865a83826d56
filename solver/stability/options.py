"""Tuning constants of the stability tests."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class StabilityOptions:
    """Resolution and size for the computation of Floquet multipliers, with the evidence."""

    small_samples: int = 512
    """Samples of the law in a period, for joints of which all multipliers are computed. In 72 scenes with one pair all
    multipliers of states that are the exact motion lie on the right side of 1. Most errors are below 0.01; for sliders
    that turn or stop up to 0.16, where the multiplier is far below 1. A quarter for larger joints, whose
    largest multipliers belong to few modes: within 0.003 of the multipliers with all (48 pairs). At most eight times as
    many where the structure alone vibrates fast."""
    samples_a_vibration: int = 40
    """Samples in a period of the fastest growing vibration of the structure alone, which BDF2 damps by 0.6 %."""
    opening_harmonics: int = 19
    """Smallest number of harmonics for a small joint that opens and closes: with fewer the impacts are too soft (9
    harmonics: multiplier 0.95 in place of 2.8)."""
    other_branch: float = 0.05
    """Relative difference of the vibration above which two states belong to different branches: a state with
    `opening_harmonics` (on the branches of a mass at a wall more than 9 harmonics change means and first harmonics by
    up to 3 %), or a state behind the end of a branch. Corners at which a branch folds back a little are no jumps, and
    there may be many of them."""
    most_rows: int = 600
    """Largest number of displacements of switching pairs: 200 such pairs take 0.4 GB and 10 s."""
    smallest_growth: float = 1e-3
    """Growth in a period, beyond 1, that counts, and the residual of Arnoldi's method below which a multiplier has
    converged. Sliding pairs that stick have multipliers of 1. The largest multiplier of 48 pairs converges in 20
    products."""


STABILITY = StabilityOptions()

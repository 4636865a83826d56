"""Tuning constants of the stability tests."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class StabilityOptions:
    """Resolution and size with which Floquet multipliers are computed, with the evidence."""

    small_samples: int = 512
    """Of the law in a period, of a joint of which all multipliers are computed: of 72 scenes with one pair those whose
    state is the exact motion are all on the right side of 1; most are within 0.01, sliders that turn or stop up to 0.16
    off, where the multiplier is far below 1."""
    large_samples: int = 128
    """The same of larger joints, whose largest multipliers belong to few modes: within 0.003 of those with 512 (48
    pairs)."""
    samples_a_vibration: int = 40
    """Of the fastest vibration that grows in the structure alone: the march takes 0.6 % of it in its own period."""
    most_marched_samples: int = 4096
    """Of a march."""
    opening_harmonics: int = 19
    """Of a small joint that opens and closes, at least: with fewer the impacts are too soft (9 harmonics: 0.95 in place
    of 2.8)."""
    opening_samples: int = 256
    """Of the law with so many harmonics, at least."""
    all_multipliers: int = 160
    """Size of a disturbance up to which all of them are computed: 40 displacements, 0.1 s."""
    arnoldi_multipliers: int = 40
    """Products of Arnoldi's method; the largest multiplier of 48 pairs settles in 20."""
    settled_multiplier: float = 1e-3
    """Residual of a multiplier that counts."""
    most_rows: int = 600
    """Displacements of pairs that switch: 200 such pairs take 0.4 GB and 10 s."""
    smallest_growth: float = 1e-3
    """In a period. Sliding pairs that stick have multipliers of 1."""
    indefinite: float = 1e-10
    """Of the largest entry of a matrix: by so much it may be indefinite."""


STABILITY = StabilityOptions()

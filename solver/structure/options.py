"""Tuning constants of the penalty."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class StructureOptions:
    """Ratios; each with its meaning and the evidence for its value.

    Results at a finite number of harmonics depend on them, in the limit of many they do not.
    """

    inertial_ratio: float = 2.0
    """Stiffness at twice the rate over that at the rate, above which a pair is inertial: 1 for a spring, 4 for a
    mass."""
    inertial_rate: float = 8.0
    """Of the frequency: rate at which that is judged first, for any number of harmonics alike."""
    drag_fraction: float = 0.1
    """Drag of a marched mass over m w: a mean velocity falls to exp(-2 pi 0.1) = 0.53 of itself in a period."""
    mean_stiffness_fraction: float = 1e-5
    """Stiffness that holds the mean position of a marched mass over that of the joint at the frequency: small enough
    not to hold one that slips."""


STRUCTURE = StructureOptions()

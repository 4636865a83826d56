"""Tuning constants of the condensed structure and of the penalty."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class StructureOptions:
    """Ratios; each with its meaning and the evidence for its value.

    Results at a finite number of harmonics depend on them, in the limit of many they do not.
    """

    dense_bytes: float = 2e6
    """Matrices of all harmonics up to which a product with each of them is fastest: more do not stay in the cache. Does
    not change results."""
    rough_directions: int = 48
    """Motions of the joint that carry its mass, and damping that is no multiple of stiffness, in rough products."""
    rough: float = 1e-3
    """Of the stiffness: what may be left out of a rough product. Does not change results."""
    kept_structures: int = 8
    """Condensed structures of a case, and low-rank differences of their harmonics, that are kept for the next one who
    asks: a wear history with its errors uses six. Does not change results."""
    inertial_ratio: float = 2.0
    """Stiffness at twice the rate over that at the rate, above which a pair is inertial: 1 for a spring, 4 for a mass.
    With 4 no pair is, and the two masses move by 20 % otherwise with five harmonics."""
    inertial_rate: float = 8.0
    """Of the frequency: rate at which that is judged first, for any number of harmonics alike."""
    drag_fraction: float = 0.1
    """Drag of a marched mass over m w: a mean velocity falls to exp(-2 pi 0.1) = 0.53 of itself in a period.
    Half and twice as much change the motion of slider and two masses by 1e-4."""
    mean_stiffness_fraction: float = 1e-5
    """Stiffness that holds the mean position of a marched mass over that of the joint at the frequency: small enough
    not to hold one that slips. Half and twice as much change states by 3e-6 at most."""


STRUCTURE = StructureOptions()

"""Tuning constants of the penalty: meaning, unit, evidence."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class StructureOptions:
    """Dimensionless numbers; at a finite number of harmonics results depend on them, in the limit they do not."""

    # Ratio of the stiffness at twice the rate to that at the rate, 1 for a spring, 4 for a mass: above it a mass.
    inertial_ratio: float = 2.0
    # Rate over the frequency at which that is judged first, for any number of harmonics alike.
    inertial_rate: float = 8.0
    # Drag of a marched mass over m w: a mean velocity falls to exp(-2 pi 0.1) = 0.53 of itself in a period.
    drag_fraction: float = 0.1
    # Stiffness that holds the mean position of a marched mass, over the stiffness at the frequency. Small enough not to
    # hold one that slips.
    mean_stiffness_fraction: float = 1e-5


STRUCTURE = StructureOptions()

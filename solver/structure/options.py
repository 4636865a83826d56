"""Tuning constants of the condensed structure and of the penalty."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class StructureOptions:
    """Ratios, each with its meaning and the evidence for its value.

    Results with a finite number of harmonics depend on the ratios; in the limit of many harmonics they do not.
    """

    dense_bytes: float = 2e6
    """Bytes of the matrices of all harmonics up to which a product with each matrix is fastest: larger matrices do not
    fit into the cache of the processor. Does not change results."""
    rough_directions: int = 48
    """Largest number of motions that carry mass, and damping not proportional to stiffness, in rough products."""
    rough: float = 1e-3
    """Part of the stiffness that a rough product may leave out. Does not change results."""
    kept_structures: int = 8
    """Size of the caches of condensed structures of a case and of low-rank differences of their harmonics. A wear
    history with its errors uses six. Does not change results."""
    inertial_ratio: float = 2.0
    """Ratio of the stiffness at twice a rate to the stiffness at the rate, above which a pair is inertial: 1 for a
    spring, 4 for a mass. With 4 no pair is inertial, and the motion of the two masses is 20 % off with H = 5."""
    inertial_rate: float = 8.0
    """Rate of the first test for `inertial_ratio` over the frequency, for any number of harmonics."""
    drag_fraction: float = 0.1
    """Drag of an inertial pair over m w: the mean velocity falls to exp(-2 pi 0.1) = 0.53 of its value in a period.
    Half and twice the value change the motion of slider and two masses by 1e-4."""
    mean_stiffness_fraction: float = 1e-5
    """Stiffness on the mean position of an inertial pair over the stiffness of the joint at the frequency. It is too
    small to hold a pair that slips. Half and twice the value change states by at most 3e-6."""


STRUCTURE = StructureOptions()

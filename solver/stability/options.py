"""Tuning constants of the stability tests: meaning, unit, evidence."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class StabilityOptions:
    """Resolution and size with which period doubling is looked for."""

    # Harmonics and samples with which a state is judged at least: the sharpness of the contact decides, with fewer
    # a stable mass at a wall is taken for one that doubles its period (tests/solver/test_period_doubling).
    doubling_harmonics: int = 19
    doubling_samples: int = 256
    # Unknowns of the balance over two periods, whose Jacobian is factorised as it is: an LU of 1584 takes 0.1 s.
    doubling_unknowns: int = 1500


STABILITY = StabilityOptions()

"""Tuning constants of the harmonic balance."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class BalanceOptions:
    """Limits of round-off in a balance, and resolution of its responses; each with the evidence."""

    peak_points: int = 1024
    """Points in a period at which the largest response is sought: a peak of harmonic 20 is found to 0.2 %."""


BALANCE = BalanceOptions()

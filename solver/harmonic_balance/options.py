"""Tuning constants of the harmonic balance."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class BalanceOptions:
    """Limits of round-off in a balance, and resolution of its responses; each with the evidence."""

    passive: float = 1e-14
    """Largest difference between the tangent of a passive pair and the identity, dimensionless. A passive pair
    transmits its predicted force and is left out of the coupled system. A hundred times the round-off of an entry."""
    least_vibration: float = 1e-6
    """Smallest scale of the vibrating residual over the static force. At the usual tolerance of 1e-8 a vibration below
    this fraction of the preload is lost in the round-off of the static force."""
    peak_points: int = 1024
    """Points in a period at which the largest response is sought: a peak of harmonic 20 is found to 0.2 %."""
    tail_orders: int = 3
    """Last harmonic of the tail of a friction force, over the highest harmonic. Eight samples for each harmonic still
    resolve this tail."""


BALANCE = BalanceOptions()

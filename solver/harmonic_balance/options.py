"""Tuning constants of the harmonic balance."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class BalanceOptions:
    """What is round-off in a balance, and how finely its responses are looked at; each with the evidence."""

    passive: float = 1e-14
    """Of the tangent of a pair, dimensionless: one that differs from the identity by less passes its predicted force
    on and is left out of the coupled system. A hundred times the round-off of an entry."""
    least_vibration: float = 1e-6
    """Of the static force, dimensionless: the scale of the vibrating residual is never less, because below this
    fraction of the preload a vibration is lost in the round-off of the static force at the usual tolerance of 1e-8."""
    peak_points: int = 1024
    """In a period, at which the largest response is looked for: a peak of harmonic 20 is found to 0.2 %."""
    tail_orders: int = 3
    """Times the highest harmonic: up to there the tail of a friction force is taken in, which eight samples a harmonic
    still tell."""


BALANCE = BalanceOptions()

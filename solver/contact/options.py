"""Tuning constants of the contact room. Those that compiled kernels read stand beside the kernels."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ContactOptions:
    """When the march through the period ends; each with its meaning, unit and the evidence for its value."""

    periodicity: float = 1e-10
    """Of the largest friction limit: the tangential state has repeated where it changes by less over a period. A
    hundredth of the usual tolerance of the residual, 1e-8, so that it does not show there."""
    most_periods: int = 400
    """Marched until a state that does not repeat is taken as it is. Pairs whose slip turns need up to some 20 with
    Newton's method and above 40 without it (`tests/solver/test_kernels.py`)."""


CONTACT = ContactOptions()

"""Tuning constants of the contact room. Constants of compiled kernels are in the files of the kernels."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ContactOptions:
    """End of the march through the period; each option with its meaning, unit and the evidence for its value."""

    most_periods: int = 400
    """Largest number of periods; then a state that is not periodic is accepted. Pairs with a turning slip direction
    need up to about 20 with Newton's method and above 40 without (`tests/solver/test_kernels.py`)."""


CONTACT = ContactOptions()

"""Tuning constants of the contact room. Constants of compiled kernels are in the files of the kernels."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ContactOptions:
    """End of the march through the period; each option with its meaning, unit and the evidence for its value."""

    periodicity: float = 1e-10
    """Change of the tangential state over a period, over the largest friction limit, below which the state is periodic.
    A hundredth of the usual tolerance of the residual, 1e-8, so that the residual does not show the change."""
    most_periods: int = 400
    """Largest number of periods; then a state that is not periodic is accepted. Pairs with a turning slip direction
    need up to about 20 with Newton's method and above 40 without (`tests/solver/test_kernels.py`)."""


CONTACT = ContactOptions()

"""Numerical settings of the solver, all with defaults."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SolverSettings:
    """How finely and how exactly a case is solved.

    harmonics: number H of harmonics above the static one.
    samples: N, equally spaced time samples in a period, at which the contact law is applied; more than 2 H.
    tolerance: largest accepted scaled residual of the harmonic balance.
    """

    harmonics: int = 5
    samples: int = 128
    tolerance: float = 1e-8

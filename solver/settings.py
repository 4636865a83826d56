"""Numerical settings of the solver, all with defaults."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class SolverSettings:
    """How finely and how exactly a case is solved.

    harmonics: number H of harmonics above the static one; "auto": as many as each state needs.
    samples: N, equally spaced time samples in a period, at which the contact law is applied; more than 2 H. "auto": as
        many as the harmonics need.
    tolerance: largest accepted scaled residual of the harmonic balance.
    rtol: relative error of response and wear rate that "auto" aims at.
    """

    harmonics: int | Literal["auto"] = "auto"
    samples: int | Literal["auto"] = "auto"
    tolerance: float = 1e-8
    rtol: float = 1e-2

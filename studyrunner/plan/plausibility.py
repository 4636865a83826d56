"""What of a study is hardly what was meant, as a unit that was mixed up. Never a refusal.

Each remark is one line; a run prints it on stderr when it begins.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from studyrunner.study.study import Study

OF_THE_PAPER = 1.1e-11
"""The default, 1/Pa, which is that of the reference."""

PLAUSIBLE = (1.9e-17, 4e-10)
"""Wear coefficients, 1/Pa, that are not asked about: a factor of 1000 around what was measured of metals, 1.9e-14
(steel; McColl, Ding and Leen, Wear 256 (2004) 1114) to 4e-13 (Ti-6Al-4V, 4e-4 mm3/J), as studies wear faster than
machines. Energy coefficients are Archard's over the friction coefficient, which is little beside this factor."""

_UNITS = {"1/MPa or mm2/N": 1e-6, "mm3/(N m) or mm3/J": 1e-9}
"""What else wear coefficients are given in, and how much of 1/Pa it is."""


def doubts_of_study(study: Study) -> tuple[str, ...]:
    """Lines on wear coefficients far off, before anything is computed; the one farthest off speaks for all."""
    off = [value for value in _coefficients(study) if not _is_plausible(value)]
    if not off:
        return ()
    worst = max(off, key=lambda value: abs(math.log(value / OF_THE_PAPER)))
    what = "wear_coefficient" if study.wear_law.table is None else "wear_coefficient times wear.factor"
    times, side = (worst / OF_THE_PAPER, "larger") if worst > OF_THE_PAPER else (OF_THE_PAPER / worst, "smaller")
    text = f"{what} {worst:.3g} 1/Pa is {times:.1g} times {side} than the default, {OF_THE_PAPER:g} 1/Pa"
    units = [
        f"in {name} (then it is {worst * factor:.3g} 1/Pa)"
        for name, factor in _UNITS.items()
        if worst > OF_THE_PAPER and _is_plausible(worst * factor)
    ]
    return (f"{text}: is it {' or '.join(units)}?" if units else text,)


def _coefficients(study: Study) -> list[float]:
    """Wear coefficients above 0, 1/Pa; with a wear table times each of its factors."""
    table = study.wear_law.table
    factors = [1.0] if table is None else [factor for row in table.factor for factor in row if factor > 0.0]
    return [value * factor for value in study.axes.wear_coefficient if value > 0.0 for factor in factors]


def _is_plausible(value: float) -> bool:
    """Whether a wear coefficient, 1/Pa, need not be asked about."""
    return PLAUSIBLE[0] <= value <= PLAUSIBLE[1]

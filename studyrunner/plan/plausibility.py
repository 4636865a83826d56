"""What of a study is hardly what was meant, as a unit that was mixed up. Never a refusal.

Each remark is one line; a run prints it on stderr when it begins.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from studyrunner.scene.scene import SceneFacts
    from studyrunner.study.study import Study

OF_THE_PAPER = 1.1e-11
"""The default, 1/Pa, which is that of the reference."""

PLAUSIBLE = (1.9e-17, 4e-10)
"""Wear coefficients, 1/Pa, that are not asked about: a factor of 1000 around what was measured of metals, 1.9e-14
(steel; McColl, Ding and Leen, Wear 256 (2004) 1114) to 4e-13 (Ti-6Al-4V, 4e-4 mm3/J), as studies wear faster than
machines. Energy coefficients are Archard's over the friction coefficient, which is little beside this factor."""

_UNITS = {"1/MPa or mm2/N": 1e-6, "mm3/(N m) or mm3/J": 1e-9}
"""What else wear coefficients are given in, and how much of 1/Pa it is."""


_LARGEST_FRICTION = 2.0
"""Coulomb friction coefficients that are not asked about: dry metals in air stay below 1.5."""

_SLOWEST = 1000.0
"""rpm; rotation speeds below it are asked about: machines whose blades wear turn faster, and 314 rad/s is 3000 rpm."""

_FAR_BELOW = 30.0
"""Times the frequency of an excitation, below the first resonance, from which on it is asked about."""


def doubts_of_study(study: Study, facts: SceneFacts | None = None) -> tuple[str, ...]:
    """Lines on values far off, before anything is computed, one for a key: the value farthest off speaks for all.

    facts: of the scene, where it is built.
    """
    asked = (_on_wear(study), _on_friction(study), _on_speed(study), _on_low_frequencies(study, facts))
    return tuple(line for line in asked if line)


def _on_friction(study: Study) -> str:
    largest = max(_numbers(study, "friction_coefficient"), default=0.0)
    if largest <= _LARGEST_FRICTION:
        return ""
    asked = f"is it in percent (then it is {largest / 100.0:.3g})" if largest >= 5.0 else "is it meant"
    return f"friction_coefficient {largest:.3g} is more than dry metals have, 0.1 to 1.5: {asked}?"


def _on_speed(study: Study) -> str:
    slow = [speed for speed in _numbers(study, "rotation_speed") if 0.0 < speed < _SLOWEST]
    if not slow:
        return ""
    radians, hertz = 30.0 / math.pi * min(slow), 60.0 * min(slow)
    units = f"in rad/s (then it is {radians:.5g} rpm) or in revolutions per second (then it is {hertz:.5g} rpm)"
    return f"rotation_speed {min(slow):.4g} rpm is slow: is it {units}?"


def _on_low_frequencies(study: Study, facts: SceneFacts | None) -> str:
    stuck = None if facts is None else facts.stuck_frequency
    highest = max((max(each.axes.frequency) for each in study.block_studies or (study,)), default=0.0)
    passed = [block.frequency for block in study.mission if isinstance(block.frequency, dict)]
    highest = max(highest, *(max(each["start"], each["stop"]) for each in passed)) if passed else highest
    if (
        not study.kind.counted
        or study.axes.frequency_ratio
        or stuck is None
        or not _FAR_BELOW * highest < stuck < math.inf
    ):
        return ""
    ratio = stuck / highest
    kilohertz = 1000.0 * highest
    meant = _FAR_BELOW * kilohertz > stuck and kilohertz < _FAR_BELOW * stuck
    asked = f"is it in kHz (then it is {kilohertz:.4g} Hz)" if meant else "is it meant"
    text = f"frequency {highest:.4g} Hz, the highest, is 1/{ratio:.0f} of that of the first resonance, near"
    return f"{text} {stuck:.4g} Hz: {asked}?"


def _numbers(study: Study, name: str) -> list[float]:
    """Numbers under a key of [scene], of all variants and blocks."""
    variants = study.variants or (study,)
    studies = (*variants, *(block for each in variants for block in each.block_studies))
    values = [dict(each.scene.parameters).get(name) for each in studies]
    values += [each for value in values if isinstance(value, dict) for each in value.values()]
    return [float(value) for value in values if isinstance(value, int | float)]


def _on_wear(study: Study) -> str:
    off = [value for value in _coefficients(study) if not _is_plausible(value)]
    if not off:
        return ""
    worst = max(off, key=lambda value: abs(math.log(value / OF_THE_PAPER)))
    what = "wear_coefficient" if study.wear_law.table is None else "wear_coefficient times wear.factor"
    times, side = (worst / OF_THE_PAPER, "larger") if worst > OF_THE_PAPER else (OF_THE_PAPER / worst, "smaller")
    text = f"{what} {worst:.3g} 1/Pa is {times:.1g} times {side} than the default, {OF_THE_PAPER:g} 1/Pa"
    units = [
        f"in {name} (then it is {worst * factor:.3g} 1/Pa)"
        for name, factor in _UNITS.items()
        if worst > OF_THE_PAPER and _is_plausible(worst * factor)
    ]
    return f"{text}: is it {' or '.join(units)}?" if units else text


def _coefficients(study: Study) -> list[float]:
    """Wear coefficients above 0, 1/Pa; with a wear table times each of its factors."""
    table = study.wear_law.table
    factors = [1.0] if table is None else [factor for row in table.factor for factor in row if factor > 0.0]
    return [value * factor for value in study.axes.wear_coefficient if value > 0.0 for factor in factors]


def _is_plausible(value: float) -> bool:
    """Whether a wear coefficient, 1/Pa, need not be asked about."""
    return PLAUSIBLE[0] <= value <= PLAUSIBLE[1]

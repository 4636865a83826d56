"""One line of a summary, a finding, and the words in which it says numbers and points.

Only results are in findings: a history that was not computed to the end, or is known to a factor of two only, has no
number.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from studyrunner.result.view import Point, Result
from studyrunner.units import scale_for, show_known

LEAST_ERROR = 1e-4
"""Relative error that is shown, of any smaller one."""


@dataclass(frozen=True)
class Finding:
    """One line of a summary. name: of what it says. label, text: as printed. values: its numbers in SI, and words.

    Errors are absolute, inf where not known, NaN where the file has none.
    """

    name: str
    label: str
    text: str
    values: Mapping[str, Any] = field(default_factory=dict)


def where_is(result: Result, point: Point) -> str:
    """A point in words, along the axes that vary; where none does, its frequency."""
    return result.describe(point, result.varying or ("frequency",)) or "the only point"


def show(value: float, units: str) -> str:
    """A number in SI with a prefix of its unit."""
    return scale_for(units, value).show(value)


def with_error(value: float, error: float, units: str) -> str:
    """A number with its error: "1.52 mm3 ± 1.3 %"."""
    if math.isnan(value):
        return "not known"
    # of nothing only whether it is known
    return show(value, units) + show_known(max(error / value, LEAST_ERROR) if value > 0.0 else 0.0 * error)

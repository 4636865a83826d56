"""The assumption that wear is small: what is worn off is little against the dimensions of the contact.

The reference takes the depth of the wear for "very small compared with the dimension of the structures in contact", so
that mass, stiffness and the places of the pairs stay as they were designed. The dimension is that of a contact surface,
the smallest that counts; it is the same however finely the surface is divided into pairs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from studyrunner.plan.point_text import describe_point
from studyrunner.plan.sharing import Index
from studyrunner.scene.scene import SceneFacts
from studyrunner.study.study import Study
from studyrunner.summary.plausibility import wears_too_fast

SMALL = 0.1
"""Largest depth over the width of the contact that is called small: slopes and stiffness change by that order."""

_ONE_PLACE = 1e-6  # of the side of a square: pairs that are no farther apart say nothing of the size of their surface


class SmallWear:
    """Collects the deepest wear from records of histories; their order does not matter."""

    def __init__(self, study: Study, facts: SceneFacts) -> None:
        self._study = study
        self._width = contact_width(facts)
        self._n_beyond = 0
        self._worst: tuple[float, Index] | None = None

    def add(self, points: Sequence[tuple[Index, ...]], records: NDArray[np.void]) -> None:
        """Records (n,) as in `records`, and the points that each of them is of."""
        ratios = records["largest_wear_depth"] / self._width
        self._n_beyond += sum(len(points[row]) for row in np.flatnonzero(ratios > SMALL).tolist())
        known = np.nan_to_num(ratios, nan=-1.0)
        largest = float(known.max(initial=-1.0))
        if largest >= 0.0:
            point = min(min(points[row]) for row in np.flatnonzero(known == largest).tolist())
            if self._worst is None or (-largest, point) < (-self._worst[0], self._worst[1]):
                self._worst = (largest, point)

    def format(self) -> str:
        """One line: the largest depth over the width of the contact; where that is not small, where and why."""
        if self._worst is None:
            return "nothing was computed"
        ratio, point = self._worst
        if ratio <= SMALL:
            return f"depth over contact width at most {ratio:.2g}"
        where = describe_point(self._study, point)
        at = f" at {where}" if where else ""
        all_of_them = f", above {SMALL:g} at {self._n_beyond} points" if self._n_beyond > 1 else ""
        # wear that deep comes from a sensible coefficient as well
        remedy = "is wear_coefficient in 1/Pa?" if wears_too_fast(self._study) else "take fewer cycles"
        return f"NOT MET: depth over contact width ({self._width:.2g} m) is {ratio:.2g}{at}{all_of_them}: {remedy}"

    @property
    def is_met(self) -> bool:
        """Whether it holds as far as is known."""
        return self._worst is None or self._worst[0] <= SMALL


def contact_width(facts: SceneFacts) -> float:
    """The shorter side of the narrowest contact surface, m, as a rectangle of its area and its second moment.

    A rectangle of length L has `L^2 / 12` times its area as second moment about the middle. Strips, whose length is in
    no position, are as wide as their row is long; without positions, and for a single pair, the side of a square.
    """
    surfaces = np.array(facts.surface)
    return min(_width(facts.position[surfaces == one], facts.area[surfaces == one]) for one in np.unique(surfaces))


def _width(position: NDArray[np.float64], area: NDArray[np.float64]) -> float:
    """The same of one surface: position (n, 3), m, and area (n,), m2, of its pairs."""
    whole = float(area.sum())
    if not np.isfinite(position).all():
        return math.sqrt(whole)
    apart = position - area @ position / whole
    length = math.sqrt(12.0 * float(np.linalg.eigvalsh((apart.T * area) @ apart)[-1]) / whole)
    # pairs of no length are at one place
    return min(length, whole / length) if length > _ONE_PLACE * math.sqrt(whole) else math.sqrt(whole)

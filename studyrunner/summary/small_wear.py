"""The assumption that wear is small: what is worn off is little against the distance between contact pairs.

The joint is computed as it was designed, pair by pair: a depth like the distance between pairs changes its shape.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from studyrunner.plan.places import describe_point
from studyrunner.plan.sharing import Index
from studyrunner.scene.scene import SceneFacts
from studyrunner.study.study import Study

SMALL = 0.1
"""Largest depth over the distance between pairs that is called small."""

_SAME_PLACE = 1e-9  # of the extent of a surface: pairs at one place are not neighbours


class SmallWear:
    """Collects the deepest wear from records of histories; their order does not matter."""

    def __init__(self, study: Study, facts: SceneFacts) -> None:
        self._study = study
        self._spacing = pair_spacing(facts)
        self._n_beyond = 0
        self._worst: tuple[float, Index] | None = None

    def add(self, points: Sequence[tuple[Index, ...]], records: NDArray[np.void]) -> None:
        """Records (n,) as in `records`, and the points that each of them is of."""
        ratios = records["largest_wear_depth"] / self._spacing
        self._n_beyond += sum(len(points[row]) for row in np.flatnonzero(ratios > SMALL).tolist())
        known = np.nan_to_num(ratios, nan=-1.0)
        largest = float(known.max(initial=-1.0))
        if largest >= 0.0:
            point = min(min(points[row]) for row in np.flatnonzero(known == largest).tolist())
            if self._worst is None or (-largest, point) < (-self._worst[0], self._worst[1]):
                self._worst = (largest, point)

    def format(self) -> str:
        """One line: the largest depth over the distance between pairs; where that is not small, where and why."""
        if self._worst is None:
            return "nothing was computed"
        ratio, point = self._worst
        if ratio <= SMALL:
            return f"depth over pair spacing at most {ratio:.2g}"
        where = describe_point(self._study, point)
        at = f" at {where}" if where else ""
        all_of_them = f", above {SMALL:g} at {self._n_beyond} points" if self._n_beyond > 1 else ""
        remedy = "is wear_coefficient in 1/Pa? If it is, take fewer cycles"
        return f"NOT MET: depth over pair spacing ({self._spacing:.2g} m) is {ratio:.2g}{at}{all_of_them}: {remedy}"

    @property
    def is_met(self) -> bool:
        """Whether it holds as far as is known."""
        return self._worst is None or self._worst[0] <= SMALL


def pair_spacing(facts: SceneFacts) -> float:
    """Smallest distance between neighbouring pairs of one surface, m; the side of a pair where positions do not say."""
    surfaces = np.array(facts.surface)
    found: list[float] = []
    for surface in np.unique(surfaces):
        own = facts.position[surfaces == surface]
        distance = _nearest(own) if np.isfinite(own).all() else None
        found.append(float(np.sqrt(facts.area[surfaces == surface].min())) if distance is None else distance)
    return min(found)


def _nearest(position: NDArray[np.float64]) -> float | None:
    """Smallest distance between two of the places; None where there is one place only."""
    extent = float(np.ptp(position, axis=0).max())
    places = np.unique(position, axis=0)
    if len(places) < 2 or extent == 0.0:
        return None
    nearest = cKDTree(places).query(places, k=2)[0][:, 1]
    apart = nearest[nearest > _SAME_PLACE * extent]
    return float(apart.min()) if apart.size else None

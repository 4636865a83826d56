"""Where the resonance moves while the joint wears, over all points of a study whose frequency follows the resonance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from studyrunner.plan.point_text import describe_point
from studyrunner.plan.sharing import Index
from studyrunner.study.study import Study


class FollowedFrequencies:
    """Collects the frequencies from records of histories; their order does not matter."""

    def __init__(self, study: Study) -> None:
        self._study = study
        self._n_points = 0
        self._farthest: tuple[float, Index, float, float] | None = None

    def add(self, points: Sequence[tuple[Index, ...]], records: NDArray[np.void]) -> None:
        """Records (n,) as in `records`, and the points that each of them is of."""
        if self._study.follow is None or "excitation_frequency" not in (records.dtype.names or ()):
            return
        for row, frequencies in enumerate(records["excitation_frequency"]):
            known = frequencies[np.isfinite(frequencies)]
            if known.size:
                first, last = float(known[0]), float(known[-1])
                self._n_points += len(points[row])
                found = (-abs(last - first), min(points[row]), first, last)
                self._farthest = found if self._farthest is None else min(self._farthest, found)

    def rows(self) -> list[tuple[str, str]]:
        """Label and text of one line; none where no frequency is followed or found."""
        if self._farthest is None or self._study.follow is None:
            return []
        _, point, first, last = self._farthest
        word, where = self._study.follow.of, describe_point(self._study, point)
        if self._study.cycles_kept[-1] == 0.0:
            said = f"the {word} is at {first:.6g} Hz"
        else:
            said = f"the {word} moves from {first:.6g} to {last:.6g} Hz"
        at = f" at {where}, farthest of {self._n_points} points" if where and self._n_points > 1 else ""
        return [("frequency", said + at)]

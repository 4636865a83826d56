"""How well the worn volume is known over all points of a study: to `rtol`, less well, the worst, and what to do."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from solver.outcome import COMPLETE
from studyrunner.advice import advise_error
from studyrunner.percent import show_percent, show_rtol
from studyrunner.plan.point_text import describe_point, settings_of
from studyrunner.plan.sharing import Index
from studyrunner.study.study import Study
from studyrunner.system.progress import count


class WornVolumes:
    """Collects the errors of the last worn volumes from records of histories; their order does not matter."""

    def __init__(self, study: Study) -> None:
        self._study = study
        self._n_known = self._n_less = self._n_unknown = 0
        self._worst: tuple[bool, float, Index, list[float]] | None = None

    def add(self, points: Sequence[tuple[Index, ...]], records: NDArray[np.void]) -> None:
        """Records (n,) as in `records`, and the points that each of them is of."""
        complete = np.isin(records["outcome"], list(COMPLETE))
        for row in np.flatnonzero(complete).tolist():
            error = float(records["error_estimate"][row])
            if math.isnan(error):
                self._n_unknown += len(points[row])
                continue
            less = [point for point in points[row] if error > rtol_of(self._study, point)]
            self._n_less += len(less)
            self._n_known += len(points[row]) - len(less)
            # each is held against its own rtol: one that is above it is worse than any that is not
            first = min(less or points[row])
            if self._worst is None or (not less, -error, first) < (self._worst[0], -self._worst[1], self._worst[2]):
                there = "wear_rate_error" in (records.dtype.names or ())
                rates = records["wear_rate_error"][row].tolist() if there else []
                self._worst = (not less, error, first, rates)

    def format(self) -> str:
        """One line: how many points are known to `rtol`, how many less well, the worst, and what would help there."""
        study = self._study
        if study.cycles_kept[-1] == 0.0:
            return "not asked for: slow_time.cycles = 0"
        total = math.prod(len(values) for values in study.dimensions.values())
        rtol = f"rtol = {show_rtol(study.rtol[0])}" if len(study.rtol) == 1 else "their rtol"
        text = f"{self._n_known} of {count(total, 'point')} known to {rtol}"
        n_short = total - self._n_known - self._n_less - self._n_unknown
        for number, what in ((self._n_less, "less well"), (n_short, "not computed to the end")):
            text += f", {number} {what}" if number else ""
        text += f", {self._n_unknown} never estimated" if self._n_unknown else ""
        if self._worst is None:
            return text
        is_known, error, point, rates = self._worst
        where, aim = describe_point(study, point), rtol_of(study, point)
        text += f"; worst {show_percent(error, aim)}" + (f" at {where}" if where else "")
        return text if is_known else f"{text}: {advise_error(error, rates, settings_of(study, point))}"


def rtol_of(study: Study, point: Index) -> float:
    """The `rtol` of a point."""
    names = list(study.dimensions)
    return study.rtol[point[names.index("rtol")] if "rtol" in names else 0]

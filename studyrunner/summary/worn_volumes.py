"""How well the worn volume is known over all points of a study: within `rtol`, above it, the worst, and what to do."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from solver.outcome import COMPLETE
from studyrunner.plan.places import describe_point, show_percent
from studyrunner.plan.sharing import Index
from studyrunner.study.study import AUTO, Study
from studyrunner.system.progress import count

_OF_STATES = 0.5
"""Fraction of the error of a worn volume from which on that of the wear rate is what it comes from."""


class WornVolumes:
    """Collects the errors of the last worn volumes from records of histories; their order does not matter."""

    def __init__(self, study: Study) -> None:
        self._study = study
        names = list(study.dimensions)
        self._rtol_axis = names.index("rtol") if "rtol" in names else None
        self._n_within = self._n_above = self._n_unknown = 0
        self._worst: tuple[float, Index, bool] | None = None

    def add(self, points: Sequence[tuple[Index, ...]], records: NDArray[np.void]) -> None:
        """Records (n,) as in `records`, and the points that each of them is of."""
        complete = np.isin(records["outcome"], list(COMPLETE))
        for row in np.flatnonzero(complete).tolist():
            error = float(records["error_estimate"][row])
            if math.isnan(error):
                self._n_unknown += len(points[row])
                continue
            n_within = sum(error <= self._rtol(point) for point in points[row])
            self._n_within += n_within
            self._n_above += len(points[row]) - n_within
            first = min(points[row])
            if self._worst is None or (-error, first) < (-self._worst[0], self._worst[1]):
                rates = np.nan_to_num(records["wear_rate_error"][row], posinf=np.inf)
                self._worst = (error, first, bool(rates.max() >= _OF_STATES * error > 0.0))

    def format(self) -> str:
        """One line: how many points are within `rtol`, how many above, the worst, and what would make it better."""
        study = self._study
        if study.cycles_kept[-1] == 0.0:
            return "not asked for: slow_time.cycles = 0"
        total = math.prod(len(values) for values in study.dimensions.values())
        rtol = f"rtol = {show_percent(study.rtol[0])}" if len(study.rtol) == 1 else "their rtol"
        text = f"{self._n_within} of {count(total, 'point')} within {rtol}"
        n_short = total - self._n_within - self._n_above - self._n_unknown
        for number, what in ((self._n_above, "above it"), (n_short, "without one at the last cycle")):
            text += f", {number} {what}" if number else ""
        text += f", {self._n_unknown} never estimated" if self._n_unknown else ""
        if self._worst is None:
            return text
        error, point, of_states = self._worst
        where = describe_point(study, point)
        text += f"; worst {show_percent(error)}" + (f" at {where}" if where else "")
        return text if error <= self._rtol(point) else f"{text}: {self._remedy(point, of_states)}"

    def _rtol(self, point: Index) -> float:
        return self._study.rtol[0 if self._rtol_axis is None else point[self._rtol_axis]]

    def _remedy(self, point: Index, of_states: bool) -> str:
        study, names = self._study, list(self._study.dimensions)
        if of_states and AUTO not in study.harmonics:
            return 'harmonics = "auto"'
        scheme = study.axes.scheme[point[names.index("scheme")]]
        if scheme in ("adaptive", "final"):
            return "a smaller rtol"
        shorter = "a smaller step"
        if scheme == "explicit" and study.slow_time.largest_depth is not None:
            shorter = "a smaller slow_time.largest_depth"
        return f'scheme = "adaptive" or {shorter}'

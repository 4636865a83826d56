"""The last lines of a run of nonlinear modes: frequency and damping of each mode, and how well they are known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from solver.outcome import COMPLETE
from studyrunner.percent import show_rtol
from studyrunner.plan.sharing import Index
from studyrunner.study.study import Study
from studyrunner.system.progress import count


class ModeTable:
    """Collects the ranges of frequency and damping from records of points; their order does not matter."""

    def __init__(self, study: Study) -> None:
        self._study = study
        self._axis = list(study.dimensions).index("mode")
        self._numbers = study.axes.mode or ()
        self._ranges = np.array([[[np.inf, -np.inf]] * 2] * len(self._numbers))
        self._n_points = np.zeros((len(self._numbers), 2), np.intp)

    def add(self, points: Sequence[tuple[Index, ...]], records: NDArray[np.void]) -> None:
        """Adds records (n,), and the points of each record."""
        complete = np.isin(records["outcome"], list(COMPLETE))
        for of_one, record, is_complete in zip(points, records, complete.tolist(), strict=True):
            mode = of_one[0][self._axis]
            self._n_points[mode] += [len(of_one), len(of_one) * is_complete]
            if is_complete:
                for place, name in enumerate(("natural_frequency", "damping_ratio")):
                    low, high = self._ranges[mode, place]
                    self._ranges[mode, place] = min(low, record[name]), max(high, record[name])

    def format(self) -> str:
        """A line for each mode."""
        rows = []
        rtol = f"rtol = {show_rtol(self._study.rtol[0])}" if len(self._study.rtol) == 1 else "their rtol"
        for number, (frequency, damping), (n_all, n_complete) in zip(
            self._numbers, self._ranges, self._n_points, strict=True
        ):
            if not n_complete:
                rows.append(f"mode {number}: found at none of {count(int(n_all), 'point')}")
                continue
            hertz = " to ".join(f"{value:.6g}" for value in frequency)
            percent = " to ".join(f"{100.0 * value:.3g}" for value in damping)
            rows.append(
                f"mode {number}: {hertz} Hz, damping {percent} %, found at {n_complete} of {count(int(n_all), 'point')}"
                f" (aim: {rtol})"
            )
        return "\n".join(rows)

    def doubts(self) -> tuple[str, ...]:
        """No doubts: nothing is excited, and nothing wears."""
        return ()

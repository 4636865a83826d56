"""One line on the lives of the points of a study with a target: cycles or missions until `slow_time.until`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from solver.outcome import COMPLETE
from studyrunner.percent import show_percent
from studyrunner.plan.point_text import describe_point, show_count
from studyrunner.plan.sharing import Index
from studyrunner.study.study import Study
from studyrunner.system.progress import count


class Lives:
    """Collects lives and their errors from records of histories; their order does not matter."""

    def __init__(self, study: Study) -> None:
        self._study = study
        self._name = "missions_to_target" if study.has_missions else "cycles_to_target"
        self._shortest: tuple[float, Index, float] | None = None
        self._n_beyond = 0

    def add(self, points: Sequence[tuple[Index, ...]], records: NDArray[np.void]) -> None:
        """Adds records (n,), and the points of each record."""
        for row in np.flatnonzero(np.isin(records["outcome"], list(COMPLETE))).tolist():
            life, error = (float(records[name][row]) for name in (self._name, f"{self._name}_error"))
            if np.isnan(life):
                self._n_beyond += len(points[row])
                continue
            found = life, min(points[row]), error
            self._shortest = found if self._shortest is None else min(self._shortest, found)

    def rows(self) -> list[tuple[str, str]]:
        """The shortest life with its error, and how many points do not reach the target; none without a target."""
        target = self._study.until
        if target is None:
            return []
        beyond = f"not reached by {count(self._n_beyond, 'point')}" if self._n_beyond else ""
        text = beyond or "nothing was computed"
        if self._shortest is not None:
            life, point, error = self._shortest
            where = describe_point(self._study, point)
            known = f"+- {error:.2g} ({show_percent(error / life)})" if np.isfinite(error) else "with an unknown error"
            text = f"{show_count(round(life))} {known}"
            text += f" at {where}, the shortest" if where else ""
            text += f"; {beyond}" if beyond else ""
        return [(f"{self._name.partition('_')[0]} to {target.quantity}", text)]

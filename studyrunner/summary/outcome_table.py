"""Which outcomes came where wear, step and load go to their extremes, and how many of each are known to `rtol`.

By hand: `rich.table` wraps at the width of the terminal, in logs as well.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from solver.outcome import COMPLETE, Outcome
from studyrunner.plan.point_text import describe_value
from studyrunner.plan.sharing import Index
from studyrunner.study.study import Study
from studyrunner.summary.worn_volumes import rtol_of

_ACROSS = ("excitation_amplitude", "step", "wear_coefficient")
_DOWN = ("wear_coefficient", "step", "excitation_amplitude")
_MOST_ACROSS, _MOST_DOWN = 6, 24


class OutcomeTable:
    """Counts outcomes over wear coefficient (or step) and excitation; empty where two of them do not vary.

    In brackets stands how many worn volumes of a cell are known to `rtol`, as an outcome does not say.
    """

    def __init__(self, study: Study) -> None:
        sizes = {name: len(values) for name, values in study.dimensions.items()}
        across = next((name for name in _ACROSS if 1 < sizes.get(name, 1) <= _MOST_ACROSS), "")
        down = next((name for name in _DOWN if name != across and 1 < sizes.get(name, 1) <= _MOST_DOWN), "")
        self._study = study
        self._wears = study.cycles_kept[-1] > 0.0
        self._axes = (down, across) if down and across else None
        self._counts: Counter[tuple[int, int, int]] = Counter()
        self._known: Counter[tuple[int, int]] = Counter()

    def add(self, points: Sequence[tuple[Index, ...]], records: NDArray[np.void]) -> None:
        """Records (n,) as in `records`, and the points that each of them is of."""
        if self._axes is None:
            return
        down, across = (list(self._study.dimensions).index(name) for name in self._axes)
        ends = zip(points, records["outcome"].tolist(), records["error_estimate"].tolist(), strict=True)
        for of_one, outcome, error in ends:
            for point in of_one:
                self._counts[point[down], point[across], outcome] += 1
                known = outcome in COMPLETE and error <= rtol_of(self._study, point)
                self._known[point[down], point[across]] += known

    def rows(self) -> list[tuple[str, str]]:
        """Label and text of each line, the first of which says what stands across."""
        if self._axes is None:
            return []
        dimensions = self._study.dimensions
        down, across = (dimensions[name] for name in self._axes)
        each = math.prod(len(values) for values in dimensions.values()) // (len(down) * len(across))
        cells = [[describe_value(self._study, self._axes[1], value) for value in across]]
        cells += [[self._cell(row, column, each) for column in range(len(across))] for row in range(len(down))]
        widths = [max(len(line[column]) for line in cells) for column in range(len(across))]
        head = "outcomes (known to rtol)" if self._wears else "outcomes"
        labels = [head, *(f"  {describe_value(self._study, self._axes[0], value)}" for value in down)]
        texts = [" | ".join(map(str.ljust, line, widths)).rstrip() for line in cells]
        return list(zip(labels, texts, strict=True))

    def _cell(self, row: int, column: int, each: int) -> str:
        found = {ending: self._counts[row, column, ending] for ending in Outcome}
        missing = each - sum(found.values())
        texts = [
            f"{number + (missing if ending == Outcome.NOT_COMPUTED else 0)} {ending.meaning}"
            for ending, number in found.items()
            if number + (missing if ending == Outcome.NOT_COMPUTED else 0)
        ]
        return ", ".join(texts) + (f" ({self._known[row, column]})" if self._wears else "")

"""Wear at the edge of the contact: right where the bodies end there, and a sign of too few pairs where they do not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.outcome import COMPLETE
from studyrunner.percent import show_percent
from studyrunner.plan.point_text import describe_point
from studyrunner.plan.sharing import Index
from studyrunner.scene.scene import SceneFacts
from studyrunner.study.study import Study

_NOTICED = 0.01
"""Of the worn volume of a point: surfaces with less have no say."""


@dataclass(frozen=True, order=True)
class _Worn:
    """How much of the volume of a surface is worn at its edge, with a sign for the order: the most comes first."""

    less: float
    point: Index
    surface: str
    deepest: bool


class EdgeWear:
    """Collects it from the last depths of records of histories; their order does not matter."""

    def __init__(self, study: Study, facts: SceneFacts) -> None:
        self._study, self._facts = study, facts
        self._edge = np.zeros(len(facts.surface), np.bool_) if facts.edge is None else facts.edge
        labels = np.array(facts.surface)
        self._surfaces = [(name, labels == name) for name in np.unique(labels) if self._edge[labels == name].any()]
        self._told = False
        self._worst: _Worn | None = None

    def add(self, points: Sequence[tuple[Index, ...]], records: NDArray[np.void]) -> None:
        """Records (n,) as in `records`, and the points that each of them is of."""
        if not self._surfaces or "wear_depth" not in (records.dtype.names or ()):
            return
        for row in np.flatnonzero(np.isin(records["outcome"], list(COMPLETE))).tolist():
            depth = records["wear_depth"][row]
            depth = depth[np.isfinite(depth).all(axis=1)]
            if len(depth):
                self._told = True
                self._add(min(points[row]), depth[-1])

    def rows(self) -> list[tuple[str, str]]:
        """Label and text of one line; none where positions or depths do not say."""
        return [("wear at the edge of the contact", self._format())] if self._told else []

    def _add(self, point: Index, depth: NDArray[np.float64]) -> None:
        """Last depths (n_contact,), m, of a point."""
        volume = depth * self._facts.area
        for name, own in self._surfaces:
            whole, at_edge = float(volume[own].sum()), float(volume[own & self._edge].sum())
            if at_edge > 0.0 and whole > _NOTICED * float(volume.sum()):
                deepest = bool(self._edge[own][np.argmax(depth[own])])
                worn = _Worn(-at_edge / whole, point, str(name), deepest)
                self._worst = worn if self._worst is None else min(self._worst, worn)

    def _format(self) -> str:
        if self._worst is None:
            return "none"
        worst, area = self._worst, self._facts.area
        own = np.array(self._facts.surface) == worst.surface
        of_area = float(area[own & self._edge].sum() / area[own].sum())
        where = describe_point(self._study, worst.point)
        text = f"up to {show_percent(-worst.less)} of the wear of {worst.surface or 'all pairs'}"
        text += f" ({show_percent(of_area)} of its area)"
        text += ", the deepest pair too" if worst.deepest else ""
        text += f", at {where}" if where else ""
        if worst.deepest or -worst.less > of_area:
            text += ": right where the bodies end, else add pairs"
        return text

"""The last lines of a run of missions: worn volumes, which blocks wear, the life where there is a target."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from solver.outcome import COMPLETE
from studyrunner.percent import show_percent
from studyrunner.plan.point_text import describe_point
from studyrunner.plan.sharing import Index
from studyrunner.scene.scene import SceneFacts
from studyrunner.study.study import Study
from studyrunner.summary.edge_wear import EdgeWear
from studyrunner.summary.lives import Lives
from studyrunner.summary.mesh_change import MeshChange
from studyrunner.summary.outcome_table import OutcomeTable
from studyrunner.summary.plausibility import doubts_of_study
from studyrunner.summary.small_wear import SmallWear
from studyrunner.summary.worn_volumes import WornVolumes


class MissionTable:
    """Collects the table from records of mission histories; their order does not matter."""

    def __init__(self, study: Study, facts: SceneFacts) -> None:
        self._study = study
        self._volumes = WornVolumes(study)
        self._small = SmallWear(study, facts)
        self._edge = EdgeWear(study, facts)
        self._mesh = MeshChange(study)
        self._outcomes = OutcomeTable(study)
        self._most: tuple[float, Index, NDArray[np.float64]] | None = None
        self._lives = Lives(study)

    def add(self, points: Sequence[tuple[Index, ...]], records: NDArray[np.void]) -> None:
        """Adds records (n,), and the points of each record."""
        for collected in (self._volumes, self._small, self._edge, self._mesh, self._outcomes, self._lives):
            collected.add(points, records)
        for row in np.flatnonzero(np.isin(records["outcome"], list(COMPLETE))).tolist():
            record, first = records[row], min(points[row])
            reached = np.flatnonzero(np.isfinite(record["worn_volume"]))
            volume = float(record["worn_volume"][reached[-1]])
            if volume > 0.0 and (self._most is None or (-volume, first) < (-self._most[0], self._most[1])):
                self._most = (volume, first, record["block_worn_volume"][reached[-1]] / volume)

    def format(self) -> str:
        """Table in lines."""
        rows = [("worn volume", self._volumes.format()), *self._mesh.rows(), ("wear by block", self._blocks())]
        rows.extend(self._lives.rows())
        rows.append(("small-wear assumption", self._small.format()))
        rows.extend(self._edge.rows())
        rows.extend(self._outcomes.rows())
        width = max(len(label) for label, _ in rows)
        return "\n".join(f"{label:<{width}}  {text}" for label, text in rows)

    def doubts(self) -> tuple[str, ...]:
        """Lines on values that are probably not intended: wear coefficient, wear depth."""
        depth = () if self._small.is_met else (f"small-wear assumption {self._small.format()}",)
        return (*doubts_of_study(self._study), *depth)

    def _blocks(self) -> str:
        """Shares of the blocks in the worn volume of the point that wears most."""
        if self._most is None:
            return "none"
        _, point, shares = self._most
        where = describe_point(self._study, point)
        parts = (
            f"{block.name} {show_percent(float(share))}"
            for block, share in zip(self._study.mission, shares, strict=True)
        )
        return ", ".join(parts) + (f" at {where}" if where else "")

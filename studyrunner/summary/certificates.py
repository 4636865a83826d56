"""Table of the accuracy of a run: worn volumes, outcomes, largest errors of states, folds and jumps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.outcome import COMPLETE
from studyrunner.plan.sharing import Index
from studyrunner.scene.scene import SceneFacts
from studyrunner.study.study import Study
from studyrunner.summary.edge_wear import EdgeWear
from studyrunner.summary.followed_frequency import FollowedFrequencies
from studyrunner.summary.lives import Lives
from studyrunner.summary.mesh_change import MeshChange
from studyrunner.summary.outcome_table import OutcomeTable
from studyrunner.summary.plausibility import Doubts, doubts_of_study
from studyrunner.summary.small_wear import SmallWear
from studyrunner.summary.worn_volumes import WornVolumes
from studyrunner.system.progress import count
from studyrunner.variables import CERTIFICATE

_NOT_OF_A_SWEEP = ("wear_coefficient", "step", "scheme")
_FOLDS_NAMED = 5

_ROUND_OFF = float(np.finfo(float).eps)
"""Certificates are relative: less than this is none, wherever it is the most."""


@dataclass(frozen=True, order=True)
class _Place:
    """A point of a study and a count among the cycles kept; None for the point as a whole. Ordered as in the file."""

    point: Index
    cycle: int | None = None


@dataclass
class _Noted:
    """Number of cases, and the first case."""

    n: int = 0
    first: Index | None = None

    def add(self, point: Index) -> None:
        """Adds a case."""
        self.n += 1
        self.first = point if self.first is None else min(self.first, point)


class CertificateTable:
    """Collects the table from the records of histories, in any order, some at a time.

    The table keeps the largest errors and counts only, whatever the number of points.
    """

    def __init__(self, study: Study, facts: SceneFacts) -> None:
        self._study = study
        self._volumes = WornVolumes(study)
        self._small = SmallWear(study, facts)
        self._edge = EdgeWear(study, facts)
        self._frequencies = FollowedFrequencies(study)
        self._mesh = MeshChange(study)
        self._lives = Lives(study)
        self._outcomes = OutcomeTable(study)
        self._doubts = Doubts(study, facts)
        self._n_complete = 0
        self._n_histories = 0
        self._worst: dict[str, tuple[float, _Place]] = {}
        self._folds: set[tuple[Index, float]] = set()
        self._first_jump: tuple[float, Index] | None = None
        self._n_jumps = 0
        self._noted = {name: _Noted() for name in ("too long", "unstable")}

    def add(self, points: Sequence[tuple[Index, ...]], records: NDArray[np.void]) -> None:
        """Adds records (n,), and the points of each record."""
        lines = (self._small, self._edge, self._frequencies, self._mesh, self._outcomes, self._doubts)
        for collected in (self._volumes, self._lives, *lines):
            collected.add(points, records)
        complete = np.isin(records["outcome"], list(COMPLETE))
        first = [min(of_one) for of_one in points]
        self._n_histories += int(np.count_nonzero(complete))
        self._n_complete += sum(len(points[row]) for row in _rows(complete))
        for name in CERTIFICATE:
            self._add_worst(name, first, records[name], complete)
        self._add_folds(points, records["fold_frequency"])
        for row in _rows(~np.isnan(records["jump_cycle"])):
            jump = (float(records["jump_cycle"][row]), first[row])
            self._first_jump = jump if self._first_jump is None else min(self._first_jump, jump)
            self._n_jumps += len(points[row])
        self._add_too_long(points, records["step_limit"])
        # a point that reached its target, or its final state directly, has counts without a state
        there = ~np.isnan(records["residual"])
        self._note("unstable", points, complete & np.any((records["stable"] == 0) & there, axis=1))

    def format(self) -> str:
        """Table in lines.

        How well the worn volume is known, what another mesh changes, the shortest life where there is a target, whether
        wear is small, how much of it is at the edge, and outcomes where loads and wear vary. Then the largest value of
        each certificate over all points
        computed to the end, with its place, and how many folds, jumps, too long steps and unstable states there are.
        """
        rows = [("worn volume", self._volumes.format()), *self._mesh.rows(), *self._lives.rows()]
        rows.append(("small-wear assumption", self._small.format()))
        rows.extend(self._edge.rows())
        rows.extend(self._frequencies.rows())
        rows.extend(self._outcomes.rows())
        rows.append(("largest errors of", f"{count(self._n_complete, 'point')} computed to the end"))
        rows.extend((f"  {label}", self._format_worst(name)) for name, label in CERTIFICATE.items())
        rows.append(("folds in the sweeps", self._format_folds()))
        rows.append(("jumps while wearing", self._format_jumps()))
        rows.append(("explicit steps too long", self._format_noted("too long", "longer than step_limit")))
        rows.append(("unstable states", self._format_noted("unstable", "see the variable stable")))
        width = max(len(label) for label, _ in rows)
        return "\n".join(f"{label:<{width}}  {text}" for label, text in rows)

    def doubts(self) -> tuple[str, ...]:
        """Lines on values that are probably not intended: wear coefficient, wear depth, frequencies, amplitudes."""
        depth = () if self._small.is_met else (f"small-wear assumption {self._small.format()}",)
        return (*doubts_of_study(self._study), *depth, *self._doubts.format())

    def _add_worst(
        self, name: str, first: Sequence[Index], values: NDArray[np.float64], complete: NDArray[np.bool_]
    ) -> None:
        """Largest value (n, n_cycles) and its place; the first in the order of the file where several are equal."""
        # None is negative: NaN, which is not estimated, counts below all.
        known = np.where(np.isnan(values) | ~complete[:, None], -1.0, values)
        cycles = known.argmax(axis=1)
        largest = known.max(axis=1)
        value = float(largest.max(initial=-1.0))
        if value < 0.0:
            return
        place = min(_Place(first[row], int(cycles[row])) for row in _rows(largest == value))
        before = self._worst.get(name)
        if before is None or value > before[0] or (value == before[0] and place < before[1]):
            self._worst[name] = (value, place)

    def _add_folds(self, points: Sequence[tuple[Index, ...]], frequencies: NDArray[np.float64]) -> None:
        """Folds at which a sweep left its branch. Points that differ in their wear only share the sweep's folds."""
        kept = [axis for axis, name in enumerate(self._study.dimensions) if name not in _NOT_OF_A_SWEEP]
        for row in _rows(~np.isnan(frequencies)):
            for point in points[row]:
                self._folds.add((tuple(point[axis] for axis in kept), float(frequencies[row])))

    def _add_too_long(self, points: Sequence[tuple[Index, ...]], limits: NDArray[np.float64]) -> None:
        """Points of the explicit scheme whose step is longer than what is predicted to be stable."""
        study = self._study
        if study.slow_time.largest_depth is not None:
            return
        names = list(study.dimensions)
        scheme, step = names.index("scheme"), names.index("step")
        for row in _rows(np.isfinite(limits)):
            for point in points[row]:
                longest = min(study.axes.step[point[step]], study.cycles_kept[-1])
                if study.axes.scheme[point[scheme]] == "explicit" and longest > limits[row]:
                    self._noted["too long"].add(point)

    def _note(self, what: str, points: Sequence[tuple[Index, ...]], where: NDArray[np.bool_]) -> None:
        for row in _rows(where):
            for point in points[row]:
                self._noted[what].add(point)

    def _format_worst(self, name: str) -> str:
        if name not in self._worst:
            return "not estimated" if self._n_histories else "none"
        largest, place = self._worst[name]
        if largest < _ROUND_OFF:
            return "none"
        where = _where(self._study, place)
        return f"{largest:.1e}" + (f" at {where}" if where else "")

    def _format_folds(self) -> str:
        if not self._folds:
            return "none"
        frequencies = sorted({frequency for _, frequency in self._folds})
        more = ", ..." if len(frequencies) > _FOLDS_NAMED else ""
        return f"{len(self._folds)}, at {', '.join(f'{value:.6g} Hz' for value in frequencies[:_FOLDS_NAMED])}{more}"

    def _format_jumps(self) -> str:
        """Points that lost their branch, and the earliest of them."""
        if self._first_jump is None:
            return "none"
        cycle, point = self._first_jump
        where = _where(self._study, _Place(point))
        return f"{self._n_jumps}, the first at cycle {cycle:g}" + (f" at {where}" if where else "")

    def _format_noted(self, what: str, remedy: str) -> str:
        """How many of them, where the first is, and what there is to say."""
        noted = self._noted[what]
        if noted.first is None:
            return "none"
        where = _where(self._study, _Place(noted.first))
        return f"{noted.n}, the first at {where}: {remedy}" if where else f"{noted.n}: {remedy}"


def _rows(where: NDArray[np.bool_]) -> list[int]:
    rows: list[int] = np.flatnonzero(where).tolist()
    return rows


def _where(study: Study, place: _Place) -> str:
    """Coordinates of a place along those dimensions that have more than one value."""
    texts = []
    for (name, values), index in zip(study.dimensions.items(), place.point, strict=True):
        if len(values) > 1:
            value, units = values[index], study.units(name)
            shown = value if isinstance(value, str) else f"{value:.8g}"
            texts.append(f"{name} {shown}" + (f" {units}" if units != "1" else ""))
    if place.cycle is not None and len(study.cycles_kept) > 1:
        texts.append(f"{'output' if study.to_the_end else 'cycle'} {study.cycles_kept[place.cycle]:.8g}")
    return ", ".join(texts)

"""A result file as summary and report read it: axes, points with results, how well they are known, the shown point."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from studyrunner.result.opening import open_known
from studyrunner.result.points import Points
from studyrunner.result.scars import Profile, read_profile
from studyrunner.result.units import show_cycles, show_value
from studyrunner.statistics.samples import SAMPLE
from studyrunner.statistics.study_statistics import statistics_of_file
from studyrunner.user_error import UserError, show_text

NO_VOLUME = 1e-24
"""Volume, m3, below which wear is round-off: a thousand atoms."""

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
"""Probabilities of the bands that figures show."""

_LIKE_CYCLES = {
    "mission": "cycle",
    "last_mission": "last_cycle",
    "missions_to_target": "cycles_to_target",
    "missions_to_target_error": "cycles_to_target_error",
}

Point = Mapping[str, int]
"""Index along each axis. A missing axis stands for all its values."""


@dataclass(frozen=True)
class Result(Points):
    """A result file.

    dataset: read lazily; a variable that was read as a whole stays in memory. fixed: axes of which this holds one value
    of several, and how many the file has. blocks: of missions what belongs to single blocks; in `dataset` missions then
    have the name of cycles. chosen: values of axes of the point that figures of a single point show. measured: a worn
    profile to compare with. again: what was computed anew of the worn joint of the shown point, see
    `studyrunner.worn_joint`. no_worn_response: why its response curve is not among them.
    """

    path: Path
    dataset: xr.Dataset
    fixed: Mapping[str, int] = field(default_factory=dict)
    blocks: xr.Dataset | None = None
    chosen: Mapping[str, float | str] = field(default_factory=dict)
    measured: Profile | None = None
    again: Mapping[str, xr.Dataset] = field(default_factory=dict)
    no_worn_response: str = ""

    @cached_property
    def title(self) -> str:
        """Title of the study, or the name of the file."""
        return str(self.dataset.attrs.get("title") or show_text(self.path.stem))

    @property
    def followed(self) -> str:
        """What the frequency of the excitation follows, "resonance" or "peak"; empty for given frequencies."""
        given = self.study.get("axes", {}).get("frequency")
        return given if isinstance(given, str) else ""

    @property
    def stuck_frequency(self) -> float:
        """First natural frequency with the joint stuck, Hz; NaN where there are several, or the file has none."""
        found = self.dataset["stuck_frequency"].values if self.has("stuck_frequency") else np.array(math.nan)
        return float(found) if found.ndim == 0 else math.nan

    @cached_property
    def responses(self) -> tuple[str, ...]:
        """Names of the responses; empty where the file has none."""
        return tuple(map(str, self.dataset["response"].values)) if "response" in self.dataset.coords else ()

    @cached_property
    def statistics(self) -> xr.Dataset | None:
        """What the samples of the file say, see `statistics_of_file`; None where it has none."""
        return statistics_of_file(self.dataset, QUANTILES)

    def lacks(self, *names: str) -> str:
        """Sentence that says which of these variables to ask for; empty where the file has all."""
        missing = [name for name in names if not self.has(name)]
        return f"Add {' and '.join(missing)} to [outputs] variables." if missing else ""

    def read(self, name: str) -> xr.DataArray:
        """A whole variable. Whole numbers along `cycle` become floating ones, NaN where there is no state."""
        values = self.dataset[name]
        if values.dtype.kind in "iu" and "cycle" in values.dims and not self.has_modes:
            if self.has("cycle_count"):
                return values.where(self.dataset["cycle_count"].notnull())
            last = xr.DataArray(np.where(self.held, self.last_cycle, -1.0), dims=self.axes)
            return values.where(self.dataset["cycle"] <= last)
        return values

    def at(self, name: str, point: Point, cycle: int | slice | list[int] = slice(None)) -> xr.DataArray:
        """A variable of one point, read for this point only. cycle: index, or indices, along `cycle` if it has that."""
        values = self.dataset[name]
        where: dict[str, int | slice | list[int]] = {
            axis: index for axis, index in point.items() if axis in values.dims
        }
        if "cycle" in values.dims and not self.has_modes:
            where["cycle"] = cycle
        return values.isel(where)

    @cached_property
    def cycles(self) -> NDArray[np.float64]:
        """Cycle counts that the file holds; where each point has its own those of the shown point."""
        return self.counts(self._shown) if self.has("cycle_count") else self.counts({})

    def counts(self, point: Point) -> NDArray[np.float64]:
        """Cycle counts of one point, NaN for outputs that it has not.

        Numbers of the outputs where it has counts of its own and they do not ascend, or are not finite, as old files
        have them for a final state.
        """
        numbers = np.asarray(self.dataset["cycle"].values, dtype=float)
        if not self.has("cycle_count"):
            return numbers
        own = np.asarray(self.at("cycle_count", point).values, dtype=float)
        ascend = own.size > 1 and not np.isinf(own).any() and (np.diff(own[~np.isnan(own)]) > 0.0).all()
        return own if ascend else numbers

    def last_kept(self, point: Point) -> int:
        """Index of the last cycle count at which a point holds values: one at its target has none behind it."""
        counts = self.counts(point)
        last = self.last_cycle[tuple(point[name] for name in self.axes)]
        reached = np.flatnonzero(np.isfinite(counts) & (counts <= last * (1.0 + 1e-9)))
        return int(reached[-1]) if reached.size and not self.has("cycle_count") else len(counts) - 1

    def shown_point(self) -> dict[str, int]:
        """The point that figures of a single point show: of `best_known` the one with the largest final worn volume.

        Where nothing is worn the one with the largest response at first. Other points count only where there is none.
        """
        return dict(self._shown)

    @cached_property
    def _shown(self) -> dict[str, int]:
        measures = [np.ones(self.computed.shape)]
        if self.has_modes:
            amplitude = self.dataset["modal_amplitude"].broadcast_like(self.dataset["outcome"])
            measures.insert(0, amplitude.transpose(*self.axes).values)
        elif self.has("response_amplitude"):
            amplitude = self.read("response_amplitude").isel(cycle=0)
            measures.insert(0, amplitude.max("response", skipna=False).transpose(*self.axes).values)
        if not self.has_modes and self.has("worn_volume"):
            measures.insert(0, self.worn)
        has_slow_time = np.ones(self.computed.shape, np.bool_)
        if self.has("cycle_count"):
            has_slow_time = np.isfinite(self.dataset["cycle_count"].isel(cycle=-1).values)
        wanted = xr.ones_like(self.dataset["outcome"], dtype=bool)
        for name, value in self.chosen.items():
            if name in self.varying:
                wanted = wanted & (self.dataset[name] == value)
        allowed = np.asarray(wanted.transpose(*self.axes).values)
        usable, best, all_points = self.usable, self.best_known, np.ones_like(allowed)
        sets = (best & has_slow_time, usable & has_slow_time, best, self.computed, self.held, all_points)
        points = next(each & allowed for each in sets if (each & allowed).any())
        for measure in measures:
            known = np.where(points & np.isfinite(measure), measure, 0.0)
            if known.max() > 0.0:
                break
        return self.point_at(np.unravel_index(int(np.argmax(known)), known.shape))

    def point_at(self, place: Sequence[Any] | NDArray[np.intp]) -> dict[str, int]:
        """The point at a place in an array of points."""
        return {name: int(index) for name, index in zip(self.axes, place, strict=True)}

    @cached_property
    def course_axis(self) -> str | None:
        """The axis that figures are drawn over: the frequency, or where it does not vary the first other axis of
        several numbers; None where nothing but words and samples varies.
        """
        numbers = [name for name in self.varying if self.dataset[name].dtype.kind in "iuf" and name != SAMPLE]
        of_first_rank = [name for name in ("frequency", "modal_amplitude") if name in numbers]
        return next(iter(of_first_rank + numbers), None)

    def describe(self, point: Point, axes: Collection[str] | None = None) -> str:
        """A point in words, along `axes`; by default along those of more than one value, or along all where none is."""
        kept = axes if axes is not None else ((*self.varying, *self.fixed) or self.axes)
        followed = f"the {self.followed}" if self.followed else ""
        return ", ".join(
            (name == "frequency" and followed) or show_value(self.dataset[name], point[name])
            for name in self.axes
            if name in kept and name in point
        )

    def cycle_label(self, index: int) -> str:
        """A kept cycle count in words."""
        return show_cycles(float(self.cycles[index]), self.counted)

    def when(self, index: int, before: str = "at") -> str:
        """A kept cycle count in words, with the word `before` it: "at 5 cycles"."""
        return f"{before} {self.cycle_label(index)}"


def as_sentences(*parts: str) -> str:
    """Text of those parts that are not empty, each ended with a full stop."""
    return " ".join(part if part.endswith(".") else f"{part}." for part in parts if part)


def as_history(dataset: xr.Dataset) -> tuple[xr.Dataset, xr.Dataset | None]:
    """The dataset with missions as cycles and without what belongs to single blocks, and these variables or None.

    Responses with a unit of their own in their name, as root stress [MPa], are left out: the others share a scale.
    """
    if "response" in dataset.coords:
        own = np.char.endswith(dataset["response"].values.astype(str), "]")
        if own.any() and not own.all():
            close = dataset.close
            dataset = dataset.isel(response=np.flatnonzero(~own))
            dataset.set_close(close)
    if "block" not in dataset.dims:
        return dataset, None
    renamed = dataset.rename({name: new for name, new in _LIKE_CYCLES.items() if name in dataset.variables})
    of_blocks = [name for name, variable in renamed.variables.items() if "block" in variable.dims]
    history = renamed.drop_vars(of_blocks)
    # renaming and dropping variables loses the file to be closed
    history.set_close(dataset.close)
    return history, renamed[of_blocks]


def open_for_report(path: Path | str, chosen: Mapping[str, str] | None = None, measured: Path | None = None) -> Result:
    """Open a result file as the report reads it.

    chosen: values of axes, as text, of the point that figures of a single point show. measured: CSV file of a worn
    profile. Raises UserError where it is no result of `run-study`, or has no such point.
    """
    profile = None if measured is None else read_profile(measured)
    dataset, blocks = as_history(open_known(path))
    values = {name: _find_value(dataset, name, text) for name, text in (chosen or {}).items()}
    return Result(Path(path), dataset, blocks=blocks, chosen=values, measured=profile)


def _find_value(dataset: xr.Dataset, name: str, text: str) -> float | str:
    """The value of an axis as it is in a file, from its text. Raises UserError."""
    axes = [str(axis) for axis in dataset["outcome"].dims]
    remedy = f"give one of the axes {', '.join(axes)}"
    if name in axes:
        values = dataset[name].values.tolist()
        for value in values:
            try:
                if value == text or math.isclose(value, float(text), rel_tol=1e-9):
                    return value  # type: ignore[no-any-return]
            except (TypeError, ValueError):
                continue
        remedy = f"give one of the values of {name}: {', '.join(map(str, values[:12]))}"
        remedy += ", ..." if len(values) > 12 else ""
    raise UserError("command line", "--point", f"{name}={text}", remedy)

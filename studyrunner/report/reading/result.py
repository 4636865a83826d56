"""A result file for the report: varying axes, points with results, and the point that is shown."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from studyrunner.report.reading.chosen import find_values
from studyrunner.report.reading.endings import Ending, read_endings
from studyrunner.report.reading.measured import Profile, read_profile
from studyrunner.report.reading.missions import as_history
from studyrunner.report.reading.opening import open_known
from studyrunner.report.reading.sample_statistics import SAMPLE, statistics_of
from studyrunner.report.reading.schema_check import study_tables
from studyrunner.report.reading.units import show_cycles, show_value
from studyrunner.user_error import UserError, show_text

CONVERGED = 0
"""The `outcome` of a point that was computed to the end without restriction."""

COMPLETE_WORDS = ("converged", "inaccurate", "sensitive")
"""Outcomes of points that were computed to the end."""

NO_VOLUME = 1e-24
"""Volume, m3, below which wear is round-off: a thousand atoms."""

WELL_ENOUGH = 0.5
"""Largest relative error of a number that is a result: that of the outcome `sensitive`."""

_OF_STEPS = ("step", "scheme")

_AT_ONCE = 2**21
"""Numbers that are read at once."""

Point = Mapping[str, int]
"""Index along each axis. A missing axis stands for all its values."""


@dataclass(frozen=True)
class Result:
    """A result file. A point is one combination of the axes.

    dataset: read lazily. A variable that was read as a whole stays in memory. fixed: axes of which this holds one value
    of several, and how many the file has. blocks: of a result of missions what belongs to single blocks; in `dataset`
    missions then have the name of the cycles that they replace. chosen: values of axes of the point that figures of a
    single point show. measured: a worn profile to compare with.
    """

    path: Path
    dataset: xr.Dataset
    fixed: Mapping[str, int] = field(default_factory=dict)
    blocks: xr.Dataset | None = None
    chosen: Mapping[str, float | str] = field(default_factory=dict)
    measured: Profile | None = None

    @cached_property
    def axes(self) -> tuple[str, ...]:
        """Dimensions of a point, in the order of the file."""
        return tuple(str(name) for name in self.dataset["outcome"].dims)

    @cached_property
    def varying(self) -> tuple[str, ...]:
        """Axes of more than one value."""
        return tuple(name for name in self.axes if self.dataset.sizes[name] > 1)

    @property
    def has_modes(self) -> bool:
        """Whether the points are those of nonlinear modes, which have no slow time: `cycle` is then an axis."""
        return "modal_amplitude" in self.axes

    @property
    def counted(self) -> str:
        """What slow time counts: "cycles", or "missions"."""
        return "cycles" if self.blocks is None else "missions"

    @cached_property
    def computed(self) -> NDArray[np.bool_]:
        """Points that were computed to the end, in the shape of the axes."""
        outcome = self.dataset["outcome"].values
        if not self.has("last_cycle") and not self.has_modes:
            # an older file holds nothing of any other point
            return np.asarray(outcome == CONVERGED)
        complete = [number for number, ending in self.endings.items() if ending.word in COMPLETE_WORDS]
        return np.asarray(np.isin(outcome, complete))

    @cached_property
    def last_cycle(self) -> NDArray[np.float64]:
        """Last cycle counts with values, NaN without values; in the shape of the axes."""
        last = self.dataset["last_cycle"].values if self.has("last_cycle") else np.nan
        if self.has_modes:
            return np.where(self.computed, 0.0, np.nan)
        # points of an older file, or of one that was joined to this
        return np.where(self.computed & np.isnan(last), self.dataset["cycle"].values[-1], last)

    @cached_property
    def held(self) -> NDArray[np.bool_]:
        """Points with values, be it of the first cycles only; in the shape of the axes."""
        if self.has_modes:
            return self.computed
        return np.asarray(self.computed | (self.last_cycle >= self.dataset["cycle"].values[0]))

    @cached_property
    def errors(self) -> NDArray[np.float64]:
        """Estimated relative errors of the last worn volumes; NaN where the file has none; in the shape of the axes."""
        known = self.dataset["error_estimate"].values if self.has("error_estimate") else np.nan
        return np.broadcast_to(np.asarray(known, dtype=float), self.computed.shape)

    @cached_property
    def rtol(self) -> NDArray[np.float64]:
        """Relative error that each point was to keep below; NaN where the file does not say."""
        outcome = self.dataset["outcome"]
        if "rtol" in outcome.dims:
            return np.asarray(self.dataset["rtol"].broadcast_like(outcome).transpose(*self.axes).values, dtype=float)
        return np.full(outcome.shape, self.study_number("solver", "rtol"))

    @cached_property
    def above(self) -> NDArray[np.bool_]:
        """Points that were computed to the end with a worn volume known less well than rtol; shape of the axes."""
        return np.asarray(self.computed & (self.errors > self.rtol))

    @cached_property
    def known(self) -> NDArray[np.bool_]:
        """Points that were computed to the end with a worn volume known to `rtol`; in the shape of the axes."""
        return np.asarray(self.computed & (self.errors <= self.rtol))

    @property
    def wears(self) -> bool:
        """Whether wear was asked for, and not of unworn states or modes only."""
        return not self.has_modes and (self.has("cycle_count") or bool(self.dataset["cycle"].values[-1] > 0.0))

    @cached_property
    def usable(self) -> NDArray[np.bool_]:
        """Points whose worn volume is a result: computed to the end, and not known to a factor of two only."""
        found = self.computed & ~self.ended("sensitive")
        if self.has("oscillates"):
            found = found & (self.dataset["oscillates"].values == 0)
        return found & (self.errors <= WELL_ENOUGH) if self.has("error_estimate") else found

    @cached_property
    def numerical(self) -> list[str]:
        """Axes that are numerical settings."""
        return [name for name in self.axes if name in _OF_STEPS or name in self.study.get("solver", {})]

    @cached_property
    def best_known(self) -> NDArray[np.bool_]:
        """Of usable points that differ in numerical settings only, those with the smallest error.

        Of explicit histories, which wear too much, only those without another one of the same case.
        """
        errors = np.where(self.usable, self.errors if self.has("error_estimate") else 0.0, np.inf)
        labelled = xr.DataArray(errors, dims=self.axes)
        if "scheme" in self.axes:
            labelled = labelled + xr.DataArray(self.dataset["scheme"].values == "explicit", dims="scheme")
        best = labelled <= labelled.min(self.numerical)
        return np.asarray(self.usable & best.transpose(*self.axes).values)

    @property
    def tells_volumes(self) -> bool:
        """Whether the file says how well worn volumes are known, with an rtol."""
        return bool(self.wears and self.has("error_estimate") and np.isfinite(self.rtol).any() and self.computed.any())

    @cached_property
    def worn(self) -> NDArray[np.float64]:
        """Worn volume of each point at its last cycle, m3, or where it ended early; NaN without a state."""

        def last(values: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.where(np.isnan(values[:, -1]), np.fmax.reduce(values, axis=1), values[:, -1])

        return self.over_points("worn_volume", last)

    def over_points(
        self, name: str, reduce: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    ) -> NDArray[np.float64]:
        """A number of each point, in the shape of the axes, read some points at a time.

        reduce: from values (n_points, ...) of the variable to (n_points,).
        """
        found = []
        for part in _in_slabs(self.dataset[name], self.axes):
            values = np.asarray(part.transpose(*self.axes, ...).values, dtype=float)
            found.append(reduce(values.reshape(-1, *values.shape[len(self.axes) :])))
        return np.concatenate(found).reshape(self.computed.shape)

    def ended(self, word: str) -> NDArray[np.bool_]:
        """Points with the outcome of this word; in the shape of the axes."""
        numbers = [number for number, ending in self.endings.items() if ending.word == word]
        return np.asarray(np.isin(self.dataset["outcome"].values, numbers))

    @cached_property
    def cycles(self) -> NDArray[np.float64]:
        """Cycle counts that the file holds; where each point has its own those of the shown point."""
        return self.counts(self._shown) if self.has("cycle_count") else self.counts({})

    def counts(self, point: Point) -> NDArray[np.float64]:
        """Cycle counts of one point. Numbers of the outputs where it has counts of its own and they do not ascend.

        Infinite is that of a final state that was found without slow time; NaN those of outputs the point has not.
        """
        numbers = np.asarray(self.dataset["cycle"].values, dtype=float)
        if not self.has("cycle_count"):
            return numbers
        own = np.asarray(self.at("cycle_count", point).values, dtype=float)
        ascend = own.size > 1 and (np.diff(own[~np.isnan(own)]) > 0.0).all()
        return own if ascend else numbers

    @property
    def has_history(self) -> bool:
        """Whether the shown point has states between the first and a final one."""
        return len(self.cycles) > 1 and bool(np.isfinite(self.cycles[1:]).any())

    def last_kept(self, point: Point) -> int:
        """Index of the last cycle count at which a point holds values: one at its target has none behind it."""
        counts = self.counts(point)
        last = self.last_cycle[tuple(point[name] for name in self.axes)]
        reached = np.flatnonzero(np.isfinite(counts) & (counts <= last * (1.0 + 1e-9)))
        return int(reached[-1]) if reached.size and not self.has("cycle_count") else len(counts) - 1

    @cached_property
    def title(self) -> str:
        """Title of the study, or the name of the file."""
        return str(self.dataset.attrs.get("title") or show_text(self.path.stem))

    @cached_property
    def study(self) -> dict[str, dict[str, object]]:
        """The effective study in the file, by table; empty where there is none that can be read."""
        try:
            return study_tables(self.dataset.attrs)
        except UserError:
            return {}

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

    def study_number(self, table: str, key: str) -> float:
        """A number of the study; NaN where the file does not say."""
        value = self.study.get(table, {}).get(key)
        return float(value) if isinstance(value, int | float) else math.nan

    @cached_property
    def endings(self) -> dict[int, Ending]:
        """All ways for a point to end that the file names, by number."""
        return read_endings(self.dataset["outcome"])

    @cached_property
    def responses(self) -> tuple[str, ...]:
        """Names of the responses; empty where the file has none."""
        if "response" not in self.dataset.coords:
            return ()
        return tuple(str(name) for name in self.dataset["response"].values)

    def has(self, *names: str) -> bool:
        """Whether the file holds all of these variables."""
        return all(name in self.dataset.variables for name in names)

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
        """A variable of one point, read from the file for this point only unless all of it was read before.

        cycle: index, or indices, along `cycle`, where the variable has it.
        """
        values = self.dataset[name]
        where: dict[str, int | slice | list[int]] = {
            axis: index for axis, index in point.items() if axis in values.dims
        }
        if "cycle" in values.dims and not self.has_modes:
            where["cycle"] = cycle
        return values.isel(where)

    @cached_property
    def statistics(self) -> xr.Dataset | None:
        """What the samples of the file say, see `statistics_of`; None where it has none."""
        return statistics_of(self.dataset, self.study, self.endings)

    def shown_point(self) -> dict[str, int]:
        """The point that figures of a single point show.

        Of `best_known` the one with the largest final worn volume. Where nothing is worn, or the file has no wear, the
        one with the largest response at the first kept cycle count. Other points count only where there is none.
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
        marched = np.ones(self.computed.shape, np.bool_)
        if self.has("cycle_count"):
            marched = np.isfinite(self.dataset["cycle_count"].isel(cycle=-1).values)
        usable, best = self.usable, self.best_known
        sets = (best & marched, usable & marched, best, self.computed, self.held, np.ones_like(marched))
        points = next(each & self._wanted for each in sets if (each & self._wanted).any())
        for measure in measures:
            known = np.where(points & np.isfinite(measure), measure, 0.0)
            if known.max() > 0.0:
                break
        place = np.unravel_index(int(np.argmax(known)), known.shape)
        return {name: int(index) for name, index in zip(self.axes, place, strict=True)}

    @property
    def _wanted(self) -> NDArray[np.bool_]:
        """Points with the chosen values; in the shape of the axes."""
        outcome = self.dataset["outcome"]
        wanted = xr.ones_like(outcome, dtype=bool)
        for name, value in self.chosen.items():
            if name in outcome.dims and self.dataset.sizes[name] > 1:
                wanted = wanted & (self.dataset[name] == value)
        return np.asarray(wanted.transpose(*self.axes).values)

    @cached_property
    def course_axis(self) -> str | None:
        """The axis that figures over frequency are drawn over: the frequency, or the first other axis of several
        numbers where the file has one frequency only; None where nothing but words and samples varies.
        """
        numbers = [name for name in self.varying if self.dataset[name].dtype.kind in "iuf" and name != SAMPLE]
        for name in ("frequency", "modal_amplitude"):
            if name in numbers:
                return name
        return numbers[0] if numbers else None

    def describe(self, point: Point, axes: Collection[str] | None = None) -> str:
        """A point in words, along `axes`; by default along those of more than one value, or along all where none is."""
        kept = axes if axes is not None else ((*self.varying, *self.fixed) or self.axes)
        return ", ".join(
            f"the {self.followed}"
            if name == "frequency" and self.followed
            else show_value(self.dataset[name], point[name])
            for name in self.axes
            if name in kept and name in point
        )

    def cycle_label(self, index: int) -> str:
        """A kept cycle count in words."""
        return show_cycles(float(self.cycles[index]), self.counted)

    def when(self, index: int, before: str = "at") -> str:
        """A kept cycle count in words, with the word `before` it: "at 5 cycles", "in the final state"."""
        return "in the final state" if np.isinf(self.cycles[index]) else f"{before} {self.cycle_label(index)}"

    def close(self) -> None:
        """Close the file."""
        self.dataset.close()


def _in_slabs(values: xr.DataArray, axes: Sequence[str]) -> Iterator[xr.DataArray]:
    """Parts of a variable along its axes, in their order, of which none is much larger than `_AT_ONCE`."""
    if values.size <= _AT_ONCE or not axes:
        yield values
        return
    axis, *others = axes
    length = max(1, _AT_ONCE // (values.size // values.sizes[axis]))
    for start in range(0, values.sizes[axis], length):
        yield from _in_slabs(values.isel({axis: slice(start, start + length)}), others if length == 1 else [])


def as_sentences(*parts: str) -> str:
    """Text of those parts that are not empty, each ended with a full stop."""
    return " ".join(part if part.endswith(".") else f"{part}." for part in parts if part)


def open_for_report(path: Path | str, chosen: Mapping[str, str] | None = None, measured: Path | None = None) -> Result:
    """Open a result file as the report reads it; variables are read when they are needed.

    chosen: values of axes, as text, of the point that figures of a single point show. measured: CSV file of a worn
    profile.

    Raises
    ------
    UserError
        Where there is no such file, it is no result of `run-study`, or it has no such point.
    """
    profile = None if measured is None else read_profile(measured)
    dataset, blocks = as_history(open_known(path))
    values = find_values(dataset, chosen or {})
    return Result(Path(path), dataset, blocks=blocks, chosen=values, measured=profile)

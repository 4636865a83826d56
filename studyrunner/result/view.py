"""A result file as summary and report read it: axes, points with results, how well they are known, the shown point."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from solver.outcome import COMPLETE, SENSITIVE_ERROR, Outcome
from studyrunner.coordinates import POINT, SAMPLE
from studyrunner.kinds.kind import Kind
from studyrunner.measured import MeasuredSection, Profile
from studyrunner.result.opening import ENDED, as_history, kind_of, open_known, study_tables
from studyrunner.statistics.study_statistics import statistics_of_file
from studyrunner.units import show_cycles, show_value
from studyrunner.user_error import UserError, listing

NO_VOLUME = 1e-24
"""Volume, m3, below which wear is round-off: a thousand atoms."""

NO_MOTION = 1e-12
"""Motion, m, below which it is round-off: less than the size of an atom."""

_AT_ONCE = 2**21  # numbers that are read at once

Mask = NDArray[np.bool_]
Point = Mapping[str, int]
"""Index along each axis. A missing axis stands for all its values."""


@dataclass(frozen=True)
class Result:
    """A result file, each point one combination of the axes. Arrays of points have the shape of the axes.

    dataset: read lazily; a variable that was read as a whole stays in memory. fixed: axes of which this holds one value
    of several. blocks: of missions what belongs to single blocks; in `dataset` missions then have the name of cycles.
    chosen: values of axes of the shown point. measured: a worn profile to compare with. recomputed: of the worn joint
    of the shown point, by `studyrunner.worn_joint`. no_worn_response: why its response curve is not among them.
    """

    path: Path
    dataset: xr.Dataset
    fixed: tuple[str, ...] = ()
    blocks: xr.Dataset | None = None
    chosen: Mapping[str, float | str] = field(default_factory=dict)
    measured: Profile | None = None
    recomputed: Mapping[str, xr.Dataset] = field(default_factory=dict)
    no_worn_response: str = ""

    @cached_property
    def study(self) -> dict[str, dict[str, object]]:
        """The effective study in the file, by table; empty where there is none that can be read."""
        return study_tables(self.dataset.attrs)

    @cached_property
    def measurements(self) -> MeasuredSection | None:
        """[measured] of the study; None where nothing was measured."""
        given = self.study.get("measured")
        section = MeasuredSection.model_validate(given, strict=False) if given else None
        return section if section and section.all else None

    def at_one_point(self, *kept: str) -> xr.Dataset:
        """The result at the shown point, with all samples, and all values of the axes `kept`."""
        left = (SAMPLE, *kept)
        return self.dataset.isel({name: [index] for name, index in self.shown.items() if name not in left})

    @cached_property
    def axes(self) -> tuple[str, ...]:
        """Dimensions of a point, in the order of the file."""
        return tuple(str(name) for name in self.dataset["outcome"].dims)

    @cached_property
    def varying(self) -> tuple[str, ...]:
        """Axes of more than one value."""
        return tuple(name for name in self.axes if self.dataset.sizes[name] > 1)

    @cached_property
    def designed(self) -> list[str]:
        """Columns that differ between the points of a design; none where the points are combinations of the axes."""
        arrays = self.dataset.drop_vars([POINT, ENDED], errors="ignore").coords.items()
        found = [(str(name), array.values) for name, array in arrays if array.dims == (POINT,)]
        return [name for name, values in found if (values != values[0]).any()]

    @cached_property
    def numerical(self) -> list[str]:
        """Axes that are numerical settings."""
        return [name for name in self.axes if name in ("step", "scheme") or name in self.study.get("solver", {})]

    @cached_property
    def kind(self) -> Kind:
        """Which kind of study this is the result of."""
        return kind_of(self.dataset)

    @property
    def counted(self) -> str:
        """What slow time counts: "cycles" or "missions"."""
        return f"{self.kind.counted}s"

    @property
    def has_slow_time(self) -> bool:
        """Whether points have a course over cycles or missions; else `cycle` is an axis, of the wear before."""
        return bool(self.kind.counted)

    @property
    def wears(self) -> bool:
        """Whether wear was asked for, and not unworn states or modes only."""
        return self.has_slow_time and (self.has("cycle_count") or bool(self.dataset["cycle"].values[-1] > 0.0))

    @property
    def followed(self) -> str:
        """What the frequency of the excitation follows, "resonance" or "peak"; empty for given frequencies."""
        given = self.study.get("axes", {}).get("frequency")
        return given if isinstance(given, str) else ""

    @property
    def responses(self) -> tuple[str, ...]:
        """Names of the responses; empty where the file has none."""
        return tuple(map(str, self.dataset["response"].values)) if "response" in self.dataset.coords else ()

    @cached_property
    def statistics(self) -> xr.Dataset | None:
        """What the samples of the file say, see `statistics_of_file`; None where it has none."""
        return statistics_of_file(self.dataset, self.blocks)

    def has(self, *names: str) -> bool:
        """Whether the file holds all of these variables."""
        return all(name in self.dataset.variables for name in names)

    def lacks(self, *names: str) -> str:
        """Which of these variables to ask for, without a full stop; empty where the file has all."""
        there = {*self.dataset.variables, *(self.blocks or ())}
        missing = [name for name in names if name not in there]
        return f"Add {' and '.join(missing)} to [outputs] variables" if missing else ""

    def at(self, name: str, point: Point, cycle: int | slice | list[int] = slice(None)) -> xr.DataArray:
        """A variable of one point, read for this point only. cycle: index, or indices, along `cycle` if it has that."""
        values = self.dataset[name].isel(point, missing_dims="ignore")
        return values.isel(cycle=cycle) if "cycle" in values.dims else values

    def over_points(
        self, name: str, reduce: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    ) -> NDArray[np.float64]:
        """A number of each point, read some at a time. reduce: from values (..., n) of what follows the axes."""
        values, axis = self.dataset[name].transpose(*self.axes, ...), max(self.axes, key=self.dataset.sizes.__getitem__)
        length, parts = max(1, _AT_ONCE * values.sizes[axis] // values.size), []
        for start in range(0, values.sizes[axis], length):
            part = np.asarray(values.isel({axis: slice(start, start + length)}).values, dtype=float)
            # a copy: a view would keep the whole part in memory
            parts.append(np.array(reduce(part.reshape(*part.shape[: len(self.axes)], -1))))
        return np.concatenate(parts, axis=self.axes.index(axis))

    def ended(self, *outcomes: Outcome) -> Mask:
        """Points with one of these outcomes."""
        return np.asarray(np.isin(self.dataset["outcome"].values, outcomes))

    @cached_property
    def computed(self) -> Mask:
        """Points that were computed to the end."""
        # version 0.4 has kept nothing of other points than these
        is_old = self.has_slow_time and not self.has("last_cycle")
        return self.ended(Outcome.CONVERGED) if is_old else self.ended(*COMPLETE)

    def of_points(self, name: str, cycle: int | None = None) -> NDArray[Any]:
        """A variable of all points (axes..., what follows), also along axes that it lacks. cycle: index of a count."""
        values = self.dataset[name] if cycle is None else self.dataset[name].isel(cycle=cycle)
        return values.broadcast_like(self.dataset["outcome"]).transpose(*self.axes, ...).values

    @cached_property
    def last_cycle(self) -> NDArray[np.float64]:
        """Last cycle counts with values, NaN without values."""
        last = self.dataset["last_cycle"].values if self.has("last_cycle") else np.nan
        # points of an older file, or of one that was joined to this
        return np.where(self.computed & np.isnan(last), self.dataset["cycle"].values[-1], last)

    @cached_property
    def has_values(self) -> Mask:
        """Points with values, if only of the first cycles."""
        if not self.has_slow_time:
            return self.computed
        return np.asarray(self.computed | (self.last_cycle >= self.dataset["cycle"].values[0]))

    @cached_property
    def errors(self) -> NDArray[np.float64]:
        """Estimated relative errors of the last worn volumes; NaN where the file has none."""
        known = self.dataset["error_estimate"].values if self.has("error_estimate") else np.nan
        return np.broadcast_to(np.asarray(known, dtype=float), self.computed.shape)

    @cached_property
    def rtol(self) -> NDArray[np.float64]:
        """Relative error that each point was to keep below; NaN where the file does not say."""
        if self.has("rtol"):
            return self.of_points("rtol").astype(float)
        value = self.study.get("solver", {}).get("rtol")
        return np.full(self.computed.shape, float(value) if isinstance(value, int | float) else math.nan)

    @property
    def above(self) -> Mask:
        """Points that were computed to the end with a worn volume known less well than rtol."""
        return np.asarray(self.computed & (self.errors > self.rtol))

    @cached_property
    def usable(self) -> Mask:
        """Points whose worn volume is a result: computed to the end, and not known to a factor of two only."""
        known = self.errors <= SENSITIVE_ERROR if self.has("error_estimate") else True
        return self.computed & ~self.ended(Outcome.SENSITIVE) & known

    @cached_property
    def best_known(self) -> Mask:
        """Of usable points that differ in numerical settings only, those with the smallest error.

        Of explicit histories, which wear too much, only those without another one of the same case.
        """
        errors = np.where(self.usable, self.errors if self.has("error_estimate") else 0.0, np.inf)
        labelled = xr.DataArray(errors, dims=self.axes)
        if "scheme" in self.axes:
            labelled = labelled + xr.DataArray(self.dataset["scheme"].values == "explicit", dims="scheme")
        best = labelled <= labelled.min(self.numerical)
        return np.asarray(self.usable & best.transpose(*self.axes).values)

    @cached_property
    def worn(self) -> NDArray[np.float64]:
        """Worn volume of each point at its last cycle, m3, or where it ended early; NaN without a state."""

        def last(values: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.where(np.isnan(values[..., -1]), np.fmax.reduce(values, axis=-1), values[..., -1])

        return self.over_points("worn_volume", last)

    @cached_property
    def cycles(self) -> NDArray[np.float64]:
        """Cycle counts that the file holds; where each point has its own those of the shown point."""
        return self.counts(self.shown) if self.has("cycle_count") else self.counts({})

    def counts(self, point: Point) -> NDArray[np.float64]:
        """Cycle counts of one point, NaN for outputs that it has not.

        Numbers of its outputs where its own counts do not ascend or are not finite, as of a final state in old files.
        """
        numbers = np.asarray(self.dataset["cycle"].values, dtype=float)
        if not self.has("cycle_count"):
            return numbers
        counts = np.asarray(self.at("cycle_count", point).values, dtype=float)
        ascend = counts.size > 1 and not np.isinf(counts).any() and (np.diff(counts[~np.isnan(counts)]) > 0.0).all()
        return counts if ascend else numbers

    def last_reached(self, point: Point) -> int:
        """Index of the last cycle count at which a point holds values: one at its target has none after it."""
        counts = self.counts(point)
        last = self.last_cycle[self.place(point)]
        reached = np.flatnonzero(np.isfinite(counts) & (counts <= last * (1.0 + 1e-9)))
        return int(reached[-1]) if reached.size and not self.has("cycle_count") else len(counts) - 1

    def cycle_label(self, index: int) -> str:
        """A cycle count of the file in words."""
        return show_cycles(float(self.cycles[index]), self.counted)

    @cached_property
    def shown(self) -> dict[str, int]:
        """The point that figures of a single point show: of `best_known` the one with the largest final worn volume, or
        the least allowable amplitude.

        Where nothing is worn the one with the largest response at first. Other points count only where there is none.
        """
        everywhere = has_slow_time = np.ones(self.computed.shape, np.bool_)
        measures = [self.of_points(name) for name in self.kind.last_axes]
        if self.has("allowable_amplitude"):
            # the least one is that of all
            measures.append(1.0 / self.of_points("allowable_amplitude"))
        if self.has("worn_volume"):
            measures.append(self.worn)
        if self.has_slow_time and self.has("response_amplitude"):
            measures.append(self.of_points("response_amplitude", 0).max(axis=-1))
        if self.has("cycle_count"):
            has_slow_time = np.isfinite(self.of_points("cycle_count", -1))
        wanted = everywhere
        for name in set(self.chosen) & {*self.varying, *self.designed}:
            wanted = wanted & (self.of_points(name) == self.chosen[name])
        best = self.best_known
        sets = (best & has_slow_time, self.usable & has_slow_time, best, self.computed, self.has_values, everywhere)
        points = next(each & wanted for each in sets if (each & wanted).any())
        for measure in (*measures, everywhere):
            known = np.where(points & np.isfinite(measure), measure, 0.0)
            if known.max() > 0.0:
                break
        return self.largest(known)

    def largest(self, values: NDArray[Any]) -> dict[str, int]:
        """The point at which an array of points is largest."""
        return self.point_at(np.unravel_index(int(np.argmax(values)), values.shape))

    def point_at(self, place: Sequence[Any] | NDArray[np.intp]) -> dict[str, int]:
        """The point at a place in an array of points."""
        return {name: int(index) for name, index in zip(self.axes, place, strict=True)}

    def place(self, point: Point) -> tuple[int, ...]:
        """The place of a point in an array of points."""
        return tuple(point[name] for name in self.axes)

    def describe(self, point: Point, axes: Collection[str] | None = None) -> str:
        """A point in words, along `axes`; by default along those of more than one value, or along all where none is."""
        named = axes if axes is not None else ((*self.varying, *self.fixed) or self.axes)
        followed = f"the {self.followed}" if self.followed else ""
        names = [name for name in self.axes if name in named and name in point]
        values = {name: show_value(self.dataset[name], point[name]) for name in names}
        if POINT in values and self.designed:
            own = ", ".join(show_value(self.dataset[name], point[POINT]) for name in self.designed)
            values[POINT] += f" ({own})"
        return ", ".join((name == "frequency" and followed) or value for name, value in values.items())


def open_for_report(path: Path | str, chosen: Mapping[str, str] | None = None) -> Result:
    """Open a result file as the report reads it. chosen: values of axes, as text, of the point that is shown.

    Raises UserError where it is no result of `run-study`, or has no such point.
    """
    dataset, blocks = as_history(open_known(path))
    values = {name: _find_value(dataset, name, text) for name, text in (chosen or {}).items()}
    return Result(Path(path), dataset, blocks=blocks, chosen=values)


def _find_value(dataset: xr.Dataset, name: str, text: str) -> float | str:
    """The value of an axis as it is in a file, from its text on the command line."""
    columns = [name for name, array in dataset.coords.items() if array.dims == (POINT,) and name != POINT]
    axes = [str(axis) for axis in (*dataset["outcome"].dims, *columns)]
    remedy = f"give one of the axes {', '.join(axes)}"
    if name in axes:
        values = dataset[name].values.tolist()
        for value in values:
            with suppress(TypeError, ValueError):
                if value == text or math.isclose(value, float(text), rel_tol=1e-9):
                    return value  # type: ignore[no-any-return]
        remedy = f"give one of the values of {name}: {listing(values)}"
    raise UserError("command line", "--point", f"{name}={text}", remedy)

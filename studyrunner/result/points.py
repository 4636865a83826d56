"""The points of a result: which were computed to the end, how well their worn volumes are known, which count."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from studyrunner.result.opening import study_tables
from studyrunner.user_error import UserError

CONVERGED = 0
"""The `outcome` of a point that was computed to the end without restriction."""

COMPLETE_WORDS = ("converged", "inaccurate", "sensitive")
"""Outcomes of points that were computed to the end."""

WELL_ENOUGH = 0.5
"""Largest relative error of a number that is a result: that of the outcome `sensitive`."""

_AT_ONCE = 2**21  # numbers that are read at once

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Ending:
    """One outcome: word of the file, sentence for the reader."""

    word: str
    sentence: str


class Points:
    """The points of a result, each one combination of the axes. Arrays of points have the shape of the axes.

    dataset: read lazily. blocks: of a result of missions what belongs to single blocks.
    """

    dataset: xr.Dataset
    blocks: xr.Dataset | None

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
    def study(self) -> dict[str, dict[str, object]]:
        """The effective study in the file, by table; empty where there is none that can be read."""
        try:
            return study_tables(self.dataset.attrs)
        except UserError:
            return {}

    def has(self, *names: str) -> bool:
        """Whether the file holds all of these variables."""
        return all(name in self.dataset.variables for name in names)

    def over_points(
        self, name: str, reduce: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    ) -> NDArray[np.float64]:
        """A number of each point, read some at a time. reduce: from values (n_points, ...) to (n_points,)."""

        def reduced(part: xr.DataArray) -> NDArray[np.float64]:
            values = np.asarray(part.transpose(*self.axes, ...).values, dtype=float)
            return reduce(values.reshape(-1, *values.shape[len(self.axes) :]))

        # in a function of its own, so that no part is in memory while the next one is read; `map` holds none either
        parts = map(reduced, _in_slabs(self.dataset[name], self.axes))
        return np.concatenate(list(parts)).reshape(self.computed.shape)

    @cached_property
    def endings(self) -> dict[int, Ending]:
        """All ways for a point to end that the file names, by number; a number without a name stands for itself."""
        outcome = self.dataset["outcome"]
        numbers = np.atleast_1d(outcome.attrs.get("flag_values", ())).tolist()
        words = str(outcome.attrs.get("flag_meanings", "")).split()
        # versions before 0.5 said so of every point that was computed to the end
        claimed = str(outcome.attrs.get("sentences", "")).replace("computed to tolerance", "computed to the end")
        sentences = claimed.splitlines() + [""] * len(words)
        found = {number: Ending(f"outcome_{number}", f"outcome {number}") for number in np.unique(outcome).tolist()}
        for number, word, sentence in zip(numbers, words, sentences, strict=False):
            found[int(number)] = Ending(word, sentence or word.replace("_", " "))
        return found

    def ended(self, *words: str) -> Mask:
        """Points with one of these outcomes."""
        numbers = [number for number, ending in self.endings.items() if ending.word in words]
        return np.asarray(np.isin(self.dataset["outcome"].values, numbers))

    @cached_property
    def computed(self) -> Mask:
        """Points that were computed to the end."""
        if not self.has("last_cycle") and not self.has_modes:
            # an older file holds nothing of any other point
            return np.asarray(self.dataset["outcome"].values == CONVERGED)
        return self.ended(*COMPLETE_WORDS)

    @cached_property
    def last_cycle(self) -> NDArray[np.float64]:
        """Last cycle counts with values, NaN without values."""
        if self.has_modes:
            return np.where(self.computed, 0.0, np.nan)
        last = self.dataset["last_cycle"].values if self.has("last_cycle") else np.nan
        # points of an older file, or of one that was joined to this
        return np.where(self.computed & np.isnan(last), self.dataset["cycle"].values[-1], last)

    @cached_property
    def held(self) -> Mask:
        """Points with values, if only of the first cycles."""
        if self.has_modes:
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
        outcome = self.dataset["outcome"]
        if "rtol" in outcome.dims:
            return np.asarray(self.dataset["rtol"].broadcast_like(outcome).transpose(*self.axes).values, dtype=float)
        value = self.study.get("solver", {}).get("rtol")
        return np.full(outcome.shape, float(value) if isinstance(value, int | float) else math.nan)

    @property
    def above(self) -> Mask:
        """Points that were computed to the end with a worn volume known less well than rtol."""
        return np.asarray(self.computed & (self.errors > self.rtol))

    @property
    def wears(self) -> bool:
        """Whether wear was asked for, and not unworn states or modes only."""
        return not self.has_modes and (self.has("cycle_count") or bool(self.dataset["cycle"].values[-1] > 0.0))

    @cached_property
    def usable(self) -> Mask:
        """Points whose worn volume is a result: computed to the end, and not known to a factor of two only."""
        found = self.computed & ~self.ended("sensitive")
        return found & (self.errors <= WELL_ENOUGH) if self.has("error_estimate") else found

    @cached_property
    def numerical(self) -> list[str]:
        """Axes that are numerical settings."""
        return [name for name in self.axes if name in ("step", "scheme") or name in self.study.get("solver", {})]

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
            return np.where(np.isnan(values[:, -1]), np.fmax.reduce(values, axis=1), values[:, -1])

        return self.over_points("worn_volume", last)


def _in_slabs(values: xr.DataArray, axes: Sequence[str]) -> Iterator[xr.DataArray]:
    """Parts of a variable along its axes, in their order, of which none is much larger than `_AT_ONCE`."""
    if values.size <= _AT_ONCE or not axes:
        yield values
        return
    axis, *others = axes
    length = max(1, _AT_ONCE // (values.size // values.sizes[axis]))
    for start in range(0, values.sizes[axis], length):
        yield from _in_slabs(values.isel({axis: slice(start, start + length)}), others if length == 1 else [])

"""Samples of a quantity, some of them without a value: read from a result, and statistics of them as bands."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.stats import rankdata

from studyrunner.scatter.section import ScatterSection

Array = NDArray[np.float64]
SAMPLE, CYCLE = "sample", "cycle"
DRAWN = "sample_"
"""How the coordinates with drawn values begin."""


@dataclass(frozen=True)
class SampleValues:
    """Samples of a quantity, n in the last dimension, at any number of points.

    low, high (..., n): the value, twice; of a sample without a value, or without one to be trusted, its bounds, where
    high may be inf. error (..., n): absolute numerical error of a value, 0 or more.
    """

    low: Array
    high: Array
    error: Array

    @property
    def is_known(self) -> NDArray[np.bool_]:
        """Whether a sample has a value, (..., n)."""
        return np.asarray(self.low == self.high)

    def at(self, place: Any) -> SampleValues:
        """Some of the points or samples, as numpy's indices select them."""
        return SampleValues(self.low[place], self.high[place], self.error[place])

    @property
    def widened(self) -> SampleValues:
        """The samples between their values less and more the numerical error, without error."""
        return SampleValues(self.low - self.error, self.high + self.error, np.zeros_like(self.error))

    @property
    def limited(self) -> SampleValues:
        """The samples with no bound above the largest value, and no error above its magnitude."""
        largest = np.where(self.is_known, self.high, self.low).max(axis=-1, keepdims=True)
        high = np.minimum(self.high, np.maximum(largest, self.low))
        return SampleValues(self.low, high, np.minimum(self.error, np.abs(largest)))


@dataclass(frozen=True)
class Band:
    """A statistic of samples, arrays of one shape.

    lowest, highest: over all that the samples without a value may have; equal where all have one.
    interval_low, interval_high: confidence interval, from that of `lowest` to that of `highest`.
    error_low, error_high: lowest and highest, with each value less or more its numerical error, all in one direction.
    """

    lowest: Array
    highest: Array
    interval_low: Array
    interval_high: Array
    error_low: Array
    error_high: Array


Estimate = Callable[[Array], tuple[Array, Array, Array]]
"""From values (..., n) to (..., d): d estimates and the ends of their intervals."""


def band_of(estimate: Estimate, values: SampleValues, inputs: Array | None = None) -> Band:
    """The band (..., d) of an estimate over all that samples without a value may be.

    inputs (n, d): drawn values where the estimate is one of order. A sample without a value is then also as high within
    its bounds as each input, or its reverse, orders it. Without inputs the estimate rises or falls with every value.
    """
    value, low, high = estimate(_cases(values, values, inputs))
    moved = value if not values.error.any() else estimate(_cases(values.widened, values, inputs))[0]
    ends = ((np.fmin, value), (np.fmax, value), (np.fmin, low), (np.fmax, high), (np.fmin, moved), (np.fmax, moved))
    return Band(*(end.reduce(each, axis=0) for end, each in ends))


def _cases(values: SampleValues, known_of: SampleValues, inputs: Array | None) -> Array:
    """Cases (n_cases, ..., n) of what the samples may be: all low, all high, and as the inputs order them."""
    low, high = values.low, values.high
    if np.array_equal(low, high):
        return low[None]
    cases = [low, high]
    if inputs is not None:
        known = known_of.is_known
        typical = np.where(known | ~known.any(axis=-1, keepdims=True), 0.5 * (low + high), np.nan)
        place = (rankdata(inputs, axis=0) - 0.5) / len(inputs)
        for column in (*place.T, *(1.0 - place.T)):
            ordered = np.moveaxis(np.nanquantile(typical, column, axis=-1), 0, -1)
            cases.append(np.clip(ordered, low, high))
    return np.stack(cases)


# --- from a result ---


def volume_samples(dataset: xr.Dataset) -> tuple[SampleValues, dict[Hashable, int]]:
    """Worn volumes, m3, with the sample last, and names and lengths of the dimensions before it.

    A volume that was not computed lies above the last one that was, without upper bound. A `sensitive` one lies within
    its error. An error that was never estimated is infinite.
    """
    return _read(dataset, dataset["worn_volume"], dataset.get("worn_volume_error"), relative=True)


def depth_samples(dataset: xr.Dataset) -> tuple[SampleValues, dict[Hashable, int]] | None:
    """Depths of the deepest pair, m, as `volume_samples`, with the largest error of any pair; None without depths."""
    if "wear_depth" in dataset:
        depth, error = dataset["wear_depth"].max("contact"), dataset.get("wear_depth_error")
        return _read(dataset, depth, None if error is None else error.max("contact"), relative=False)
    if "wear_depth_max" in dataset:
        return _read(dataset, dataset["wear_depth_max"], dataset.get("wear_depth_max_error"), relative=False)
    return None


def inputs_of(dataset: xr.Dataset) -> dict[str, Array]:
    """Drawn values (n,) of each input, in the order of the columns of its design; of an input of pairs their mean."""
    section = scatter_of(dataset)
    names = sorted(str(name).removeprefix(DRAWN) for name in dataset.coords if str(name).startswith(DRAWN))
    drawn = {name: dataset[f"{DRAWN}{name}"] for name in (names if section is None else section.inputs)}
    return {name: each.mean([d for d in each.dims if d != SAMPLE]).values for name, each in drawn.items()}


def is_of_pairs(dataset: xr.Dataset, name: str) -> bool:
    """Whether an input has a draw for each contact pair, or for each surface."""
    return "contact" in dataset[f"{DRAWN}{name}"].dims


def scatter_of(dataset: xr.Dataset) -> ScatterSection | None:
    """[scatter] of the study of a result; None where there is none that fits the samples of the file."""
    try:
        section = ScatterSection.model_validate(tomllib.loads(str(dataset.attrs.get("study", ""))).get("scatter"))
    except ValueError:
        return None
    has_all = all(f"{DRAWN}{name}" in dataset.coords for name in section.inputs)
    rows = section.realisations // section.samples
    return section if has_all and dataset.sizes[SAMPLE] % rows == 0 else None


def _read(
    dataset: xr.Dataset, values: xr.DataArray, errors: xr.DataArray | None, *, relative: bool
) -> tuple[SampleValues, dict[Hashable, int]]:
    ordered = values.transpose(..., SAMPLE)
    value = np.asarray(ordered.values, dtype=np.float64)
    missing = np.isnan(value)
    low, high = np.where(missing, 0.0, value), np.where(missing, np.inf, value)
    if CYCLE in ordered.dims:
        # worn volume never falls
        low = np.where(missing, np.maximum.accumulate(low, axis=ordered.dims.index(CYCLE)), low)
    error = np.full(value.shape, np.inf)
    if errors is not None:
        given = errors.broadcast_like(ordered).transpose(*ordered.dims).values.astype(np.float64)
        error = np.where(np.isnan(given), np.inf, given)
    # nothing worn is known to be nothing
    error[missing | (value == 0.0)] = 0.0
    if relative:
        error *= low
    outcome = dataset["outcome"]
    numbers, words = np.atleast_1d(outcome.attrs.get("flag_values", [])), str(outcome.attrs.get("flag_meanings", ""))
    named = zip(numbers, words.split(), strict=False)
    sensitive = outcome.isin([number for number, word in named if word == "sensitive"])
    vague = sensitive.broadcast_like(ordered).transpose(*ordered.dims).values & ~missing
    low, high = np.where(vague, np.maximum(low - error, 0.0), low), np.where(vague, high + error, high)
    lengths = {name: length for name, length in ordered.sizes.items() if name != SAMPLE}
    return SampleValues(low, high, np.where(vague, 0.0, error)), lengths

"""Samples of a quantity, some of them without a value: read from a result, and statistics of them as bands."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
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
        """The samples with no bound above the largest value."""
        largest = np.where(self.is_known, self.high, self.low).max(axis=-1, keepdims=True)
        return SampleValues(self.low, np.minimum(self.high, np.maximum(largest, self.low)), self.error)


Estimate = Callable[[Array], tuple[Array, Array, Array]]
"""From values (..., n) to (..., d): d estimates and the ends of their intervals."""


def band_of(estimate: Estimate, values: SampleValues, inputs: Array | None = None) -> tuple[Array, Array]:
    """Ends and confidence interval (..., d, 2) of an estimate over all that samples without a value may be.

    inputs (n, d): drawn values where the estimate is one of order. A sample without a value is then also as high within
    its bounds as each input, or its reverse, orders it. Without inputs the estimate rises or falls with every value.
    """
    cases = [values.low]
    known = values.is_known
    if not known.all():
        cases.append(values.high)
    if not known.all() and inputs is not None:
        typical = np.where(known | ~known.any(axis=-1, keepdims=True), 0.5 * (values.low + values.high), np.nan)
        place = (rankdata(inputs, axis=0) - 0.5).T / len(inputs)
        for order in (*place, *(1.0 - place)):
            ordered = np.moveaxis(np.nanquantile(typical, order, axis=-1), 0, -1)
            cases.append(np.clip(ordered, values.low, values.high))
    value, low, high = estimate(np.stack(cases))
    ends = ((np.fmin, value), (np.fmax, value), (np.fmin, low), (np.fmax, high))
    lowest, highest, interval_low, interval_high = (end.reduce(each, axis=0) for end, each in ends)
    return np.stack([lowest, highest], axis=-1), np.stack([interval_low, interval_high], axis=-1)


def read_samples(dataset: xr.Dataset, name: str) -> tuple[SampleValues, tuple[str, ...]]:
    """Samples of a variable of a result, and the dimensions before them: worn_volume, m3, wear_depth_max, m, or
    wear_depth, m, of which the deepest pair counts, with the largest error of any pair.

    What was not computed lies above the last value that was, without upper bound. What is `sensitive` lies within its
    error. An error that was never estimated is infinite.
    """
    values = dataset[name].astype(float)
    errors = dataset.get(f"{name}_error", xr.full_like(values, np.inf))
    if "contact" in values.dims:
        values, errors = values.max("contact"), errors.max("contact")
    values = values.transpose(..., SAMPLE)
    outcome = dataset["outcome"]
    words = dict(zip(outcome.attrs["flag_meanings"].split(), np.atleast_1d(outcome.attrs["flag_values"]), strict=False))
    value, missing = values.values, values.isnull().values
    low, high = np.where(missing, 0.0, value), np.where(missing, np.inf, value)
    if CYCLE in values.dims:
        # wear never falls
        low = np.where(missing, np.maximum.accumulate(low, axis=values.dims.index(CYCLE)), low)
    error = errors.fillna(np.inf).broadcast_like(values).transpose(*values.dims).values.copy()
    # nothing worn is known to be nothing
    error[missing | (value == 0.0)] = 0.0
    if name == "worn_volume":
        # its error is relative
        error *= low
    sensitive = (outcome == words.get("sensitive", -1)).broadcast_like(values).transpose(*values.dims).values
    vague = sensitive & ~missing
    low, high = np.where(vague, np.maximum(low - error, 0.0), low), np.where(vague, high + error, high)
    return SampleValues(low, high, np.where(vague, 0.0, error)), tuple(map(str, values.dims[:-1]))


def read_inputs(dataset: xr.Dataset) -> dict[str, Array]:
    """Drawn values (n,) of each input, in the order of the columns of its design; of an input of pairs their mean."""
    section = scatter_of(dataset)
    names = sorted(str(name).removeprefix(DRAWN) for name in dataset.coords if str(name).startswith(DRAWN))
    drawn = {name: dataset[f"{DRAWN}{name}"] for name in (names if section is None else section.inputs)}
    return {name: each.mean([d for d in each.dims if d != SAMPLE]).values for name, each in drawn.items()}


def scatter_of(dataset: xr.Dataset) -> ScatterSection | None:
    """[scatter] of the study of a result; None where there is none that fits the samples of the file."""
    try:
        section = ScatterSection.model_validate(tomllib.loads(str(dataset.attrs.get("study", ""))).get("scatter"))
    except ValueError:
        return None
    has_all = all(f"{DRAWN}{name}" in dataset.coords for name in section.inputs)
    rows = section.realisations // section.samples
    return section if has_all and dataset.sizes[SAMPLE] % rows == 0 else None

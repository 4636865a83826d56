"""Samples of a quantity, some of them without a value: read from a result; quantiles, probabilities, what decides.

Each estimate has ends over all that samples without a value may be, and a confidence interval, (..., d, 2). The
intervals are of independent samples. Samples of a Sobol' sequence or a Latin hypercube fill the distribution more
evenly: their intervals are wider than necessary.

By hand: `scipy.stats.sobol_indices`, which is used, takes no samples without a value; `scipy.stats.spearmanr` gives no
interval; the intervals of quantiles in `scipy.stats` are of one set of samples a call.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.stats import beta, binom, norm, rankdata, sobol_indices

from studyrunner.scatter.section import ScatterSection

Array = NDArray[np.float64]
SAMPLE, CYCLE = "sample", "cycle"
DRAWN = "sample_"
"""How the coordinates with drawn values begin."""

FEWEST = 10
"""Samples, or base samples of a Saltelli design, below which no input is ranked: the interval of a rank correlation
covers what it should from 10 samples on (Bonett and Wright 2000)."""

_RESAMPLES = 50
_SEED = 1
_ROUND_OFF = 1e-9
_EQUAL = 1e-12
"""Share of a value by which samples differ that are equal."""


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


def quantiles(values: SampleValues, probabilities: Sequence[float], confidence: float) -> tuple[Array, Array]:
    """Quantiles (..., d) without interpolation: of n samples the one of rank ceil(n probability).

    The interval lies between two samples whose ranks follow from the binomial distribution, whatever the distribution
    of the samples (David and Nagaraja 2003, section 7.1). With too few samples an end is infinite.
    """
    n, p, tail = values.low.shape[-1], np.array(probabilities), 0.5 * (1.0 - confidence)
    rank = np.maximum(np.ceil(n * p - _ROUND_OFF).astype(int), 1)
    # P(at most first - 1 samples lie below the quantile) <= tail, P(last samples or more do) <= tail
    first, last = binom.ppf(tail, n, p).astype(int), binom.ppf(1.0 - tail, n, p).astype(int) + 1

    def estimate(y: Array) -> tuple[Array, Array, Array]:
        ordered = np.sort(y, axis=-1)
        low = np.where(first >= 1, ordered[..., np.maximum(first, 1) - 1], -np.inf)
        return ordered[..., rank - 1], low, np.where(last <= n, ordered[..., np.minimum(last, n) - 1], np.inf)

    return band_of(estimate, values)


def exceedance(values: SampleValues, thresholds: Array, confidence: float) -> tuple[Array, Array]:
    """Probabilities (..., d) of values above d thresholds, with the intervals of Clopper and Pearson (1934)."""
    n, tail = values.low.shape[-1], 0.5 * (1.0 - confidence)

    def estimate(y: Array) -> tuple[Array, Array, Array]:
        above = np.stack([(y > each).sum(axis=-1) for each in thresholds], axis=-1).astype(np.float64)
        low = np.where(above > 0, beta.ppf(tail, np.maximum(above, 1), n - above + 1), 0.0)
        high = np.where(above < n, beta.ppf(1.0 - tail, above + 1, np.maximum(n - above, 1)), 1.0)
        return above / n, low, high

    return band_of(estimate, values)


def rank_correlations(inputs: Array, values: SampleValues, confidence: float) -> tuple[Array, Array]:
    """Spearman's rank correlations (..., d) of inputs (n, d) with values (..., n); NaN where nothing varies or n is
    below `FEWEST`. Intervals by Fisher's transformation (Bonett and Wright 2000).
    """
    n = len(inputs)

    def scores(y: Array) -> Array:
        ranks = rankdata(y, axis=-1) - 0.5 * (n + 1)
        length = np.linalg.norm(ranks, axis=-1, keepdims=True)
        return np.asarray(ranks / np.where(length > 0.0, length, 1.0))

    def estimate(y: Array) -> tuple[Array, Array, Array]:
        found = np.clip(scores(y) @ scores(inputs.T).T, -1.0, 1.0)
        margin = norm.ppf(0.5 + 0.5 * confidence) * np.sqrt((1.0 + 0.5 * found**2) / (n - 3.0))
        # that of 1 is infinite: the largest of other ranks, with two neighbours exchanged
        most = 1.0 - 12.0 / (n**3 - n)
        middle = np.arctanh(np.clip(found, -most, most))
        low, high = np.tanh(middle - margin), np.tanh(middle + margin)
        return _where_varying(y, found, np.minimum(low, found), np.maximum(high, found))

    return band_of(estimate, values.limited, inputs) if n >= FEWEST else _unknown(values, inputs.shape[1])


def saltelli_indices(
    inputs: Array, values: SampleValues, confidence: float
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """First and total Sobol' indices (..., d): share of the variance that an input decides alone, and with the others.

    inputs (n, d), values (..., n): 2 + d rows of each base sample, as `unit_design` has them. NaN as in
    `rank_correlations`, with base samples. Intervals by bootstrap of the base samples.
    """
    d = inputs.shape[1]
    n_base = len(inputs) // (2 + d)
    if n_base < FEWEST:
        return _unknown(values, d), _unknown(values, d)
    rng = np.random.default_rng(_SEED)
    blocks = np.arange(len(inputs)).reshape(n_base, -1)
    resampled = [blocks[rng.integers(n_base, size=n_base)].ravel() for _ in range(_RESAMPLES)]

    def both(y: Array) -> Array:
        """First and total indices (n_points, 2 d) of values (n_points, n)."""
        # scipy takes off dimensions of length 1: there are at least two points
        rows = np.vstack([y, y[:1]]).reshape(len(y) + 1, -1, 2 + d)
        parts = {"f_A": rows[..., 0], "f_B": rows[..., 1], "f_AB": np.moveaxis(rows[..., 2:], -1, 0)}
        found = sobol_indices(func=parts, n=n_base)
        return np.concatenate([each.reshape(len(y) + 1, d)[:-1] for each in (found.first_order, found.total_order)], 1)

    def estimate(y: Array) -> tuple[Array, Array, Array]:
        points = y.reshape(-1, y.shape[-1])
        found, spread = both(points), np.std([both(points[:, rows]) for rows in resampled], axis=0)
        margin = norm.ppf(0.5 + 0.5 * confidence) * spread
        ends = np.clip([found, found - margin, found + margin], 0.0, 1.0)
        return _where_varying(y, *ends.reshape(3, *y.shape[:-1], 2 * d))

    ends, interval = band_of(estimate, values.limited, inputs)
    return (ends[..., :d, :], interval[..., :d, :]), (ends[..., d:, :], interval[..., d:, :])


def _where_varying(y: Array, *estimates: Array) -> tuple[Array, Array, Array]:
    varies = np.ptp(y, axis=-1) > _EQUAL * np.abs(y).max(axis=-1)
    value, low, high = (np.where(varies[..., None], each, math.nan) for each in estimates)
    return value, low, high


def _unknown(values: SampleValues, d: int) -> tuple[Array, Array]:
    return (nothing := np.full((*values.low.shape[:-1], d, 2), math.nan)), nothing.copy()


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
    return section if has_all and dataset.sizes[SAMPLE] % section.rows_a_sample == 0 else None

"""What each input decides: Sobol' indices of a Saltelli design, rank correlations of any other one.

By hand: `scipy.stats.sobol_indices`, which is used, takes no samples without a value, and `scipy.stats.spearmanr` gives
no interval.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.stats import norm, rankdata, sobol_indices

from studyrunner.scatter.design import SaltelliLayout
from studyrunner.statistics.bands import Array, Band, SampleValues

FEWEST = 10
"""Samples, or base samples of a Saltelli design, below which nothing is said: the interval of a rank correlation covers
what it should from 10 samples on (Bonett and Wright 2000)."""

SOBOL = "Saltelli et al. 2010, scipy.stats.sobol_indices; interval by bootstrap of the base samples"
RANKS = "Spearman's rank correlation; interval by Fisher's transformation (Bonett and Wright 2000)"

_RESAMPLES = 50
_SEED = 1
_ROUND_OFF = 1e-12
"""Share of a value by which samples differ that are equal."""

_Estimate = Callable[[Array], tuple[Array, Array, Array]]
"""From values (n_points, n) to (..., n_points, d): estimates and the ends of their intervals."""


def rank_correlations(inputs: Array, values: SampleValues, confidence: float) -> Band:
    """Rank correlations (..., d) between -1 and 1; NaN where nothing varies or samples are too few.

    Parameters
    ----------
    inputs
        (n, d), drawn values, one column for an input.
    values
        (..., n), the quantity that is decided.
    confidence
        Of the intervals, between 0 and 1.
    """
    n = len(inputs)
    of_inputs = _normed_ranks(inputs.T)

    def estimate(y: Array) -> tuple[Array, Array, Array]:
        found = np.clip(_normed_ranks(y) @ of_inputs.T, -1.0, 1.0)
        margin = norm.ppf(0.5 + 0.5 * confidence) * np.sqrt((1.0 + 0.5 * found**2) / (n - 3.0))
        # that of 1 is infinite: the largest of other ranks, with two neighbours exchanged
        most = 1.0 - 12.0 / (n**3 - n)
        middle = np.arctanh(np.clip(found, -most, most))
        low, high = np.tanh(middle - margin), np.tanh(middle + margin)
        return found, np.minimum(low, found), np.maximum(high, found)

    if n < FEWEST:
        return _nothing(values, inputs.shape[1])
    return _band(estimate, inputs, values)


def saltelli_indices(
    layout: SaltelliLayout, inputs: Array, values: SampleValues, confidence: float
) -> tuple[Band, Band]:
    """First and total indices (..., d): the share of the variance that an input decides alone, and with the others.

    layout: which of the n rows is what; else as `rank_correlations`.
    """
    n_base = len(inputs) // layout.rows_per_base
    if n_base < FEWEST:
        return _nothing(values, inputs.shape[1]), _nothing(values, inputs.shape[1])
    rng = np.random.default_rng(_SEED)
    blocks = np.arange(len(inputs)).reshape(n_base, -1)
    resampled = [blocks[rng.integers(n_base, size=n_base)].ravel() for _ in range(_RESAMPLES)]

    def at(y: Array, which: int) -> Array:
        # scipy takes off dimensions of length 1: there are at least two points
        f_A, f_B, f_AB = layout.split(np.vstack([y, y[:1]]))
        found = sobol_indices(func={"f_A": f_A, "f_B": f_B, "f_AB": f_AB}, n=n_base)
        both = (found.first_order, found.total_order)
        return np.asarray(both[which].reshape(len(y) + 1, -1)[:-1])

    def of(which: int) -> Band:
        def estimate(y: Array) -> tuple[Array, Array, Array]:
            found = at(y, which)
            spread = np.std([at(y[:, rows], which) for rows in resampled], axis=0)
            margin = norm.ppf(0.5 + 0.5 * confidence) * spread
            return tuple(np.clip(each, 0.0, 1.0) for each in (found, found - margin, found + margin))  # type: ignore[return-value]

        return _band(estimate, inputs, values)

    return of(0), of(1)


def _normed_ranks(values: Array) -> Array:
    """Ranks (..., n) less their mean, with a sum of squares of 1; 0 for equal values."""
    ranks = rankdata(values, axis=-1)
    ranks -= ranks.mean(axis=-1, keepdims=True)
    length = np.sqrt((ranks**2).sum(axis=-1, keepdims=True))
    return np.asarray(np.divide(ranks, length, out=np.zeros_like(ranks), where=length > 0.0))


def _band(estimate: _Estimate, inputs: Array, values: SampleValues) -> Band:
    """The band of an estimate over all that samples without a value may be."""
    n, shape = values.n_samples, values.low.shape[:-1]

    def ends(cases: Array) -> tuple[Array, Array, Array, Array]:
        """Lowest and highest estimate, and outer ends of the intervals, of cases (n_cases, n_points, n)."""
        varies = np.ptp(cases, axis=-1) > _ROUND_OFF * np.abs(cases).max(axis=-1)
        found = [each.reshape(*cases.shape[:-1], -1) for each in estimate(cases.reshape(-1, n))]
        value, low, high = (np.where(varies[..., None], each, np.nan) for each in found)
        pairs = ((np.fmin, value), (np.fmax, value), (np.fmin, low), (np.fmax, high))
        return tuple(end.reduce(each, axis=0).reshape(*shape, -1) for end, each in pairs)

    lowest, highest, low, high = ends(_cases(values, inputs))
    error_low, error_high, *_ = ends(_cases(values, inputs, with_error=True))
    return Band(lowest, highest, low, high, error_low, error_high)


def _cases(values: SampleValues, inputs: Array, *, with_error: bool = False) -> Array:
    """Cases (n_cases, n_points, n) of what the samples may be; one where each has a value and no error is asked for.

    A sample without a value is between its bounds, and not above the largest of the others. The cases: all low, all
    high; and for each input as far as the bounds allow in the order of this input, and in the reverse.
    """
    low, high = (each.reshape(-1, values.n_samples) for each in (values.low, values.high))
    known = low == high
    largest = np.where(known, high, low).max(axis=-1, keepdims=True)
    high = np.minimum(high, np.maximum(largest, low))
    if with_error:
        error = np.minimum(values.error.reshape(low.shape), np.abs(largest))
        low, high = low - error, high + error
    elif np.array_equal(low, high):
        return low[None]
    typical = np.where(known | ~known.any(axis=-1, keepdims=True), 0.5 * (low + high), np.nan)
    place = (rankdata(inputs, axis=0) - 0.5) / values.n_samples
    orders = [np.nanquantile(typical, each, axis=-1).T for column in place.T for each in (column, 1.0 - column)]
    return np.stack([low, high, *(np.clip(order, low, high) for order in orders)])


def _nothing(values: SampleValues, n_inputs: int) -> Band:
    return Band(*[np.full((*values.low.shape[:-1], n_inputs), np.nan)] * 6)

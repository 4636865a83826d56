"""Quantiles and probabilities of samples, and what each input decides, with confidence intervals.

The intervals are of independent samples. Samples of a Sobol' sequence or a Latin hypercube fill the distribution more
evenly: their intervals are wider than necessary. Each estimate has ends and an interval (..., d, 2), see `band_of`.

By hand: `scipy.stats.sobol_indices`, which is used, takes no samples without a value; `scipy.stats.spearmanr` gives no
interval; the intervals of quantiles in `scipy.stats` are of one set of samples a call.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.stats import beta, binom, norm, rankdata, sobol_indices

from studyrunner.scatter.design import SaltelliLayout
from studyrunner.statistics.samples import Array, SampleValues, band_of

FEWEST = 10
"""Samples, or base samples of a Saltelli design, below which no input is ranked: the interval of a rank correlation
covers what it should from 10 samples on (Bonett and Wright 2000)."""

_RESAMPLES = 50
_SEED = 1
_ROUND_OFF = 1e-9
_EQUAL = 1e-12
"""Share of a value by which samples differ that are equal."""


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
    layout: SaltelliLayout, inputs: Array, values: SampleValues, confidence: float
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """First and total Sobol' indices (..., d): share of the variance that an input decides alone, and with the others.

    layout: which of the n rows of inputs (n, d) and values (..., n) is what. NaN as in `rank_correlations`, with base
    samples. Intervals by bootstrap of the base samples.
    """
    d, n_base = inputs.shape[1], len(inputs) // layout.rows_per_base
    if n_base < FEWEST:
        return _unknown(values, d), _unknown(values, d)
    rng = np.random.default_rng(_SEED)
    blocks = np.arange(len(inputs)).reshape(n_base, -1)
    resampled = [blocks[rng.integers(n_base, size=n_base)].ravel() for _ in range(_RESAMPLES)]

    def both(y: Array) -> Array:
        """First and total indices (n_points, 2 d) of values (n_points, n)."""
        # scipy takes off dimensions of length 1: there are at least two points
        f_A, f_B, f_AB = layout.split(np.vstack([y, y[:1]]))
        found = sobol_indices(func={"f_A": f_A, "f_B": f_B, "f_AB": f_AB}, n=n_base)
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

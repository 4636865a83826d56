"""Quantiles and probabilities of exceedance of samples, with confidence intervals.

The intervals are of independent samples. Samples of a Sobol' sequence or a Latin hypercube fill the distribution more
evenly: their intervals are wider than need be.

By hand: intervals of `scipy.stats` are of one set of samples a call, each with a value.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.stats import beta, binom

from studyrunner.statistics.bands import Array, Band, SampleValues

_ROUND_OFF = 1e-9


def quantile(values: SampleValues, probability: float, confidence: float) -> Band:
    """The quantile of a probability, without interpolation: of n samples the one of rank ceil(n probability).

    Its interval lies between two samples whose ranks follow from the binomial distribution, whatever the distribution
    of the samples (David and Nagaraja 2003, section 7.1); an end is infinite where there are too few samples for it.
    Band of shape (...).
    """
    n = values.n_samples
    rank = max(1, math.ceil(n * probability - _ROUND_OFF))
    tail = 0.5 * (1.0 - confidence)
    # P(at most first - 1 samples lie below the quantile) <= tail, P(last samples or more do) <= tail
    first, last = int(binom.ppf(tail, n, probability)), int(binom.ppf(1.0 - tail, n, probability)) + 1
    low, high, widened = np.sort(values.low), np.sort(values.high), values.widened
    return Band(
        low[..., rank - 1],
        high[..., rank - 1],
        low[..., first - 1] if first >= 1 else np.full(low.shape[:-1], -np.inf),
        high[..., last - 1] if last <= n else np.full(low.shape[:-1], np.inf),
        np.sort(widened.low)[..., rank - 1],
        np.sort(widened.high)[..., rank - 1],
    )


def exceedance(values: SampleValues, thresholds: Array, confidence: float) -> Band:
    """Probabilities that the quantity is above thresholds (m,), with the intervals of Clopper and Pearson (1934).

    Band of shape (..., m), between 0 and 1.
    """
    n, tail, widened = values.n_samples, 0.5 * (1.0 - confidence), values.widened

    def count(samples: Array) -> Array:
        return np.stack([(samples > threshold).sum(axis=-1) for threshold in thresholds], axis=-1).astype(np.float64)

    fewest, most = count(values.low), count(values.high)
    return Band(
        fewest / n,
        most / n,
        np.where(fewest > 0, beta.ppf(tail, np.maximum(fewest, 1), n - fewest + 1), 0.0),
        np.where(most < n, beta.ppf(1.0 - tail, most + 1, np.maximum(n - most, 1)), 1.0),
        count(widened.low) / n,
        count(widened.high) / n,
    )

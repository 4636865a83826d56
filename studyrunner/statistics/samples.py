"""Samples of a quantity, some of them without a value: quantiles, probabilities, what decides, two groups.

Each estimate has ends over all that samples without a value may be, and a confidence interval, (..., d, 2), of
independent samples: those of a Sobol' sequence or a Latin hypercube are more even, and their intervals too wide.

By hand: functions of `scipy.stats` take no samples without a value, `spearmanr` gives no interval, and those of
quantiles are of one set of samples a call; mixtures of scikit-learn take a skewed density for two groups.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy  # whose parts are loaded at their first use
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
CYCLE = "cycle"
DRAWN = "sample_"
"""How the coordinates with drawn values begin."""

FEWEST = 10
"""Samples, or base samples of a Saltelli design, below which no input is ranked: the interval of a rank correlation
covers what it should from 10 samples on (Bonett and Wright 2000)."""

_RESAMPLES = 50
_SEED = 1
_ROUND_OFF = 1e-9
_EQUAL = 1e-12  # share of a value by which samples differ that are equal
_FALSE_ALARMS = 0.005  # bound of the probability that samples of one group are taken for two
_FEWEST_SPACINGS = 2  # in each group: with one a gap passes at ratios that no joint has


@dataclass(frozen=True)
class SampleValues:
    """Samples of a quantity, n in the last dimension.

    low, high (..., n): the value, twice; without a value to be trusted its bounds, where high may be inf.
    error (..., n): absolute numerical error of a value, 0 or more.
    """

    low: Array
    high: Array
    error: Array

    @property
    def is_known(self) -> NDArray[np.bool_]:
        """Whether a sample has a value, (..., n)."""
        return np.asarray(self.low == self.high)

    def at(self, place: Any) -> "SampleValues":
        """Some of the points or samples, as numpy's indices select them."""
        return SampleValues(self.low[place], self.high[place], self.error[place])

    def widened(self, where: Any = True) -> "SampleValues":
        """Some of the samples, or all, between their values less and more the numerical error, without error."""
        by = np.where(where, self.error, 0.0)
        return SampleValues(self.low - by, self.high + by, np.where(where, 0.0, self.error))

    @property
    def limited(self) -> "SampleValues":
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
    known = values.is_known
    cases = [values.low] if known.all() else [values.low, values.high]
    if not known.all() and inputs is not None:
        typical = np.where(known | ~known.any(axis=-1, keepdims=True), 0.5 * (values.low + values.high), np.nan)
        place = (scipy.stats.rankdata(inputs, axis=0) - 0.5).T / len(inputs)
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
    first, last = scipy.stats.binom.ppf(tail, n, p).astype(int), scipy.stats.binom.ppf(1.0 - tail, n, p).astype(int) + 1

    def estimate(y: Array) -> tuple[Array, Array, Array]:
        ordered = np.sort(y, axis=-1)
        low = np.where(first >= 1, ordered[..., np.maximum(first, 1) - 1], -np.inf)
        return ordered[..., rank - 1], low, np.where(last <= n, ordered[..., np.minimum(last, n) - 1], np.inf)

    return band_of(estimate, values)


def exceedance(values: SampleValues, thresholds: Array, confidence: float) -> tuple[Array, Array]:
    """Probabilities (..., d) of values above d thresholds, with the intervals of `probability_interval`."""
    n = values.low.shape[-1]

    def estimate(y: Array) -> tuple[Array, Array, Array]:
        above = np.stack([(y > each).sum(axis=-1) for each in thresholds], axis=-1)
        return above / n, *probability_interval(above, n, confidence)

    return band_of(estimate, values)


def probability_interval(found: ArrayLike, n: int, confidence: float) -> tuple[Array, Array]:
    """Ends of the intervals of Clopper and Pearson (1934) of the probability of what is found so often in n samples."""
    of, tail = np.asarray(found, dtype=np.float64), 0.5 * (1.0 - confidence)
    low = np.where(of > 0, scipy.stats.beta.ppf(tail, np.maximum(of, 1), n - of + 1), 0.0)
    return low, np.where(of < n, scipy.stats.beta.ppf(1.0 - tail, of + 1, np.maximum(n - of, 1)), 1.0)


def within(
    values: SampleValues, limit: float, confidence: float, *, at_least: bool = False
) -> tuple[Array, Array, NDArray[np.int_]]:
    """Probability (..., 2) of values up to a limit, or from it on, its interval (..., 2), and the number (...) of
    samples of which value and error, or its bounds, lie on both sides: these count as within and as beyond.
    """
    own, end = values.widened(), np.nextafter(limit, -np.inf) if at_least else limit
    band, interval = (each[..., 0, :] for each in exceedance(own, np.array([end]), confidence))
    if not at_least:
        band, interval = (1.0 - each[..., ::-1] for each in (band, interval))
    return band, interval, ((own.low <= end) & (own.high > end)).sum(axis=-1)


def rank_correlations(inputs: Array, values: SampleValues, confidence: float) -> tuple[Array, Array]:
    """Spearman's rank correlations (..., d) of inputs (n, d) with values (..., n); NaN where nothing varies or n is
    below `FEWEST`. Intervals by Fisher's transformation (Bonett and Wright 2000).
    """
    n = len(inputs)

    def scores(y: Array) -> Array:
        ranks = scipy.stats.rankdata(y, axis=-1) - 0.5 * (n + 1)
        length = np.linalg.norm(ranks, axis=-1, keepdims=True)
        return np.asarray(ranks / np.where(length > 0.0, length, 1.0))

    def estimate(y: Array) -> tuple[Array, Array, Array]:
        found = np.clip(scores(y) @ scores(inputs.T).T, -1.0, 1.0)
        margin = scipy.stats.norm.ppf(0.5 + 0.5 * confidence) * np.sqrt((1.0 + 0.5 * found**2) / (n - 3.0))
        # that of 1 is infinite: the largest of other ranks, with two neighbours exchanged
        most = 1.0 - 12.0 / (n**3 - n)
        middle = np.arctanh(np.clip(found, -most, most))
        low, high = np.tanh(middle - margin), np.tanh(middle + margin)
        return _where_varying(y, found, np.minimum(low, found), np.maximum(high, found))

    return band_of(estimate, values.limited, inputs) if n >= FEWEST else _unknown(values, inputs.shape[1])


def saltelli_indices(inputs: Array, values: SampleValues, confidence: float) -> tuple[Array, Array]:
    """Sobol' indices (..., 2 d): d first ones, shares of the variance that an input decides alone, and d total ones,
    with the others.

    inputs (n, d), values (..., n): 2 + d rows of each base sample, as `unit_design` has them. NaN as in
    `rank_correlations`, with base samples, and where these are no power of 2, as of a run that goes on. Intervals by
    bootstrap of the base samples.
    """
    d = inputs.shape[1]
    n_base = len(inputs) // (2 + d)
    if n_base < FEWEST or n_base.bit_count() > 1:
        return _unknown(values, 2 * d)
    rng = np.random.default_rng(_SEED)
    blocks = np.arange(len(inputs)).reshape(n_base, -1)
    resampled = [blocks[rng.integers(n_base, size=n_base)].ravel() for _ in range(_RESAMPLES)]

    def both(y: Array) -> Array:
        """First and total indices (n_points, 2 d) of values (n_points, n)."""
        # scipy takes off dimensions of length 1: there are at least two points
        rows = np.vstack([y, y[:1]]).reshape(len(y) + 1, -1, 2 + d)
        parts = {"f_A": rows[..., 0], "f_B": rows[..., 1], "f_AB": np.moveaxis(rows[..., 2:], -1, 0)}
        found = scipy.stats.sobol_indices(func=parts, n=n_base)
        return np.concatenate([each.reshape(len(y) + 1, d)[:-1] for each in (found.first_order, found.total_order)], 1)

    def estimate(y: Array) -> tuple[Array, Array, Array]:
        points = y.reshape(-1, y.shape[-1])
        found, spread = both(points), np.std([both(points[:, rows]) for rows in resampled], axis=0)
        margin = scipy.stats.norm.ppf(0.5 + 0.5 * confidence) * spread
        ends = np.clip([found, found - margin, found + margin], 0.0, 1.0)
        return _where_varying(y, *ends.reshape(3, *y.shape[:-1], 2 * d))

    return band_of(estimate, values.limited, inputs)


def _where_varying(y: Array, *estimates: Array) -> tuple[Array, Array, Array]:
    varies = np.ptp(y, axis=-1) > _EQUAL * np.abs(y).max(axis=-1)
    value, low, high = (np.where(varies[..., None], each, math.nan) for each in estimates)
    return value, low, high


def _unknown(values: SampleValues, d: int) -> tuple[Array, Array]:
    return (nothing := np.full((*values.low.shape[:-1], d, 2), math.nan)), nothing.copy()


# --- two groups, as where a pair slips or locks ---


@dataclass(frozen=True)
class Groups:
    """Two groups of samples. lower_end, upper_end: of the gap between them, in the unit of the samples.

    is_upper (n,): whether a sample is in the upper group. is_placed (n,): whether it is known to be in one of them.
    """

    lower_end: float
    upper_end: float
    is_upper: NDArray[np.bool_]
    is_placed: NDArray[np.bool_]

    @property
    def sizes(self) -> tuple[int, int]:
        """Numbers of samples below and above the gap."""
        return int((self.is_placed & ~self.is_upper).sum()), int((self.is_placed & self.is_upper).sum())


def two_groups(values: SampleValues) -> Groups | None:
    """The two groups of samples (n,), None where one density with a single peak may be what they are of.

    Such a density falls from every gap outwards on one side at least. The spacings there are longer than the gap by
    trend, and the ratio of the gap to the mean of these k spacings is above r with a probability of at most
    (1 + r / k)^-k, the one of a uniform density. The side with the larger probability counts; that any of n gaps passes
    by chance has a probability below 0.5 %. Of the gaps that pass, and are longer than the numerical errors beside
    them, the longest is taken. A sample whose error is above half of the range of all counts as one without a value.
    """
    known = values.is_known
    if known.any():
        values = values.widened(known & (values.error > 0.5 * np.ptp(values.low[known])))
        known = values.is_known
    order = np.argsort(values.low[known], kind="stable")
    sample, error = values.low[known][order], values.error[known][order]
    gap, number = np.diff(sample), np.arange(len(sample) - 1)

    def chance(spacings: NDArray[np.intp], length: Array) -> Array:
        # of a gap beside so many spacings of this length in all, if they are of one density
        share = np.divide(length, length + gap, out=np.ones(len(gap)), where=length + gap > 0.0)
        return np.asarray(share**spacings)

    both = np.maximum(chance(number, sample[:-1] - sample[:1]), chance(number[::-1], sample[-1:] - sample[1:]))
    passes = (both * len(gap) < _FALSE_ALARMS) & (gap > error[:-1] + error[1:])
    passes &= np.minimum(number, number[::-1]) >= _FEWEST_SPACINGS
    if not passes.any():
        return None
    best = int(np.argmax(np.where(passes, gap, 0.0)))
    lower, upper = float(sample[best]), float(sample[best + 1])
    is_upper = values.low > lower
    return Groups(lower, upper, is_upper, is_upper | (values.high < upper))


def density(values: SampleValues, groups: Groups | None, grid: Array) -> Array:
    """Density of the samples with a value on a grid (m,): Gaussian kernels, Silverman's width of each group alone."""
    known = values.is_known
    upper = np.zeros_like(known) if groups is None else groups.is_upper
    whole = np.zeros(grid.shape)
    for sample in (values.low[known & ~upper], values.low[known & upper]):
        if len(sample):
            # equal samples: as narrow a peak as the grid shows
            width = max(1.06 * sample.std() * len(sample) ** -0.2, 0.5 * float(np.ptp(grid)) / len(grid)) or np.nan
            whole += scipy.stats.norm.pdf(grid[:, None], sample, width).sum(axis=1) / known.sum()
    return whole


def deciding_pair(depths: Array, groups: Groups) -> int | None:
    """The pair whose depths are all larger in one group, with the largest distance of the means over the root of the
    mean of both variances; None where the depths of each pair overlap. depths (n, n_pairs): m, NaN where not known.
    """
    known = groups.is_placed & np.isfinite(depths).all(axis=1)
    below, above = depths[known & ~groups.is_upper], depths[known & groups.is_upper]
    if len(below) == 0 or len(above) == 0:
        return None
    apart = (above.min(axis=0) > below.max(axis=0)) | (above.max(axis=0) < below.min(axis=0))
    width = np.sqrt(0.5 * (below.var(axis=0) + above.var(axis=0)))
    distance = np.abs(above.mean(axis=0) - below.mean(axis=0))
    ratio = np.divide(distance, width, out=np.full(len(width), np.inf), where=width > 0.0)
    return int(np.argmax(np.where(apart, ratio, -1.0))) if apart.any() else None

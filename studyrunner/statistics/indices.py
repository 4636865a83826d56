"""First and total Sobol' indices: which share of the variance an input decides, alone and with the others.

By hand: `scipy.stats.sobol_indices`, which is used, has no bands and takes neither other designs nor gaps.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, sobol_indices

from studyrunner.scatter.design import SaltelliLayout
from studyrunner.statistics import expansion
from studyrunner.statistics.bands import Array, Band, SampleValues

_RESAMPLES = 50
_SEED = 1
_FEWEST = 8
"""Samples below which no index is told."""
_ROUND_OFF = 1e-12
"""Share of a value by which samples differ that are equal."""

_Rows = NDArray[np.intp]
_Estimate = Callable[[Array, _Rows], Array]
"""From values (n_points, n) and some of the samples to (first or total, value or low or high, n_points, d)."""


@dataclass(frozen=True)
class Indices:
    """Sobol' indices, bands of shape (..., n_inputs) between 0 and 1; NaN where nothing varies or samples are too few.

    first_method, total_method: name of the estimate, with its source.
    """

    first: Band
    total: Band
    first_method: str
    total_method: str


def plain_indices(inputs: Array, values: SampleValues, confidence: float, balanced: NDArray[np.bool_]) -> Indices:
    """Indices from samples of any design.

    First ones by classes of equal size (Plischke, Borgonovo and Smith 2013), total ones by a polynomial chaos
    expansion (Sudret 2008), whose interval holds what the expansion leaves unexplained. Standard errors are those of
    halves of the samples, drawn without replacement (delete-half jackknife, Shao and Wu 1989).

    A sample without a value is taken between its bounds, and not above the largest of the others. The ends of a band
    are those of 2 + 3 d cases: all low, all high; and for each input low below its median and high above, the
    reverse, and the mean of the samples near in this input.

    Parameters
    ----------
    inputs
        (n, d), drawn values, one column for an input.
    values
        (..., n), the quantity that is decided.
    confidence
        Of the intervals, between 0 and 1.
    balanced
        (d,), whether an input is a column of a Sobol' sequence: its classes are then even in the other inputs, and
        what independent samples add to the variance between classes is not taken off.
    """
    n = len(inputs)
    rng = np.random.default_rng(_SEED)

    def estimate(y: Array, rows: _Rows) -> Array:
        y = y[:, rows]
        first = _given_data(inputs[rows], y, balanced)
        total, unexplained = expansion.expand(inputs[rows], y)
        low = total * (1.0 - unexplained[:, None])
        return np.array([[first, first, first], [total, low, low + unexplained[:, None]]])

    halves = (np.sort(rng.permutation(n)[: n // 2]) for _ in range(_RESAMPLES))
    first, total = _bands(estimate, halves, inputs, values, confidence)
    return Indices(first, total, "classes of equal size (Plischke et al. 2013)", expansion.NAME)


def saltelli_indices(layout: SaltelliLayout, inputs: Array, values: SampleValues, confidence: float) -> Indices:
    """Indices by `scipy.stats.sobol_indices` (Saltelli et al. 2010), standard errors by bootstrap of base samples.

    inputs (n, d), values (..., n): as for `plain_indices`; layout: which of the n rows is what.
    """
    n_base = len(inputs) // layout.rows_per_base
    rng = np.random.default_rng(_SEED)
    blocks = np.arange(len(inputs)).reshape(n_base, -1)

    def estimate(y: Array, rows: _Rows) -> Array:
        # scipy takes off dimensions of length 1: there are at least two points
        f_A, f_B, f_AB = layout.split(np.vstack([y, y[:1]])[:, rows])
        found = sobol_indices(func={"f_A": f_A, "f_B": f_B, "f_AB": f_AB}, n=n_base)
        both = np.stack([found.first_order, found.total_order]).reshape(2, len(y) + 1, -1)[:, :-1]
        return np.repeat(both[:, None], 3, axis=1)

    resampled = (blocks[rng.integers(n_base, size=n_base)].ravel() for _ in range(_RESAMPLES))
    first, total = _bands(estimate, resampled, inputs, values, confidence)
    return Indices(first, total, *["Saltelli et al. 2010, scipy.stats.sobol_indices"] * 2)


def _given_data(inputs: Array, values: Array, balanced: NDArray[np.bool_]) -> Array:
    """Variance between classes over the whole: (n_points, d). With M classes of n samples, independent samples add
    M - 1 times the variance within classes over n - M.
    """
    n = values.shape[1]
    starts = _class_starts(n)
    n_classes, sizes = len(starts), np.diff(np.append(starts, n))
    centred = values - values.mean(axis=1, keepdims=True)
    whole = np.maximum((centred**2).sum(axis=1), np.finfo(np.float64).tiny)
    found = np.zeros((len(values), inputs.shape[1]))
    for column, each in enumerate(inputs.T):
        if np.ptp(each) > 0.0:
            sums = np.add.reduceat(centred[:, np.argsort(each, kind="stable")], starts, axis=1)
            within = 1.0 - (sums**2 / sizes).sum(axis=1) / whole
            found[:, column] = 1.0 - within * (1.0 if balanced[column] else (n - 1) / (n - n_classes))
    return found


def _class_starts(n: int) -> _Rows:
    """First ranks of the classes of n samples: about as many classes as there are samples in two of them."""
    n_classes = 2 ** int(0.5 * np.log2(2 * n))
    return np.asarray(np.arange(n_classes) * n // n_classes)


def _bands(
    estimate: _Estimate, resamples: Iterator[_Rows], inputs: Array, values: SampleValues, confidence: float
) -> tuple[Band, Band]:
    """Bands of the first and of the total indices."""
    shape, n = values.low.shape[:-1], values.n_samples
    if n < _FEWEST:
        nothing = np.full((*shape, inputs.shape[1]), np.nan)
        return Band(*[nothing] * 6), Band(*[nothing] * 6)

    def at(rows: _Rows, cases: Array) -> Array:
        found = estimate(cases.reshape(-1, n), rows)
        return found.reshape(2, 3, *cases.shape[:-1], -1)

    cases, widened = _cases(values, inputs), _cases(values, inputs, with_error=True)
    varies = np.ptp(cases, axis=-1) > _ROUND_OFF * np.abs(cases).max(axis=-1)
    value, low, high = np.moveaxis(np.where(varies[..., None], at(np.arange(n), cases), np.nan), 1, 0)
    spread = np.std([at(rows, cases)[:, 0] for rows in resamples], axis=0)
    margin = norm.ppf(0.5 + 0.5 * confidence) * spread
    error = np.where(varies.any(axis=0)[:, None], at(np.arange(n), widened)[:, 0], np.nan)

    def of(which: int, samples: Array, end: np.ufunc) -> Array:
        found: Array = end.reduce(samples[which], axis=0).reshape(*shape, -1)
        return np.clip(found, 0.0, 1.0)

    first, total = (
        Band(
            of(which, value, np.fmin),
            of(which, value, np.fmax),
            of(which, low - margin, np.fmin),
            of(which, high + margin, np.fmax),
            of(which, error, np.fmin),
            of(which, error, np.fmax),
        )
        for which in range(2)
    )
    return first, total


def _cases(values: SampleValues, inputs: Array, *, with_error: bool = False) -> Array:
    """Cases (n_cases, n_points, n) of what the samples may be; one where each has a value and no error is asked for."""
    low, high = (each.reshape(-1, values.n_samples) for each in (values.low, values.high))
    largest = np.where(low == high, high, low).max(axis=-1, keepdims=True)
    high = np.minimum(high, np.maximum(largest, low))
    if with_error:
        error = np.minimum(values.error.reshape(low.shape), np.abs(largest))
        low, high = low - error, high + error
    elif np.array_equal(low, high):
        return low[None]
    sides = inputs > np.median(inputs, axis=0)
    cases = [low, high, *(np.where(side, a, b) for side in sides.T for a, b in ((low, high), (high, low)))]
    cases += [np.clip(_class_means(each, low, values.is_known.reshape(low.shape)), low, high) for each in inputs.T]
    return np.stack(cases)


def _class_means(each: Array, values: Array, known: NDArray[np.bool_]) -> Array:
    """Mean of the samples with a value that are of the same class of an input, (n_points, n)."""
    order, starts = np.argsort(each, kind="stable"), _class_starts(len(each))
    sums = np.add.reduceat(np.where(known, values, 0.0)[:, order], starts, axis=1)
    counts = np.add.reduceat(known[:, order], starts, axis=1, dtype=np.intp)
    means = np.empty(values.shape)
    means[:, order] = np.repeat(sums / np.maximum(counts, 1), np.diff(np.append(starts, len(each))), axis=1)
    return means

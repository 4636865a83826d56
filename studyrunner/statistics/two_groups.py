"""Whether samples fall into two groups, as where a pair slips or locks; the density, and the pair that decides.

By hand: the mixtures of scikit-learn take a skewed density with one peak for two groups.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from studyrunner.statistics.samples import Array, SampleValues

_FALSE_ALARMS = 0.005
"""Bound of the probability that samples of one group are taken for two."""
_FEWEST_SPACINGS = 2
"""In each group: with one a gap passes at ratios that no joint has."""


@dataclass(frozen=True)
class Groups:
    """Two groups of samples with a gap between. lower_end, upper_end: of the gap, in the unit of the samples.

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
    """The two groups of samples (n,), None where one hill of any form may be what they are of.

    Where the density has one peak, it falls from every gap outwards on one side at least. The spacings there are then
    longer than the gap by trend, and the ratio of the gap to the mean of these k spacings is above r with a probability
    of at most (1 + r / k)^-k, the one of a uniform density. The gap is compared with the side on which the probability
    is larger; that any of n gaps passes by chance has a probability below 0.5 %. The gap must be longer than the
    numerical errors beside it. Of the gaps that pass the longest is taken. A sample whose error is more than half of
    the range of all samples may lie on either side of a gap and counts as one without a value.
    """
    known, wide = values.is_known, values.widened
    if known.any():
        vague = known & (values.error > 0.5 * np.ptp(values.low[known]))
        low, high = np.where(vague, wide.low, values.low), np.where(vague, wide.high, values.high)
        values = SampleValues(low, high, np.where(vague, 0.0, values.error))
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
    """Density of the samples with a value at the points of a grid (m,): Gaussian kernels, Silverman's width.

    The width is of each group alone, so that both peaks stay as sharp as they are. NaN for samples that are all equal.
    """
    known = values.is_known
    upper = np.zeros_like(known) if groups is None else groups.is_upper
    whole = np.zeros(grid.shape)
    for sample in (values.low[known & ~upper], values.low[known & upper]):
        if len(sample):
            # equal samples: as narrow a peak as the grid shows
            width = max(1.06 * sample.std() * len(sample) ** -0.2, 0.5 * float(np.ptp(grid)) / len(grid)) or np.nan
            whole += norm.pdf(grid[:, None], sample, width).sum(axis=1) / known.sum()
    return whole


def deciding_pair(depths: Array, groups: Groups) -> int | None:
    """The pair that separates both groups best; None where the depths of each pair overlap.

    depths (n, n_pairs): m, NaN where not known. Of the pairs whose depths in one group are all larger than those in the
    other, the one with the largest distance of the means over the root of the mean of both variances.
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

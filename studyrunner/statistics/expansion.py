"""Polynomial chaos expansion by least squares, for total Sobol' indices from samples of any design.

Nearest neighbours (Broto, Bachoc and Depecker 2020) and ranks (Gamboa et al. 2022) take samples as independent. Those
of a Sobol' sequence are not, and of 128 or 1024 the estimates of either are off by 0.1 to 0.25 (Ishigami's function, a
lognormal product); those of the expansion by 0.01 to 0.1.

By hand: `openturns` and `chaospy` are large packages in place of these few functions.
"""

from __future__ import annotations

import math
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import eval_legendre
from scipy.stats import rankdata

from studyrunner.statistics.bands import Array

NAME = "polynomial chaos expansion by least squares (Sudret 2008), degree by leave-one-out error"

_HIGHEST_DEGREE, _MOST_TERMS = 10, 200
_TINY = np.finfo(np.float64).tiny
_SAMPLES_PER_TERM = 2.0
"""At least so many samples for each coefficient, as Blatman and Sudret (2010) advise 2 to 3."""


def expand(inputs: Array, values: Array) -> tuple[Array, Array]:
    """Total indices of the part of the variance that an expansion in Legendre polynomials of the ranks explains.

    The degree of each point is the one of the smallest leave-one-out error.

    Parameters
    ----------
    inputs
        (n, d); a constant column has the index 0.
    values
        (n_points, n), finite; constant ones have no meaningful index.

    Returns
    -------
    total : NDArray
        (n_points, d), shares of the explained variance; NaN with fewer than 2 (d + 1) samples.
    unexplained : NDArray
        (n_points,), share of the variance that the expansion leaves, between 0 and 1.
    """
    n, varies = len(inputs), np.ptp(inputs, axis=0) > 0.0
    d = int(np.count_nonzero(varies))
    total = np.full((len(values), inputs.shape[1]), np.nan)
    unexplained = np.full(len(values), np.inf)
    coordinate = (2.0 * rankdata(inputs[:, varies], axis=0) - 1.0) / n - 1.0
    centred = values - values.mean(axis=1, keepdims=True)
    variance = np.maximum((centred**2).mean(axis=1), _TINY)
    for degree in range(1, _HIGHEST_DEGREE + 1):
        if math.comb(d + degree, degree) > min(n / _SAMPLES_PER_TERM, _MOST_TERMS) or d == 0:
            break
        powers = _powers(d, degree)
        legendre = [eval_legendre(k, coordinate) * math.sqrt(2 * k + 1) for k in range(degree + 1)]
        basis = np.prod([np.stack(legendre)[powers[:, i], :, i] for i in range(d)], axis=0).T
        q, r = np.linalg.qr(basis)
        inner = centred @ q
        leverage = (q**2).sum(axis=1)
        left = ((centred - inner @ q.T) / np.maximum(1.0 - leverage, 1e-6)) ** 2
        share = left.mean(axis=1) / variance
        better = share < unexplained
        squares = solve_triangular(r, inner[better].T).T[:, 1:] ** 2
        parts = squares @ (powers[1:] > 0) / np.maximum(squares.sum(axis=1, keepdims=True), _TINY)
        total[np.ix_(better, varies)] = parts
        unexplained[better] = share[better]
    total[:, ~varies] = 0.0
    return total, np.minimum(unexplained, 1.0)


def _powers(d: int, degree: int) -> NDArray[np.intp]:
    """Degrees (n_terms, d) of the terms up to a total degree, the constant one first."""
    chosen = combinations_with_replacement(range(d + 1), degree)
    powers = np.array([np.bincount(each, minlength=d + 1)[:d] for each in chosen])
    return powers[np.argsort(powers.sum(axis=1), kind="stable")]

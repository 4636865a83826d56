"""Designs of samples in the unit cube: Sobol' sequence, Latin hypercube, random, Saltelli.

By hand: a column of `scipy.stats.qmc` depends on the number of columns; its plain Sobol' sequence is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studyrunner.scatter.section import Method
from studyrunner.user_error import WrongValueError

_DIGITS = 30
"""Binary digits of a Sobol' sequence in scipy."""


@dataclass(frozen=True)
class SaltelliLayout:
    """Rows of a Saltelli design. Of each base sample: A, B, and for each group of columns A with this group from B."""

    n_groups: int

    @property
    def rows_per_base(self) -> int:
        """Rows of a base sample."""
        return 2 + self.n_groups

    def split(
        self, values: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """f_A (..., n), f_B (..., n), f_AB (n_groups, ..., n) of values (..., n rows_per_base) of the rows."""
        rows = values.reshape(*values.shape[:-1], -1, self.rows_per_base)
        return rows[..., 0], rows[..., 1], np.moveaxis(rows[..., 2:], -1, 0)


def unit_design(
    method: Method, seed: int, samples: int, dimensions: int, groups: Sequence[int] = ()
) -> NDArray[np.float64]:
    """Points (rows, dimensions) in the unit cube, without its surface.

    A column depends on its number, the seed and the method alone. Except with "latin_hypercube" the first rows are the
    design of fewer samples. "sobol" is scrambled by a random lower triangular matrix and a digital shift (Matousek
    1998); with "saltelli" A and B are two halves of its columns (Saltelli et al. 2010), and there are 2 + len(groups)
    rows a sample. groups: numbers of columns that vary together in "saltelli"; each alone if empty.

    Raises WrongValueError where a Sobol' sequence has not so many columns.
    """
    if method == "saltelli":
        return _saltelli(seed, samples, groups or (1,) * dimensions)
    if method == "sobol":
        return _sobol(seed, samples, dimensions)
    columns = np.empty((dimensions, samples))
    for number, column in enumerate(columns):
        rng = np.random.default_rng([seed, number])
        # strictly inside: a normal distribution has no value at 0
        column[:] = np.maximum(rng.random(samples), 2.0**-53)
        if method == "latin_hypercube":
            column[:] = (rng.permutation(samples) + column) / samples
    return columns.T


def _sobol(seed: int, samples: int, dimensions: int) -> NDArray[np.float64]:
    from scipy.stats import qmc  # where it is used: it takes a while to load

    if dimensions > qmc.Sobol.MAXDIM:
        remedy = f'give "random": a Sobol\' sequence has at most {qmc.Sobol.MAXDIM} columns, {dimensions} are drawn'
        raise WrongValueError("sobol", remedy, "scatter.method")
    power = max(samples - 1, 0).bit_length()
    plain = qmc.Sobol(dimensions, scramble=False, bits=_DIGITS).random_base2(power)[:samples]
    whole = (plain * 2.0**_DIGITS).astype(np.int64)
    design = np.empty((samples, dimensions))
    for column in range(dimensions):
        rng = np.random.default_rng([seed, column])
        scrambled = np.full(samples, rng.integers(2**_DIGITS))
        for digit in range(_DIGITS):
            # a digit changes itself and, at random, those behind it
            changed = 2**digit + rng.integers(2**digit)
            scrambled ^= np.where(whole[:, column] >> digit & 1, changed, 0)
        design[:, column] = (scrambled + 0.5) / 2.0**_DIGITS
    return design


def _saltelli(seed: int, samples: int, groups: Sequence[int]) -> NDArray[np.float64]:
    dimensions = sum(groups)
    # A and B of one column stand side by side, so that further columns change neither
    both = _sobol(seed, samples, 2 * dimensions)
    first, second = both[:, 0::2], both[:, 1::2]
    design = np.repeat(first[:, None], SaltelliLayout(len(groups)).rows_per_base, axis=1)
    design[:, 1] = second
    ends = np.cumsum(groups)
    for group, (begin, end) in enumerate(zip(ends - groups, ends, strict=True)):
        design[:, 2 + group, begin:end] = second[:, begin:end]
    return design.reshape(-1, dimensions)

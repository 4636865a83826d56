"""The values that the samples of a study draw of its inputs, and designs of samples in the unit cube.

By hand: a column of `scipy.stats.qmc` depends on the number of columns; its plain Sobol' sequence is used.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import cholesky

from studyrunner.scatter.section import Array, Distribution, Method, Scattered, ScatterSection
from studyrunner.user_error import WrongValueError

_ABOVE_ZERO = ("area", "excitation_amplitude", "frequency")
_NOT_BELOW_ZERO = ("friction_coefficient", "surfaces_", "threshold", "wear_coefficient")

_NUGGET = 1e-8
"""Share of the variance of a field that is independent from pair to pair: its Cholesky factor exists then for any
positions; a value changes by 1e-4 standard deviations."""

_DIGITS = 30
"""Binary digits of a Sobol' sequence in scipy."""


@dataclass(frozen=True)
class ScatteredPairs:
    """Contact pairs between which inputs may differ. surface (n_pairs,): labels. position (n_pairs, 3): m, or NaN."""

    surface: tuple[str, ...]
    position: Array


@dataclass(frozen=True)
class Drawn:
    """What the samples draw of an input: standard normal scores (samples,), or (samples, n_pairs) where pairs differ,
    of its distribution.
    """

    score: Array
    distribution: Distribution

    def apply(self, own: ArrayLike) -> Array:
        """The input (samples,) or (samples, n_pairs), of the study's own value: a number, or (n_pairs,).

        Without width it is the own value to the last bit.
        """
        own = np.asarray(own, dtype=np.float64)
        score = self.score if own.ndim == 0 or self.score.ndim == 2 else self.score[:, None]
        return np.zeros_like(own + score) + self.distribution.at(own, score)


def drawn(section: ScatterSection, own_values: Mapping[str, ArrayLike], pairs: ScatteredPairs) -> dict[str, Drawn]:
    """What the samples draw of each input that scatters, in the order of `section.inputs`.

    own_values: of the study: a number, (n_pairs,), or (n_values, 1) for an axis; not needed for an absolute
    distribution.

    Raises WrongValueError, with its key, where a draw is none that physics allows, positions that a correlation length
    needs are missing, or a width is a share of 0.
    """
    from scipy.special import ndtri  # where it is used: it takes a while to load

    inputs = section.inputs
    labels = tuple(dict.fromkeys(pairs.surface))
    widths = {"all pairs": 1, "each surface": len(labels), "each pair": len(pairs.surface)}
    groups = [widths[each.of] for each in inputs.values()]
    design = unit_design(section.method, section.seed, section.samples, sum(groups), groups)
    scores = np.split(ndtri(design), np.cumsum(groups)[:-1], axis=1)
    found = {}
    for (name, scattered), score in zip(inputs.items(), scores, strict=True):
        if scattered.of == "each surface":
            score = score[:, [labels.index(label) for label in pairs.surface]]
        elif scattered.correlation_length is not None:
            score = score @ _field(name, scattered.correlation_length, pairs).T
        found[name] = Drawn(score if scattered.of != "all pairs" else score[:, 0], scattered.distribution)
        _check(name, scattered, found[name], own_values.get(name, 0.0))
    return found


def _field(name: str, length: float, pairs: ScatteredPairs) -> Array:
    """Factor L (n_pairs, n_pairs) of a Gaussian field L z of unit variance, z independent.

    Correlation exp(-(r / length)^2 / 2) of two pairs of a surface at the distance r; surfaces are independent.
    """
    if not np.isfinite(pairs.position).all():
        remedy = "leave it out: the scene does not say where its contact pairs are"
        raise WrongValueError(length, remedy, f"scatter.{name}.correlation_length")
    distance = np.linalg.norm(pairs.position[:, None] - pairs.position[None], axis=2)
    surface = np.array(pairs.surface)
    covariance = np.where(surface[:, None] == surface, np.exp(-0.5 * (distance / length) ** 2), 0.0)
    covariance = (1.0 - _NUGGET) * covariance + _NUGGET * np.eye(len(covariance))
    return np.asarray(cholesky(covariance, lower=True))


def _check(name: str, scattered: Scattered, draw: Drawn, own: ArrayLike) -> None:
    """Refuses draws that physics forbids. own: numbers, or rows of values of all pairs."""
    rows = np.atleast_2d(np.asarray(own, dtype=np.float64))
    distribution = scattered.distribution
    shown = distribution.model_dump(exclude_none=True)
    if not distribution.is_absolute and not rows.any() and not draw.apply(0.0).any() and draw.apply(1.0).std() > 0.0:
        remedy = "give a width in the unit of the input: the study's own value is 0, of which a share is nothing"
        raise WrongValueError(shown, remedy, f"scatter.{name}")
    smallest = min(float(draw.apply(row).min()) for row in rows)
    if (smallest < 0.0 and name.startswith(_NOT_BELOW_ZERO)) or (smallest <= 0.0 and name in _ABOVE_ZERO):
        remedy = f"give less width, or lognormal: a sample draws {smallest:.3g}, which {name} cannot be"
        raise WrongValueError(shown, remedy, f"scatter.{name}")


def unit_design(method: Method, seed: int, samples: int, dimensions: int, groups: Sequence[int] = ()) -> Array:
    """Points (rows, dimensions) in the unit cube, without its surface.

    A column depends on its number, the seed and the method alone. Except with "latin_hypercube" the first rows are the
    design of fewer samples. "sobol" is scrambled by a random lower triangular matrix and a digital shift (Matousek
    1998). With "saltelli" (Saltelli et al. 2010) each base sample has 2 + len(groups) rows: A, B, and for each group of
    columns A with this group from B. groups: numbers of columns that vary together; each alone if empty.

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


def _sobol(seed: int, samples: int, dimensions: int) -> Array:
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


def _saltelli(seed: int, samples: int, groups: Sequence[int]) -> Array:
    # A and B of one column stand side by side, so that further columns change neither
    both = _sobol(seed, samples, 2 * sum(groups))
    first, second = both[:, 0::2], both[:, 1::2]
    design = np.repeat(first[:, None], 2 + len(groups), axis=1)
    design[:, 1] = second
    ends = np.cumsum(groups)
    for group, (begin, end) in enumerate(zip(ends - groups, ends, strict=True)):
        design[:, 2 + group, begin:end] = second[:, begin:end]
    return design.reshape(-1, sum(groups))

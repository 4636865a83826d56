"""The values that the samples of a study draw of its inputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import cholesky

from studyrunner.scatter.design import unit_design
from studyrunner.scatter.section import Array, Distribution, Scattered, ScatterSection
from studyrunner.user_error import WrongValueError

_ABOVE_ZERO = ("area", "excitation_amplitude", "frequency")
_NOT_BELOW_ZERO = ("friction_coefficient", "surfaces_", "threshold", "wear_coefficient")

_NUGGET = 1e-8
"""Share of the variance of a field that is independent from pair to pair.

Its Cholesky factor exists then for any positions; a value changes by 1e-4 standard deviations.
"""


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


def largest_draw(scattered: Scattered, own: float, score: float) -> float:
    """The value of an input so many standard deviations up, or the same share of a uniform one. own: study's value."""
    return float(scattered.distribution.at(np.array(own), np.array(score)))


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

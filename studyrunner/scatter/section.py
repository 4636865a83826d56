"""[scatter] of a study file: how many samples, and the distribution of each input that scatters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, ClassVar, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, model_validator

from studyrunner.values import NotNegative, Positive, Section, Whole, Wrong

Array = NDArray[np.float64]
Method = Literal["sobol", "latin_hypercube", "random", "saltelli"]
Of = Literal["all pairs", "each surface", "each pair"]

OF_PAIRS = ("area", "friction_coefficient", "gap")
"""Inputs that may differ between the contact pairs; named as in a scene file."""


class Distribution(Section):
    """A distribution. LOCATION: key of its location, which is the study's own value where it is left out.

    WIDTHS: sets of keys of which one has to be given.
    """

    LOCATION: ClassVar[str]
    WIDTHS: ClassVar[tuple[tuple[str, ...], ...]]

    @model_validator(mode="after")
    def _check(self) -> Distribution:
        given = {key for key in type(self).model_fields if getattr(self, key) is not None} - {self.LOCATION}
        if given not in [{*keys} - {self.LOCATION} for keys in self.WIDTHS]:
            raise ValueError(f"give either {', or '.join(' and '.join(keys) for keys in self.WIDTHS)}")
        return self

    @property
    def is_absolute(self) -> bool:
        """Whether the location is given."""
        return getattr(self, self.LOCATION) is not None

    def at(self, own: Array, score: Array) -> Array:
        """What is drawn, of standard normal scores. own: the study's own value, in the unit of the input."""
        raise NotImplementedError


class Normal(Distribution):
    """Normal distribution. mean, std: unit of the input. relative_std: share of the mean."""

    LOCATION = "mean"
    WIDTHS = (("std",), ("relative_std",))

    mean: float | None = None
    std: NotNegative | None = None
    relative_std: NotNegative | None = None

    def at(self, own: Array, score: Array) -> Array:
        """As `Distribution.at`."""
        if self.std is not None:
            return (own if self.mean is None else self.mean) + self.std * score
        share = (self.relative_std or 0.0) * score
        return own * (1.0 + share) if self.mean is None else self.mean + abs(self.mean) * share


class Lognormal(Distribution):
    """Lognormal distribution. median: unit of the input.

    factor: ratio of the 84 % quantile to the median, exp of the standard deviation of the logarithm.
    """

    LOCATION = "median"
    WIDTHS = (("factor",),)

    median: Positive | None = None
    factor: Annotated[float, Field(ge=1)] = Field(description="1 or more")

    def at(self, own: Array, score: Array) -> Array:
        """As `Distribution.at`."""
        return (own if self.median is None else self.median) * self.factor**score


class Uniform(Distribution):
    """Uniform distribution from low to high, or of this half width around the study's own value; unit of the input."""

    LOCATION = "low"
    WIDTHS = (("low", "high"), ("half_width",))

    low: float | None = None
    high: float | None = None
    half_width: NotNegative | None = None

    @model_validator(mode="after")
    def _check_ends(self) -> Uniform:
        ends = [each for each in (self.low, self.high) if each is not None]
        if len(ends) == 1 or (ends and ends[0] >= ends[1]):
            raise ValueError("give a low, and a high above it")
        return self

    def at(self, own: Array, score: Array) -> Array:
        """As `Distribution.at`."""
        from scipy.special import ndtr  # where it is used: it takes a while to load

        if self.low is not None and self.high is not None:
            return np.asarray(self.low + (self.high - self.low) * ndtr(score))
        return np.asarray(own + (self.half_width or 0.0) * (2.0 * ndtr(score) - 1.0))


class Scattered(Section):
    """How one input scatters: its distribution, what has a draw of its own, and the correlation length, m."""

    normal: Normal | None = None
    lognormal: Lognormal | None = None
    uniform: Uniform | None = None
    of: Of = "all pairs"
    correlation_length: Positive | None = Field(None, description="m")

    @model_validator(mode="before")
    @classmethod
    def _has_one_distribution(cls, table: object) -> object:
        if not isinstance(table, Mapping) or len(table.keys() & {"normal", "lognormal", "uniform"}) != 1:
            remedy = "give a table with one distribution, normal or lognormal or uniform, as {normal = {std = 0.03}}"
            raise ValueError(remedy)
        return table

    @property
    def distribution(self) -> Distribution:
        """The one distribution that the table holds."""
        return next(each for each in (self.normal, self.lognormal, self.uniform) if each is not None)


class ScatterSection(Section):
    """[scatter]: samples, method, seed; every other key names an input that scatters."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Scattered]
    EXTRA: ClassVar = Scattered

    samples: Annotated[Whole, Field(ge=1, le=1_000_000)] = Field(
        description="number; with saltelli base samples, each of 2 + number of inputs"
    )
    method: Method = Field("sobol", description="how the samples are chosen")
    seed: Annotated[Whole, Field(ge=0, lt=2**31)] = Field(1, description="of the random numbers")

    def rules(self) -> Iterator[Wrong]:
        """Something scatters, pair by pair only what belongs to pairs, and the method has the samples it needs."""
        if self.method == "saltelli" and (self.samples & (self.samples - 1) or self.samples < 2):
            remedy = 'give a power of 2, at least 2: the method "saltelli" takes a balanced design'
            yield Wrong("samples", self.samples, remedy)
        if not self.inputs:
            remedy = "name what scatters, as friction_coefficient = {normal = {std = 0.03}}, or leave out [scatter]"
            yield Wrong("samples", self.samples, remedy)
        for name, each in self.inputs.items():
            if each.of != "all pairs" and name not in OF_PAIRS:
                yield Wrong(f"{name}.of", each.of, f"leave it out: only {', '.join(OF_PAIRS)} differ between pairs")
            if each.correlation_length is not None and each.of != "each pair":
                yield Wrong(f"{name}.correlation_length", each.correlation_length, 'give of = "each pair" beside it')

    @property
    def inputs(self) -> dict[str, Scattered]:
        """The inputs that scatter, in the order of their columns in a design: those of pairs last, else by name."""
        order, extra = get_args(Of), self.__pydantic_extra__
        return {name: extra[name] for name in sorted(extra, key=lambda name: (order.index(extra[name].of), name))}

    @property
    def rows_a_sample(self) -> int:
        """Rows of the design for each of `samples`: A, B, and A with one input from B after the other (Saltelli)."""
        return 2 + len(self.inputs) if self.method == "saltelli" else 1

    @property
    def realisations(self) -> int:
        """Length of the dimension `sample`."""
        return self.samples * self.rows_a_sample


def flat_table(table: Mapping[str, Any]) -> dict[str, Any]:
    """[scatter] with inputs by name, factors of surfaces as the dimensions that they have as axes: `surfaces_flat`."""
    surfaces = table.get("surfaces")
    if not isinstance(surfaces, Mapping):
        return dict(sorted(table.items()))
    others = {name: value for name, value in table.items() if name != "surfaces"}
    return dict(sorted((others | {f"surfaces_{label}": value for label, value in surfaces.items()}).items()))

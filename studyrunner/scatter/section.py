"""[scatter] of a study file: how many samples, and the distribution of each input that scatters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, ClassVar, Literal, Self, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, model_serializer, model_validator

from studyrunner.values import NotNegative, Positive, Section, Whole, Wrong

Method = Literal["sobol", "latin_hypercube", "random", "saltelli"]
Kind = Literal["value", "offset", "factor"]
"""What is drawn of an input: its values, or offsets from, or factors of the study's own value."""
Of = Literal["all pairs", "each surface", "each pair"]

OF_PAIRS = ("area", "friction_coefficient", "gap")
"""Inputs that may differ between the contact pairs; named as in a scene file."""


class _Table(Section):
    """A table that is written without the keys that nothing is given for."""

    @model_serializer(mode="wrap")
    def _without_empty_keys(self, serialize: Any) -> dict[str, object]:
        return {key: value for key, value in serialize(self).items() if value is not None}


class Normal(_Table):
    """Normal distribution. mean: unit of the input; the study's own value where it is left out."""

    mean: float | None = None
    std: NotNegative | None = None
    relative_std: NotNegative | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.std is None) == (self.relative_std is None):
            raise ValueError("give either std, in the unit of the input, or relative_std")
        return self

    @property
    def kind(self) -> Kind:
        """As `Kind` says."""
        return "value" if self.mean is not None else "offset" if self.std is not None else "factor"

    def draw(self, score: NDArray[np.float64]) -> NDArray[np.float64]:
        """What is drawn, of standard normal scores and in their shape."""
        centre = {"value": self.mean or 0.0, "offset": 0.0, "factor": 1.0}[self.kind]
        if self.std is not None:
            return centre + self.std * score
        return centre + (self.relative_std or 0.0) * abs(centre) * score


class Lognormal(_Table):
    """Lognormal distribution. median: unit of the input; the study's own value where it is left out.

    factor: ratio of the 84 % quantile to the median, exp of the standard deviation of the logarithm.
    """

    median: Positive | None = None
    factor: Annotated[float, Field(ge=1)] = Field(description="1 or more")

    @property
    def kind(self) -> Kind:
        """As `Kind` says."""
        return "factor" if self.median is None else "value"

    def draw(self, score: NDArray[np.float64]) -> NDArray[np.float64]:
        """What is drawn, of standard normal scores and in their shape."""
        return (self.median or 1.0) * self.factor**score


class Uniform(_Table):
    """Uniform distribution from low to high, or of this half width around the study's own value; unit of the input."""

    low: float | None = None
    high: float | None = None
    half_width: NotNegative | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        ends = (self.low, self.high)
        if ends.count(None) != (0 if self.half_width is None else 2):
            raise ValueError("give either low and high, or half_width")
        if self.low is not None and self.high is not None and self.low >= self.high:
            raise ValueError("give a high above low")
        return self

    @property
    def kind(self) -> Kind:
        """As `Kind` says."""
        return "offset" if self.low is None else "value"

    def draw(self, score: NDArray[np.float64]) -> NDArray[np.float64]:
        """What is drawn, of standard normal scores and in their shape."""
        from scipy.special import ndtr  # where it is used: it takes a while to load

        share = ndtr(score)
        if self.low is not None and self.high is not None:
            return np.asarray(self.low + (self.high - self.low) * share)
        return np.asarray((self.half_width or 0.0) * (2.0 * share - 1.0))


Distribution = Normal | Lognormal | Uniform


class Scattered(_Table):
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
    def realisations(self) -> int:
        """Length of the dimension `sample`."""
        return self.samples * (2 + len(self.inputs) if self.method == "saltelli" else 1)


def flat_table(table: Mapping[str, Any]) -> dict[str, Any]:
    """[scatter] with inputs by name, factors of surfaces as the dimensions that they have as axes: `surfaces_flat`."""
    surfaces = table.get("surfaces")
    if not isinstance(surfaces, Mapping):
        return dict(sorted(table.items()))
    others = {name: value for name, value in table.items() if name != "surfaces"}
    return dict(sorted((others | {f"surfaces_{label}": value for label, value in surfaces.items()}).items()))

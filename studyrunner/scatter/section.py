"""[scatter] of a study file: how many samples, and the distribution of each input that scatters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_serializer, model_validator

from studyrunner.user_error import WrongValueError

Method = Literal["sobol", "latin_hypercube", "random", "saltelli"]
Kind = Literal["value", "offset", "factor"]
Of = Literal["all pairs", "each surface", "each pair"]

OF_PAIRS = ("area", "friction_coefficient", "gap")
"""Inputs that may differ between the contact pairs; named as in a scene file."""

_Finite = Annotated[float, Field(allow_inf_nan=False)]
_Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
_NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
_NUMBER, _POSITIVE, _NOT_NEGATIVE = "a finite number", "a finite number above 0", "a finite number that is 0 or more"


class _Table(BaseModel):
    """A table in which unknown keys are errors; the description of a key says what is right."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    @model_serializer(mode="wrap")
    def _without_empty_keys(self, serialize: Any) -> dict[str, object]:
        return {key: value for key, value in serialize(self).items() if value is not None}


class Normal(_Table):
    """Normal distribution. mean: unit of the input; the study's own value where it is left out."""

    mean: _Finite | None = Field(None, description=_NUMBER)
    std: _NotNegative | None = Field(None, description=_NOT_NEGATIVE)
    relative_std: _NotNegative | None = Field(None, description=_NOT_NEGATIVE)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.std is None) == (self.relative_std is None):
            raise WrongValueError(self.model_dump(), "give either std, in the unit of the input, or relative_std")
        return self

    @property
    def kind(self) -> Kind:
        """What is drawn: values, or offsets from or factors of the study's own value."""
        return "value" if self.mean is not None else "offset" if self.std is not None else "factor"

    @property
    def has_width(self) -> bool:
        """Whether samples differ."""
        return (self.std or self.relative_std or 0.0) > 0.0

    def draw(self, score: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values, offsets or factors of standard normal scores, shape of the scores."""
        centre = {"value": self.mean or 0.0, "offset": 0.0, "factor": 1.0}[self.kind]
        if self.std is not None:
            return centre + self.std * score
        return centre + (self.relative_std or 0.0) * abs(centre) * score


class Lognormal(_Table):
    """Lognormal distribution. median: unit of the input; the study's own value where it is left out.

    factor: ratio of the 84 % quantile to the median, exp of the standard deviation of the logarithm.
    """

    median: _Positive | None = Field(None, description=_POSITIVE)
    factor: Annotated[float, Field(ge=1, allow_inf_nan=False)] = Field(description="a finite number that is 1 or more")

    @property
    def kind(self) -> Kind:
        """What is drawn: values, or factors of the study's own value."""
        return "factor" if self.median is None else "value"

    @property
    def has_width(self) -> bool:
        """Whether samples differ."""
        return self.factor > 1.0

    def draw(self, score: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values or factors of standard normal scores, shape of the scores."""
        return (1.0 if self.median is None else self.median) * self.factor**score


class Uniform(_Table):
    """Uniform distribution from low to high, or of this half width around the study's own value; unit of the input."""

    low: _Finite | None = Field(None, description=_NUMBER)
    high: _Finite | None = Field(None, description=_NUMBER)
    half_width: _NotNegative | None = Field(None, description=_NOT_NEGATIVE)

    @model_validator(mode="after")
    def _check(self) -> Self:
        ends = (self.low, self.high)
        if ends.count(None) != (0 if self.half_width is None else 2):
            raise WrongValueError(self.model_dump(), "give either low and high, or half_width")
        if self.low is not None and self.high is not None and self.low >= self.high:
            raise WrongValueError(self.low, f"give less than high = {self.high:g}", "low")
        return self

    @property
    def kind(self) -> Kind:
        """What is drawn: values, or offsets from the study's own value."""
        return "offset" if self.low is None else "value"

    @property
    def has_width(self) -> bool:
        """Whether samples differ."""
        return self.half_width != 0.0

    def draw(self, score: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values or offsets of standard normal scores, shape of the scores."""
        from scipy.special import ndtr  # where it is used: it takes a while to load

        share = ndtr(score)
        if self.low is not None and self.high is not None:
            return np.asarray(self.low + (self.high - self.low) * share)
        return np.asarray((self.half_width or 0.0) * (2.0 * share - 1.0))


Distribution = Normal | Lognormal | Uniform
_DISTRIBUTIONS: dict[str, type[Distribution]] = {"normal": Normal, "lognormal": Lognormal, "uniform": Uniform}


class Scattered(_Table):
    """How one input scatters: its distribution, what has a draw of its own, and the correlation length, m."""

    normal: Normal | None = None
    lognormal: Lognormal | None = None
    uniform: Uniform | None = None
    of: Of = Field("all pairs", description=" or ".join(f'"{word}"' for word in get_args(Of)))
    correlation_length: _Positive | None = Field(None, description=f"{_POSITIVE}, in m")

    @property
    def distribution(self) -> Distribution:
        """The one distribution that the table holds."""
        return next(each for each in (self.normal, self.lognormal, self.uniform) if each is not None)


class ScatterSection(BaseModel):
    """[scatter]: samples, method, seed; every other key names an input that scatters."""

    model_config = ConfigDict(frozen=True, extra="allow")
    __pydantic_extra__: dict[str, Scattered]

    MOST_SAMPLES: ClassVar = 1_000_000

    samples: int = Field(
        description="realisations of the study; with saltelli base samples, of 2 realisations and one for each input"
    )
    method: Method = Field("sobol", description="how the samples are spread over the scatter")
    seed: int = Field(1, description="of the random numbers: the same seed draws the same values")

    @model_validator(mode="before")
    @classmethod
    def _read_table(cls, table: object) -> object:
        if not isinstance(table, Mapping):
            raise WrongValueError(table, "give a table [scatter] with samples and a distribution for each input")
        if isinstance(surfaces := table.get("surfaces"), Mapping):
            # factors of [wear] by surface: named as the dimensions that they have as axes
            of_surfaces = {f"surfaces_{label}": each for label, each in surfaces.items()}
            table = {name: each for name, each in table.items() if name != "surfaces"} | of_surfaces
        if "samples" not in table:
            raise WrongValueError(None, "missing: give the number of realisations", "scatter.samples")
        samples = _read_whole("samples", table["samples"], 1, cls.MOST_SAMPLES)
        seed = _read_whole("seed", table.get("seed", 1), 0, 2**31 - 1)
        own = {"samples": samples, "method": _read_method(table.get("method", "sobol")), "seed": seed}
        if own["method"] == "saltelli" and (samples & (samples - 1) or samples < 2):
            remedy = 'give a power of 2, at least 2: the method "saltelli" takes a balanced design'
            raise WrongValueError(samples, remedy, "scatter.samples")
        names = sorted(table.keys() - own.keys())
        if not names:
            remedy = "name what scatters, as friction_coefficient = {normal = {std = 0.03}}, or leave out [scatter]"
            raise WrongValueError(samples, remedy, "scatter.samples")
        return own | {name: _read_input(name, table[name]) for name in names}

    @property
    def inputs(self) -> dict[str, Scattered]:
        """The inputs that scatter, in the order of their columns in a design: those of pairs last, else by name."""
        order = get_args(Of)
        extra = self.__pydantic_extra__
        return {name: extra[name] for name in sorted(extra, key=lambda name: (order.index(extra[name].of), name))}

    @property
    def realisations(self) -> int:
        """Length of the dimension `sample`."""
        return self.samples * (2 + len(self.inputs) if self.method == "saltelli" else 1)


def _read_whole(name: str, value: object, smallest: int, largest: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int | float) or not smallest <= value <= largest or value % 1:
        remedy = f"give a whole number, at least {smallest} and at most {largest}"
        raise WrongValueError(value, remedy, f"scatter.{name}")
    return int(value)


def _read_method(value: object) -> object:
    if value not in get_args(Method):
        remedy = "give " + " or ".join(f'"{word}"' for word in get_args(Method))
        raise WrongValueError(value, remedy, "scatter.method")
    return value


def _read_input(name: str, table: object) -> Scattered:
    """How an input scatters, or a WrongValueError with the whole key."""
    key = f"scatter.{name}"
    if isinstance(table, Scattered):
        return table
    kinds = " or ".join(_DISTRIBUTIONS)
    if not isinstance(table, Mapping) or len(table.keys() & _DISTRIBUTIONS.keys()) != 1:
        raise WrongValueError(
            table, f"give a table with one distribution, {kinds}, as {{normal = {{std = 0.03}}}}", key
        )
    (word,) = table.keys() & _DISTRIBUTIONS.keys()
    inner = {word: _read_table(_DISTRIBUTIONS[word], table[word], f"{key}.{word}")}
    scattered = _read_table(Scattered, {**table, **inner}, key)
    if scattered.of != "all pairs" and name not in OF_PAIRS:
        raise WrongValueError(
            scattered.of, f"leave it out: only {', '.join(OF_PAIRS)} differ between pairs", f"{key}.of"
        )
    if scattered.correlation_length is not None and scattered.of != "each pair":
        raise WrongValueError(
            scattered.correlation_length, 'give of = "each pair" beside it', f"{key}.correlation_length"
        )
    return scattered


_T = TypeVar("_T", bound=BaseModel)


def _read_table(kind: type[_T], table: object, key: str) -> _T:
    """The model of a table, or a WrongValueError that names the key in it that is wrong."""
    known = ", ".join(kind.model_fields)
    if isinstance(table, kind):
        return table
    if not isinstance(table, Mapping):
        raise WrongValueError(table, f"give a table with keys out of {known}", key)
    try:
        return kind.model_validate(dict(table), strict=True)
    except ValidationError as error:
        details = error.errors(include_url=False)[0]
    name = str(details["loc"][0]) if details["loc"] else ""
    cause = details.get("ctx", {}).get("error")
    if isinstance(cause, WrongValueError):
        raise WrongValueError(cause.value, cause.remedy, ".".join(filter(None, (key, cause.key))))
    if details["type"] == "extra_forbidden":
        raise WrongValueError(details["input"], f"unknown key, give one of {known}", f"{key}.{name}")
    value = None if details["type"] == "missing" else details["input"]
    raise WrongValueError(value, f"give {kind.model_fields[name].description}", f"{key}.{name}")

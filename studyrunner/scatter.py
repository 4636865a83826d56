"""[scatter] of a study: the distribution of each input that scatters, and what the samples draw of it.

By hand: a column of `scipy.stats.qmc` depends on the number of columns; its plain Sobol' sequence is used.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import ConfigDict, Field

from studyrunner.values import NotNegative, Positive, Section, Whole, Wrong

if TYPE_CHECKING:
    from solver.model import ContactInterface

Array = NDArray[np.float64]
Method = Literal["sobol", "latin_hypercube", "random", "saltelli"]
Of = Literal["all pairs", "each sector", "each surface", "each pair"]

OF_PAIRS = ("area", "friction_coefficient", "gap")
"""Inputs that may differ between the contact pairs; named as in a scene file."""

SECTOR_FREQUENCY = "sector_frequency"
"""Input of each sector of a ring: the relative deviation of the blade-alone frequency."""

_ABOVE_ZERO = ("area", "excitation_amplitude", "frequency")
_NOT_BELOW_ZERO = ("friction_coefficient", "surfaces_", "threshold", "adhesive", "decay", "wear_coefficient")

_NUGGET = 1e-8
"""Share of the variance of a field that is independent from pair to pair: its Cholesky factor exists then for any
positions; a value changes by 1e-4 standard deviations."""

_DIGITS = 30  # binary digits of a Sobol' sequence in scipy


# --- the section ---


class Distribution(Section):
    """A distribution. LOCATION: its key that may be left out. WIDTHS: sets of keys of which one has to be given."""

    LOCATION: ClassVar[str]
    WIDTHS: ClassVar[tuple[tuple[str, ...], ...]]

    def rules(self) -> Iterator[Wrong]:
        """One of the widths is given."""
        given = self.model_dump(exclude_none=True)
        if given.keys() - {self.LOCATION} not in [{*keys} - {self.LOCATION} for keys in self.WIDTHS]:
            yield Wrong("", given, f"give either {', or '.join(' and '.join(keys) for keys in self.WIDTHS)}")

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

    def at(self, own: Array, score: Array) -> Array:  # noqa: D102
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
    factor: Annotated[float, Field(ge=1)] = Field(description="ratio of the 84 % quantile to the median")

    def at(self, own: Array, score: Array) -> Array:  # noqa: D102
        return (own if self.median is None else self.median) * self.factor**score


class Uniform(Distribution):
    """Uniform distribution from low to high, or of this half width around the study's own value; unit of the input."""

    LOCATION = "low"
    WIDTHS = (("low", "high"), ("half_width",))

    low: float | None = None
    high: float | None = None
    half_width: NotNegative | None = None

    def rules(self) -> Iterator[Wrong]:
        """With both ends, in their order, or none."""
        yield from super().rules()
        ends = [each for each in (self.low, self.high) if each is not None]
        if len(ends) == 1 or (ends and ends[0] >= ends[1]):
            yield Wrong("", self.model_dump(exclude_none=True), "give a low, and a high above it")

    def at(self, own: Array, score: Array) -> Array:  # noqa: D102
        from scipy.special import ndtr

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

    def rules(self) -> Iterator[Wrong]:
        """It has one distribution."""
        if sum(each is not None for each in (self.normal, self.lognormal, self.uniform)) != 1:
            remedy = "give one distribution, normal or lognormal or uniform, as {normal = {std = 0.03}}"
            yield Wrong("", self.model_dump(exclude_unset=True), remedy)

    @property
    def distribution(self) -> Distribution:
        """The one distribution that the table holds."""
        return next(each for each in (self.normal, self.lognormal, self.uniform) if each is not None)


LIVES = {"cycles_to_target", "missions_to_target"}


class Limits(Section):
    """What a design allows, of the values of samples after all cycles and before, named as variables of the result."""

    wear_depth: Positive | None = Field(None, description="m, at most, of the deepest pair")
    worn_volume: Positive | None = Field(None, description="m3, at most")
    response_amplitude: Positive | None = Field(None, description="m, at most, of any response at any count")
    cycles_to_target: Positive | None = Field(None, description="at least, until slow_time.until")
    missions_to_target: Positive | None = Field(None, description="at least, until slow_time.until")

    def rules(self) -> Iterator[Wrong]:
        """One of them is given."""
        if not self.model_dump(exclude_none=True):
            yield Wrong("", {}, f"give one or more of {', '.join(type(self).model_fields)}, or leave it out")


class ScatterSection(Section):
    """[scatter]: samples, method, seed, limits; every other key names an input that scatters."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Scattered]
    EXTRA: ClassVar = (Scattered, "{normal = {std = 0.03}}")

    samples: Annotated[Whole, Field(ge=1, le=1_000_000)] = Field(
        description="number; with saltelli base samples, each of 2 + number of inputs"
    )
    method: Method = Field("sobol", description="how the samples are chosen")
    seed: Annotated[Whole, Field(ge=0, lt=2**31)] = Field(1, description="of the random numbers")
    limits: Limits | None = Field(
        None,
        description="how probable is at most {wear_depth = 5e-6}, m, of the deepest pair, {worn_volume = 1e-9}, m3,"
        " {response_amplitude = 1e-3}, m, or, with slow_time.until, at least {cycles_to_target = 1e6}",
    )

    def rules(self) -> Iterator[Wrong]:
        """Something scatters, pair by pair only what belongs to pairs, and the method has the samples it needs."""
        if self.method == "saltelli" and (self.samples & (self.samples - 1) or self.samples < 2):
            remedy = 'give a power of 2, at least 2: the method "saltelli" takes a balanced design'
            yield Wrong("samples", self.samples, remedy)
        if not self.inputs:
            remedy = "name what scatters, as friction_coefficient = {normal = {std = 0.03}}, or leave out [scatter]"
            yield Wrong("samples", self.samples, remedy)
        for name, each in self.__pydantic_extra__.items():
            if each.of != "all pairs" and name not in OF_PAIRS and (name, each.of) != (SECTOR_FREQUENCY, "each sector"):
                yield Wrong(f"{name}.of", each.of, f"leave it out: only {', '.join(OF_PAIRS)} differ between pairs")
            if each.correlation_length is not None and each.of != "each pair":
                yield Wrong(f"{name}.correlation_length", each.correlation_length, 'give of = "each pair" beside it')

    @property
    def inputs(self) -> dict[str, Scattered]:
        """The inputs that scatter, in the order of their columns in a design: those of pairs last, else by name."""
        order, extra = get_args(Of), dict(self.__pydantic_extra__)
        if SECTOR_FREQUENCY in extra:
            extra[SECTOR_FREQUENCY] = extra[SECTOR_FREQUENCY].model_copy(update={"of": "each sector"})
        return {name: extra[name] for name in sorted(extra, key=lambda name: (order.index(extra[name].of), name))}

    @property
    def of_pairs(self) -> tuple[str, ...]:
        """Inputs that belong to contact pairs, as a friction coefficient with draws of its own, or to sectors."""
        of_all = {name for name, each in self.inputs.items() if each.of == "all pairs"} & {"friction_coefficient"}
        return tuple(name for name in self.inputs if name in (*OF_PAIRS, SECTOR_FREQUENCY) and name not in of_all)

    @property
    def rows_a_sample(self) -> int:
        """Rows of the design for each of `samples`: A, B, and A with one input from B after the other (Saltelli)."""
        return 2 + len(self.inputs) if self.method == "saltelli" else 1

    @property
    def given_limits(self) -> dict[str, float]:
        """The limits by name."""
        return {} if self.limits is None else self.limits.model_dump(exclude_none=True)

    @property
    def n_rows(self) -> int:
        """Length of the dimension `sample`."""
        return self.samples * self.rows_a_sample


def flat_table(table: Mapping[str, Any]) -> dict[str, Any]:
    """[scatter] with inputs by name, factors of surfaces as the dimensions that they have as axes: `surfaces_flat`."""
    flat, surfaces = dict(table), table.get("surfaces")
    if isinstance(surfaces, Mapping):
        del flat["surfaces"]
        flat |= {f"surfaces_{label}": value for label, value in surfaces.items()}
    return dict(sorted(flat.items()))


# --- what is drawn ---


def draw(
    section: ScatterSection,
    own_values: Mapping[str, ArrayLike],
    pairs: "ContactInterface | None" = None,
    n_sectors: int = 1,
) -> dict[str, Array]:
    """What the samples draw of each input that is the same for all pairs, (samples,) or (n_values, samples) of an axis;
    with pairs of each input that belongs to them, (samples, n_pairs), or to sectors, (samples, n_sectors). Without
    width the study's own values, exactly.

    own_values: of the study: a number, (n_values, 1) of an axis, (n_pairs,) of pairs; not needed for an absolute
    distribution. n_sectors: to which pairs belong one after the other. Raises Wrong where physics forbids a draw,
    positions are missing, or a width is a share of 0.
    """
    from scipy.special import ndtri

    labels = () if pairs is None else tuple(dict.fromkeys(pairs.surface))
    n_pairs = 0 if pairs is None else len(pairs.surface)
    widths = {"each surface": len(labels), "each pair": n_pairs, "each sector": n_sectors}
    groups = [widths.get(each.of) or 1 for each in section.inputs.values()]
    design = unit_design(section.method, section.seed, section.samples, sum(groups), groups)
    scores = np.split(ndtri(design), np.cumsum(groups)[:-1], axis=1)
    found = {}
    for (name, scattered), score in zip(section.inputs.items(), scores, strict=True):
        if (name in section.of_pairs) == (pairs is None):
            continue
        own = np.asarray(own_values.get(name, 0.0), dtype=np.float64)
        shape: tuple[int, ...] = (*own.shape[:-1], len(score))
        if pairs is None:
            score = score[:, 0]
        elif name == SECTOR_FREQUENCY:
            shape = score.shape
        else:
            shape = (len(score), n_pairs)
            if scattered.of == "each sector":
                score = np.repeat(score, n_pairs // n_sectors, axis=1)
            elif scattered.of == "each surface":
                score = score[:, [labels.index(label) for label in pairs.surface]]
            elif scattered.correlation_length is not None:
                score = score @ _field(name, scattered.correlation_length, pairs).T
        found[name] = np.zeros(shape) + scattered.distribution.at(own, score)
        _check(name, scattered.distribution, own, found[name])
    return found


def _field(name: str, length: float, pairs: "ContactInterface") -> Array:
    """Factor L (n_pairs, n_pairs) of a Gaussian field L z of unit variance, z independent.

    Correlation exp(-(r / length)^2 / 2) of two pairs of a surface at the distance r; surfaces are independent.
    """
    if not np.isfinite(pairs.position).all():
        remedy = "leave it out: the scene does not say where its contact pairs are"
        raise Wrong(f"scatter.{name}.correlation_length", length, remedy)
    distance = np.linalg.norm(pairs.position[:, None] - pairs.position[None], axis=2)
    surface = np.array(pairs.surface)
    covariance = np.where(surface[:, None] == surface, np.exp(-0.5 * (distance / length) ** 2), 0.0)
    from scipy.linalg import cholesky  # where it is used: it takes a while to load

    covariance = (1.0 - _NUGGET) * covariance + _NUGGET * np.eye(len(covariance))
    return np.asarray(cholesky(covariance, lower=True))


def _check(name: str, distribution: Distribution, own: Array, values: Array) -> None:
    """Refuses draws that physics forbids, and those that are a share of nothing."""
    shown = distribution.model_dump(exclude_none=True)
    varies = distribution.at(np.array(1.0), np.array([-1.0, 1.0])).std() > 0.0
    if not distribution.is_absolute and not own.any() and not values.any() and varies:
        remedy = "give a width in the unit of the input: the study's own value is 0, of which a share is nothing"
        raise Wrong(f"scatter.{name}", shown, remedy)
    smallest = float(values.min())
    if (smallest < 0.0 and name.startswith(_NOT_BELOW_ZERO)) or (smallest <= 0.0 and name in _ABOVE_ZERO):
        remedy = f"give less width, or lognormal: a sample draws {smallest:.3g}, which {name} cannot be"
        raise Wrong(f"scatter.{name}", shown, remedy)


def unit_design(method: Method, seed: int, samples: int, dimensions: int, groups: Sequence[int] = ()) -> Array:
    """Points (rows, dimensions) in the unit cube, without its surface.

    A column depends on its number, the seed and the method alone. Except with "latin_hypercube" the first rows are the
    design of fewer samples. "sobol" is scrambled by a random lower triangular matrix and a digital shift (Matousek
    1998). With "saltelli" (Saltelli et al. 2010) each base sample has 2 + len(groups) rows: A, B, and for each group of
    columns A with this group from B. groups: numbers of columns that vary together; each alone if empty. Raises
    Wrong where a Sobol' sequence has not so many columns.
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
    from scipy.stats import qmc

    if dimensions > qmc.Sobol.MAXDIM:
        remedy = f'give "random": a Sobol\' sequence has at most {qmc.Sobol.MAXDIM} columns, {dimensions} are drawn'
        raise Wrong("scatter.method", "sobol", remedy)
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

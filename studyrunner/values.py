"""Types of the values in a study file, as pydantic checks them, and the values of axes.

By hand: `linspace` of numpy rounds more than once, and values of `geomspace` differ between machines.
"""

import decimal
from collections.abc import Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

T = TypeVar("T", bound=Hashable)

LONGEST_AXIS = 100_000
"""Values of an axis: the effective study, which lists them, is to be read again."""

_LARGEST_WHOLE = 2.0**53
_TOO_LARGE = 1e100  # its square is still a number


@dataclass(eq=False, repr=False)
class Wrong(ValueError):  # noqa: N818 - rules yield it
    """What a check of one key, or a rule between keys, refuses; the reader of the study adds the file.

    key: dotted name below what is checked, "" for all of it. value: the offending part. remedy: what would be right.
    """

    key: str
    value: object
    remedy: str


class Section(BaseModel):
    """A table of the study file: frozen, unknown keys are errors, numbers are finite. AXES: keys that may also stand
    under [axes]. EXTRA: class of the values of keys that are names of something, and how one looks.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    AXES: ClassVar[tuple[str, ...]] = ()
    EXTRA: ClassVar[tuple[type[BaseModel], str] | None] = None

    def rules(self) -> Iterator[Wrong]:
        """What breaks a rule between the keys of the table, whose values are all right by themselves."""
        return iter(())

    @model_validator(mode="after")
    def _keep_rules(self) -> Self:
        for wrong in self.rules():
            raise wrong
        return self


def _no_text(value: object) -> object:
    if isinstance(value, bool | str) or (isinstance(value, float) and abs(value) > _LARGEST_WHOLE):
        raise ValueError("give a whole number")
    return value


def listed(value: object) -> Sequence[Any]:
    """The values of a list, or the only value."""
    return value if isinstance(value, list | tuple) else [value]


def once(values: Iterable[T]) -> tuple[T, ...]:
    """The values in their order. Raises Wrong where one of them comes twice."""
    seen: set[T] = set()
    kept = tuple(values)
    for value in kept:
        if value in seen:
            raise Wrong("", value, "give every value once")
        seen.add(value)
    return kept


def ascending(values: tuple[float, ...]) -> tuple[float, ...]:
    """The values. Raises ValueError where one is not above the value before it."""
    if any(later <= earlier for earlier, later in pairwise(values)):
        raise ValueError("give ascending numbers")
    return values


def read_axis(value: object) -> tuple[Any, ...]:
    """The values of an axis, each once: one, a list of them or {start, stop, num}. Raises ValueError.

    A range between whole numbers whose values are whole numbers gives whole numbers. A tuple, which no file and no list
    of an override is, holds the values of a column of a design: any number of them, which differ.
    """
    if isinstance(value, tuple) and value:
        return value
    values = tuple(listed(value))
    if isinstance(value, dict):
        if value.keys() - {"spacing"} != {"start", "stop", "num"}:
            raise ValueError("give a number, a list or {start, stop, num}")
        values = Range.model_validate(value).values
        if isinstance(value["start"], int) and isinstance(value["stop"], int):
            values = tuple(int(each) if each == int(each) else each for each in values)
    if not values or len(values) > LONGEST_AXIS:
        raise ValueError(f"give at least one value, and at most {LONGEST_AXIS}")
    for each in values:
        if not isinstance(each, bool | int | float | str):
            raise Wrong("", each, "give a number, true, false or a name, a list of them or {start, stop, num}")
    return once(values)


Positive = Annotated[float, Field(gt=0, lt=_TOO_LARGE)]
NotNegative = Annotated[float, Field(ge=0, lt=_TOO_LARGE)]
Fraction = Annotated[float, Field(gt=0, lt=1)]
Whole = Annotated[int, Field(strict=False), BeforeValidator(_no_text)]
"""A whole number; 5.0 and 1e4 are whole numbers, too, true and "5" are not."""
Listed = Annotated[tuple[T, ...], Field(strict=False)]
"""A list."""
Axis = Annotated[tuple[T, ...], BeforeValidator(read_axis)]
"""Values of an axis in the order in which they are given, at least one and each once."""


class Range(Section):
    """Values of an axis in a table: their differences are equal, or their ratios with spacing = "log"."""

    start: float
    stop: float
    num: Annotated[Whole, Field(ge=1, le=LONGEST_AXIS)]
    spacing: Literal["linear", "log"] = "linear"

    @property
    def values(self) -> tuple[float, ...]:
        """The values, each the number that a person would write: 212.8, not 212.79999999999998.

        They are computed from the decimals of start and stop and rounded once, so that `sel` finds them by the number
        written and a point is the same in a range and in a list. Raises Wrong.
        """
        start, stop, num = self.start, self.stop, self.num
        if self.spacing == "log" and min(start, stop) <= 0.0:
            raise Wrong("", min(start, stop), 'give start and stop above 0 with spacing = "log"')
        if num == 1:
            return (start,)
        with decimal.localcontext(prec=60):
            first, last = (decimal.Decimal(repr(value)) for value in (start, stop))
            is_log = self.spacing == "log"
            first, last = (first.ln(), last.ln()) if is_log else (first, last)
            inner = (((num - 1 - place) * first + place * last) / (num - 1) for place in range(1, num - 1))
            return (start, *(float(value.exp() if is_log else value) for value in inner), stop)

"""Types of the values in a study file: what pydantic accepts, and the sentence that a user reads where it does not.

By hand: `linspace` of numpy rounds more than once, and values of `geomspace` differ between machines.
"""

from __future__ import annotations

import decimal
import math
from collections.abc import Hashable, Iterable
from fractions import Fraction as Rational
from typing import Annotated, Any, Literal, TypeVar, cast

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    TypeAdapter,
    ValidationError,
    WrapValidator,
)

from solver.settings import Automatic
from studyrunner.user_error import WrongValueError

T = TypeVar("T", bound=Hashable)

LONGEST_AXIS = 100_000
"""Values of an axis: the effective study, which lists them, is to be read again."""


class Section(BaseModel):
    """A table of the study file: frozen, unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid")


def told(remedy: str) -> WrapValidator:
    """Whatever of a value is refused, the user reads this remedy."""

    def check(value: object, accept: Any) -> object:
        try:
            return accept(value)
        except ValidationError:
            raise WrongValueError(value, remedy) from None

    return WrapValidator(check)


def words(*known: str) -> WrapValidator:
    """One of a few words."""
    return told("give " + " or ".join(f'"{word}"' for word in known))


def whole(smallest: int, largest: int, *, or_auto: bool = False) -> WrapValidator:
    """A whole number between two; 5.0 and 1e4 are whole numbers, too, true and "5" are not."""
    number = TypeAdapter(Annotated[int, Field(ge=smallest, le=largest)])

    def check(value: object, _: Any) -> object:
        try:
            if or_auto and value == "auto":
                return value
            return number.validate_python(None if isinstance(value, bool | str) else value, strict=False)
        except ValidationError:
            otherwise = ', or "auto"' if or_auto else ""
            remedy = f"give a whole number, at least {smallest} and at most {largest}{otherwise}"
            raise WrongValueError(value, remedy) from None

    return WrapValidator(check)


def _spread(value: object) -> tuple[object, ...]:
    """The values of an axis: one, a list of them or {start, stop, num}."""
    if isinstance(value, dict):
        return _spread_range(value)
    if not isinstance(value, list | tuple):
        return (value,)
    if not value:
        raise WrongValueError(value, "give at least one value")
    return tuple(value)


def read_axis(value: object) -> tuple[Any, ...]:
    """Values of an axis of any kind: numbers, flags or names, each once. Raises WrongValueError.

    A range between whole numbers whose values are whole numbers gives whole numbers.
    """
    values = _spread(value)
    for each in values:
        if not isinstance(each, bool | int | float | str) or (isinstance(each, float) and not math.isfinite(each)):
            raise WrongValueError(each, "give a number, true, false or a name, a list of them or {start, stop, num}")
    if isinstance(value, dict) and all(isinstance(value[key], int) for key in ("start", "stop")):
        values = tuple(int(each) if each == int(each) else each for each in cast("tuple[float, ...]", values))
    if len({float if type(each) is int else type(each) for each in values}) > 1:
        raise WrongValueError(value, "give values of one kind: numbers, flags or names")
    if len(values) > LONGEST_AXIS:
        raise WrongValueError(len(values), f"give at most {LONGEST_AXIS} values")
    return once(values)


def _spread_range(table: dict[str, object]) -> tuple[float, ...]:
    """Equally spaced values, each the number that a person would write: 212.8, not 212.79999999999998.

    With spacing = "log" their ratios are equal. Others are computed from the decimals of start and stop without
    round-off and rounded once, so that `sel` finds them by the number written and a point is the same in a range and in
    a list.
    """
    if table.keys() - {"spacing"} != {"start", "stop", "num"}:
        raise WrongValueError(table, "give a number, a list or {start, stop, num}")
    spacing = table.get("spacing", "linear")
    if spacing not in ("linear", "log"):
        raise WrongValueError(spacing, 'give "linear" or "log" as spacing')
    start, stop, num = read(_NUMBER, table["start"]), read(_NUMBER, table["stop"]), read(_LENGTH, table["num"])
    if spacing == "log" and min(start, stop) <= 0.0:
        raise WrongValueError(min(start, stop), 'give start and stop above 0 with spacing = "log"')
    if num == 1:
        return (start,)
    if spacing == "log":
        return _equal_ratios(start, stop, num)
    first, last = Rational(repr(start)), Rational(repr(stop))
    whole = first.denominator * last.denominator
    low, high = int(first * whole), int(last * whole)
    # the quotient of two whole numbers is rounded correctly, whatever their length
    return tuple((low * (num - 1 - place) + high * place) / (whole * (num - 1)) for place in range(num))


def _equal_ratios(start: float, stop: float, num: int) -> tuple[float, ...]:
    """Values with equal ratios from start to stop, both above 0, at least two; equal on all machines."""
    with decimal.localcontext(prec=40):
        first, last = (decimal.Decimal(repr(value)).ln() for value in (start, stop))
        between = (((num - 1 - place) * first + place * last) / (num - 1) for place in range(1, num - 1))
        return (start, *(float(value.exp()) for value in between), stop)


def read(kind: TypeAdapter[Any], value: object) -> Any:
    """The value as this type has it. Raises the WrongValueError of the check that refuses it."""
    try:
        return kind.validate_python(value, strict=True)
    except ValidationError as error:
        raise error.errors()[0]["ctx"]["error"] from None


def once(values: Iterable[T]) -> tuple[T, ...]:
    """The values in their order. Raises WrongValueError where one of them comes twice."""
    seen: dict[T, None] = {}
    for value in values:
        if value in seen:
            raise WrongValueError(value, "give every value once")
        seen[value] = None
    return tuple(seen)


Number = Annotated[float, Field(allow_inf_nan=False), told("give a finite number")]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False), told("give a finite number above 0")]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False), told("give a finite number that is 0 or more")]
Cycles = Annotated[float, Field(ge=0, allow_inf_nan=True), told("give a number that is 0 or more, or inf")]
Fraction = Annotated[float, Field(gt=0, lt=1), told("give a number between 0 and 1")]
Switch = Annotated[bool, told("give true or false")]
Text = Annotated[str, told("give a text in quotes")]
Harmonics = Annotated[int | Automatic, whole(1, 1000, or_auto=True)]
Mode = Annotated[int, whole(1, 1000)]
Samples = Annotated[int | Automatic, whole(4, 100_000, or_auto=True)]
Scheme = Annotated[
    Literal["implicit", "explicit", "adaptive", "final"], words("implicit", "explicit", "adaptive", "final")
]
Sweep = Annotated[Literal["up", "down", "ramp"], words("up", "down", "ramp")]
Axis = Annotated[tuple[T, ...], BeforeValidator(_spread), AfterValidator(once)]
"""Values of an axis in the order in which they are given, at least one and each once."""

_NUMBER = TypeAdapter(Number)
_LENGTH = TypeAdapter(Annotated[int, whole(1, LONGEST_AXIS)])

"""Checks of single values and of axes in a study file: a checked value, or WrongValueError with the remedy."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeVar

from studyrunner.user_error import WrongValueError

T = TypeVar("T")

_RANGE_KEYS = ("start", "stop", "num")
LONGEST_AXIS = 100_000
"""Values of an axis: the effective study, which lists them, is to be read again."""


def read_number(value: object) -> float:
    """A finite number; whole numbers become floats, booleans and text are refused."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise WrongValueError(value, "give a number")
    try:
        number = float(value)
    except OverflowError:
        raise WrongValueError(value, "give a smaller number") from None
    if not math.isfinite(number):
        raise WrongValueError(value, "give a finite number")
    return number


def read_positive(value: object) -> float:
    """A finite number above 0."""
    number = read_number(value)
    if number <= 0.0:
        raise WrongValueError(value, "give a number above 0")
    return number


def read_not_negative(value: object) -> float:
    """A finite number that is 0 or more."""
    number = read_number(value)
    if number < 0.0:
        raise WrongValueError(value, "give a number that is 0 or more")
    return number


def read_switch(value: object) -> bool:
    """Only true or false; numbers and text are refused."""
    if not isinstance(value, bool):
        raise WrongValueError(value, "give true or false")
    return value


def read_fraction(value: object) -> float:
    """A number between 0 and 1, both left out."""
    number = read_number(value)
    if not 0.0 < number < 1.0:
        raise WrongValueError(value, "give a number between 0 and 1")
    return number


def whole_number(smallest: int, largest: int) -> Callable[[object], int]:
    """Check for a whole number from `smallest` to `largest`; 5.0 and 1e4 are whole numbers, too."""

    def read(value: object) -> int:
        number = read_number(value)
        if number != math.floor(number) or number < smallest:
            raise WrongValueError(value, f"give a whole number of at least {smallest}")
        if number > largest:
            raise WrongValueError(value, f"give a whole number of at most {largest}")
        return int(number)

    return read


def one_of(*words: str) -> Callable[[object], str]:
    """Check for one of a few words."""
    choice = " or ".join(f'"{word}"' for word in words)

    def read(value: object) -> str:
        if not isinstance(value, str) or value not in words:
            raise WrongValueError(value, f"give {choice}")
        return value

    return read


def number_or(word: str, read: Callable[[object], T]) -> Callable[[object], T | str]:
    """`read`, or the word that stands in place of a number."""

    def read_or_word(value: object) -> T | str:
        if value == word:
            return word
        try:
            return read(value)
        except WrongValueError as error:
            raise WrongValueError(error.value, f'{error.remedy}, or "{word}"') from None

    return read_or_word


def axis_of(read: Callable[[object], T]) -> Callable[[object], tuple[T, ...]]:
    """Check for an axis: one value, a list of them or {start, stop, num}, at least one value and each once.

    The values keep the order in which they are given. {start, stop, num} is what numpy.linspace gives.
    """

    def read_axis(value: object) -> tuple[T, ...]:
        if isinstance(value, dict):
            value = _read_range(value)
        values = tuple(read(item) for item in value) if isinstance(value, list | tuple) else (read(value),)
        if not values:
            raise WrongValueError(value, "give at least one value")
        seen: set[T] = set()
        for item in values:
            if item in seen:
                raise WrongValueError(item, "give every value of an axis once")
            seen.add(item)
        return values

    return read_axis


def _read_range(table: dict[str, object]) -> list[float]:
    if sorted(table) != sorted(_RANGE_KEYS):
        raise WrongValueError(table, "give a number, a list or {start, stop, num}")
    start, stop = read_number(table["start"]), read_number(table["stop"])
    num = whole_number(1, LONGEST_AXIS)(table["num"])
    if num == 1:
        return [start]
    width = (stop - start) / (num - 1)
    return [position * width + start for position in range(num - 1)] + [stop]

"""Numbers out of data lines: by the hundred thousand where they are well formed, with their line where not."""

from __future__ import annotations

import math
import re
from array import array

import numpy as np
from numpy.typing import NDArray

from studies.fe_models.text.keyword_lines import Block
from studies.fe_models.text.read_errors import Place, shown

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

LARGEST_NUMBER = 2**31 - 1
"""Of a node or an element: the codes count in 32 bits."""

_INTEGER = re.compile(r"[+-]?\d{1,18}")
_REAL = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[eEdD]?([+-]\d{1,4})|[eEdD](\d{1,4}))?")


def is_integer(text: str) -> bool:
    """Whether a text is a whole number."""
    return _INTEGER.fullmatch(text) is not None


def read_float(text: str, place: Place) -> float:
    """A finite number, Fortran's 1.5D+03 and 1.5+3 included; 0 for an empty text. Raises SceneError."""
    text = text.strip()
    if not text:
        return 0.0
    match = _REAL.fullmatch(text)
    value = math.nan
    if match is not None:
        try:
            value = float(f"{match[1]}e{match[2] or match[3] or 0}")
        except (OverflowError, ValueError):
            value = math.inf
    if not math.isfinite(value):
        raise place.wrong(f"{shown(text)!r} in place of a number", "give a finite number")
    return value


def read_integer(text: str, place: Place, what: str = "a whole number") -> int:
    """A whole number from 1 to LARGEST_NUMBER. Raises SceneError, about `what`."""
    text = text.strip()
    if not is_integer(text) or not 0 < int(text) <= LARGEST_NUMBER:
        raise place.wrong(f"{shown(text)!r} in place of {what}", f"give a whole number of at most {LARGEST_NUMBER}")
    return int(text)


def read_fields(block: Block, line: int) -> list[str]:
    """Fields of a data line, without the empty ones at its end."""
    fields = [part.strip() for part in block.lines[line].split(",")]
    while fields and not fields[-1]:
        fields.pop()
    return fields


def read_floats(block: Block, line: int, least: int) -> list[float]:
    """Numbers of a data line, at least so many. Raises SceneError."""
    if line >= len(block.lines):
        raise block.place.wrong(f"*{block.written} without its data line", "give the numbers below it")
    place = block.place_of(line)
    values = [read_float(part, place) for part in read_fields(block, line)]
    if len(values) < least:
        raise place.wrong(f"{len(values)} numbers below *{block.written}", f"give {least}")
    return values


def read_points(block: Block) -> tuple[IntArray, FloatArray]:
    """Numbers (n,) and coordinates (n, 3) of data lines "number, x, y, z"; coordinates that are missing are 0."""
    numbers = np.zeros(len(block.lines), dtype=np.int64)
    coordinates = np.full((len(block.lines), 3), np.nan)
    for line, text in enumerate(block.lines):
        try:
            number, x, y, z = text.split(",")
            numbers[line], coordinates[line] = int(number), (float(x), float(y), float(z))
        except (ValueError, OverflowError):
            pass
    plain = np.isfinite(coordinates).all(axis=1) & (numbers > 0) & (numbers <= LARGEST_NUMBER)
    for line in np.flatnonzero(~plain).tolist():
        place = block.place_of(line)
        fields = read_fields(block, line)[:4]  # Abaqus: direction of a normal behind the position
        numbers[line] = read_integer(fields[0] if fields else "", place, "a node number")
        values = [read_float(part, place) for part in fields[1:]]
        coordinates[line] = values + [0.0] * (3 - len(values))
    return numbers, coordinates


def read_records(block: Block, length: int, what: str) -> IntArray:
    """Records (n, length) of whole numbers, each from the beginning of a line over one or more lines.

    Raises SceneError where a line is none of numbers, or a record is too short or too long. what: of the record, for
    the message.
    """
    values = array("q")
    started = 0  # numbers of records before the present one
    for line, text in enumerate(block.lines):
        parts = text.rstrip(", \t").split(",")
        try:
            values.extend(list(map(int, parts)))
        except (ValueError, OverflowError):
            for part in parts:
                read_integer(part, block.place_of(line), "a whole number")
        have = len(values) - started
        if have > length:
            raise block.place_of(line).wrong(f"{have} numbers for {what}", f"give {length}")
        if have == length:
            started = len(values)
    if started != len(values):
        have = len(values) - started
        raise block.place_of(len(block.lines) - 1).wrong(f"{have} numbers for {what}", f"give {length}")
    records = np.array(values, dtype=np.int64).reshape(-1, length)
    if records.size and not ((records > 0) & (records <= LARGEST_NUMBER)).all():
        for line, text in enumerate(block.lines):
            for part in text.rstrip(", \t").split(","):
                read_integer(part, block.place_of(line), "a node or element number")
    return records

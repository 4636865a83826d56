"""A worn profile that was measured, from a CSV file: positions along x and depths, each with its unit in the header."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studyrunner.user_error import UserError, Verbatim

_UNITS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6}
_HEADER = re.compile(r"\s*(x|depth)\s*[_(\[ ]\s*(m|mm|um|µm)\s*[)\]]?\s*", re.IGNORECASE)
_MOST_BYTES = 20_000_000


@dataclass(frozen=True)
class Profile:
    """A measured profile. name: of its file. x, depth (n,): m, depth positive where material is missing."""

    name: str
    x: NDArray[np.float64]
    depth: NDArray[np.float64]


def read_profile(path: Path) -> Profile:
    """The profile in a CSV file: a header such as `x_mm,depth_um`, then a row for each position.

    Raises
    ------
    UserError
        Where there is no such file, or it is not of this form.
    """
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise UserError(str(path), "the file", None, f"give a file of at most {_MOST_BYTES // 10**6} MB")
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = [row for row in csv.reader(file) if any(cell.strip() for cell in row)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise UserError(str(path), "the file", None, f"give a CSV file that can be read: {error}") from None
    header = rows[0] if rows else []
    found = {match[1].lower(): (place, _UNITS[match[2].lower()]) for place, match in _matches(header)}
    if set(found) != {"x", "depth"}:
        remedy = "give a first line that names both columns with their units, m, mm or um, as x_mm,depth_um"
        raise UserError(str(path), "line 1", Verbatim(f'"{",".join(header)[:60]}"'), remedy)
    values = []
    for number, row in enumerate(rows[1:], start=2):
        try:
            values.append([float(row[place]) * factor for place, factor in (found["x"], found["depth"])])
        except (ValueError, IndexError):
            raise UserError(str(path), f"row {number}", ",".join(row)[:60], "give a number in both columns") from None
    array = np.array(values, dtype=float).reshape(-1, 2)
    if not len(array) or not np.isfinite(array).all():
        raise UserError(str(path), "the file", None, "give at least one row, and finite numbers")
    array = array[np.argsort(array[:, 0], kind="stable")]
    return Profile(path.name, array[:, 0], array[:, 1])


def _matches(header: list[str]) -> list[tuple[int, re.Match[str]]]:
    matches = [(place, _HEADER.fullmatch(cell)) for place, cell in enumerate(header)]
    return [(place, match) for place, match in matches if match is not None]

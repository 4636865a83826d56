"""A measured profile of a worn surface, from a CSV file."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studyrunner.user_error import UserError, Verbatim

_COLUMN = re.compile(r"(x|depth)_?(m|mm|um|µm)", re.IGNORECASE)  # as `genfromtxt` writes the names of columns
_UNITS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6}


@dataclass(frozen=True)
class Profile:
    """A measured profile. name: of its file. x, depth (n,): m, depth positive where material is missing."""

    name: str
    x: NDArray[np.float64]
    depth: NDArray[np.float64]


def read_profile(path: Path) -> Profile:
    """The profile in a CSV file: a header such as `x_mm,depth_um`, then a row for each position. Raises UserError."""
    try:
        lines = path.read_text(encoding="utf-8-sig").replace('"', "").splitlines()
        lines = [line for line in lines if line.strip(" ,")]
        # rows may end with a comma that the header does not have
        lines = [",".join(line.split(",")[: lines[0].count(",") + 1]) for line in lines]
        table: NDArray[Any] = np.genfromtxt(lines, delimiter=",", names=True, ndmin=1) if lines else np.zeros(0)
    except (OSError, ValueError) as error:
        remedy = f"give a CSV file with a first line such as x_mm,depth_um, and numbers between commas: {error}"
        raise UserError(str(path), "the file", None, remedy) from None
    columns = table.dtype.names or ()
    units = {
        match[1].lower(): (match[0], _UNITS[match[2].lower()]) for match in map(_COLUMN.fullmatch, columns) if match
    }
    if set(units) != {"x", "depth"}:
        remedy = "give a first line that names both columns with their units, m, mm or um, as x_mm,depth_um"
        raise UserError(str(path), "line 1", Verbatim(f'"{",".join(columns)[:60]}"'), remedy)
    x, depth = (table[name] * factor for name, factor in (units["x"], units["depth"]))
    wrong = np.flatnonzero(~np.isfinite([x, depth]).all(axis=0))
    if not x.size or wrong.size:
        where = f"row {wrong[0] + 2}" if wrong.size else "the file"
        raise UserError(str(path), where, None, "give at least one row, and finite numbers in both columns")
    order = np.argsort(x, kind="stable")
    return Profile(path.name, x[order], depth[order])

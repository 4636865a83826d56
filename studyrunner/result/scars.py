"""The whole contact of a cylinder or a sphere on a flat, of which a part is computed, and a measured profile of it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from studyrunner.user_error import UserError, Verbatim

if TYPE_CHECKING:
    from studyrunner.result.view import Result

_MIRRORED = {"cylinder_on_flat": 1, "sphere_on_flat": 2}
"""Of bundled scenes with pairs of one half or one quarter of the contact: how many planes mirror them, x = 0 first."""

_UNITS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6}
_HEADER = re.compile(r"\s*(x|depth)\s*[_(\[ ]\s*(m|mm|um|µm)\s*[)\]]?\s*", re.IGNORECASE)


@dataclass(frozen=True)
class Scar:
    """The whole contact. pairs (n,): index along `contact`, each pair as often as it is mirrored. x, y (n,): m.

    line (k,): places in `pairs` of those along x through the middle, x ascending. width: of a square patch, m; 0 for
    strips.
    """

    pairs: NDArray[np.intp]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    line: NDArray[np.intp]
    width: float


def find_scar(result: Result) -> Scar | None:
    """The contact of the shown scene where it is one of a cylinder or a sphere on a flat; None for other scenes."""
    planes = _MIRRORED.get(str(result.study.get("scene", {}).get("model", "")), 0)
    coordinates = result.dataset.coords
    if not planes or not all(name in coordinates for name in ("contact_x", "contact_y")):
        return None
    x, y = (np.asarray(coordinates[f"contact_{axis}"].values, dtype=float) for axis in "xy")
    if x.ndim != 1 or not np.isfinite([x, y]).all():
        return None
    pairs, width = np.arange(x.size), 0.0
    pairs, x, y = np.r_[pairs, pairs], np.r_[-x, x], np.r_[y, y]
    if planes == 2:
        width = 2.0 * float(np.abs(x).min())
        pairs, x, y = np.r_[pairs, pairs], np.r_[x, x], np.r_[y, -y]
    middle = np.flatnonzero((np.abs(y) <= 0.75 * width) & (y >= 0.0))
    return Scar(pairs, x, y, middle[np.argsort(x[middle], kind="stable")], width)


@dataclass(frozen=True)
class Profile:
    """A measured profile. name: of its file. x, depth (n,): m, depth positive where material is missing."""

    name: str
    x: NDArray[np.float64]
    depth: NDArray[np.float64]


def read_profile(path: Path) -> Profile:
    """The profile in a CSV file: a header such as `x_mm,depth_um`, then a row for each position. Raises UserError."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(str(path), "the file", None, f"give a CSV file that can be read: {error}") from None
    header, *rows = [line.replace('"', "").split(",") for line in lines if line.strip(" ,")] or [[""]]
    matches = ((place, _HEADER.fullmatch(cell)) for place, cell in enumerate(header))
    found = {match[1].lower(): (place, _UNITS[match[2].lower()]) for place, match in matches if match}
    if set(found) != {"x", "depth"}:
        remedy = "give a first line that names both columns with their units, m, mm or um, as x_mm,depth_um"
        raise UserError(str(path), "line 1", Verbatim(f'"{",".join(header)[:60]}"'), remedy)
    values = []
    for number, row in enumerate(rows, start=2):
        try:
            values.append([float(row[place]) * factor for place, factor in (found["x"], found["depth"])])
        except (ValueError, IndexError):
            raise UserError(str(path), f"row {number}", ",".join(row)[:60], "give a number in both columns") from None
    array = np.array(values, dtype=float).reshape(-1, 2)
    if not len(array) or not np.isfinite(array).all():
        raise UserError(str(path), "the file", None, "give at least one row, and finite numbers")
    array = array[np.argsort(array[:, 0], kind="stable")]
    return Profile(path.name, array[:, 0], array[:, 1])

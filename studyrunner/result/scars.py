"""The whole contact of a cylinder or a sphere on a flat, of which one half or one quarter is computed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studyrunner.result.view import Result

_MIRRORED = {"cylinder_on_flat": 1, "sphere_on_flat": 2}
"""Of bundled scenes with pairs of one half or one quarter of the contact: how many planes mirror them, x = 0 first."""


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

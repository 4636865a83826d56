"""Points and cycles that fit into the page, and the values of variables there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from studyrunner.report.page.encoding import encode_floats
from studyrunner.report.reading.result import Result
from studyrunner.report.reading.units import Scale, scale_for
from studyrunner.variables import CERTIFICATE

_BYTES_A_BLOCK = 32e6

_IN_PERCENT = ("worn_volume_error", "error_estimate", *(name for name in CERTIFICATE if name != "residual"))
"""Relative errors."""

Encoded = dict[str, str | float]
"""`data`: see `encode_floats`. Values times `factor` are in `unit`. `label`: name of the quantity."""


@dataclass(frozen=True)
class Kept:
    """Kept points and cycles: numbers of points, ascending; indices of cycles, with the first and the last."""

    points: NDArray[np.int64]
    cycles: NDArray[np.int64]


def thin_out(count: int, keep: int) -> NDArray[np.int64]:
    """`keep` of the indices 0 to `count` - 1, evenly, with first and last; all where `keep` is at least `count`."""
    if keep >= count:
        return np.arange(count)
    return np.unique(np.round(np.linspace(0, count - 1, max(keep, min(count, 2)))).astype(np.int64))


def fit_points(result: Result, cycles: NDArray[np.int64], floats_each: int, floats: float, fewest_cycles: int) -> Kept:
    """Points and cycles at which `floats_each` numbers fit: first the cycles are thinned out, then points go.

    The points that stay are those worn most at the end; those without a state have nothing to keep.
    """
    points = np.flatnonzero(result.held)
    fewest = min(len(cycles), fewest_cycles)
    room = int(floats // max(floats_each, 1))
    keep = min(len(cycles), room // max(len(points), 1))
    if keep < fewest:
        keep = fewest
        points = np.sort(_most_worn_first(result, points)[: room // fewest])
    return Kept(points, cycles[thin_out(len(cycles), keep)])


def _most_worn_first(result: Result, points: NDArray[np.int64]) -> NDArray[np.int64]:
    if not result.has("worn_volume"):
        return points
    return points[np.argsort(-np.nan_to_num(result.worn.ravel()[points]), kind="stable")]


def tell_kept(what: str, kept: Kept, cycles: NDArray[np.int64], result: Result, notes: list[str]) -> None:
    """A note where not all points, or not all cycles of the slider, are kept."""
    n_points = int(np.count_nonzero(result.held))
    if not len(kept.points):
        notes.append(f"{what} are not on this page: those of a single point would not fit.")
        return
    if len(kept.points) < n_points:
        notes.append(f"{what} are on this page for the {len(kept.points)} most worn of {n_points} points.")
    if len(kept.cycles) < len(cycles):
        notes.append(
            f"{what} are on this page at {len(kept.cycles)} of the {len(cycles)} cycle counts of the slider: the"
            " nearest one is shown and named."
        )


def encode_kept(result: Result, name: str, kept: Kept) -> Encoded:
    """A variable at the points and cycles that are kept, (point, cycle, others)."""
    return encode_values(result.dataset[name], read_kept(result.dataset[name], kept))


def read_kept(variable: xr.DataArray, kept: Kept) -> NDArray[np.float64]:
    """Values (point, cycle, others) at what is kept; never much more in memory than that and a block of the file."""
    inner = inner_shape(variable)
    shape = variable.shape[: variable.dims.index("cycle" if "cycle" in variable.dims else "contact")]
    leading = 0
    while leading < len(shape) and math.prod(shape[leading:]) * math.prod(inner) * 8 > _BYTES_A_BLOCK:
        leading += 1
    found = np.empty((len(kept.points), len(kept.cycles), *inner[1:]))
    trailing = math.prod(shape[leading:])
    blocks = kept.points // trailing
    for block in np.unique(blocks).tolist():
        # A variable that fits is read as a whole and stays in memory for all others who ask.
        at = tuple(int(place) for place in np.unravel_index(block, shape[:leading])) if leading else ()
        part = variable[at] if leading else variable
        here = blocks == block
        found[here] = part.values.reshape(trailing, *inner)[kept.points[here] % trailing][:, kept.cycles]
    return found


def inner_shape(variable: xr.DataArray) -> tuple[int, ...]:
    """Sizes after the axes: cycle, 1 of a variable of the last count alone, and what follows it."""
    if "cycle" in variable.dims:
        return variable.shape[variable.dims.index("cycle") :]
    return (1, *variable.shape[variable.dims.index("contact") :])


def encode_values(variable: xr.DataArray, values: NDArray[np.generic]) -> Encoded:
    """Values of a variable, with what it is called and how they are shown."""
    scale = scale_for(str(variable.attrs.get("units", "")), values)
    label = str(variable.attrs.get("long_name", variable.name))
    if variable.name in _IN_PERCENT:
        scale = Scale(100.0, "%")
    return {"label": label, "unit": scale.unit, "factor": scale.factor, "data": encode_floats(values)}

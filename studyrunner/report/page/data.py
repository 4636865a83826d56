"""Numbers of the interactive part of the page: variables of the file as 32-bit floats, within a limit of size."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from studyrunner.report.figures.loops import find_loops
from studyrunner.result.units import Scale, scale_for, units_of
from studyrunner.result.view import NO_VOLUME, Result
from studyrunner.statistics.samples import DRAWN
from studyrunner.variables import CERTIFICATE

_CHARACTERS_A_FLOAT = 16.0 / 3.0
_MOST_POINTS = 20_000
"""Points of a study with an interactive part: each takes time to draw."""

_MOST_MESSAGES, _MOST_PHASES = 500, 64
_LOOPS = "pair_of_loop"
"""Dimension of those pairs that have loops."""

_ERRORS = dict.fromkeys(("response_amplitude", "response_amplitude_begin", "response_peak"), "response_error")
"""Variables whose error has another name than `<name>_error`."""

_FIRST = ("worn_volume", "natural_frequency", "response_amplitude")
_COLOURED = ("worn_cycle", "scheme", "sweep", "cycle", "mode")
_LINES = 10


def encode_floats(values: ArrayLike) -> str:
    """Numbers as base64 of little-endian 32 bit floats, the last index fastest; NaN stays NaN."""
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode("ascii")


def build_page_data(result: Result, limit: float, notes: list[str]) -> dict[str, Any] | None:
    """What the script of the page reads, in about `limit` characters; None where there is nothing to show.

    `dims`: the dimensions, the axes of the study first, with label, unit and values. `coords`: numbers along one
    dimension that may be its values instead. `variables`: see `_encode`. `at`: index along each dimension that is shown
    first; `start`: variable, horizontal and coloured dimension. `messages`: of points, by number, the last axis
    fastest. Sentences on what is left out are appended to `notes`.
    """
    if not result.held.any():
        return None
    if result.held.size > _MOST_POINTS:
        notes.append(f"The study has {result.held.size} points, more than the {_MOST_POINTS} that can be picked here.")
        return None
    if result.has("cycle_count"):
        notes.append("Each point has cycle counts of its own, see cycle_count: cycle is the number of the output.")
    arrays = _fit(dict(_arrays(result)), limit / _CHARACTERS_A_FLOAT, notes)
    variables = [_encode(array, kept, arrays) for array, kept in arrays.values()]
    used = [*result.axes, *(str(dim) for array, _ in arrays.values() for dim in array.dims)]
    shown: dict[str, int] = {**result.shown_point(), **({} if result.has_modes else {"cycle": -1})}
    if "cycle" in shown:
        shown["cycle"] = result.last_kept(result.shown_point())
    dims = [_dimension(result, name, arrays) for name in dict.fromkeys(used)]
    messages = result.dataset["message"].values.ravel().tolist() if result.has("message") else []
    return {
        "dims": dims,
        "axes": list(result.axes),
        "coords": list(_coordinates(result, set(used))),
        "variables": variables,
        "at": {str(entry["name"]): shown.get(str(entry["name"]), 0) for entry in dims},
        "start": _start(result, arrays),
        "sentences": {str(number): ending.sentence for number, ending in result.endings.items()},
        "messages": {str(place): text for place, text in enumerate(messages) if text and place < _MOST_MESSAGES},
    }


def _arrays(result: Result) -> Iterator[tuple[str, xr.DataArray]]:
    """Numbers of the file that belong to points of the study, unread; loops of those pairs alone that have some."""
    found = {**result.dataset.data_vars, **(result.blocks.data_vars if result.blocks is not None else {})}
    for name, array in found.items():
        if array.dtype.kind not in "iuf" or not set(result.axes) & set(array.dims) or not array.size:
            continue
        if "phase" in array.dims:
            phases = slice(None, None, -(-array.sizes["phase"] // _MOST_PHASES))
            array = array.sel(contact=find_loops(result, result.shown_point())).isel(phase=phases)
            array = array.rename(contact=_LOOPS)
        if array.size:
            yield str(name), array


def _fit(
    arrays: Mapping[str, xr.DataArray], floats: float, notes: list[str]
) -> dict[str, tuple[xr.DataArray, NDArray[np.intp] | None]]:
    """Variables that fit, in the order of the file, and which cycles of each are held; None for all.

    Small ones come first. Of what does not fit, cycles are thinned out evenly, down to the first and the last.
    """
    found: dict[str, NDArray[np.intp] | None] = {}
    for n_before, name in enumerate(sorted(arrays, key=lambda name: arrays[name].size)):
        array, share = arrays[name], floats / (len(arrays) - n_before)
        n_cycles = array.sizes.get("cycle", 1)
        keep = min(n_cycles, int(share * n_cycles // array.size))
        if keep < min(2, n_cycles):
            notes.append(f"{name} does not fit into this page.")
            continue
        found[name] = None
        if keep < n_cycles:
            found[name] = np.unique(np.linspace(0, n_cycles - 1, keep).round().astype(np.intp))
            notes.append(f"{name} is on this page at {keep} of {n_cycles} counts; the nearest one is shown.")
        floats -= array.size * keep / n_cycles
    return {name: (array, found[name]) for name, array in arrays.items() if name in found}


def _encode(array: xr.DataArray, kept: NDArray[np.intp] | None, arrays: Mapping[str, Any]) -> dict[str, Any]:
    """A variable: `dims`, `data` in SI, times `factor` in `unit`; `kept`, the places along dimensions held in part.

    `error`: the variable that holds its error, `relative` or in the same unit. `words`: what its values mean.
    """
    name = str(array.name)
    values = (array if kept is None else array.isel(cycle=kept)).values.astype(float)
    scale = scale_for(str(array.attrs.get("units", "")), values)
    if name in ("worn_volume_error", "error_estimate", "block_worn_volume_error") or (
        name in CERTIFICATE and name.endswith("_error")
    ):
        scale = Scale(100.0, "%")
    error = _ERRORS.get(name, f"{name}_error")
    words = dict(
        zip(array.attrs.get("flag_values", ()), str(array.attrs.get("flag_meanings", "")).split(), strict=False)
    )
    return {
        "name": name,
        "label": str(array.attrs.get("long_name", name)),
        "unit": scale.unit,
        "factor": scale.factor,
        "dims": [str(dim) for dim in array.dims],
        "kept": {} if kept is None else {"cycle": kept.tolist()},
        "data": encode_floats(values),
        "error": error if error in arrays else None,
        "relative": error in arrays and str(arrays[error][0].attrs.get("units")) != str(array.attrs.get("units")),
        "words": {str(int(value)): word.replace("_", " ") for value, word in words.items()},
    }


def _dimension(result: Result, name: str, arrays: Mapping[str, tuple[xr.DataArray, Any]]) -> dict[str, Any]:
    """A dimension with its values: numbers, or words."""
    axis = next(array for array, _ in arrays.values() if name in array.dims)[name]
    label = result.counted if name == "cycle" and not result.has_modes else name.replace("_", " ")
    words = axis.dtype.kind not in "fiu"
    values = axis.values.tolist()
    return {
        "name": name,
        "label": label,
        "unit": "" if name == "cycle" else units_of(axis),
        "values": [str(each) for each in values]
        if words
        else [each if math.isfinite(each) else None for each in values],
        "words": words,
    }


def _coordinates(result: Result, dims: set[str]) -> Iterator[dict[str, Any]]:
    """Numbers along one dimension: what samples draw, positions of the pairs."""
    for name, axis in result.dataset.coords.items():
        along = [str(dim) for dim in axis.dims]
        if len(along) == 1 and along[0] in dims and name != along[0] and axis.dtype.kind in "iuf":
            scale = scale_for(str(axis.attrs.get("units", "")), axis.values)
            label = str(name).removeprefix(DRAWN).replace("_", " ")
            data = encode_floats(scale(axis.values))
            yield {"name": str(name), "dim": along[0], "label": label, "unit": scale.unit, "data": data}


def _start(result: Result, arrays: Mapping[str, tuple[xr.DataArray, Any]]) -> dict[str, str]:
    """What is shown first: a variable over the axis that figures are drawn over, or over slow time."""
    wears = result.has("worn_volume") and bool(np.nanmax(result.worn) > NO_VOLUME)
    usual = [name for name in _FIRST if name in arrays and (wears or name != "worn_volume")]
    name = next(iter((*usual, *arrays)))
    sizes = arrays[name][0].sizes
    several = [str(dim) for dim in sizes if sizes[dim] > 1]
    across = result.course_axis if result.course_axis in several else ("cycle" if "cycle" in several else "")
    across = across or (several[0] if several else str(arrays[name][0].dims[0]))
    colours = [dim for dim in _COLOURED if dim in several and dim != across and sizes[dim] <= _LINES]
    return {"variable": name, "x": across, "colour": colours[0] if colours else ""}

"""Numbers for the interactive part of the page: 32-bit floats of a result file, within a limit of size.

Points are numbered as in the file, the last axis fastest. Values are in the units of the file; the script of the page
multiplies them by `factor`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from studyrunner.report.drawing import COLOURS
from studyrunner.report.figures.loops import component_labels
from studyrunner.report.page.encoding import encode_floats
from studyrunner.report.page.panels import build_panels
from studyrunner.report.page.root import build_root_numbers
from studyrunner.report.page.trends import build_trend_numbers
from studyrunner.report.reading.known_volumes import advise_point, advise_volume, show_error
from studyrunner.report.reading.result import CONVERGED, Result, as_sentences
from studyrunner.report.reading.units import scale_for, units_of
from studyrunner.variables import CERTIFICATE

COURSES = (
    "response_amplitude",
    "response_phase",
    "response_peak",
    "worn_volume",
    "worn_volume_error",
    "wear_rate",
    "exact_worn_volume",
    "exact_response_amplitude",
)
"""Variables that the page holds for every point at every cycle."""

MAPS = ("mean_pressure", "wear_depth", "open_fraction", "slip_range")
"""Variables of the contact pairs that the page draws as maps."""

LOOPS = ("loop_displacement", "loop_force")

POINT_NUMBERS = (
    "jump_cycle",
    "cycles_to_target",
    "error_estimate",
    "last_cycle",
    "largest_wear_depth",
    "newton_iterations",
    "run_time",
    "branch",
    "step_limit",
)
"""Numbers of a point that stand in the list beside the plots."""

_LARGEST = {"harmonics_used": "harmonics", "samples_used": "samples in a period"}

MOST_POINTS = 20_000
"""Largest number of points of a study with interactive part: not even the numbers without cycles would fit."""

_LINES = ("scheme", "sweep")
_FEWEST_MAP_CYCLES = 11
_FEWEST_LOOP_CYCLES = 2
_FRACTION_OF_COURSES = 0.5
_FRACTION_OF_LOOPS = 0.25
_CHARACTERS_A_FLOAT = 16.0 / 3.0
_BYTES_A_BLOCK = 32e6

Encoded = dict[str, str | float]
"""`data`: see `encode_floats`. Values times `factor` are in `unit`. `label`: name of the quantity."""


@dataclass(frozen=True)
class PageData:
    """Input of the script of the page.

    content: None without interactive part.
    notes: on what is left out.
    """

    content: Mapping[str, object] | None
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Kept:
    """Kept points and cycles: numbers of points, ascending; indices of cycles, with the first and the last."""

    points: NDArray[np.int64]
    cycles: NDArray[np.int64]


def build_page_data(result: Result, limit: float) -> PageData:
    """Numbers of the interactive part in about `limit` characters of text.

    Where there are too many numbers cycles are thinned out evenly, first those of the contact pairs, then those of the
    points; then points lose their maps and loops. A note says so.
    """
    n_points = result.held.size
    if n_points > MOST_POINTS:
        note = f"The study has {n_points} points, more than the {MOST_POINTS} that can be picked here."
        return PageData(None, (note,))
    notes: list[str] = []
    if result.has("cycle_count"):
        notes.append(
            "Each point has cycle counts of its own, spaced evenly in worn volume and cycles: those of the point"
            " that is picked are shown; the slider runs through the outputs."
        )
    floats = limit / _CHARACTERS_A_FLOAT
    points, last = _point_numbers(result), result.last_cycle
    remarks = {str(place): text for place, text in _remarks(result)}
    floats -= len(json.dumps(remarks)) / _CHARACTERS_A_FLOAT
    floats -= sum(len(str(entry["data"])) for entry in points.values()) / _CHARACTERS_A_FLOAT
    trends = build_trend_numbers(result)
    floats -= len(json.dumps(trends)) / _CHARACTERS_A_FLOAT
    kept = _fit_courses(result, _FRACTION_OF_COURSES * floats, notes)
    if kept is None:
        return PageData(None, (f"The histories of {n_points} points do not fit into the page.",))
    courses = {name: _variable(result, name, kept) for name in COURSES if result.has(name)}
    floats -= sum(len(str(entry["data"])) for entry in courses.values()) / _CHARACTERS_A_FLOAT
    root = build_root_numbers(result, limit, notes) if _has_maps(result) else None
    floats -= len(json.dumps(root)) / _CHARACTERS_A_FLOAT
    loops, used = _loops(result, kept.cycles, _FRACTION_OF_LOOPS * floats, notes)
    maps = _maps(result, kept.cycles, floats - used, notes)
    shown = [result.shown_point()[name] for name in result.axes]
    content = {
        "axes": [_axis(result.dataset[name]) for name in result.axes],
        "horizontal": result.axes.index(result.course_axis or result.axes[0]),
        "lines": [result.axes.index(name) for name in _LINES if name in result.varying],
        "colours": COLOURS,
        "cycles": result.dataset["cycle"].values[kept.cycles].tolist(),
        "counts": _counts(result, kept) if result.has("cycle_count") else None,
        "responses": result.responses,
        "shown": int(np.ravel_multi_index(shown, result.held.shape)),
        "outcome": result.dataset["outcome"].values.ravel().tolist(),
        "without": np.flatnonzero(~result.held).tolist(),
        "ends": {
            str(place): float(last.flat[place])
            # of counts of their own each says whether it is known
            for place in np.flatnonzero(result.held & (~result.computed | (last < result.cycles[-1]))).tolist()
            if not result.has("cycle_count")
        },
        "remarks": remarks,
        "endings": {str(number): ending.sentence for number, ending in result.endings.items()},
        "points": points,
        "courses": courses,
        "trends": trends,
        "maps": maps,
        "loops": loops,
        "root": root if maps else None,
    }
    return PageData(content, tuple(notes))


def _remarks(result: Result) -> Iterator[tuple[int, str]]:
    """What there is to say of points beside their outcome, by number: messages, errors above rtol, advice."""
    messages = result.dataset["message"].values.ravel() if result.has("message") else None
    for flat in np.flatnonzero(result.above | (result.dataset["outcome"].values != CONVERGED)).tolist():
        place = tuple(int(index) for index in np.unravel_index(flat, result.above.shape))
        texts = ["" if messages is None else str(messages[flat]), advise_point(result, place)]
        if result.above[place] and math.isfinite(result.errors[place]):
            texts.append(f"Its worn volume is known to {show_error(result, place)} only")
            texts.append(f"What may help: {advise_volume(result, place)}")
        text = as_sentences(*texts)
        if text:
            yield flat, text


def _counts(result: Result, kept: _Kept) -> str:
    """Cycle counts of the points, infinite of a final state that has none, NaN where there is no such output."""
    points = np.stack(np.unravel_index(kept.points, result.held.shape), axis=-1).tolist()
    counts = [result.counts(dict(zip(result.axes, place, strict=True))) for place in points]
    return encode_floats(np.array(counts)[:, kept.cycles])


def thin_out(count: int, keep: int) -> NDArray[np.int64]:
    """`keep` of the indices 0 to `count` - 1, evenly, with first and last; all where `keep` is at least `count`."""
    if keep >= count:
        return np.arange(count)
    return np.unique(np.round(np.linspace(0, count - 1, max(keep, min(count, 2)))).astype(np.int64))


def _fit_courses(result: Result, floats: float, notes: list[str]) -> _Kept | None:
    """Cycles at which the numbers of all points fit; None where not even two of them do."""
    told = np.arange(result.dataset.sizes.get("cycle", 1))
    if result.has("cycle_count"):
        # final states have no outputs on the way to them
        told = np.flatnonzero(result.dataset["cycle_count"].notnull().any(result.axes).values)
    n_cycles, n_points = len(told), result.held.size
    names = [name for name in COURSES if result.has(name)]
    per_cycle = sum(math.prod(_inner_shape(result.dataset[name])[1:]) for name in names) * n_points
    keep = n_cycles if per_cycle == 0 else min(n_cycles, int(floats // per_cycle))
    if keep < min(2, n_cycles):
        return None
    cycles = told[thin_out(n_cycles, keep)]
    if len(cycles) < n_cycles:
        notes.append(f"The slider runs through {len(cycles)} of the {n_cycles} cycle counts of the file.")
    return _Kept(np.arange(n_points), cycles)


def _fit_points(
    result: Result, cycles: NDArray[np.int64], floats_each: int, floats: float, fewest_cycles: int
) -> _Kept:
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
    return _Kept(points, cycles[thin_out(len(cycles), keep)])


def _most_worn_first(result: Result, points: NDArray[np.int64]) -> NDArray[np.int64]:
    if not result.has("worn_volume"):
        return points
    return points[np.argsort(-np.nan_to_num(result.worn.ravel()[points]), kind="stable")]


def _has_maps(result: Result) -> bool:
    """Whether there is anything to draw at the contact pairs."""
    return bool(result.held.any()) and any(map(result.has, MAPS))


def _maps(result: Result, cycles: NDArray[np.int64], floats: float, notes: list[str]) -> dict[str, object] | None:
    """Values of the contact pairs; None where the file or the page holds none."""
    names = [name for name in MAPS if result.has(name)]
    if not _has_maps(result):
        return None
    kept = _fit_points(result, cycles, len(names) * result.dataset.sizes["contact"], floats, _FEWEST_MAP_CYCLES)
    _say_what_is_kept("Maps", kept, cycles, result, notes)
    if not len(kept.points):
        return None
    return {
        "points": kept.points.tolist(),
        "cycles": np.searchsorted(cycles, kept.cycles).tolist(),
        "panels": build_panels(result),
        "variables": {name: _variable(result, name, kept) for name in names},
    }


def _loops(
    result: Result, cycles: NDArray[np.int64], floats: float, notes: list[str]
) -> tuple[dict[str, object] | None, float]:
    """Loops of the pairs that the file holds, and the floats that they take; None where there are none."""
    if not result.has(*LOOPS) or not result.held.any():
        return None, 0.0
    first = int(np.flatnonzero(result.held)[0])
    force = _read(result.dataset["loop_force"], _Kept(np.array([first]), cycles[:1]))
    held = np.flatnonzero(np.isfinite(force).any(axis=(0, 1, 3, 4)))
    if not len(held):
        return None, 0.0
    sizes = result.dataset.sizes
    each = len(LOOPS) * len(held) * sizes["phase"] * sizes["component"]
    kept = _fit_points(result, cycles, each, floats, _FEWEST_LOOP_CYCLES)
    _say_what_is_kept("Loops", kept, cycles, result, notes)
    if not len(kept.points):
        return None, 0.0
    components = [str(name) for name in result.dataset["component"].values]
    # a pair without a second tangent holds NaN or zero there
    second = force[..., components.index("tangent_2")] if "tangent_2" in components else np.zeros(1)
    labels = component_labels(result, both=bool(np.nan_to_num(second).any()))
    content = {
        "points": kept.points.tolist(),
        "cycles": np.searchsorted(cycles, kept.cycles).tolist(),
        "contacts": result.dataset["contact"].values[held].tolist(),
        "widest": _widest(result, held),
        "phases": int(sizes["phase"]),
        "components": components,
        "labels": [labels.get(name, f"{name} {{}}") for name in components],
        "variables": {name: _variable(result, name, kept, held) for name in LOOPS},
    }
    return content, float(each * len(kept.points) * len(kept.cycles))


def _widest(result: Result, held: NDArray[np.int64]) -> int:
    """Which of the pairs moves furthest in the point that is shown first, unworn: the others may well stick."""
    loops = result.dataset["loop_displacement"].isel({"cycle": 0, "contact": held, **result.shown_point()})
    moved = np.ptp(loops.transpose("contact", "phase", "component").values, axis=1)
    return int(np.argmax(np.nan_to_num(moved).max(axis=1)))


def _say_what_is_kept(what: str, kept: _Kept, cycles: NDArray[np.int64], result: Result, notes: list[str]) -> None:
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


def _variable(result: Result, name: str, kept: _Kept, contacts: NDArray[np.int64] | None = None) -> Encoded:
    """A variable at the points and cycles that are kept, (point, cycle, others)."""
    values = _read(result.dataset[name], kept)
    return _encode(result.dataset[name], values if contacts is None else values[:, :, contacts])


def _read(variable: xr.DataArray, kept: _Kept) -> NDArray[np.float64]:
    """Values (point, cycle, others) at what is kept; never much more in memory than that and a block of the file."""
    inner = _inner_shape(variable)
    shape = variable.shape[: variable.ndim - len(inner)]
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


def _inner_shape(variable: xr.DataArray) -> tuple[int, ...]:
    """Sizes after the axes: cycle and what follows it."""
    return variable.shape[variable.dims.index("cycle") :]


def _point_numbers(result: Result) -> dict[str, Encoded]:
    """Numbers of the points without cycles: those of the file, and the worst of the certificates over the cycles."""
    dataset = result.dataset
    found = {name: _encode(dataset[name], dataset[name].values) for name in POINT_NUMBERS if result.has(name)}
    for name, label in {**CERTIFICATE, **_LARGEST}.items():
        if result.has(name):
            worst = result.read(name).max("cycle").values
            found[name] = {**_encode(dataset[name], worst), "label": f"{label}, largest over the cycles"}
    return found


def _encode(variable: xr.DataArray, values: NDArray[np.generic]) -> Encoded:
    """Values of a variable, with what it is called and how they are shown."""
    scale = scale_for(str(variable.attrs.get("units", "")), values)
    label = str(variable.attrs.get("long_name", variable.name))
    return {"label": label, "unit": scale.unit, "factor": scale.factor, "data": encode_floats(values)}


def _axis(axis: xr.DataArray) -> dict[str, object]:
    """Name, label, unit and values of an axis. `words`: whether the values are texts."""
    words = axis.dtype.kind not in "fiu"
    return {
        "label": str(axis.name).replace("_", " "),
        "unit": units_of(axis),
        "words": words,
        "values": [str(value) for value in axis.values] if words else axis.values.tolist(),
    }

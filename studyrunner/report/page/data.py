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

from studyrunner.report.drawing import COLOURS
from studyrunner.report.page.blocks import build_block_numbers, n_block_numbers
from studyrunner.report.page.encoding import encode_floats
from studyrunner.report.page.kept import Encoded, Kept, encode_kept, encode_values, inner_shape, thin_out
from studyrunner.report.page.maps import build_loops, build_maps, has_maps
from studyrunner.report.page.root import build_root_numbers
from studyrunner.report.page.scatter import build_scatter_numbers
from studyrunner.report.page.trends import build_trend_numbers
from studyrunner.report.reading.known_volumes import advise_point, advise_volume, show_error
from studyrunner.report.reading.result import CONVERGED, Result, as_sentences
from studyrunner.report.reading.units import units_of
from studyrunner.variables import CERTIFICATE

COURSES = (
    "response_amplitude",
    "response_phase",
    "response_peak",
    "worn_volume",
    "worn_volume_error",
    "wear_depth_max",
    "wear_rate",
    "exact_worn_volume",
    "exact_response_amplitude",
)
"""Variables that the page holds for every point at every cycle."""

POINT_NUMBERS = (
    "jump_cycle",
    "cycles_to_target",
    "cycles_to_target_error",
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
_FRACTION_OF_COURSES = 0.5
_FRACTION_OF_LOOPS = 0.25
_FRACTION_OF_SCATTER = 0.2
_CHARACTERS_A_FLOAT = 16.0 / 3.0


@dataclass(frozen=True)
class PageData:
    """Input of the script of the page.

    content: None without interactive part.
    notes: on what is left out.
    """

    content: Mapping[str, object] | None
    notes: tuple[str, ...]


def build_page_data(result: Result, limit: float) -> PageData:
    """Numbers of the interactive part in about `limit` characters of text.

    Where there are too many numbers cycles are thinned out evenly, first those of the contact pairs, then those of the
    points; then points lose their maps and loops. A note says so.
    """
    if result.has_modes:
        return PageData(None, ("Of nonlinear modes the page has figures alone.",))
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
    scatter = build_scatter_numbers(result, _FRACTION_OF_SCATTER * floats, notes)
    floats -= (len(json.dumps(trends)) + len(json.dumps(scatter))) / _CHARACTERS_A_FLOAT
    kept = _fit_courses(result, _FRACTION_OF_COURSES * floats, notes)
    if kept is None:
        return PageData(None, (f"The histories of {n_points} points do not fit into the page.",))
    courses = {name: encode_kept(result, name, kept) for name in COURSES if result.has(name)}
    blocks = build_block_numbers(result, kept)
    floats -= sum(len(str(entry["data"])) for entry in courses.values()) / _CHARACTERS_A_FLOAT
    floats -= len(json.dumps(blocks)) / _CHARACTERS_A_FLOAT
    root = build_root_numbers(result, limit, notes) if has_maps(result) else None
    floats -= len(json.dumps(root)) / _CHARACTERS_A_FLOAT
    loops, used = build_loops(result, kept.cycles, _FRACTION_OF_LOOPS * floats, notes)
    maps = build_maps(result, kept.cycles, floats - used, notes)
    shown = [result.shown_point()[name] for name in result.axes]
    content = {
        "axes": [_axis(result.dataset[name]) for name in result.axes],
        "horizontal": result.axes.index(result.course_axis or result.axes[0]),
        "lines": [result.axes.index(name) for name in _LINES if name in result.varying],
        "colours": COLOURS,
        "counted": result.counted.removesuffix("s"),
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
        "blocks": blocks,
        "trends": trends,
        "scatter": scatter,
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


def _counts(result: Result, kept: Kept) -> str:
    """Cycle counts of the points, infinite of a final state that has none, NaN where there is no such output."""
    points = np.stack(np.unravel_index(kept.points, result.held.shape), axis=-1).tolist()
    counts = [result.counts(dict(zip(result.axes, place, strict=True))) for place in points]
    return encode_floats(np.array(counts)[:, kept.cycles])


def _fit_courses(result: Result, floats: float, notes: list[str]) -> Kept | None:
    """Cycles at which the numbers of all points fit; None where not even two of them do."""
    told = np.arange(result.dataset.sizes.get("cycle", 1))
    if result.has("cycle_count"):
        # final states have no outputs on the way to them
        told = np.flatnonzero(result.dataset["cycle_count"].notnull().any(result.axes).values)
    n_cycles, n_points = len(told), result.held.size
    names = [name for name in COURSES if result.has(name)]
    of_point = sum(math.prod(inner_shape(result.dataset[name])[1:]) for name in names) + n_block_numbers(result)
    per_cycle = of_point * n_points
    keep = n_cycles if per_cycle == 0 else min(n_cycles, int(floats // per_cycle))
    if keep < min(2, n_cycles):
        return None
    cycles = told[thin_out(n_cycles, keep)]
    if len(cycles) < n_cycles:
        notes.append(f"The slider runs through {len(cycles)} of the {n_cycles} cycle counts of the file.")
    return Kept(np.arange(n_points), cycles)


def _point_numbers(result: Result) -> dict[str, Encoded]:
    """Numbers of the points without cycles: those of the file, and the worst of the certificates over the cycles."""
    dataset = result.dataset
    found = {name: encode_values(dataset[name], dataset[name].values) for name in POINT_NUMBERS if result.has(name)}
    for name, label in {**CERTIFICATE, **_LARGEST}.items():
        if result.has(name):
            worst = result.read(name).max("cycle").values
            found[name] = {**encode_values(dataset[name], worst), "label": f"{label}, largest over the cycles"}
    return found


def _axis(axis: xr.DataArray) -> dict[str, object]:
    """Name, label, unit and values of an axis. `words`: whether the values are texts."""
    words = axis.dtype.kind not in "fiu"
    return {
        "label": str(axis.name).replace("_", " "),
        "unit": units_of(axis),
        "words": words,
        "values": [str(value) for value in axis.values] if words else axis.values.tolist(),
    }

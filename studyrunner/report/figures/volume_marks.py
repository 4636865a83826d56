"""What the figures of the worn volume say of its error: bands, bars, and marks of points to be taken with care."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from studyrunner.report.figures.frequency_course import Course
from studyrunner.report.reading.choice import Choice
from studyrunner.report.reading.known_volumes import show_error
from studyrunner.report.reading.result import Result
from studyrunner.report.reading.units import Scale, show_cycles
from studyrunner.system.progress import count

_BAND = 0.18


def draw_band(result: Result, panel: Axes, point: Mapping[str, int], cycles: Scale, scale: Scale, colour: str) -> float:
    """The estimated error of a worn volume over the cycles as a band; its highest value, m3, 0 where there is none."""
    if not result.has("worn_volume_error"):
        return 0.0
    worn = result.at("worn_volume", point).values
    wrong = result.at("worn_volume_error", point).values * worn
    told = np.isfinite(wrong)
    if not (wrong[told] > 0.0).any():
        return 0.0
    low, high = np.maximum(worn - wrong, 0.0)[told], (worn + wrong)[told]
    options: dict[str, Any] = {"color": colour, "alpha": _BAND, "linewidth": 0.0, "gid": "error"}
    panel.fill_between(cycles(result.counts(point)[told]), scale(low), scale(high), **options)
    # a band that leaves the others too little room is cut
    return float(min(high.max(), 2.0 * np.nanmax(worn)))


def mark_end(result: Result, panel: Axes, point: Mapping[str, int], cycles: Scale, scale: Scale, colour: str) -> str:
    """A cross where a history ended early; a sentence about it, empty where it did not."""
    place = tuple(point[name] for name in result.axes)
    worn = result.at("worn_volume", point).values
    told = np.flatnonzero(np.isfinite(worn))
    if result.computed[place] or not told.size:
        return ""
    at, last = float(result.counts(point)[told[-1]]), float(result.last_cycle[place])
    panel.plot(cycles(at), scale(worn[told[-1]]), "X", color=colour, markersize=9, label="ended early")
    ending = result.endings[int(result.dataset["outcome"].values[place])]
    return f"Ended early, at {show_cycles(last, result.counted)}: {ending.word.replace('_', ' ')}"


def tell_error(result: Result, point: Mapping[str, int]) -> str:
    """The error of a final worn volume in words: " ± 3 %", with what is to be said where it is above rtol."""
    place = tuple(point[name] for name in result.axes)
    error = float(result.errors[place])
    if not result.computed[place] or not np.isfinite(error) or error <= 0.0:
        return ""
    remark = ", sensitive" if result.ended("sensitive")[place] else ", above rtol" if result.above[place] else ""
    return f" ± {show_error(result, place)}{remark}"


def draw_bars(
    result: Result,
    panel: Axes,
    course: Course,
    choice: Choice,
    fields: list[NDArray[np.float64]],
    scale: Scale,
    colours: list[str],
) -> float:
    """Estimated errors of the last worn volumes over the course as bars; how high they reach, m3, 0 where none is.

    fields: (n,) each.
    """
    highest = 0.0
    if not result.has("error_estimate"):
        return highest
    for point, field, colour in zip(choice.points, fields, colours, strict=True):
        wrong = course.read(result, "error_estimate", point) * field
        told = np.isfinite(wrong) & (wrong > 0.0)
        if told.any():
            sides = scale(np.stack([np.minimum(wrong, field)[told], wrong[told]]))
            at = (course.values[told], scale(field[told]))
            panel.errorbar(*at, yerr=sides, fmt="none", ecolor=colour, elinewidth=1.0, capsize=2.5, zorder=2.5)
            highest = max(highest, float((field + wrong)[told].max()))
    return highest


def mark_care(
    result: Result,
    panel: Axes,
    course: Course,
    choice: Choice,
    fields: list[NDArray[np.float64]],
    scale: Scale,
) -> list[str]:
    """Marks at points above rtol, at sensitive ones and at those that ended early, and a sentence for each kind.

    fields (n,) each: worn volumes at the last cycle count that each point has.
    """
    sensitive = result.ended("sensitive")
    kinds = (
        ("above rtol", "s", result.above & ~sensitive, "Squares: {} whose worn volume is known less well than to rtol"),
        ("sensitive", "D", sensitive, "Diamonds: {} so sensitive that one number says little"),
        (
            "ended early",
            "^",
            result.held & ~result.computed,
            "Triangles: {} that ended early, at what was worn by then",
        ),
    )
    sentences = []
    for label, marker, where, sentence in kinds:
        x: list[float] = []
        y: list[float] = []
        for point, field in zip(choice.points, fields, strict=True):
            marked = _along(result, course, where, point) & np.isfinite(field)
            x.extend(course.values[marked].tolist())
            y.extend(scale(field[marked]).tolist())
        if x:
            style: dict[str, Any] = {"markersize": 9, "markerfacecolor": "none", "color": "black", "label": label}
            panel.plot(x, y, linestyle="none", marker=marker, **style)
            sentences.append(sentence.format(count(len(x), "point")))
    return sentences


def _along(result: Result, course: Course, where: NDArray[np.bool_], point: Mapping[str, int]) -> NDArray[np.bool_]:
    """Flags of points (axes...) along the course, at a point whose index along it does not matter."""
    index = tuple(slice(None) if name == course.axis else point[name] for name in result.axes)
    return np.asarray(where[index][course.index])

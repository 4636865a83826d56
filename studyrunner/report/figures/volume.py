"""Worn volume and wear rate over an axis of the study: at the end (Fig. 8 of the paper), and as maps (Figs. 6, 7)."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize

from studyrunner.report.drawing import (
    Drawing,
    FloatArray,
    add_colour_bar,
    add_legend,
    add_line,
    hatch_empty,
    mark_failed,
    new_panel,
    new_panels,
    set_from_zero,
)
from studyrunner.report.figures.courses import Course, cell_edges, find_course, slow_time
from studyrunner.result.choice import Choice, choose
from studyrunner.result.units import Scale, scale_for
from studyrunner.result.view import NO_VOLUME, Result, as_sentences
from studyrunner.system.progress import count

_MOST_LINES, _MOST_MAPS = 6, 4
_CHARACTERS = 80  # of titles over panels side by side
_LARGE: dict[str, Any] = {"linestyle": "none", "markersize": 9, "markerfacecolor": "none", "color": "black"}


def _read_known(result: Result, course: Course, name: str, limit: int) -> tuple[Choice, list[FloatArray]]:
    """Combinations with a result anywhere along the course, and their values (course, cycle)."""
    choice = choose(result, [course.axis], limit)
    found = [(point, label, course.read(result, name, point)) for point, label in choice]
    # the shown point has a result: there is at least one
    points, labels, fields = zip(*(one for one in found if not np.isnan(one[2]).all()), strict=True)
    return Choice(points, labels, choice.sentence), list(fields)


def _worn_over(result: Result) -> Course | None:
    """The course of figures of the worn volume; None where there is none, or nothing wears."""
    wears = len(result.cycles) > 1 and float(np.nanmax(result.worn, initial=0.0)) > NO_VOLUME
    return find_course(result) if wears else None


def draw_final(result: Result) -> Drawing | None:
    """Worn volume at the last cycle count over the course, one line a combination."""
    course = _worn_over(result)
    if course is None:
        return None
    choice, fields = _read_known(result, course, "worn_volume", _MOST_LINES)
    every = choose(result, [course.axis], _MOST_LINES).points
    failed = np.array([np.isnan(course.read(result, "worn_volume", point)[:, 0]) for point in every])
    # of a point that ended early, what was worn by then
    reached = [np.where(np.isnan(field).all(axis=1), np.nan, np.nan_to_num(field).max(axis=1)) for field in fields]
    largest = max(float(np.nanmax(each, initial=0.0)) for each in reached)
    scale, (figure, panel) = scale_for("m3", largest), new_panel(3.4)
    highest = scale(largest).item()
    for number, (point, field) in enumerate(zip(choice.points, fields, strict=True)):
        error = course.read(result, "error_estimate", point) if result.has("error_estimate") else np.zeros(len(field))
        style = course.line_style(number) | {"label": choice.labels[number] or "computed"}
        at, wrong = scale(field[:, -1]), scale(error * field[:, -1])
        highest = max(highest, min(add_line(panel, course.values, at, wrong, **style), 2.0 * scale(largest).item()))
    marks = _mark_care(result, panel, course, choice, reached, scale)
    set_from_zero(panel, highest)
    crosses = mark_failed(panel, course.values, failed)
    course.set_axis(panel)
    panel.set_ylabel(scale.label(f"worn volume {'at the end' if result.has('cycle_count') else result.when(-1)}"))
    add_legend(figure)
    number = int(np.argmax([np.nanmax(each, initial=-1.0) for each in reached]))
    label = f" ({choice.labels[number]})" if choice.labels[number] else ""
    caption = as_sentences(
        f"Largest: {scale.show(largest, 4)} at {course.at(result, int(np.nanargmax(reached[number])))}{label}",
        "Each point is another joint, which wore at its own value of the horizontal axis",
        "Bars: estimated error" if result.has("error_estimate") else "",
        *marks,
        crosses,
        choice.sentence,
    )
    return Drawing("final_worn_volume", f"Final worn volume over {course.name}", caption, figure)


def _mark_care(
    result: Result, panel: Axes, course: Course, choice: Choice, fields: list[FloatArray], scale: Scale
) -> list[str]:
    """Marks at points to be taken with care, and a sentence for each kind.

    fields (n,) each: worn volumes at the last cycle count that each point has.
    """
    sensitive, early = result.ended("sensitive"), result.held & ~result.computed
    kinds = (
        ("above rtol", "s", result.above & ~sensitive, "whose worn volume is known less well than to rtol"),
        ("sensitive", "D", sensitive, "so sensitive that one number says little"),
        ("ended early", "^", early, "that ended early, at what was worn by then"),
    )
    said = []
    for label, marker, where, words in kinds:
        marked = [course.along(result, where, point) for point in choice.points]
        marked = [each & np.isfinite(field) for each, field in zip(marked, fields, strict=True)]
        if number := sum(int(each.sum()) for each in marked):
            x = np.concatenate([course.values[each] for each in marked])
            y = np.concatenate([field[each] for field, each in zip(fields, marked, strict=True)])
            panel.plot(x, scale(y), marker=marker, label=label, **_LARGE)
            name = {"s": "Squares", "D": "Diamonds", "^": "Triangles"}[marker]
            said.append(f"{name}: {count(number, 'point')} {words}")
    return said


def draw_map(result: Result, name: str) -> Drawing | None:
    """Worn volume or wear rate over the course and the cycles, one panel a combination.

    Nothing where each point has cycle counts of its own.
    """
    course, words = _worn_over(result), name.replace("_", " ")
    if course is None or result.has("cycle_count"):
        return None
    cycles = scale_for(result.counted, result.cycles)
    choice, fields = _read_known(result, course, name, _MOST_MAPS)
    largest = max(float(np.nanmax(field, initial=0.0)) for field in fields)
    scale = scale_for("m3" if name == "worn_volume" else f"m3 per {result.counted[:-1]}", largest)
    n_columns = 2 if len(fields) == _MOST_MAPS else len(fields)
    n_rows = len(fields) // n_columns
    figure, panels = new_panels(n_rows, n_columns, 0.6 + 2.7 * n_rows, sharex=True, sharey=True)
    norm = Normalize(0.0, scale(largest).item() or 1.0)
    # half a cell at both ends: nothing is known beyond
    rows = np.clip(cell_edges(cycles(result.cycles)), cycles(result.cycles[0]), cycles(result.cycles[-1]))
    for panel, field, label in zip(panels.flat, fields, choice.labels, strict=True):
        panel.pcolormesh(course.edges, rows, scale(field.T), norm=norm)
        hatch_empty(panel, bool(np.isnan(field).any()))
        panel.grid(visible=False)
        panel.set_title(textwrap.fill(label, _CHARACTERS // n_columns))
    for panel in panels[:, 0]:
        panel.set_ylabel(slow_time(result, cycles))
    for panel in panels[-1]:
        course.set_axis(panel)
    add_colour_bar(figure, panels, norm, scale.label(words))
    number = int(np.argmax([np.nanmax(field, initial=-1.0) for field in fields]))
    place, cycle = map(int, np.unravel_index(int(np.nanargmax(fields[number])), fields[number].shape))
    label = f" ({choice.labels[number]})" if choice.labels[number] else ""
    caption = as_sentences(
        f"Largest: {scale.show(largest, 4)} at {course.at(result, place)}, {result.cycle_label(cycle)}{label}",
        "Each point is worn at its own value of the horizontal axis only",
        "Hatched: points without a result" if any(np.isnan(field).any() for field in fields) else "",
        choice.sentence,
    )
    title = f"{words.capitalize()} over {course.name} and {result.counted}"
    return Drawing(f"{name}_map", title, caption, figure)

"""Worn volume and wear rate: over slow time (Fig. 4 of the paper), in the end (Fig. 8), as maps (Figs. 6, 7)."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize

from studyrunner.report.drawing import Drawn
from studyrunner.report.panels import (
    FloatArray,
    add_colour_bar,
    add_legend,
    add_line,
    add_map,
    line_style,
    mark_failed,
    new_panel,
    new_panels,
    set_from_zero,
)
from studyrunner.report.selection import Choice, Course, cell_edges, choose, find_course, labelled, slow_time
from studyrunner.result.certainty import show_error
from studyrunner.result.units import Scale, scale_for, show_number
from studyrunner.result.view import NO_VOLUME, Result, as_sentences
from studyrunner.system.progress import count

_MOST_LINES, _MOST_MAPS = 6, 4
_CHARACTERS = 80  # of titles over panels side by side
_LARGE: dict[str, Any] = {"linestyle": "none", "markersize": 9, "markerfacecolor": "none", "color": "black"}
_BANDS = "Bands: estimated error"


def draw_history(result: Result) -> Drawn:
    """Worn volume over cycles at the shown point, one line a scheme; a sentence where there is no history."""
    shown, course = result.shown_point(), result.course_axis
    largest = float(np.nanmax(result.read("worn_volume").values, initial=0.0))
    if len(result.cycles) == 1:
        return f"The file holds {result.cycle_label(0)} only: set [slow_time]."
    if not result.has_history:
        amount = scale_for("m3", largest).show(float(result.at("worn_volume", shown, -1)), 4)
        said = f"The final state was found without slow time and has no history: {amount}{_tell_error(result, shown)}"
        return f"{said} at {result.describe(shown)}."
    wears = largest > NO_VOLUME
    scale, cycles = scale_for("m3", largest if wears else 0.0), scale_for(result.counted, result.cycles)
    figure, panel = new_panel(3.4)
    choice = choose(result, [course] if course else [], _MOST_LINES)
    ends: list[str] = []
    highest = latest = 0.0
    for number, (point, label) in enumerate(choice):
        full = {**shown, **point}
        worn, counts = result.at("worn_volume", full).values, result.counts(full)
        style = line_style(number, 101) | {"label": label or "computed"}
        if np.isnan(worn).all():
            continue
        if np.isinf(counts[-1]):
            # it has no count: a level that histories come to
            look = {"color": style["color"], "linestyle": "--", "label": f"{label}: final state".lstrip(": ")}
            highest = max(highest, add_line(panel, cycles([0.0, result.cycles[-2]]), scale([worn[-1]] * 2), **look))
        else:
            error = result.at("worn_volume_error", full).values * worn if result.has("worn_volume_error") else None
            wrong = None if error is None else scale(error)
            highest = max(highest, add_line(panel, cycles(counts), scale(worn), wrong, band=True, **style))
            latest = max(latest, float(counts[-1]))
        if np.isfinite(worn[-1]):
            ends.append(labelled(f"{scale.show(float(worn[-1]), 4)}{_tell_error(result, full)}", label))
        _mark_events(result, panel, full, cycles, scale, style["color"])
    panel.set_xlabel(slow_time(result, cycles))
    panel.set_ylabel(scale.label("worn volume"))
    panel.set_xlim(0.0, cycles(latest or result.cycles[-1]).item())
    set_from_zero(panel, highest if wears else 0.0)
    add_legend(figure)
    when = "at the end" if result.has("cycle_count") else result.when(-1)
    return figure, as_sentences(
        f"Worn {when}: {', '.join(ends)}" if wears else "Nothing is worn at the counts kept",
        _BANDS if result.has("worn_volume_error") and wears else "",
        choice.sentence,
    )


def _mark_events(
    result: Result, panel: Axes, point: Mapping[str, int], cycles: Scale, scale: Scale, colour: str
) -> None:
    """Where a branch was lost, where a history ended early, and the exact answer behind it."""
    worn, counts = result.at("worn_volume", point).values, result.counts(point)
    jump = float(result.at("jump_cycle", point).values) if result.has("jump_cycle") else np.nan
    if np.isfinite(jump):
        look: dict[str, Any] = {"color": colour, "markersize": 12, "label": "branch lost, jump"}
        panel.plot(cycles(jump), scale(np.interp(jump, counts, worn)), "*", **look)
    reached = np.flatnonzero(np.isfinite(worn))
    if not result.computed[tuple(point[name] for name in result.axes)] and reached.size:
        look = {"color": colour, "markersize": 9, "label": "ended early"}
        panel.plot(cycles(float(counts[reached[-1]])), scale(worn[reached[-1]]), "X", **look)
    if result.has("exact_worn_volume"):
        exact = result.at("exact_worn_volume", point).values
        panel.plot(cycles(counts), scale(exact), color="0.5", linewidth=4, alpha=0.4, zorder=1, label="exact")


def _tell_error(result: Result, point: Mapping[str, int]) -> str:
    """The error of a final worn volume in words: " ± 3 %", with what is to be said where it is above rtol."""
    place = tuple(point[name] for name in result.axes)
    error = float(result.errors[place])
    if not result.computed[place] or not np.isfinite(error) or error <= 0.0:
        return ""
    remark = ", sensitive" if result.ended("sensitive")[place] else ", above rtol" if result.above[place] else ""
    return f" ± {show_error(result, place)}{remark}"


def draw_excitation(result: Result) -> Drawn:
    """Frequency of an excitation that follows the resonance; nothing where the study gives the frequency."""
    if not result.followed or not result.has_history:
        return None
    name, shown, choice = "excitation_frequency", result.shown_point(), choose(result, [], _MOST_LINES)
    cycles, (figure, panel) = scale_for("cycles", result.cycles), new_panel(3.4)
    said = []
    for number, (point, label) in enumerate(choice):
        full = {**shown, **point}
        counts, found = result.counts(full), result.at(name, full).values
        known = np.flatnonzero(np.isfinite(found) & np.isfinite(counts))
        if known.size:
            error = result.at(f"{name}_error", full).values[known] if result.has(f"{name}_error") else None
            style = line_style(number, found.size) | {"label": label or "computed"}
            add_line(panel, cycles(counts[known]), found[known], error, band=True, **style)
            ends = " to ".join(show_number(float(found[place])) for place in known[[0, -1]])
            said.append(labelled(f"from {ends} Hz", label))
    panel.set_xlabel(slow_time(result, cycles))
    panel.set_ylabel("frequency (Hz)")
    add_legend(figure)
    return figure, as_sentences(
        f"The excitation follows the {result.followed}: {', '.join(said)}",
        _BANDS if result.has(f"{name}_error") else "",
        choice.sentence,
    )


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


def draw_final(result: Result) -> Drawn:
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
    at_largest = course.at(result, int(np.nanargmax(reached[number])))
    return figure, as_sentences(
        labelled(f"Largest: {scale.show(largest, 4)} at {at_largest}", choice.labels[number]),
        "Each point is another joint, which wore at its own value of the horizontal axis",
        "Bars: estimated error" if result.has("error_estimate") else "",
        *marks,
        crosses,
        choice.sentence,
    )


def _mark_care(
    result: Result, panel: Axes, course: Course, choice: Choice, fields: list[FloatArray], scale: Scale
) -> list[str]:
    """Marks at points to be taken with care, and a sentence for each kind.

    fields (n,) each: worn volumes at the last cycle count that each point has.
    """
    sensitive, early = result.ended("sensitive"), result.held & ~result.computed
    kinds = (
        ("above rtol", "s", "Squares", result.above & ~sensitive, "whose worn volume is known less well than to rtol"),
        ("sensitive", "D", "Diamonds", sensitive, "so sensitive that one number says little"),
        ("ended early", "^", "Triangles", early, "that ended early, at what was worn by then"),
    )
    said = []
    for label, marker, name, where, words in kinds:
        marked = [course.along(result, where, point) for point in choice.points]
        marked = [each & np.isfinite(field) for each, field in zip(marked, fields, strict=True)]
        if number := sum(int(each.sum()) for each in marked):
            x = np.concatenate([course.values[each] for each in marked])
            y = np.concatenate([field[each] for field, each in zip(fields, marked, strict=True)])
            panel.plot(x, scale(y), marker=marker, label=label, **_LARGE)
            said.append(f"{name}: {count(number, 'point')} {words}")
    return said


def draw_map(result: Result, name: str) -> Drawn:
    """Worn volume or wear rate over the course and the cycles, one panel a combination.

    Nothing where each point has cycle counts of its own.
    """
    course = _worn_over(result)
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
        add_map(panel, course.edges, rows, scale(field.T), norm)
        panel.set_title(textwrap.fill(label, _CHARACTERS // n_columns))
    for panel in panels[:, 0]:
        panel.set_ylabel(slow_time(result, cycles))
    for panel in panels[-1]:
        course.set_axis(panel)
    add_colour_bar(figure, panels, norm, scale.label(name.replace("_", " ")))
    number = int(np.argmax([np.nanmax(field, initial=-1.0) for field in fields]))
    place, cycle = map(int, np.unravel_index(int(np.nanargmax(fields[number])), fields[number].shape))
    at = f"{course.at(result, place)}, {result.cycle_label(cycle)}"
    return figure, as_sentences(
        labelled(f"Largest: {scale.show(largest, 4)} at {at}", choice.labels[number]),
        "Each point is worn at its own value of the horizontal axis only",
        "Hatched: points without a result" if any(np.isnan(field).any() for field in fields) else "",
        choice.sentence,
    )

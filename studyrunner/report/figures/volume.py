"""Worn volume over cycles, worn volume and wear rate over the frequency (Figs. 4, 6, 7, 8 of the paper), and the
frequency of an excitation that follows the resonance.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from numpy.typing import NDArray

from studyrunner.report.drawing import (
    Drawing,
    Missing,
    add_colour_bar,
    add_legend,
    hatch_empty,
    line_style,
    mark_failed,
    new_figure,
    new_panels,
    set_from_zero,
)
from studyrunner.report.figures.courses import Course, cell_edges, find_course
from studyrunner.result.certainty import show_error
from studyrunner.result.choice import Choice, choose
from studyrunner.result.units import Scale, scale_for, show_cycles, show_number
from studyrunner.result.view import NO_VOLUME, Result, as_sentences
from studyrunner.system.progress import count

_MOST_LINES, _MOST_MAPS = 6, 4
_CHARACTERS = 80
"""Of titles over panels side by side."""
_MAPS = {"worn_volume": "worn volume", "wear_rate": "wear rate"}
_LARGE: dict[str, Any] = {"linestyle": "none", "markersize": 9, "markerfacecolor": "none", "color": "black"}


def draw_volumes(result: Result) -> Iterator[Drawing | Missing]:
    """Figures of the worn volume; one sentence in their place where the file holds no worn volume or nothing wears."""
    if not result.has("worn_volume") or len(result.cycles) == 1:
        sentence = result.lacks("worn_volume") or f"The file holds {result.cycle_label(0)} only: set [slow_time]."
        yield Missing("worn_volume", "Worn volume", sentence)
        return
    course, largest = find_course(result), float(np.nanmax(result.read("worn_volume").values))
    scale = scale_for("m3", largest if largest > NO_VOLUME else 0.0)
    if course is not None and largest > NO_VOLUME:
        yield draw_final(result, course, scale)
    if not result.has_history:
        yield Missing("worn_volume", "Worn volume", _tell_final(result, scale))
        return
    yield draw_history(result, scale, largest)
    if course is None or largest <= NO_VOLUME:
        return
    for name in _MAPS:
        if result.has(name):
            yield draw_map(result, course, name)
        else:
            yield Missing(f"{name}_map", f"{_MAPS[name].capitalize()} over {course.name}", result.lacks(name))


def slow_time(result: Result) -> str:
    """Label of an axis of slow time, without its unit."""
    return "vibration cycles" if result.blocks is None else "missions"


def draw_history(result: Result, scale: Scale, largest: float) -> Drawing:
    """Worn volume over cycles at the shown point, one line a scheme (Fig. 4)."""
    course, shown = result.course_axis, result.shown_point()
    choice = choose(result, [course] if course else [], _MOST_LINES)
    cycles, figure = scale_for(result.counted, result.cycles), new_figure(3.4)
    panel = figure.subplots()
    ends: list[str] = []
    early: list[str] = []
    highest = latest = 0.0
    for number, (point, label) in enumerate(choice):
        full = {**shown, **point}
        worn, counts, style = result.at("worn_volume", full).values, result.counts(full), line_style(number, 101)
        if np.isnan(worn).all():
            continue
        highest = max(highest, float(np.nanmax(worn)))
        if np.isinf(counts[-1]):
            # it has no count: a level that histories come to
            text = f"{label}: final state" if label else "final state"
            panel.axhline(scale(worn[-1]).item(), color=style["color"], linestyle="--", label=text)
        else:
            latest = max(latest, float(counts[-1]))
            panel.plot(cycles(counts), scale(worn), label=label or "computed", **style)
            highest = max(highest, _draw_band(result, panel, full, cycles, scale, style["color"]))
            early.append(_mark_end(result, panel, full, cycles, scale, style["color"]))
        if np.isfinite(worn[-1]):
            amount = f"{scale.show(float(worn[-1]), 4)}{_tell_error(result, full)}"
            ends.append(f"{amount} ({label})" if label else amount)
        named = panel.get_legend_handles_labels()[1]
        jump = float(result.at("jump_cycle", full).values) if result.has("jump_cycle") else np.nan
        if np.isfinite(jump):
            label = "_" if "branch lost, jump" in named else "branch lost, jump"
            height = scale(np.interp(jump, counts, worn))
            panel.plot(cycles(jump), height, "*", color=style["color"], markersize=12, label=label)
        if result.has("exact_worn_volume"):
            exact = result.at("exact_worn_volume", full).values
            label = "_" if "exact" in named else "exact"
            panel.plot(cycles(counts), scale(exact), color="0.5", linewidth=4, alpha=0.4, zorder=1, label=label)
            highest = max(highest, float(np.nanmax(exact, initial=0.0)))
    panel.set_xlabel(cycles.label(slow_time(result)))
    panel.set_ylabel(scale.label("worn volume"))
    panel.set_xlim(0.0, cycles(latest or result.cycles[-1]).item())
    set_from_zero(panel, scale(highest).item() if highest > NO_VOLUME else 0.0)
    if len(panel.get_lines()) > 1:
        add_legend(figure)
    where = result.describe(shown, [course or "frequency"])
    text = as_sentences(
        f"Worn {_when(result)}: {', '.join(ends)}" if largest > NO_VOLUME else "Nothing is worn at the counts kept",
        _bands(panel),
        *early,
        choice.sentence,
    )
    return Drawing("worn_volume", f"Worn volume over {result.counted}{f': {where}' if where else ''}", text, figure)


def _bands(panel: Axes) -> str:
    return "Bands: estimated error" if any(found.get_gid() == "error" for found in panel.collections) else ""


def _draw_band(
    result: Result, panel: Axes, point: Mapping[str, int], cycles: Scale, scale: Scale, colour: str
) -> float:
    """The estimated error of a worn volume over the cycles as a band; its highest value, m3, 0 where there is none."""
    if not result.has("worn_volume_error"):
        return 0.0
    worn = result.at("worn_volume", point).values
    wrong = result.at("worn_volume_error", point).values * worn
    told = np.isfinite(wrong)
    if not (wrong[told] > 0.0).any():
        return 0.0
    low, high = np.maximum(worn - wrong, 0.0)[told], (worn + wrong)[told]
    options: dict[str, Any] = {"color": colour, "alpha": 0.18, "linewidth": 0.0, "gid": "error"}
    panel.fill_between(cycles(result.counts(point)[told]), scale(low), scale(high), **options)
    # a band that leaves the others too little room is cut
    return float(min(high.max(), 2.0 * np.nanmax(worn)))


def _mark_end(result: Result, panel: Axes, point: Mapping[str, int], cycles: Scale, scale: Scale, colour: str) -> str:
    """A cross where a history ended early; a sentence about it, empty where it did not."""
    place = tuple(point[name] for name in result.axes)
    worn = result.at("worn_volume", point).values
    told = np.flatnonzero(np.isfinite(worn))
    if result.computed[place] or not told.size:
        return ""
    at = cycles(float(result.counts(point)[told[-1]]))
    panel.plot(at, scale(worn[told[-1]]), "X", color=colour, markersize=9, label="ended early")
    ending = result.endings[int(result.dataset["outcome"].values[place])]
    last = show_cycles(float(result.last_cycle[place]), result.counted)
    return f"Ended early, at {last}: {ending.word.replace('_', ' ')}"


def _tell_error(result: Result, point: Mapping[str, int]) -> str:
    """The error of a final worn volume in words: " ± 3 %", with what is to be said where it is above rtol."""
    place = tuple(point[name] for name in result.axes)
    error = float(result.errors[place])
    if not result.computed[place] or not np.isfinite(error) or error <= 0.0:
        return ""
    remark = ", sensitive" if result.ended("sensitive")[place] else ", above rtol" if result.above[place] else ""
    return f" ± {show_error(result, place)}{remark}"


def _tell_final(result: Result, scale: Scale) -> str:
    """What there is in place of a history where the final state was found without slow time."""
    shown = result.shown_point()
    amount = f"{scale.show(float(result.at('worn_volume', shown, -1)), 4)}{_tell_error(result, shown)}"
    return f"The final state was found without slow time and has no history: {amount} at {result.describe(shown)}."


def draw_map(result: Result, course: Course, name: str) -> Drawing:
    """Worn volume or wear rate over the course and the cycles, one panel a combination (Figs. 6, 7)."""
    cycles = scale_for(result.counted, result.cycles)
    choice, fields = _read_histories(result, course, name)
    largest = max(float(np.nanmax(field, initial=0.0)) for field in fields)
    scale = scale_for("m3" if name == "worn_volume" else f"m3 per {result.counted[:-1]}", largest)
    n_columns = 2 if len(fields) == _MOST_MAPS else len(fields)
    n_rows = len(fields) // n_columns
    figure, panels = new_panels(n_rows, n_columns, 0.6 + 2.7 * n_rows, sharex=True, sharey=True)
    norm = Normalize(0.0, scale(largest).item() or 1.0)
    # Half a cell at both ends: nothing is known beyond.
    rows = np.clip(cell_edges(cycles(result.cycles)), cycles(result.cycles[0]), cycles(result.cycles[-1]))
    for panel, field, label in zip(panels.flat, fields, choice.labels, strict=True):
        panel.pcolormesh(course.edges, rows, scale(field.T), norm=norm)
        hatch_empty(panel, bool(np.isnan(field).any()))
        panel.grid(visible=False)
        panel.set_title(textwrap.fill(label, _CHARACTERS // n_columns))
    for panel in panels[:, 0]:
        panel.set_ylabel(cycles.label(slow_time(result)))
    for panel in panels[-1]:
        course.set_axis(panel)
    add_colour_bar(figure, panels, norm, scale.label(_MAPS[name]))
    number = int(np.argmax([np.nanmax(field, initial=-1.0) for field in fields]))
    place, cycle = map(int, np.unravel_index(int(np.nanargmax(fields[number])), fields[number].shape))
    label = f" ({choice.labels[number]})" if choice.labels[number] else ""
    caption = as_sentences(
        f"Largest: {scale.show(largest, 4)} at {course.at(result, place)}, {result.cycle_label(cycle)}{label}",
        "Each point is worn at its own value of the horizontal axis only",
        "Hatched: points without a result" if any(np.isnan(field).any() for field in fields) else "",
        "A point stays as it is at the end of its own count" if result.has("cycle_count") else "",
        choice.sentence,
    )
    title = f"{_MAPS[name].capitalize()} over {course.name} and {result.counted}"
    return Drawing(f"{name}_map", title, caption, figure)


def _read_known(result: Result, course: Course, name: str, limit: int) -> tuple[Choice, list[NDArray[np.float64]]]:
    """Combinations with a result anywhere along the course, and their values (course, cycle)."""
    choice = choose(result, [course.axis], limit)
    found = [(point, label, course.read(result, name, point)) for point, label in choice]
    # The shown point has a result: there is at least one.
    points, labels, fields = zip(*(one for one in found if not np.isnan(one[2]).all()), strict=True)
    return Choice(points, labels, choice.sentence), list(fields)


def _read_histories(result: Result, course: Course, name: str) -> tuple[Choice, list[NDArray[np.float64]]]:
    """As `_read_known`, of combinations with histories, at the cycle counts of the shown point."""
    choice, fields = _read_known(result, course, name, _MOST_MAPS)
    if not result.has("cycle_count"):
        return choice, fields
    kept = []
    for point, label, field in zip(choice.points, choice.labels, fields, strict=True):
        counts = course.read(result, "cycle_count", point)
        if np.isinf(counts).any():
            continue
        rows = [
            np.interp(result.cycles, own, row) if (np.diff(own) > 0.0).all() else np.full(row.shape, row[-1])
            for own, row in zip(counts, field, strict=True)
        ]
        kept.append((point, label, np.array(rows)))
    points, labels, fields = (list(column) for column in zip(*kept, strict=True))
    return Choice(tuple(points), tuple(labels), choice.sentence), fields


def _when(result: Result) -> str:
    """When the last worn volumes are."""
    return "at the end" if result.has("cycle_count") else result.when(-1)


def draw_final(result: Result, course: Course, scale: Scale) -> Drawing:
    """Worn volume at the last cycle count over the course, one line a combination (Fig. 8)."""
    choice, fields = _read_known(result, course, "worn_volume", _MOST_LINES)
    every = choose(result, [course.axis], _MOST_LINES).points
    failed = np.array([np.isnan(course.read(result, "worn_volume", point)[:, 0]) for point in every])
    # of a point that ended early, what was worn by then
    reached = [np.where(np.isnan(field).all(axis=1), np.nan, np.nan_to_num(field).max(axis=1)) for field in fields]
    figure = new_figure(3.4)
    panel: Axes = figure.subplots()
    for number, (field, label) in enumerate(zip(fields, choice.labels, strict=True)):
        panel.plot(course.values, scale(field[:, -1]), label=label or "computed", **course.line_style(number))
    number = int(np.argmax([np.nanmax(field, initial=-1.0) for field in reached]))
    largest = float(np.nanmax(reached[number], initial=0.0))
    bars = _draw_bars(result, panel, course, choice, reached, scale)
    marks = _mark_care(result, panel, course, choice, reached, scale)
    # bars that leave the points too little room are cut
    set_from_zero(panel, scale(max(largest, min(bars, 2.0 * largest))).item())
    n_failed = mark_failed(panel, course.values, failed)
    course.set_axis(panel)
    panel.set_ylabel(scale.label(f"worn volume {_when(result)}"))
    if len(panel.get_lines()) > 1:
        add_legend(figure)
    at, label = course.at(result, int(np.nanargmax(reached[number]))), choice.labels[number]
    caption = as_sentences(
        f"Largest: {scale.show(largest, 4)} at {at}{f' ({label})' if label else ''}",
        "Bars: estimated error" if bars > 0.0 else "",
        *marks,
        f"Crosses: at these, {count(n_failed, 'point')} in all without a result" if n_failed else "",
        choice.sentence,
    )
    return Drawing("final_worn_volume", f"Final worn volume over {course.name}", caption, figure)


def _draw_bars(
    result: Result, panel: Axes, course: Course, choice: Choice, fields: list[NDArray[np.float64]], scale: Scale
) -> float:
    """Estimated errors of worn volumes (n,) each as bars; how high they reach, m3, 0 where none is."""
    highest = 0.0
    for number, (point, field) in enumerate(zip(choice.points, fields, strict=True)):
        if not result.has("error_estimate"):
            break
        wrong = course.read(result, "error_estimate", point) * field
        told = np.isfinite(wrong) & (wrong > 0.0)
        if told.any():
            sides = scale(np.stack([np.minimum(wrong, field)[told], wrong[told]]))
            style: dict[str, Any] = {"ecolor": course.line_style(number)["color"], "elinewidth": 1.0, "capsize": 2.5}
            panel.errorbar(course.values[told], scale(field[told]), yerr=sides, fmt="none", zorder=2.5, **style)
            highest = max(highest, float((field + wrong)[told].max()))
    return highest


def _mark_care(
    result: Result,
    panel: Axes,
    course: Course,
    choice: Choice,
    fields: list[NDArray[np.float64]],
    scale: Scale,
) -> list[str]:
    """Marks at points to be taken with care, and a sentence for each kind.

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
        marked = [
            course.along(result, where, point) & np.isfinite(field)
            for point, field in zip(choice.points, fields, strict=True)
        ]
        number = sum(int(each.sum()) for each in marked)
        if number:
            x = np.concatenate([course.values[each] for each in marked])
            y = np.concatenate([field[each] for field, each in zip(fields, marked, strict=True)])
            panel.plot(x, scale(y), marker=marker, label=label, **_LARGE)
            sentences.append(sentence.format(count(number, "point")))
    return sentences


def draw_excitation(result: Result) -> Iterator[Drawing | Missing]:
    """Frequency of an excitation that follows the resonance; nothing where the study gives the frequency."""
    if not result.followed or not result.has_history:
        return
    name, title = "excitation_frequency", "Frequency of the excitation over cycles"
    if not result.has(name):
        yield Missing(name, title, result.lacks(name))
        return
    shown, choice = result.shown_point(), choose(result, [], _MOST_LINES)
    cycles, figure = scale_for("cycles", result.cycles), new_figure(3.4)
    panel, ends = figure.subplots(), []
    for number, (point, label) in enumerate(choice):
        full = {**shown, **point}
        counts, found = result.counts(full), result.at(name, full).values
        known = np.flatnonzero(np.isfinite(found) & np.isfinite(counts))
        if not known.size:
            continue
        style = line_style(number, found.size)
        panel.plot(cycles(counts[known]), found[known], label=label or "computed", **style)
        if result.has(f"{name}_error"):
            error = np.nan_to_num(result.at(f"{name}_error", full).values[known], posinf=0.0)
            low, high = found[known] - error, found[known] + error
            panel.fill_between(cycles(counts[known]), low, high, color=style["color"], alpha=0.2, gid="error")
        moved = f"from {show_number(float(found[known[0]]))} to {show_number(float(found[known[-1]]))} Hz"
        ends.append(f"{moved} ({label})" if label else moved)
    panel.set_xlabel(cycles.label("vibration cycles"))
    panel.set_ylabel("frequency (Hz)")
    if len(panel.get_lines()) > 1:
        add_legend(figure)
    said = f"The excitation follows the {result.followed}: {', '.join(ends)}"
    yield Drawing(name, title, as_sentences(said, _bands(panel), choice.sentence), figure)

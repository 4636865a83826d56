"""Worn volume over cycles, and worn volume and wear rate over the frequency (Figs. 4, 6, 7, 8 of the paper)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from numpy.typing import NDArray

from studyrunner.report.drawing import (
    Drawing,
    Missing,
    add_legend,
    hatch_empty,
    line_style,
    mark_failed,
    new_figure,
    new_panels,
    set_from_zero,
)
from studyrunner.report.figures.frequency_course import Course, find_course
from studyrunner.report.figures.volume_marks import draw_band, draw_bars, mark_care, mark_end, tell_error
from studyrunner.report.isolines import add_colour_bar, add_isolines
from studyrunner.report.reading.choice import Choice, choose
from studyrunner.report.reading.flanks import cell_edges
from studyrunner.report.reading.result import NO_VOLUME, Result, as_sentences
from studyrunner.report.reading.units import Scale, scale_for
from studyrunner.system.progress import count

_MOST_LINES = 6
_MOST_MAPS = 4
_MANY_CELLS = 300


def draw_volumes(result: Result) -> Iterator[Drawing | Missing]:
    """Figures of the worn volume; one sentence in their place where the file holds no worn volume or nothing wears."""
    title = "Worn volume"
    if not result.has("worn_volume"):
        yield Missing("worn_volume", title, result.lacks("worn_volume"))
        return
    if len(result.cycles) == 1:
        sentence = (
            f"The file holds {result.cycle_label(0)} only: set {result.counted} and outputs under [slow_time] for a"
            " wear history."
        )
        yield Missing("worn_volume", title, sentence)
        return
    volume = result.read("worn_volume").values
    largest = float(np.nanmax(volume))
    scale = scale_for("m3", largest if largest > NO_VOLUME else 0.0)
    if result.has_history:
        yield draw_history(result, scale, largest)
    else:
        yield Missing("worn_volume", title, _tell_final(result, scale))
    course = find_course(result)
    if course is None:
        sentence = "The study has one frequency: give several under [axes] frequency."
        yield Missing("worn_volume_map", "Worn volume and wear rate over frequency", sentence)
        return
    if largest <= NO_VOLUME:
        return
    if not result.has_history:
        yield draw_final(result, course, scale)
        return
    yield draw_map(result, course, "worn_volume", scale)
    if result.has("wear_rate"):
        rate = result.read("wear_rate").values
        yield draw_map(result, course, "wear_rate", scale_for(f"m3 per {result.counted[:-1]}", np.nanmax(rate)))
    else:
        yield Missing("wear_rate_map", "Wear rate over frequency and cycles", result.lacks("wear_rate"))
    yield draw_final(result, course, scale)


def draw_history(result: Result, scale: Scale, largest: float) -> Drawing:
    """Worn volume over cycles at the shown point, one line a scheme (Fig. 4)."""
    course = result.course_axis
    shown = result.shown_point()
    choice = choose(result, [course] if course else [], _MOST_LINES)
    cycles = scale_for(result.counted, result.cycles)
    figure = new_figure(3.4)
    panel = figure.subplots()
    ends: list[str] = []
    early: list[str] = []
    exact_drawn: list[NDArray[np.float64]] = []
    highest = latest = 0.0
    for number, (point, label) in enumerate(choice):
        full = {**shown, **point}
        worn = result.at("worn_volume", full).values
        if np.isnan(worn).all():
            continue
        highest = max(highest, float(np.nanmax(worn)))
        style = line_style(number, worn.size)
        counts = result.counts(full)
        if np.isinf(counts[-1]):
            # it has no count: a level that histories come to
            text = f"{label}: final state" if label else "final state"
            panel.axhline(scale(worn[-1]).item(), color=style["color"], linestyle="--", label=text)
        else:
            latest = max(latest, float(counts[-1]))
            panel.plot(cycles(counts), scale(worn), label=label or "computed", **style)
            highest = max(highest, draw_band(result, panel, full, cycles, scale, style["color"]))
            early.append(mark_end(result, panel, full, cycles, scale, style["color"]))
        amount = f"{scale.show(float(worn[-1]), 4)}{tell_error(result, full)}"
        ends += [f"{amount} ({label})" if label else amount] if np.isfinite(worn[-1]) else []
        jump = float(result.at("jump_cycle", full).values) if result.has("jump_cycle") else np.nan
        if np.isfinite(jump):
            height = np.interp(jump, counts, worn)
            label_once = (
                "branch lost, jump" if not any("jump" in end for end in panel.get_legend_handles_labels()[1]) else None
            )
            panel.plot(cycles(jump), scale(height), "*", color=style["color"], markersize=12, label=label_once)
        if result.has("exact_worn_volume"):
            exact = result.at("exact_worn_volume", full).values
            if np.isfinite(exact).any() and not any(np.array_equal(exact, old, equal_nan=True) for old in exact_drawn):
                panel.plot(
                    cycles(result.cycles),
                    scale(exact),
                    color="0.5",
                    linewidth=4,
                    alpha=0.5,
                    zorder=1,
                    label=None if exact_drawn else "exact",
                )
                exact_drawn.append(exact)
                highest = max(highest, float(np.nanmax(exact)))
    panel.set_xlabel(cycles.label(slow_time(result)))
    panel.set_ylabel(scale.label("worn volume"))
    panel.set_xlim(0.0, cycles(latest or result.cycles[-1]).item())
    set_from_zero(panel, scale(highest).item() if highest > NO_VOLUME else 0.0)
    if len(panel.get_lines()) > 1:
        add_legend(figure)
    where = result.describe(shown, [course]) if course else ""
    amount = f"Worn {_when(result)}: {', '.join(ends)}." if ends else ""
    amount = amount if largest > NO_VOLUME else "Nothing is worn at the counts kept."
    bands = "Bands: estimated error" if any(found.get_gid() == "error" for found in panel.collections) else ""
    schemes = "" if "scheme" in result.varying else _tell_scheme(result)
    text = as_sentences(
        f"Worn volume over {result.counted}{f' at {where}' if where else ''}",
        amount,
        bands,
        *early,
        schemes,
        choice.sentence,
    )
    return Drawing("worn_volume", f"Worn volume over {result.counted}", text, figure)


def slow_time(result: Result) -> str:
    """Label of an axis of slow time, without its unit."""
    return "vibration cycles" if result.blocks is None else "flown missions"


def _tell_final(result: Result, scale: Scale) -> str:
    """What there is in place of a history where the final state was found without slow time."""
    shown = result.shown_point()
    amount = f"{scale.show(float(result.at('worn_volume', shown, -1)), 4)}{tell_error(result, shown)}"
    return (
        f"The final state was found without slow time, and there is no history: {amount} at {result.describe(shown)}."
        ' With scheme = "adaptive" there is one.'
    )


def _tell_scheme(result: Result) -> str:
    """Why explicit and implicit are not compared."""
    if "scheme" not in result.dataset.coords:
        return ""
    scheme = str(np.atleast_1d(result.dataset["scheme"].values)[0])
    return f"The study has the {scheme} scheme only; with more under [axes] scheme they stand side by side here"


def draw_map(result: Result, course: Course, name: str, scale: Scale) -> Drawing:
    """Worn volume or wear rate over the course and the cycles, one panel a combination (Figs. 6, 7)."""
    cycles = scale_for(result.counted, result.cycles)
    choice, fields = _read_histories(result, course, name)
    largest = max(float(np.nanmax(field, initial=0.0)) for field in fields)
    n_columns = 2 if len(fields) == _MOST_MAPS else len(fields)
    n_rows = len(fields) // n_columns
    figure, panels = new_panels(n_rows, n_columns, 0.6 + 2.7 * n_rows, sharex=True, sharey=True)
    norm = Normalize(0.0, scale(largest).item() or 1.0)
    # Half a cell at both ends: nothing is known beyond.
    rows = np.clip(cell_edges(cycles(result.cycles)), cycles(result.cycles[0]), cycles(result.cycles[-1]))
    for panel, field, label in zip(panels.flat, fields, choice.labels, strict=True):
        panel.pcolormesh(
            course.edges,
            rows,
            scale(field.T),
            norm=norm,
            rasterized=field.size > _MANY_CELLS,
        )
        hatch_empty(panel, bool(np.isnan(field).any()))
        panel.grid(visible=False)
        panel.set_title(label)
    _label_map(panels, course, cycles.label(slow_time(result)))
    for panel, field in zip(panels.flat, fields, strict=True):
        add_isolines(panel, course.values, cycles(result.cycles), scale(field.T), norm)
    text = {"worn_volume": "worn volume", "wear_rate": "wear rate"}[name]
    add_colour_bar(figure, panels, norm, scale.label(text))
    caption = as_sentences(
        f"{text.capitalize()} over {course.name} and {result.counted}",
        f"The largest is {scale.show(largest, 4)}{_where_largest(result, course, choice, fields)}",
        "Hatched: points without a result" if any(np.isnan(field).any() for field in fields) else "",
        "Each point comes to its end at a count of its own, and stays as it is then"
        if result.has("cycle_count")
        else "",
        choice.sentence,
    )
    return Drawing(f"{name}_map", f"{text.capitalize()} over {course.name} and {result.counted}", caption, figure)


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


def _read_reached(result: Result, course: Course) -> list[NDArray[np.float64]]:
    """First worn volumes along the course, of combinations without a result as well: NaN where there is no state."""
    choice = choose(result, [course.axis], _MOST_LINES)
    return [course.read(result, "worn_volume", point)[:, 0] for point in choice.points]


def _label_map(panels: NDArray[Any], course: Course, upright: str) -> None:
    """Labels at the outer panels of a grid with shared axes."""
    for row in panels:
        row[0].set_ylabel(upright)
    for panel in panels[-1]:
        course.set_axis(panel)


def _where_largest(result: Result, course: Course, choice: Choice, fields: list[NDArray[np.float64]]) -> str:
    """The place of the largest value of all fields (course, cycle), in words."""
    number = int(np.argmax([np.nanmax(field, initial=-1.0) for field in fields]))
    place, cycle = np.unravel_index(int(np.nanargmax(fields[number])), fields[number].shape)
    at = result.describe({course.axis: int(course.index[place])}, [course.axis])
    label = f" ({choice.labels[number]})" if choice.labels[number] else ""
    return f", at {at}, {result.cycle_label(int(cycle))}{label}"


def _when(result: Result) -> str:
    """When the last worn volumes are."""
    return "at the end" if result.has("cycle_count") else result.when(-1)


def draw_final(result: Result, course: Course, scale: Scale) -> Drawing:
    """Worn volume at the last cycle count over the course, one line a combination (Fig. 8)."""
    choice, fields = _read_known(result, course, "worn_volume", _MOST_LINES)
    failed = np.array([np.isnan(one) for one in _read_reached(result, course)])
    # of a point that ended early, what was worn by then
    reached = [np.where(np.isnan(field).all(axis=1), np.nan, np.nan_to_num(field).max(axis=1)) for field in fields]
    fields = [field[:, -1:] for field in fields]
    figure = new_figure(3.4)
    panel: Axes = figure.subplots()
    for number, (field, label) in enumerate(zip(fields, choice.labels, strict=True)):
        panel.plot(course.values, scale(field[:, 0]), label=label or "computed", **course.line_style(number))
    largest = max(float(np.nanmax(field, initial=0.0)) for field in reached)
    colours = [course.line_style(number)["color"] for number in range(len(fields))]
    bars = draw_bars(result, panel, course, choice, reached, scale, colours)
    care = mark_care(result, panel, course, choice, reached, scale)
    # bars that leave the points too little room are cut
    set_from_zero(panel, scale(max(largest, min(bars, 2.0 * largest))).item())
    n_failed = mark_failed(panel, course.values, failed)
    course.set_axis(panel)
    panel.set_ylabel(scale.label(f"worn volume {_when(result)}"))
    if len(panel.get_lines()) > 1:
        add_legend(figure)
    caption = as_sentences(
        f"Worn volume {_when(result)} over {course.name}",
        f"The largest is {scale.show(largest, 4)}{_where_last(result, course, choice, reached)}",
        f"Crosses: at these, {count(n_failed, 'point')} in all without a result" if n_failed else "",
        "Bars: estimated error" if bars > 0.0 else "",
        *care,
        choice.sentence,
    )
    return Drawing("final_worn_volume", f"Final worn volume over {course.name}", caption, figure)


def _where_last(result: Result, course: Course, choice: Choice, fields: list[NDArray[np.float64]]) -> str:
    """As `_where_largest`, for fields (course,) without cycles."""
    number = int(np.argmax([np.nanmax(field, initial=-1.0) for field in fields]))
    place = int(np.nanargmax(fields[number]))
    label = f" ({choice.labels[number]})" if choice.labels[number] else ""
    return f", at {result.describe({course.axis: int(course.index[place])}, [course.axis])}{label}"

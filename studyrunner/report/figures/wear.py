"""Worn volume and wear rate: over slow time (Fig. 4 of the paper), in the end (Fig. 8), as maps (Figs. 6, 7)."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize

from solver.outcome import Outcome, absolute
from studyrunner.report import drawing as plot
from studyrunner.report import selection
from studyrunner.report.drawing import Drawn, FloatArray
from studyrunner.result.view import NO_VOLUME, Point, Result
from studyrunner.units import Scale, scale_for, show_known, show_percent

_MOST_LINES, _MOST_MAPS, _MOST_PAIRS = 6, 4, 4
_LARGE: dict[str, Any] = {"linestyle": "none", "markersize": 9, "markerfacecolor": "none", "color": "black"}


# --- over slow time ---


def draw_history(result: Result) -> Drawn:
    """Worn volume over cycles at the shown point, one line a scheme; a sentence where there is no history."""
    if len(result.cycles) == 1:
        return f"The file holds {result.cycle_label(0)} only: set [slow_time]."
    largest = float(np.nanmax(result.dataset["worn_volume"].values, initial=0.0))
    wears, axis = largest > NO_VOLUME, selection.course_axis(result)
    scale = scale_for("m3", largest if wears else 0.0)
    choice = selection.choose(result, [axis] if axis else [], _MOST_LINES)
    (figure, panel), cycles = plot.new_panel(3.4), scale_for(result.counted, result.cycles)
    highest, ends = _draw_over_cycles(result, panel, "worn_volume", choice, scale), []
    for number, (point, label) in enumerate(choice):
        worn = result.at("worn_volume", point).values
        if np.isfinite(worn[-1]):
            ends.append(selection.labelled(f"{scale.show(float(worn[-1]), 4)}{_with_error(result, point)}", label))
        _mark_events(result, panel, point, cycles, scale, plot.line_style(number)["color"])
    panel.set_xlim(0.0, panel.dataLim.xmax or None)  # 0: a target before the second count
    panel.set_ylabel(scale.label("worn volume"))
    plot.set_from_zero(panel, highest if wears else 0.0)
    text = f"Worn {_at_the_end(result)}: {', '.join(ends)}" if wears else "Nothing is worn at the stored counts"
    return figure, text, choice.sentence


def draw_excitation(result: Result) -> Drawn:
    """Frequency of an excitation that follows the resonance; nothing where the study gives the frequency."""
    if not result.followed or len(result.cycles) == 1:
        return None
    if not result.has("excitation_frequency"):
        return result.lacks("excitation_frequency")
    choice, (figure, panel) = selection.choose(result, [], _MOST_LINES), plot.new_panel(3.4)
    _draw_over_cycles(result, panel, "excitation_frequency", choice, Scale(1.0, "Hz"))
    panel.set_ylabel("frequency (Hz)")
    return figure, f"The excitation follows the {result.followed}", choice.sentence


_EVOLVING = {
    "pair_friction": "friction coefficient",
    "pair_stiffness": "contact stiffness",
    "dissipated_energy": "dissipated energy",
}
"""What a figure of an evolving contact shows, by variable."""


def draw_evolution(result: Result) -> Drawn:
    """Friction, contact stiffness and dissipated energy over cycles of the pairs that wear most, at the shown point;
    nothing where no contact evolves.
    """
    if "evolution" not in result.study.get("wear", {}) or len(result.cycles) == 1:
        return None
    values = {name: result.at(name, result.shown).values for name in _EVOLVING if result.has(name)}
    # a stiffness of the scene does not evolve
    values = {name: each for name, each in values.items() if np.isfinite(each).any()}
    if not result.has("wear_depth") or not values:
        return result.lacks("wear_depth", "dissipated_energy")
    depth = result.at("wear_depth", result.shown).values[result.last_reached(result.shown)]
    pairs = np.argsort(-depth, kind="stable")[:_MOST_PAIRS]
    cycles = scale_for(result.counted, result.cycles)
    figure, panels = plot.new_panels(1, len(values), 2.8)
    for panel, (name, each) in zip(np.ravel(panels), values.items(), strict=True):
        scale = scale_for(str(result.dataset[name].attrs["units"]), each[np.isfinite(each)])
        for number, pair in enumerate(pairs):
            look = plot.line_style(number, 101) | {"label": f"pair {pair}"}
            panel.plot(cycles(result.counts(result.shown)), scale(each[:, pair]), **look)
        panel.set_xlabel(selection.slow_time(result, cycles))
        panel.set_ylabel(scale.label(_EVOLVING[name]))
        plot.set_from_zero(panel)
    return figure, f"The {pairs.size} pairs that wear most"


def _at_the_end(result: Result) -> str:
    return "at the end" if result.has("cycle_count") else f"at {result.cycle_label(-1)}"


def _draw_over_cycles(result: Result, panel: Axes, name: str, choice: selection.Choice, scale: Scale) -> float:
    """A variable over slow time, a line a combination, with bands of its error; how high they reach."""
    cycles, highest = scale_for(result.counted, result.cycles), 0.0
    for number, (point, label) in enumerate(choice):
        values, error = scale(result.at(name, point).values), None
        if np.isnan(values).all():
            continue
        if result.has(f"{name}_error"):
            wrong = result.at(f"{name}_error", point).values
            error = (
                absolute(wrong, values) if result.dataset[f"{name}_error"].attrs.get("units") == "1" else scale(wrong)
            )
        look = plot.line_style(number, 101) | {"label": label or "computed"}
        highest = max(highest, plot.add_line(panel, cycles(result.counts(point)), values, error, band=True, **look))
    panel.set_xlabel(selection.slow_time(result, cycles))
    return highest


def _mark_events(result: Result, panel: Axes, point: Point, cycles: Scale, scale: Scale, colour: str) -> None:
    """Where a branch was lost, where a history ended early, and the exact answer under both."""
    worn, counts = result.at("worn_volume", point).values, result.counts(point)
    jump = float(result.at("jump_cycle", point).values) if result.has("jump_cycle") else np.nan
    reached = np.flatnonzero(np.isfinite(worn))
    if np.isfinite(jump):
        volume = scale(np.interp(jump, counts, worn))
        panel.plot(cycles(jump), volume, "*", markersize=12, label="branch lost, jump", color=colour)
    if not result.computed[result.place(point)] and reached.size:
        last = reached[-1]
        panel.plot(cycles(float(counts[last])), scale(worn[last]), "X", markersize=9, label="ended early", color=colour)
    if result.has("exact_worn_volume"):
        exact = result.at("exact_worn_volume", point).values
        panel.plot(cycles(counts), scale(exact), color="0.5", linewidth=4, alpha=0.4, zorder=1, label="exact")


def _with_error(result: Result, point: Point) -> str:
    """The error of a final worn volume in words: " ± 3 %", with what is to be said where it is above rtol."""
    place = result.place(point)
    if not result.computed[place] or not result.errors[place] > 0.0:
        return ""
    if np.isinf(result.errors[place]):
        return show_known(np.inf)
    remark = ", sensitive" if result.ended(Outcome.SENSITIVE)[place] else ", above rtol" if result.above[place] else ""
    return f" ± {show_percent(float(result.errors[place]), float(result.rtol[place]))}{remark}"


# --- over an axis of the study ---


def _worn_over(result: Result) -> selection.Course | None:
    """The course of figures of the worn volume; None where there is none, or nothing wears."""
    wears = len(result.cycles) > 1 and float(np.nanmax(result.worn, initial=0.0)) > NO_VOLUME
    return selection.find_course(result) if wears else None


def draw_final(result: Result) -> Drawn:
    """Worn volume at the last cycle count over the course, one line a combination."""
    course = _worn_over(result)
    if course is None:
        return None
    choice = course.choose(_MOST_LINES)
    volumes, errors = course.read("worn_volume", *choice.points), course.read(result.errors, *choice.points)
    failed = np.isnan(volumes[..., 0])
    # of a point that ended early, what was worn by then
    reached = np.where(np.isnan(volumes).all(axis=-1), np.nan, np.nan_to_num(volumes).max(axis=-1))
    number, place = map(int, np.unravel_index(int(np.nanargmax(reached)), reached.shape))
    scale, (figure, panel) = scale_for("m3", reached), plot.new_panel(3.4)
    highest = top = float(scale(reached[number, place]))
    for line, (label, values, error) in enumerate(zip(choice.labels, volumes[..., -1], errors, strict=True)):
        if not failed[line].all():
            look = course.line_style(line) | {"label": label or "computed"}
            reach = plot.add_line(panel, course.values, scale(values), scale(absolute(error, values)), **look)
            highest = max(highest, min(reach, 2.0 * top))
    _mark_care(panel, course, choice, scale(reached))
    plot.set_from_zero(panel, highest)
    crosses = plot.mark_failed(panel, course.values, failed)
    course.set_axis(panel)
    panel.set_ylabel(scale.label(f"worn volume {_at_the_end(result)}"))
    wrong = show_known(float(errors[number, place]))
    text = f"Largest: {scale.show(float(reached[number, place]), 4)}{wrong} at {course.at(place)}"
    return figure, selection.labelled(text, choice.labels[number]), crosses, choice.sentence


def _mark_care(panel: Axes, course: selection.Course, choice: selection.Choice, volumes: FloatArray) -> None:
    """Marks at points to be taken with care. volumes (n_lines, n): their worn volumes, as shown."""
    result = course.result
    sensitive, early = result.ended(Outcome.SENSITIVE), result.has_values & ~result.computed
    kinds = {"above rtol": ("s", result.above & ~sensitive), "sensitive": ("D", sensitive), "ended early": ("^", early)}
    for label, (marker, where) in kinds.items():
        marked = (course.read(where, *choice.points) > 0.0) & np.isfinite(volumes)
        if marked.any():
            x = np.broadcast_to(course.values, marked.shape)[marked]
            panel.plot(x, volumes[marked], marker=marker, label=label, **_LARGE)


def draw_map(result: Result, name: str) -> Drawn:
    """Worn volume or wear rate over the course and the cycles; nothing where each point has counts of its own."""
    course = _worn_over(result)
    if course is None or result.has("cycle_count"):
        return None
    cycles, choice = scale_for(result.counted, result.cycles), course.choose(_MOST_MAPS)
    fields = course.read(name, *choice.points)
    number, place, count = map(int, np.unravel_index(int(np.nanargmax(fields)), fields.shape))
    largest = fields[number, place, count]
    scale = scale_for("m3" if name == "worn_volume" else f"m3 per {result.counted[:-1]}", fields)
    figure, panels = plot.panel_grid(choice.labels, 2.7, sharex=True)
    norm = Normalize(0.0, scale(largest).item() or 1.0)
    # half a cell at both ends: nothing is known beyond
    rows = np.clip(selection.cell_edges(cycles(result.cycles)), cycles(result.cycles[0]), cycles(result.cycles[-1]))
    for panel, field in zip(panels.flat, fields, strict=True):
        plot.add_map(panel, course.edges, rows, scale(field.T), norm)
    for panel in panels[:, 0]:
        panel.set_ylabel(selection.slow_time(result, cycles))
    for panel in panels[-1]:
        course.set_axis(panel)
    plot.add_colour_bar(figure, panels, norm, scale.label(name.replace("_", " ")))
    text = f"{scale.show(float(largest), 4)} at {course.at(place)}, {result.cycle_label(count)}"
    return figure, selection.labelled(f"Largest: {text}", choice.labels[number]), choice.sentence

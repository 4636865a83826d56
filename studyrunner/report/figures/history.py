"""What changes over slow time: the worn volume (Fig. 4 of the paper), and the frequency that an excitation follows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from studyrunner.report.drawing import Drawing, Missing, add_legend, add_line, line_style, new_panel, set_from_zero
from studyrunner.report.figures.courses import slow_time
from studyrunner.result.certainty import show_error
from studyrunner.result.choice import choose
from studyrunner.result.units import Scale, scale_for, show_cycles, show_number
from studyrunner.result.view import NO_VOLUME, Result, as_sentences

_MOST_LINES = 6
_BANDS = "Bands: estimated error"


def draw_history(result: Result) -> Drawing | Missing:
    """Worn volume over cycles at the shown point, one line a scheme; a sentence where there is no history."""
    title, shown, course = f"Worn volume over {result.counted}", result.shown_point(), result.course_axis
    largest = float(np.nanmax(result.read("worn_volume").values, initial=0.0))
    if len(result.cycles) == 1:
        return Missing("worn_volume", title, f"The file holds {result.cycle_label(0)} only: set [slow_time].")
    if not result.has_history:
        amount = scale_for("m3", largest).show(float(result.at("worn_volume", shown, -1)), 4)
        said = f"The final state was found without slow time and has no history: {amount}{_tell_error(result, shown)}"
        return Missing("worn_volume", title, f"{said} at {result.describe(shown)}.")
    scale = scale_for("m3", largest if largest > NO_VOLUME else 0.0)
    cycles, (figure, panel) = scale_for(result.counted, result.cycles), new_panel(3.4)
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
            where = f" ({label})" if label else ""
            ends.append(f"{scale.show(float(worn[-1]), 4)}{_tell_error(result, full)}{where}")
        _mark_events(result, panel, full, cycles, scale, style["color"])
    panel.set_xlabel(slow_time(result, cycles))
    panel.set_ylabel(scale.label("worn volume"))
    panel.set_xlim(0.0, cycles(latest or result.cycles[-1]).item())
    set_from_zero(panel, highest if largest > NO_VOLUME else 0.0)
    add_legend(figure)
    when = "at the end" if result.has("cycle_count") else result.when(-1)
    where = result.describe(shown, [course or "frequency"])
    text = as_sentences(
        f"Worn {when}: {', '.join(ends)}" if largest > NO_VOLUME else "Nothing is worn at the counts kept",
        _BANDS if result.has("worn_volume_error") and largest > NO_VOLUME else "",
        _tell_early(result, shown),
        choice.sentence,
    )
    return Drawing("worn_volume", f"{title}: {where}" if where else title, text, figure)


def _mark_events(
    result: Result, panel: Axes, point: Mapping[str, int], cycles: Scale, scale: Scale, colour: str
) -> None:
    """Where a branch was lost, where a history ended early, and the exact answer behind it."""
    worn, counts = result.at("worn_volume", point).values, result.counts(point)
    named = panel.get_legend_handles_labels()[1]

    def once(label: str) -> str:
        return "_" if label in named else label

    jump = float(result.at("jump_cycle", point).values) if result.has("jump_cycle") else np.nan
    if np.isfinite(jump):
        look: dict[str, Any] = {"color": colour, "markersize": 12, "label": once("branch lost, jump")}
        panel.plot(cycles(jump), scale(np.interp(jump, counts, worn)), "*", **look)
    reached = np.flatnonzero(np.isfinite(worn))
    if not result.computed[tuple(point[name] for name in result.axes)] and reached.size:
        look = {"color": colour, "markersize": 9, "label": once("ended early")}
        panel.plot(cycles(float(counts[reached[-1]])), scale(worn[reached[-1]]), "X", **look)
    if result.has("exact_worn_volume"):
        exact = result.at("exact_worn_volume", point).values
        panel.plot(cycles(counts), scale(exact), color="0.5", linewidth=4, alpha=0.4, zorder=1, label=once("exact"))


def _tell_early(result: Result, point: Mapping[str, int]) -> str:
    """Where and how the history of a point ended early; empty where it did not."""
    place = tuple(point[name] for name in result.axes)
    if result.computed[place] or not result.held[place]:
        return ""
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


def draw_excitation(result: Result) -> Drawing | None:
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
            said.append(f"from {ends} Hz" + (f" ({label})" if label else ""))
    panel.set_xlabel(slow_time(result, cycles))
    panel.set_ylabel("frequency (Hz)")
    add_legend(figure)
    text = as_sentences(
        f"The excitation follows the {result.followed}: {', '.join(said)}",
        _BANDS if result.has(f"{name}_error") else "",
        choice.sentence,
    )
    return Drawing(name, "Frequency of the excitation over cycles", text, figure)

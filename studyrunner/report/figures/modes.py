"""Nonlinear modes: natural frequency and damping ratio over the amplitude, a line for each wear state."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from studyrunner.report.drawing import Drawing, Missing, add_legend, mark_failed, new_panel, set_log
from studyrunner.report.figures.courses import Course, find_course
from studyrunner.result.choice import choose
from studyrunner.result.view import Result, as_sentences

_MOST_LINES = 6
_FIRST = ("cycle", "mode", "sweep")
_FIGURES = {
    "natural_frequency": ("natural frequency (Hz)", "Natural frequency over amplitude"),
    "damping_ratio": ("damping ratio", "Damping over amplitude"),
}


def draw_modes(result: Result) -> Iterator[Drawing | Missing]:
    """A figure of the natural frequency and one of the damping ratio; a sentence where one cannot be drawn."""
    course = find_course(result, "modal_amplitude")
    for name, (_, title) in _FIGURES.items():
        if course is None:
            yield Missing(name, title, "The study has one amplitude: give several under [axes] modal_amplitude.")
        elif not result.has(name):
            yield Missing(name, title, result.lacks(name))
        else:
            yield _draw(result, course, name)


def _draw(result: Result, course: Course, name: str) -> Drawing:
    """A variable over the amplitude with its error bars."""
    label, title = _FIGURES[name]
    choice = choose(result, ["modal_amplitude"], _MOST_LINES, first=_FIRST)
    figure, panel = new_panel(3.6)
    values = np.array([course.read(result, name, point) for point in choice.points])
    for number, (point, words) in enumerate(choice):
        style, own = course.line_style(number), values[number]
        if np.isfinite(own).any():
            panel.plot(course.values, own, **style, label=words or None)
        if result.has(f"{name}_error"):
            errors = course.read(result, f"{name}_error", point)
            known = np.isfinite(errors) & np.isfinite(own)
            at = course.values[known], own[known], errors[known]
            panel.errorbar(*at, linestyle="none", color=style["color"], capsize=2.0, elinewidth=0.9)
    panel.set_xlabel(course.label)
    panel.set_ylabel(label)
    set_log(panel.xaxis, float(course.values[0]), float(course.values[-1]))
    low, high = float(np.nanmin(values, initial=np.inf)), float(np.nanmax(values, initial=-np.inf))
    # negative damping, e.g. of the air, has no logarithm
    if name == "damping_ratio" and 0.0 < low <= high:
        set_log(panel.yaxis, low, high, percent=True)
    crosses = mark_failed(panel, course.values, np.isnan(values))
    add_legend(figure)
    units = " Hz" if name == "natural_frequency" else ""
    caption = as_sentences(
        f"From {low:.6g}{units} to {high:.6g}{units}" if low <= high else "No point has a state",
        "Bars: estimated errors; none where they are smaller than the markers" if result.has(f"{name}_error") else "",
        crosses,
        choice.sentence,
    )
    return Drawing(name, title, caption, figure)

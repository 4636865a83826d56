"""Nonlinear modes: natural frequency and damping ratio over the amplitude, a line for each wear state."""

from __future__ import annotations

import numpy as np

from studyrunner.report.drawing import Drawing, Missing, add_legend, add_line, mark_failed, new_panel, set_log
from studyrunner.report.figures.courses import find_course
from studyrunner.result.choice import choose
from studyrunner.result.view import Result, as_sentences

_MOST_LINES = 6
_TITLES = {"natural_frequency": "Natural frequency over amplitude", "damping_ratio": "Damping ratio over amplitude"}


def draw_mode(result: Result, name: str) -> Drawing | Missing:
    """Natural frequency or damping ratio over the amplitude with error bars."""
    course, unit = find_course(result, "modal_amplitude"), " Hz" if name == "natural_frequency" else ""
    if course is None:
        said = "The study has one amplitude: give several under [axes] modal_amplitude."
        return Missing(name, _TITLES[name], said)
    choice = choose(result, ["modal_amplitude"], _MOST_LINES, first=("cycle", "mode", "sweep"))
    figure, panel = new_panel(3.6)
    values = np.array([course.read(result, name, point) for point in choice.points])
    for number, (point, label) in enumerate(choice):
        error = course.read(result, f"{name}_error", point) if result.has(f"{name}_error") else None
        if np.isfinite(values[number]).any():
            add_line(panel, course.values, values[number], error, **course.line_style(number), label=label or "mode")
    panel.set_xlabel(course.label)
    panel.set_ylabel(name.replace("_", " ") + (" (Hz)" if unit else ""))
    set_log(panel.xaxis, float(course.values[0]), float(course.values[-1]))
    low, high = float(np.nanmin(values, initial=np.inf)), float(np.nanmax(values, initial=-np.inf))
    # negative damping, e.g. of the air, has no logarithm
    if name == "damping_ratio" and 0.0 < low <= high:
        set_log(panel.yaxis, low, high, percent=True)
    crosses = mark_failed(panel, course.values, np.isnan(values))
    add_legend(figure)
    caption = as_sentences(
        f"From {low:.6g}{unit} to {high:.6g}{unit}" if low <= high else "No point has a state",
        "Bars: estimated errors; none where they are smaller than the markers" if result.has(f"{name}_error") else "",
        crosses,
        choice.sentence,
    )
    return Drawing(name, _TITLES[name], caption, figure)

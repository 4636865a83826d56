"""Figures of nonlinear modes."""

import numpy as np

from studyrunner.report import drawing as plot
from studyrunner.report.contents import BARS, NUMBERS, ONE, OUTCOMES, Entry
from studyrunner.report.drawing import Drawn
from studyrunner.report.figures.root import draw_fraction
from studyrunner.report.selection import find_course
from studyrunner.result.view import Result

_MOST_LINES = 6


def draw_mode(result: Result, name: str) -> Drawn:
    """Natural frequency or damping ratio of modes over the amplitude with error bars, a line for each wear state."""
    course = find_course(result, "modal_amplitude")
    if course is None:
        return "The study has one amplitude: give several under [axes] modal_amplitude."
    choice = course.choose(_MOST_LINES, first=("cycle", "mode", "sweep"))
    figure, panel = plot.new_panel(3.6)
    values, has_errors = course.read(name, *choice.points), result.has(f"{name}_error")
    errors = course.read(f"{name}_error", *choice.points) if has_errors else np.nan * values
    for number, (label, line, error) in enumerate(zip(choice.labels, values, errors, strict=True)):
        if np.isfinite(line).any():
            look = course.line_style(number) | {"label": label or "mode"}
            plot.add_line(panel, course.values, line, error, **look)
    panel.set(xlabel=course.label, ylabel="natural frequency (Hz)" if name == "natural_frequency" else "damping ratio")
    plot.set_log(panel.xaxis, float(course.values[0]), float(course.values[-1]))
    low, high = float(np.nanmin(values, initial=np.inf)), float(np.nanmax(values, initial=-np.inf))
    # negative damping, e.g. of the air, has no logarithm
    if name == "damping_ratio" and 0.0 < low <= high:
        plot.set_log(panel.yaxis, low, high, percent=True)
    return figure, plot.mark_failed(panel, course.values, np.isnan(values)), choice.sentence


FIGURES = (
    *(
        Entry(name, f"{of} of a mode over its amplitude", draw_mode, name, (name,), caption=BARS)
        for name, of in (("natural_frequency", "Natural frequency"), ("damping_ratio", "Damping ratio"))
    ),
    *(
        Entry(f"{of}_fraction", f"Where the joint {of}s", draw_fraction, f"{of}_fraction", (f"{of}_fraction",), **ONE)
        for of in ("slip", "open")
    ),
    NUMBERS,
    OUTCOMES,
)
"""In the order of the page."""

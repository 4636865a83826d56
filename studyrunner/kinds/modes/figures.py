"""Figures of nonlinear modes."""

import numpy as np

from studyrunner.report import drawing as plot
from studyrunner.report.contents import BARS, NUMBERS, OF_MEASURED, ONE, OUTCOMES, Entry
from studyrunner.report.drawing import Drawn
from studyrunner.report.figures.root import draw_fraction
from studyrunner.report.selection import find_course
from studyrunner.result.view import Result

_MOST_LINES = 6


def draw_mode(result: Result, over: tuple[str, str]) -> Drawn:
    """Natural frequency or damping ratio of modes with error bars, over their amplitude, a line for each wear state, or
    over the cycles of wear, a line for each amplitude; nothing where there is one count of cycles.
    """
    name, axis = over
    course = find_course(result, axis)
    if course is None:
        return None if axis == "cycle" else "The study has one amplitude: give several under [axes] modal_amplitude."
    choice = course.choose(_MOST_LINES, first=("cycle", "modal_amplitude", "mode", "sweep"))
    figure, panel = plot.new_panel(3.6)
    values, has_errors = course.read(name, *choice.points), result.has(f"{name}_error")
    errors = course.read(f"{name}_error", *choice.points) if has_errors else np.nan * values
    for number, (label, line, error) in enumerate(zip(choice.labels, values, errors, strict=True)):
        if np.isfinite(line).any():
            look = course.line_style(number) | {"label": label or "mode"}
            plot.add_line(panel, course.values, line, error, **look)
    panel.set(xlabel=course.label, ylabel="natural frequency (Hz)" if name == "natural_frequency" else "damping ratio")
    if axis == "modal_amplitude":
        plot.set_log(panel.xaxis, float(course.values[0]), float(course.values[-1]))
    low, high = float(np.nanmin(values, initial=np.inf)), float(np.nanmax(values, initial=-np.inf))
    # negative damping, e.g. of the air, has no logarithm
    if name == "damping_ratio" and 0.0 < low <= high:
        plot.set_log(panel.yaxis, low, high, percent=True)
    return figure, plot.mark_failed(panel, course.values, np.isnan(values)), choice.sentence


FIGURES = (
    *(
        Entry(f"{name}{end}", f"{of} of a mode over {words}", draw_mode, (name, axis), (name,), caption=BARS)
        for end, axis, words in (("", "modal_amplitude", "its amplitude"), ("_cycle", "cycle", "the cycles of wear"))
        for name, of in (("natural_frequency", "Natural frequency"), ("damping_ratio", "Damping ratio"))
    ),
    *OF_MEASURED,
    *(
        Entry(f"{of}_fraction", f"Where the joint {of}s", draw_fraction, f"{of}_fraction", (f"{of}_fraction",), **ONE)
        for of in ("slip", "open")
    ),
    NUMBERS,
    OUTCOMES,
)
"""In the order of the page."""

"""Nonlinear modes: natural frequency and damping ratio over the amplitude, a line for each wear state."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis

from studyrunner.report.drawing import Drawing, Missing, add_legend, mark_failed, new_panels
from studyrunner.report.figures.frequency_course import Course, find_course
from studyrunner.report.reading.choice import Choice, choose
from studyrunner.report.reading.result import Result, as_sentences
from studyrunner.report.reading.units import show_number, show_power
from studyrunner.system.progress import count

_MOST_LINES = 6
_FIRST = ("cycle", "mode", "sweep")
_FIGURES = {
    "natural_frequency": (1.0, "natural frequency (Hz)", "Natural frequency over amplitude"),
    "damping_ratio": (100.0, "damping ratio (%)", "Damping over amplitude"),
}


def draw_modes(result: Result) -> Iterator[Drawing | Missing]:
    """A figure of the natural frequency and one of the damping ratio; a sentence where one cannot be drawn."""
    course = find_course(result, "modal_amplitude")
    for name, (_, _, title) in _FIGURES.items():
        if course is None:
            yield Missing(name, title, "The study has one amplitude: give several under [axes] modal_amplitude.")
        elif not result.has(name):
            yield Missing(name, title, result.lacks(name))
        else:
            yield _draw(result, course, name)


def _draw(result: Result, course: Course, name: str) -> Drawing:
    """A variable over the amplitude with its error bars."""
    factor, label, title = _FIGURES[name]
    choice = choose(result, ["modal_amplitude"], _MOST_LINES, first=_FIRST)
    figure, panels = new_panels(1, 1, 3.6)
    panel: Axes = panels[0, 0]
    values = np.array([factor * course.read(result, name, point) for point in choice.points])
    _draw_lines(result, panel, course, choice, name)
    panel.set_xlabel(course.label)
    panel.set_ylabel(label)
    panel.set_xscale("log")
    _format_ticks(panel.xaxis, course.values)
    # negative damping, e.g. of the air, has no logarithm
    if name == "damping_ratio" and np.nanmin(values, initial=np.inf) > 0.0:
        panel.set_yscale("log")
        _format_ticks(panel.yaxis, values)
    n_failed = mark_failed(panel, course.values, np.isnan(values))
    add_legend(figure)
    errors = f"{name}_error"
    caption = as_sentences(
        f"{title}: {_range_of(values)}" if np.isfinite(values).any() else "No point has a state",
        "Bars: estimated errors; none where they are smaller than the markers" if result.has(errors) else "",
        f"Crosses: at these, {count(n_failed, 'point')} in all without a result" if n_failed else "",
        choice.sentence,
    )
    return Drawing(name, title, caption, figure)


def _format_ticks(axis: Axis, values: np.ndarray) -> None:
    """Ticks of a logarithmic axis; in a range of a decade those between powers of ten have numbers as well."""
    known = values[np.isfinite(values)]
    several = known.size and known.max() > 20.0 * known.min()
    axis.set_major_formatter(show_power)
    axis.set_minor_formatter("" if several else lambda value, _: show_number(value, 1))


def _draw_lines(result: Result, panel: Axes, course: Course, choice: Choice, name: str) -> None:
    factor = _FIGURES[name][0]
    for number, (point, label) in enumerate(choice):
        values = factor * course.read(result, name, point)
        if not np.isfinite(values).any():
            continue
        panel.plot(course.values, values, **course.line_style(number), label=label or None)
        if result.has(f"{name}_error"):
            errors = factor * course.read(result, f"{name}_error", point)
            known = np.isfinite(errors) & np.isfinite(values)
            colour = course.line_style(number)["color"]
            at = course.values[known], values[known]
            panel.errorbar(*at, errors[known], linestyle="none", color=colour, capsize=2.0, elinewidth=0.9)


def _range_of(values: np.ndarray) -> str:
    low, high = (f"{end:.6g}" for end in (np.nanmin(values), np.nanmax(values)))
    return f"from {low} to {high}, in the unit of the vertical axis"

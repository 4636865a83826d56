"""Error against run time: a picture with a line for each scheme, and a table of all settings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from studyrunner.percent import show_percent
from studyrunner.report.drawing import Drawing, Missing, Table, add_legend, line_style, new_panels, set_log
from studyrunner.report.figures.settings import KEYS, QUANTITIES, RESOLVED, ComparedPoint, Setting, compare_settings
from studyrunner.result.view import Result, as_sentences
from studyrunner.system.progress import count

_MOST_POINTS = 3
_TITLE = "Error against run time"
_SHAPES, _SIZE = "os^DvPX<>p", 5.5
_RING: dict[str, Any] = {"marker": "o", "markerfacecolor": "none", "markeredgecolor": "black", "linestyle": "none"}
_DASH = "\N{EN DASH}"


def draw_precision(result: Result) -> Iterator[Drawing | Missing | Table]:
    """The figure, and a table for each point that is drawn, those that wear most.

    Nothing where no settings are compared; a sentence where no error tells one from another.
    """
    points = compare_settings(result)
    if not points:
        return
    clear = [point for point in points if any(point.is_clear(name).any() for name in QUANTITIES)]
    worn = [float(np.nanmax(np.where(point.computed, point.worn, 0.0))) for point in clear]
    chosen = sorted(np.argsort(np.negative(worn), kind="stable")[:_MOST_POINTS].tolist())
    shown = [clear[number] for number in chosen]
    if not shown:
        said = "No error is clearly larger than the uncertainty of the reference: give finer values of a key."
        yield Missing("precision", _TITLE, said)
        return
    yield _draw(points, shown, [key for key in KEYS if key in result.varying])
    for number, point in enumerate(shown, start=1):
        yield _list_settings(point, number, [key for key in KEYS if key in result.varying])


def _draw(points: Sequence[ComparedPoint], shown: Sequence[ComparedPoint], keys: Sequence[str]) -> Drawing:
    """One row a point, one column a quantity."""
    quantities = [name for name in QUANTITIES if any(point.is_clear(name).any() for point in shown)]
    figure, panels = new_panels(len(shown), len(quantities), 0.3 + 2.4 * len(shown))
    marks = _Marks(points[0].settings, keys)
    for row, point in zip(panels, shown, strict=True):
        for panel, quantity in zip(row, quantities, strict=True):
            _draw_panel(panel, point, quantity, marks)
            panel.set_ylabel(f"error of {QUANTITIES[quantity]}")
        # one title a row: it goes on above the panels to its right
        row[0].set_title(point.label, loc="left")
    for panel in panels[-1]:
        panel.set_xlabel("CPU time of one point (s)")
    add_legend(figure, marks.legend())
    failed = sum(int((~point.computed).sum()) for point in points)
    caption = as_sentences(
        "Each mark is one setting; a line joins those of a scheme than which no quicker one is as exact; rings: of all",
        "Open marks, in the grey: errors below"
        f" {RESOLVED:.0f} times the uncertainty of the reference, which tell no setting from another",
        *(f"{point.label or 'Reference'}: {_tell_reference(point)}" for point in shown),
        f"Left out: {count(failed, 'result')} not computed to the end" if failed else "",
        f"{count(len(points) - len(shown), 'other point')} not drawn" if len(points) > len(shown) else "",
    )
    return Drawing("precision", _TITLE, caption, figure)


def _tell_reference(point: ComparedPoint) -> str:
    """What the errors at a point are measured against, and how well this is known."""
    if point.reference is None:
        return "errors are those against the exact answer"
    known = " and ".join(f"{show_percent(point.uncertainty[name])} ({words})" for name, words in QUANTITIES.items())
    return (
        f"errors are those against the finest setting ({point.settings[point.reference].describe()}), known to {known}"
    )


class _Marks:
    """Colour and dashes of each scheme; the shape of markers by the first other key, their size by the step."""

    def __init__(self, settings: Sequence[Setting], keys: Sequence[str]) -> None:
        schemes = dict.fromkeys(setting.scheme for setting in settings)
        styles = {scheme: line_style(number) for number, scheme in enumerate(schemes)}
        self.lines = {name: {key: style[key] for key in ("color", "linestyle")} for name, style in styles.items()}
        ranked = [key for key in ("harmonics", "rtol", "samples", "tolerance", "step") if key in keys]
        self.key = ranked[0] if ranked else "scheme"
        values = {getattr(setting, self.key) for setting in settings if ranked} - {None}
        self.values: list[Any] = sorted(values, key=lambda value: math.inf if isinstance(value, str) else value)
        steps = sorted({setting.step for setting in settings if setting.step is not None})
        self.steps = steps if len(steps) > 1 and self.key != "step" else []

    def marker(self, setting: Setting) -> dict[str, Any]:
        """Shape and size; small steps have small ones."""
        value, size = getattr(setting, self.key), _SIZE
        if self.steps and setting.step is not None:
            size = 3.0 + 5.0 * self.steps.index(setting.step) / (len(self.steps) - 1)
        shape = _SHAPES[self.values.index(value) % len(_SHAPES)] if value in self.values else "h"
        return {"marker": shape, "markersize": size, "linestyle": "none"}

    def legend(self) -> list[Line2D]:
        """What the marks mean."""
        found = [(scheme or "all", {"linewidth": 2.0, **style}) for scheme, style in self.lines.items()]
        for value in self.values:
            setting = Setting(**{self.key: value})
            found.append((f"{self.key} {setting.words(self.key)}", {"color": "0.3", **self.marker(setting)}))
        for step in self.steps[:1] + self.steps[-1:]:
            setting = Setting(step=step)
            found.append((f"step {setting.words('step')}", {"color": "0.3", **self.marker(setting), "marker": "o"}))
        found.append(("cheapest for its error", {**_RING, "markersize": 10}))
        return [Line2D([], [], label=label, **style) for label, style in found]


def _draw_panel(panel: Axes, point: ComparedPoint, quantity: str, marks: _Marks) -> None:
    errors, time, clear = point.errors[quantity], point.values["run_time"], point.is_clear(quantity)
    if not clear.any():
        panel.text(0.5, 0.5, "the same for all settings", ha="center", va="center", transform=panel.transAxes)
        panel.set(xticks=[], yticks=[])
        return
    least = RESOLVED * point.uncertainty[quantity]
    bottom = 0.5 * min(float(errors[clear].min()), *errors[(errors > 1e-12) & np.isfinite(errors)])
    drawn = np.maximum(errors, bottom)
    for scheme, style in marks.lines.items():
        rows = point.front(quantity, scheme)
        panel.plot(time[rows], drawn[rows], linewidth=2.0, zorder=3, **style)
    for row in np.flatnonzero(np.isfinite(errors)):
        colour = marks.lines[point.settings[row].scheme]["color"]
        style = {"markerfacecolor": colour if clear[row] else "white", "markeredgecolor": colour}
        panel.plot(time[row], drawn[row], alpha=0.85, zorder=4, **style, **marks.marker(point.settings[row]))
    rows = point.front(quantity)
    panel.plot(time[rows], drawn[rows], markersize=11, zorder=5, **_RING)
    known = np.isfinite(errors)
    set_log(panel.xaxis, float(time[known].min()), float(time[known].max()))
    set_log(panel.yaxis, bottom, float(errors[known].max()), percent=True)
    if 0.8 * bottom < least < math.inf:
        panel.axhspan(0.8 * bottom, least, color="0.9", zorder=0)
    panel.set_ylim(bottom=0.8 * bottom)


def _list_settings(point: ComparedPoint, number: int, keys: Sequence[str]) -> Table:
    """All settings, the quickest first, with their errors."""
    fronts = {name: point.front(name) for name in QUANTITIES}
    rows = []
    for row in np.argsort(np.where(point.computed, point.values["run_time"], math.inf), kind="stable").tolist():
        values = map(point.settings[row].words, keys)
        if not point.computed[row]:
            rows.append((*values, *[_DASH] * 3, f"failed: {point.endings[row].replace('_', ' ')}"))
            continue
        remarks = ["reference"] if row == point.reference else []
        remarks += [f"cheapest for its {QUANTITIES[name]}" for name, front in fronts.items() if row in front]
        errors = [point.errors[name][row] for name in QUANTITIES]
        remarks += [
            f"{words} not resolved"
            for (name, words), error in zip(QUANTITIES.items(), errors, strict=True)
            if np.isfinite(error) and not point.is_clear(name)[row]
        ]
        shown = [show_percent(error) if np.isfinite(error) else _DASH for error in errors]
        rows.append((*values, f"{point.values['run_time'][row]:.3g}", *shown, ", ".join(remarks)))
    title = "All settings" + (f" at {point.label}" if point.label else "")
    columns = (*keys, "CPU time (s)", "worn volume", "response", "remark")
    note = f"Relative {_tell_reference(point)}."
    return Table(f"precision_settings_{number}", title, columns, tuple(rows), note)

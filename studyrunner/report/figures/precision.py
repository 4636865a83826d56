"""Error against run time: a picture with a line for each scheme; its CSV file has all settings with their errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from studyrunner.percent import show_percent
from studyrunner.report.drawing import Drawn
from studyrunner.report.figures.settings import KEYS, QUANTITIES, RESOLVED, ComparedPoint, Setting, compare_settings
from studyrunner.report.panels import add_legend, line_style, new_panels, set_log
from studyrunner.result.view import Result, as_sentences
from studyrunner.system.progress import count

_MOST_POINTS = 3
_SHAPES, _SIZE = "os^DvPX<>p", 5.5
_RING: dict[str, Any] = {"marker": "o", "markerfacecolor": "none", "markeredgecolor": "black", "linestyle": "none"}


def draw_precision(result: Result) -> Drawn:
    """One row a point, one column a quantity; nothing where no settings are compared."""
    points = compare_settings(result)
    shown = _choose(points)
    if points and not shown:
        return "No error is clearly larger than the uncertainty of the reference: give finer values of a key."
    if not shown:
        return None
    quantities = [name for name in QUANTITIES if any(point.is_clear(name).any() for point in shown)]
    figure, panels = new_panels(len(shown), len(quantities), 0.3 + 2.4 * len(shown))
    marks = _Marks(points[0].settings, [key for key in KEYS if key in result.varying])
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
    return figure, as_sentences(
        "Each mark is one setting; a line joins those of a scheme than which no quicker one is as exact; rings: of all",
        "Open marks, in the grey: errors below"
        f" {RESOLVED:.0f} times the uncertainty of the reference, which tell no setting from another",
        *_tell_references(shown),
        f"Left out: {count(failed, 'result')} not computed to the end" if failed else "",
        f"{count(len(points) - len(shown), 'other point')} not drawn" if len(points) > len(shown) else "",
    )


def _choose(points: Sequence[ComparedPoint]) -> list[ComparedPoint]:
    """Of the points at which an error is clear those that wear most."""
    clear = [point for point in points if any(point.is_clear(name).any() for name in QUANTITIES)]
    worn = [float(np.nanmax(np.where(point.computed, point.worn, 0.0))) for point in clear]
    chosen = sorted(np.argsort(np.negative(worn), kind="stable")[:_MOST_POINTS].tolist())
    return [clear[number] for number in chosen]


def _tell_references(points: Sequence[ComparedPoint]) -> list[str]:
    """What the errors at each point are measured against, and how well this is known."""
    told = []
    for point in points:
        said = "errors are those against the exact answer"
        if point.reference is not None:
            each = (f"{show_percent(point.uncertainty[name])} ({words})" for name, words in QUANTITIES.items())
            finest = point.settings[point.reference].describe()
            said = f"errors are those against the finest setting ({finest}), known to {' and '.join(each)}"
        told.append(f"{point.label or 'Reference'}: {said}")
    return told


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
    drawn, known = np.maximum(errors, bottom), np.isfinite(errors)
    for scheme, style in marks.lines.items():
        rows = point.front(quantity, scheme)
        panel.plot(time[rows], drawn[rows], linewidth=2.0, zorder=3, **style)
    for row in np.flatnonzero(known):
        setting = point.settings[row]
        colour = marks.lines[setting.scheme]["color"]
        style = {"markerfacecolor": colour if clear[row] else "white", "markeredgecolor": colour}
        label = setting.describe()
        panel.plot(time[row], drawn[row], alpha=0.85, zorder=4, label=label, **style, **marks.marker(setting))
    rows = point.front(quantity)
    panel.plot(time[rows], drawn[rows], markersize=11, zorder=5, **_RING)
    set_log(panel.xaxis, float(time[known].min()), float(time[known].max()))
    set_log(panel.yaxis, bottom, float(errors[known].max()), percent=True)
    if 0.8 * bottom < least < math.inf:
        panel.axhspan(0.8 * bottom, least, color="0.9", zorder=0)
    panel.set_ylim(bottom=0.8 * bottom)

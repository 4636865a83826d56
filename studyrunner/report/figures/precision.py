"""Error against run time: a picture with a line for each scheme, and a table of all settings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from studyrunner.percent import show_percent
from studyrunner.report.drawing import Drawing, Missing, Table, add_legend, line_style, new_panels, set_log
from studyrunner.report.figures.settings import KEYS, QUANTITIES, RESOLVED, ComparedPoint, Setting, compare_settings
from studyrunner.result.view import Result, as_sentences
from studyrunner.system.progress import count

_MOST_POINTS, _TITLE, _DASH = 3, "Error against run time", "\N{EN DASH}"
_SHAPES, _SIZE = "os^DvPX<>p", 5.5
_RING: dict[str, Any] = {"marker": "o", "markerfacecolor": "none", "markeredgecolor": "black", "linestyle": "none"}


def draw_precision(result: Result) -> Drawing | Missing | None:
    """One row a point, one column a quantity; nothing where no settings are compared."""
    points = compare_settings(result)
    shown = _choose(points)
    if points and not shown:
        said = "No error is clearly larger than the uncertainty of the reference: give finer values of a key."
        return Missing("precision", _TITLE, said)
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
    caption = as_sentences(
        "Each mark is one setting; a line joins those of a scheme than which no quicker one is as exact; rings: of all",
        "Open marks, in the grey: errors below"
        f" {RESOLVED:.0f} times the uncertainty of the reference, which tell no setting from another",
        *(f"{point.label or 'Reference'}: {_tell_reference(point)}" for point in shown),
        f"Left out: {count(failed, 'result')} not computed to the end" if failed else "",
        f"{count(len(points) - len(shown), 'other point')} not drawn" if len(points) > len(shown) else "",
    )
    return Drawing("precision", _TITLE, caption, figure)


def _choose(points: Sequence[ComparedPoint]) -> list[ComparedPoint]:
    """Of the points at which an error is clear those that wear most."""
    clear = [point for point in points if any(point.is_clear(name).any() for name in QUANTITIES)]
    worn = [float(np.nanmax(np.where(point.computed, point.worn, 0.0))) for point in clear]
    chosen = sorted(np.argsort(np.negative(worn), kind="stable")[:_MOST_POINTS].tolist())
    return [clear[number] for number in chosen]


def _tell_reference(point: ComparedPoint) -> str:
    """What the errors at a point are measured against, and how well this is known."""
    if point.reference is None:
        return "errors are those against the exact answer"
    known = " and ".join(f"{show_percent(point.uncertainty[name])} ({words})" for name, words in QUANTITIES.items())
    finest = point.settings[point.reference].describe()
    return f"errors are those against the finest setting ({finest}), known to {known}"


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


def list_settings(result: Result) -> Table | None:
    """All settings at each point that is drawn, the quickest first, with their errors."""
    shown, keys = _choose(compare_settings(result)), [key for key in KEYS if key in result.varying]
    rows: list[tuple[str, ...]] = []
    for point in shown:
        fronts = {name: point.front(name) for name in QUANTITIES}
        for row in np.argsort(np.where(point.computed, point.values["run_time"], math.inf), kind="stable").tolist():
            values = (point.label, *map(point.settings[row].words, keys))
            if not point.computed[row]:
                rows.append((*values, *[_DASH] * 3, f"failed: {point.endings[row].replace('_', ' ')}"))
                continue
            remarks = ["reference"] if row == point.reference else []
            remarks += [f"cheapest for its {QUANTITIES[name]}" for name, front in fronts.items() if row in front]
            errors = [point.errors[name][row] for name in QUANTITIES]
            told = [show_percent(error) if np.isfinite(error) else _DASH for error in errors]
            rows.append((*values, f"{point.values['run_time'][row]:.3g}", *told, ", ".join(remarks)))
    columns = ("point", *keys, "CPU time (s)", "worn volume", "response", "remark")
    note = as_sentences(*(f"{point.label or 'Reference'}: {_tell_reference(point)}" for point in shown))
    return Table("precision_settings", "All settings", columns, tuple(rows), note) if rows else None

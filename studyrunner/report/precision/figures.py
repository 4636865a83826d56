"""Error against run time, drawn: a line for each scheme, and the settings that are the cheapest for their error."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from studyrunner.report.drawing import Drawing, Missing, Table, line_style, new_panels, style
from studyrunner.report.precision.errors import QUANTITIES, RESOLVED, Measured, Point, Precision
from studyrunner.report.precision.settings import Setting
from studyrunner.report.precision.tables import NAMES, how_known, list_precision, reference_words
from studyrunner.report.reading.result import as_sentences
from studyrunner.system.progress import count

NOT_COMPARED = (
    "The file does not compare numerical settings: give scheme or step under [axes], or keys of [solver], several"
    " values, as in --set solver.harmonics=[1,3,5]."
)
"""For a file that has no `Precision`."""

_MOST_POINTS = 3
_TITLE = "Error against run time"
_HATCHED = "0.9"


def draw_precision(precision: Precision) -> Iterator[Drawing | Missing | Table]:
    """The figure, then the tables."""
    shown = _shown_points(precision)
    if not shown:
        sentence = "No setting has a result that could be compared with that of another one: see the outcomes."
        if any(point.measured for point in precision.points):
            sentence = "All settings give the same to round-off: nothing slips, or nothing is resolved that differs."
        yield Missing("precision", _TITLE, sentence)
        return
    with style():
        yield _draw(precision, shown)
    yield from list_precision(precision, shown)


def _shown_points(precision: Precision) -> tuple[Point, ...]:
    """Points whose settings differ, those that wear most; in the order of the file."""
    differing = [point for point in precision.points if point.differs]

    def worn(point: Point) -> float:
        assert point.reference is not None
        return float(np.nan_to_num(point.reference.run.worn[-1]))

    chosen = sorted(differing, key=worn, reverse=True)[:_MOST_POINTS]
    return tuple(point for point in differing if any(point is item for item in chosen))


def _sizes(point: Point, quantity: str) -> list[float]:
    """Errors that a logarithmic axis can show and that are more than round-off."""
    return [item.error(quantity) for item in point.measured if 1e-12 < item.error(quantity) < math.inf]


def _draw(precision: Precision, shown: Sequence[Point]) -> Drawing:
    quantities = [name for name in QUANTITIES if any(_sizes(point, name) for point in shown)]
    figure, panels = new_panels(len(shown), len(quantities), 0.9 + 2.7 * len(shown))
    shape = _Shapes(precision)
    for row, point in zip(panels, shown, strict=True):
        for panel, quantity in zip(row, quantities, strict=True):
            _draw_panel(panel, precision, point, quantity, shape)
            name = NAMES[quantity]
            panel.set_title(f"{point.label}: {name}" if point.label else name[0].upper() + name[1:])
    for panel in panels[-1]:
        panel.set_xlabel("CPU time of one point (s)")
    for row in panels:
        row[0].set_ylabel("Relative error")
    figure.legend(handles=shape.legend(), loc="outside lower center", ncols=4)
    return Drawing("precision", _TITLE, _caption(precision, shown), figure)


class _Shapes:
    """Colour and dashes of each scheme; the shape and size of markers by the other settings.

    The shape tells harmonics apart, or the first other key of several values where there is one kind of these only; the
    size the step.
    """

    def __init__(self, precision: Precision) -> None:
        self.schemes = precision.schemes
        items = [item.setting for point in precision.points for item in point.measured]
        keys = [key for key in ("harmonics", "rtol", "samples", "tolerance", "step") if key in precision.keys]
        self.key = keys[0] if keys else None
        self.values: list[Any] = []
        for setting in items:
            value = None if self.key is None else getattr(setting, self.key)
            if value is not None and value not in self.values:
                self.values.append(value)
        self.values.sort(key=lambda value: math.inf if isinstance(value, str) else float(str(value)))
        self.steps = sorted({setting.step for setting in items if setting.step is not None})
        self.sized = len(self.steps) > 1 and self.key != "step"

    def marker(self, setting: Setting) -> str:
        """Its shape."""
        value = None if self.key is None else getattr(setting, self.key)
        shapes = "os^DvPX<>p"
        return shapes[self.values.index(value) % len(shapes)] if value in self.values else "h"

    def size(self, setting: Setting) -> float:
        """Points: small steps have small markers."""
        if not self.sized or setting.step is None:
            return 5.5
        return 3.0 + 5.0 * self.steps.index(setting.step) / (len(self.steps) - 1)

    def line(self, scheme: str | None) -> dict[str, Any]:
        """Colour and dashes."""
        styles = line_style(self.schemes.index(scheme))
        return {"color": styles["color"], "linestyle": styles["linestyle"]}

    def legend(self) -> list[Line2D]:
        """What the marks mean."""
        plain: dict[str, Any] = {"linestyle": "none", "color": "0.3"}
        handles = [Line2D([], [], label=scheme or "all", linewidth=2.0, **self.line(scheme)) for scheme in self.schemes]
        for value in self.values:
            setting = replace(Setting(), **{str(self.key): value})
            label = f"{self.key} {setting.words(str(self.key))}"
            handles.append(Line2D([], [], marker=self.marker(setting), markersize=5.5, label=label, **plain))
        if self.sized:
            for step in (self.steps[0], self.steps[-1]):
                setting = Setting(step=step)
                words = f"step {setting.words('step')}"
                handles.append(Line2D([], [], marker="o", markersize=self.size(setting), label=words, **plain))
        ring: dict[str, Any] = {"marker": "o", "markersize": 10, "markerfacecolor": "none", "markeredgecolor": "black"}
        handles.append(Line2D([], [], linestyle="none", label="cheapest for its error", **ring))
        hollow: dict[str, Any] = {
            "marker": "o",
            "markersize": 5.5,
            "markerfacecolor": "white",
            "markeredgecolor": "0.3",
        }
        handles.append(Line2D([], [], linestyle="none", label="not resolved", **hollow))
        handles.append(
            Line2D(
                [],
                [],
                marker="x",
                markersize=5,
                markeredgewidth=0.8,
                label="oscillates",
                linestyle="none",
                color="black",
            )
        )
        return handles


def _draw_panel(panel: Axes, precision: Precision, point: Point, quantity: str, shape: _Shapes) -> None:
    sizes = _sizes(point, quantity)
    assert point.reference is not None
    if not sizes:
        panel.text(0.5, 0.5, "the same for all settings", ha="center", va="center", transform=panel.transAxes)
        panel.set(xticks=[], yticks=[])
        return
    bottom = 0.5 * min(sizes)
    for scheme in precision.schemes:
        front = [item for item in point.front(quantity, scheme) if math.isfinite(item.error(quantity))]
        where = [item.run_time for item in front]
        errors = [max(item.error(quantity), bottom) for item in front]
        panel.plot(where, errors, linewidth=2.0, zorder=3, **shape.line(scheme))
        for item in point.line(scheme, quantity):
            _mark(panel, item, quantity, bottom, shape)
    panel.set(xscale="log", yscale="log")
    panel.set_ylim(bottom=0.8 * bottom)
    for axis, factor, unit in ((panel.xaxis, 1.0, ""), (panel.yaxis, 100.0, " %")):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if axis is panel.xaxis else (1.0,)))
        axis.set_major_formatter(FuncFormatter(lambda value, _, f=factor, u=unit: f"{f * value:.3g}{u}"))
        axis.set_minor_formatter(NullFormatter())
    for item in point.front(quantity):
        at = ([item.run_time], [max(item.error(quantity), bottom)])
        panel.plot(*at, "o", markersize=11, markerfacecolor="none", markeredgecolor="black", zorder=5)
    least = RESOLVED * point.reference.uncertainty(quantity)
    if 0.8 * bottom < least < math.inf:
        panel.axhspan(0.8 * bottom, least, color=_HATCHED, zorder=0)
        panel.text(
            0.985,
            0.02,
            "grey: not resolved",
            ha="right",
            va="bottom",
            fontsize=7.5,
            transform=panel.transAxes,
            zorder=7,
        )


def _mark(panel: Axes, item: Measured, quantity: str, bottom: float, shape: _Shapes) -> None:
    colour = shape.line(item.setting.scheme)["color"]
    at = ([item.run_time], [max(item.error(quantity), bottom)])
    face = colour if item.resolved(quantity) else "white"
    panel.plot(
        *at,
        marker=shape.marker(item.setting),
        markersize=shape.size(item.setting),
        markerfacecolor=face,
        markeredgecolor=colour,
        linestyle="none",
        alpha=0.85,
        zorder=4,
    )
    if item.oscillates:
        panel.plot(*at, marker="x", markersize=5, markeredgewidth=0.8, color="black", zorder=6)


def _caption(precision: Precision, shown: Sequence[Point]) -> str:
    parts = ["Each mark is one setting; a line joins those settings of a scheme than which no quicker one is as exact"]
    parts.append("Rings mark those that are the cheapest of all schemes for their error")
    references = {reference_words(precision, point) for point in shown}
    if len(references) == 1:
        parts.append(f"Errors are those against {references.pop()}")
    else:
        against = "; ".join(f"at {point.label} {reference_words(precision, point)}" for point in shown)
        parts.append(f"Errors are those against the reference: {against}")
    parts.extend(how_known(point) for point in shown)
    if any(point.reference is not None and point.reference.setting is not None for point in shown):
        words = f"Errors below {RESOLVED:.0f} times the uncertainty of the reference (grey) are not resolved"
        parts.append(words)
    failed = precision.outcomes
    if failed:
        kinds = ", ".join(f"{number} {word.replace('_', ' ')}" for word, number in sorted(failed.items()))
        parts.append(f"Left out: {count(failed.total(), 'failed result')} ({kinds})")
    left = len(precision.points) - len(shown)
    if left:
        parts.append(f"{count(left, 'other point')} not drawn: less wears there, or all settings agree")
    if precision.shared:
        parts.append(
            "Points of several wear coefficients may share a march, whose time is then that of all of them: set"
            " shortcuts = false under [solver] for the time of each"
        )
    return as_sentences(*parts)

"""Error against run time, drawn: a line for each scheme, and the settings that are the cheapest for their error."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator, NullLocator

from studyrunner.report.drawing import Drawing, Missing, Table, add_legend, line_style, new_panels
from studyrunner.report.precision.comparison import Precision
from studyrunner.report.precision.errors import QUANTITIES, RESOLVED, Point
from studyrunner.report.precision.settings import Setting
from studyrunner.report.precision.tables import how_known, list_precision, reference_words
from studyrunner.report.reading.result import as_sentences
from studyrunner.report.reading.units import show_power
from studyrunner.system.progress import count

_MOST_POINTS = 3
_TITLE = "Error against run time"
_SIZE = 5.5  # of markers, points
_RING: dict[str, Any] = {"marker": "o", "markerfacecolor": "none", "markeredgecolor": "black"}
_LEAST_TICKS, _MOST_TICKS = 3, 6
_PLAIN = (1e-3, 1e4)
_NOT_RESOLVED = (
    "No error is clearly larger than the uncertainty of the reference: nothing tells one setting from another. Finer"
    " values of a key, or a smaller rtol, make a better reference."
)
_SCHEMES_ALONE = "Schemes alone are compared in the tables: give several values of a key of [solver], or of the step."


def draw_precision(precision: Precision) -> Iterator[Drawing | Missing | Table]:
    """The figure, then the tables; a sentence where all settings give the same.

    The figure is left out where it would tell no setting from another: of schemes alone, or where no error is resolved.
    """
    differing = [point for point in precision.points if point.differs and point.reference]
    if not differing:
        sentence = "All settings give the same to round-off: nothing slips, or nothing is resolved that differs."
        yield Missing("precision", _TITLE, sentence)
        return
    # those that wear most, in the order of the file
    worn = [float(np.nan_to_num(point.reference.worn)) for point in differing if point.reference]
    most = [differing[place] for place in np.argsort(np.negative(worn), kind="stable")]
    drawn = [point for point in most if any(point.resolves(name) for name in QUANTITIES)]
    places = {id(point): place for place, point in enumerate(precision.points)}
    shown, listed = (
        sorted(chosen[:_MOST_POINTS], key=lambda point: places[id(point)]) for chosen in (drawn, drawn or most)
    )
    if shown and set(precision.keys) != {"scheme"}:
        yield _draw(precision, shown)
    else:
        yield Missing("precision", _TITLE, _NOT_RESOLVED if not shown else _SCHEMES_ALONE)
    yield from list_precision(precision, listed)


def _draw(precision: Precision, shown: Sequence[Point]) -> Drawing:
    """One row a point, one column a quantity."""
    quantities = [name for name in QUANTITIES if any(point.resolves(name) for point in shown)]
    figure, panels = new_panels(len(shown), len(quantities), 0.3 + 2.4 * len(shown))
    marks = _Marks(precision)
    for row, point, title in zip(panels, shown, _titles(shown), strict=True):
        for panel, quantity in zip(row, quantities, strict=True):
            _draw_panel(panel, precision, point, quantity, marks)
            panel.set_ylabel(f"error of {QUANTITIES[quantity]}")
        # one title a row: it goes on above the panels to its right
        row[0].set_title(title, loc="left")
    for panel in panels[-1]:
        panel.set_xlabel("CPU time of one point (s)")
    add_legend(figure, marks.legend(shown))
    return Drawing("precision", _TITLE, _caption(precision, shown), figure)


def _titles(shown: Sequence[Point]) -> list[str]:
    """Labels of the points without what all of them share, which is in the caption."""
    parts = [point.label.split(", ") for point in shown]
    shared = set.intersection(*map(set, parts)) if len(shown) > 1 else set(parts[0])
    return [", ".join(part for part in own if part not in shared) for own in parts]


def _ticks(low: float, high: float) -> list[float]:
    """Three to six numbers in few digits on a logarithmic axis from `low` to `high`, both above zero."""
    decades = [10.0**power for power in range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)]
    for steps in ((1.0,), (1.0, 3.0), (1.0, 2.0, 5.0)):
        found = [factor * decade for decade in decades for factor in steps if low <= factor * decade <= high]
        if len(found) >= _LEAST_TICKS:
            return found[:: -(-len(found) // _MOST_TICKS)]
    return [float(tick) for tick in MaxNLocator(_LEAST_TICKS).tick_values(low, high) if low <= tick <= high]


def _show_tick(value: float, percent: bool) -> str:
    """A number of `_ticks` as text."""
    number = 100.0 * value if percent else value
    text = f"{number:.3g}" if _PLAIN[0] <= number < _PLAIN[1] else show_power(number)
    return f"{text} %" if percent else text


class _Marks:
    """Colour and dashes of each scheme; the shape and size of markers by the other settings.

    The shape tells harmonics apart, or the first other key of several values where there is one kind of these only; the
    size the step.
    """

    def __init__(self, precision: Precision) -> None:
        keys = [key for key in ("harmonics", "rtol", "samples", "tolerance", "step") if key in precision.keys]
        compared = np.any([point.compared for point in precision.points], axis=0)
        settings = [setting for setting, row in precision.points[0].settings.items() if compared[row]]
        self.key = keys[0] if keys else "scheme"
        values = {getattr(setting, self.key) for setting in settings if keys} - {None}
        self.values: list[Any] = sorted(values, key=lambda value: math.inf if isinstance(value, str) else value)
        self.steps = sorted({setting.step for setting in settings if setting.step is not None})
        self.sized = len(self.steps) > 1 and self.key != "step"
        styles = {scheme: line_style(number) for number, scheme in enumerate(precision.schemes)}
        self.lines = {name: {key: style[key] for key in ("color", "linestyle")} for name, style in styles.items()}

    def marker(self, setting: Setting) -> dict[str, Any]:
        """Shape and size; small steps have small ones."""
        value, shapes, size = getattr(setting, self.key), "os^DvPX<>p", _SIZE
        if self.sized and setting.step is not None:
            size = 3.0 + 5.0 * self.steps.index(setting.step) / (len(self.steps) - 1)
        shape = shapes[self.values.index(value) % len(shapes)] if value in self.values else "h"
        return {"marker": shape, "markersize": size}

    def legend(self, shown: Sequence[Point]) -> list[Line2D]:
        """What the marks at these points mean."""
        lines = [(scheme or "all", {"linewidth": 2.0, **style}) for scheme, style in self.lines.items()]
        samples = [replace(Setting(), **{self.key: value}) for value in self.values]
        marks = [(f"{self.key} {each.words(self.key)}", {"color": "0.3", **self.marker(each)}) for each in samples]
        for setting in [Setting(step=self.steps[place]) for place in (0, -1) if self.sized]:
            size = {**self.marker(setting), "marker": "o", "color": "0.3"}
            marks.append((f"step {setting.words('step')}", size))
        marks.append(("cheapest for its error", {**_RING, "markersize": 10}))
        if any(not point.measured[f"{name}_resolved"].all() for point in shown for name in point.quantities):
            marks.append(("not resolved", {**_RING, "markersize": _SIZE, "markeredgecolor": "0.3"}))
        return [Line2D([], [], label=label, **{"linestyle": "none", **style}) for label, style in (*lines, *marks)]


def _draw_panel(panel: Axes, precision: Precision, point: Point, quantity: str, marks: _Marks) -> None:
    clear = point.clear_errors(quantity)
    if not clear.size:
        panel.text(0.5, 0.5, "the same for all settings", ha="center", va="center", transform=panel.transAxes)
        panel.set(xticks=[], yticks=[])
        return
    bottom = 0.5 * min(clear)
    for scheme in precision.schemes:
        front = point.front(quantity, scheme)
        front = front[np.isfinite(front[quantity])]
        panel.plot(
            front["run_time"], front[quantity].clip(lower=bottom), linewidth=2.0, zorder=3, **marks.lines[scheme]
        )
    for item in point.measured[np.isfinite(point.measured[quantity])].itertuples():
        colour = marks.lines[item.Index.scheme]["color"]
        at = ([item.run_time], [max(getattr(item, quantity), bottom)])
        face = colour if getattr(item, f"{quantity}_resolved") else "white"
        style = {"markerfacecolor": face, "markeredgecolor": colour, **marks.marker(item.Index)}
        panel.plot(*at, linestyle="none", alpha=0.85, zorder=4, **style)
    panel.set(xscale="log", yscale="log")
    panel.set_ylim(bottom=0.8 * bottom)
    cheapest = point.front(quantity)
    for time, error in zip(cheapest["run_time"], cheapest[quantity].clip(lower=bottom), strict=True):
        panel.plot([time], [error], linestyle="none", markersize=11, zorder=5, **_RING)
    least = RESOLVED * point.uncertainty(quantity)
    if 0.8 * bottom < least < math.inf:
        panel.axhspan(0.8 * bottom, least, color="0.9", zorder=0)
    for axis, limits in ((panel.xaxis, panel.get_xlim()), (panel.yaxis, panel.get_ylim())):
        ticks = _ticks(*limits)
        axis.set_minor_locator(NullLocator())
        axis.set_ticks(ticks, [_show_tick(tick, percent=axis is panel.yaxis) for tick in ticks])


def _caption(precision: Precision, shown: Sequence[Point]) -> str:
    parts = ["Each mark is one setting; a line joins those settings of a scheme than which no quicker one is as exact"]
    parts.append("Rings mark those that are the cheapest of all schemes for their error")
    titles = _titles(shown)
    shared = [part for part in shown[0].label.split(", ") if part and part not in titles[0].split(", ")]
    parts.append(f"All at {', '.join(shared)}" if shared else "")
    references = {reference_words(precision, point) for point in shown}
    if len(references) == 1:
        parts.append(f"Errors are those against {references.pop()}")
    else:
        against = "; ".join(f"at {point.label} {reference_words(precision, point)}" for point in shown)
        parts.append(f"Errors are those against the reference: {against}")
    known = [how_known(point) for point in shown]
    parts += known
    if any(known):
        parts.append(f"Errors below {RESOLVED:.0f} times the uncertainty of the reference (grey) are not resolved")
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

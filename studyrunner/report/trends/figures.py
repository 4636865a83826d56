"""Trends along every axis as small multiples, and maps of the final worn volume over any two axes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.text import Text
from numpy.typing import NDArray

from studyrunner.report.drawing import COLOURS, Drawing, hatch_empty, new_figure, new_panels
from studyrunner.report.reading.result import Result, as_sentences
from studyrunner.report.reading.sample_statistics import SAMPLE
from studyrunner.report.reading.units import scale_for, show_number, show_power, units_of
from studyrunner.report.trends.quantities import Quantity, find_error, find_quantities, has_trends

_MOST_AXES = 6
_DECADES = 30.0
_MANY_CELLS = 400
_SMALL = 7.5
_LONG = 9
"""Characters that stand side by side under a small panel."""
_TITLE = "Trends along the axes of the study"
_MAPS = "Final worn volume over any two axes"


def draw_trends(result: Result) -> Iterator[Drawing]:
    """Small multiples and maps; nothing where only frequency and scheme vary, which other figures show."""
    if not has_trends(result):
        return
    quantities = [one for one in find_quantities(result) if np.isfinite(one.values).any()]
    if not quantities:
        return
    axes = _choose_axes(result)
    yield _draw_multiples(result, quantities, axes)
    if len(axes) > 1 and quantities[0].units == "m3":
        yield _draw_maps(result, quantities[0], axes)


def _choose_axes(result: Result) -> list[str]:
    """Axes of several values, at most `_MOST_AXES`: the last are the first to go. Samples are no axis of a trend."""
    return [name for name in result.varying if name != SAMPLE][:_MOST_AXES]


def _draw_multiples(result: Result, quantities: list[Quantity], axes: list[str]) -> Drawing:
    """One row a quantity and one for the error, one column an axis."""
    shown = tuple(result.shown_point()[name] for name in result.axes)
    error = find_error(result)
    rows = [*quantities, *([error] if error else [])]
    figure, panels = new_panels(len(rows), len(axes), 0.5 + 1.35 * len(rows), sharey="row")
    for row, quantity in enumerate(rows):
        scale = scale_for(quantity.units, quantity.values)
        for column, name in enumerate(axes):
            panel: Axes = panels[row, column]
            axis = result.axes.index(name)
            if quantity.values.shape[axis] == 1:
                panel.remove()
                continue
            at, order = _positions(result, name)
            lines = np.moveaxis(quantity.values, axis, 0)[order] * scale.factor
            place = tuple(0 if quantity.values.shape[i] == 1 else index for i, index in enumerate(shown) if i != axis)
            wrong = np.moveaxis(quantity.errors, axis, 0)[order] * scale.factor
            through: tuple[Any, ...] = (slice(None), *place)
            wrong = wrong[through]
            others = lines.reshape(len(order), -1)
            panel.plot(at, others, color="0.72", linewidth=0.6, zorder=1)
            own = lines[through]
            panel.plot(at, own, color=COLOURS[0], marker="o", markersize=3.5, zorder=3)
            told = np.isfinite(own * wrong)
            if told.any():
                bars: dict[str, Any] = {
                    "fmt": "none",
                    "ecolor": COLOURS[1],
                    "elinewidth": 1.0,
                    "capsize": 2.0,
                    "zorder": 4,
                }
                panel.errorbar(at[told], own[told], yerr=wrong[told], **bars)
            if quantity.units in ("m3", "m"):
                panel.set_ylim(bottom=0.0)
            _set_axis(panel, result, name)
            if not _is_last(rows, row, axis):
                panel.set_xlabel("")
                panel.tick_params(labelbottom=False)
        words = (
            quantity.label.replace(" at ", "\nat ")
            .replace("shift of the", "shift of\nthe")
            .replace("response of", "response\nof")
        )
        first = next(column for column, name in enumerate(axes) if quantity.values.shape[result.axes.index(name)] > 1)
        panels[row, first].set_ylabel(f"{words}\n({scale.unit})")
        panels[row, first].tick_params(labelleft=True)
    caption = as_sentences(
        f"Each column is one axis of the study; blue: through {result.describe(result.shown_point())}, where most is"
        " worn; grey: all other combinations",
        "Orange bars: estimated error of the worn volume; of the peak, how far it lies from the nearest frequency of"
        " the study",
        "The shift is the frequency of the largest response at the last cycle less that at the first"
        if any(one.units == "Hz" for one in quantities)
        else "",
        "Peaks at an end of the frequency range are left out: the range may miss them"
        if "frequency" in result.varying
        else "",
        _tell_left(result, axes),
    )
    return Drawing("trends", _TITLE, caption, figure)


def _is_last(rows: list[Quantity], row: int, axis: int) -> bool:
    """Whether no panel stands below this one."""
    return all(one.values.shape[axis] == 1 for one in rows[row + 1 :])


def _tell_left(result: Result, axes: list[str]) -> str:
    left = [name.replace("_", " ") for name in result.varying if name not in (*axes, SAMPLE)]
    return f"Left out: {', '.join(left)}" if left else ""


def _positions(result: Result, name: str) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Where the values of an axis stand on paper, ascending, and their places in the file; words one after another."""
    values = result.dataset[name].values
    if values.dtype.kind not in "fiu":
        return np.arange(len(values), dtype=float), np.arange(len(values))
    order = np.argsort(values, kind="stable")
    return np.asarray(values[order], dtype=float), order


def _set_axis(panel: Axes, result: Result, name: str) -> None:
    """Label, scale and ticks of a horizontal axis: few values are ticks themselves."""
    values = result.dataset[name].values
    panel.set_xlabel(_label(result, name))
    panel.tick_params(labelsize=_SMALL)
    if values.dtype.kind not in "fiu":
        panel.set_xticks(range(len(values)), [str(value) for value in values])
        panel.set_xlim(-0.4, len(values) - 0.6)
        return
    if name != "frequency" and values.min() > 0.0 and values.max() / values.min() > _DECADES:
        panel.set_xscale("log")
        panel.xaxis.set_major_formatter(show_power)
        panel.xaxis.set_minor_formatter("")
    elif len(values) <= 3:
        panel.set_xticks(values, [show_number(float(value), 4) for value in values])
        panel.margins(x=0.15)
    else:
        panel.locator_params(axis="x", nbins=3)
    if len(values) <= 3:
        _turn(panel.get_xticklabels())


def _label(result: Result, name: str) -> str:
    """Name of an axis, a word a line, and its unit below: panels are narrow."""
    units = units_of(result.dataset[name])
    return name.replace("_", "\n") + (f"\n({units})" if units else "")


def _turn(texts: list[Text]) -> None:
    """Turn tick labels that would run into each other."""
    if sum(len(text.get_text()) for text in texts) > _LONG:
        for text in texts:
            text.set(rotation=35, ha="right", rotation_mode="anchor")


def _draw_maps(result: Result, worn: Quantity, axes: list[str]) -> Drawing:
    """A matrix of the axes: below its diagonal the worn volume, above it the estimated error over the same two axes."""
    n = len(axes)
    shown = result.shown_point()
    scale = scale_for("m3", worn.values)
    errors = np.where(result.computed, result.errors, np.nan) * 100.0
    told = bool((errors > 0.0).any())
    norms = (
        Normalize(0.0, scale(np.nanmax(worn.values)).item() or 1.0),
        Normalize(0.0, float(np.nanmax(errors, initial=0.0)) or 1.0),
    )
    figure = new_figure(1.1 + 1.3 * (n - 1) + (0.6 if n == 2 else 0.0))
    if n == 2:
        panels = figure.subplots(1, 2 if told else 1, squeeze=False)
        cells = [(panels[0, 0], 1, 0, False), *([(panels[0, 1], 1, 0, True)] if told else [])]
    else:
        panels = figure.subplots(n, n)
        cells = []
        for row, column in np.ndindex(n, n):
            if row == column or (column > row and not told):
                panels[row, column].remove()
            else:
                cells.append((panels[row, column], row, column, column > row))
    for panel, row, column, of_error in cells:
        values = errors if of_error else scale(worn.values)
        across, down = axes[column], axes[row]
        where = tuple(slice(None) if name in (across, down) else shown[name] for name in result.axes)
        field = values[where]
        if result.axes.index(down) > result.axes.index(across):
            field = field.T
        (_, at), (_, up) = _positions(result, across), _positions(result, down)
        field = field[np.ix_(up, at)]
        panel.pcolormesh(
            np.arange(len(at) + 1) - 0.5,
            np.arange(len(up) + 1) - 0.5,
            field,
            norm=norms[of_error],
            cmap="magma_r" if of_error else None,
            rasterized=field.size > _MANY_CELLS,
        )
        hatch_empty(panel, bool(np.isnan(field).any()))
        panel.grid(visible=False)
        top = of_error and n > 2
        _tick(panel, result, across, at, n == 2 or row == (0 if top else n - 1), top=top)
        _tick_up(panel, result, down, up, n == 2 or column == 0 or (column == 1 and row == 0))
    bars: list[tuple[Normalize, str | None, str]] = [(norms[0], None, scale.label("worn volume"))]
    if told:
        bars.append((norms[1], "magma_r", "estimated error (%)"))
    for number, (norm, colours, label) in enumerate(bars):
        beside = [cell[0] for cell in cells] if n > 2 else panels[0, number]
        figure.colorbar(ScalarMappable(norm, colours), ax=beside, label=label, fraction=0.05, aspect=35, pad=0.02)
    caption = as_sentences(
        f"Worn volume {result.when(-1, 'after')} over each two axes"
        + (" below the diagonal, its estimated error above it" if n > 2 and told else ""),
        f"The other axes are at {result.describe(shown)}, where most is worn" if n > 2 else "",
        "Hatched: points without a result" if not result.computed.all() else "",
        _tell_left(result, axes),
    )
    return Drawing("trend_maps", _MAPS, caption, figure)


def _tick(panel: Axes, result: Result, name: str, order: NDArray[np.intp], named: bool, *, top: bool) -> None:
    """Values of an axis under or above the cells, as many as fit; none on inner panels."""
    panel.set_xticks(*_cells(result, name, order, named), fontsize=_SMALL)
    if top:
        panel.xaxis.tick_top()
        panel.xaxis.set_label_position("top")
    if named:
        panel.set_xlabel(_label(result, name))
        texts = panel.get_xticklabels()
        _turn(texts)
        if top:
            for text in texts:
                text.set_horizontalalignment("left" if text.get_rotation() else "center")


def _tick_up(panel: Axes, result: Result, name: str, order: NDArray[np.intp], named: bool) -> None:
    """As `_tick`, beside the cells."""
    panel.set_yticks(*_cells(result, name, order, named), fontsize=_SMALL)
    if named:
        panel.set_ylabel(_label(result, name))


def _cells(result: Result, name: str, order: NDArray[np.intp], named: bool) -> tuple[list[int], list[str]]:
    """Places of the cells that are named, and their texts: all of a few, else the first and the last."""
    values = result.dataset[name].values[order]
    kept = list(range(len(values))) if len(values) <= 3 else [0, len(values) - 1]
    words = values.dtype.kind not in "fiu"
    texts = [str(values[i]) if words else show_number(float(values[i]), 4) for i in kept]
    return kept, texts if named else [""] * len(kept)

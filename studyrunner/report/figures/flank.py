"""Wear depth per contact pair, pressure and wear on the flanks (Figs. 5, 10, 11, 12 of the paper)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from studyrunner.report.drawing import (
    COLOURS,
    Drawing,
    Missing,
    add_legend,
    line_style,
    new_figure,
    new_panels,
    set_from_zero,
)
from studyrunner.report.isolines import add_colour_bar, add_isolines
from studyrunner.report.reading.choice import choose
from studyrunner.report.reading.flanks import Flank, find_flanks
from studyrunner.report.reading.result import Result, as_sentences
from studyrunner.report.reading.scene_pairs import last_depth, tells_depth
from studyrunner.report.reading.units import Scale, scale_for
from studyrunner.system.progress import count

_MOST_SERIES = 4
_MOST_PROFILES = 5
_MOST_FLANKS = 3
_MANY_PAIRS = 150
_FEW_PAIRS = 6
_MANY_CELLS = 600
_SLENDER = 0.12
_BELOW_AXIS = 4.6
"""Heights of its text that a legend stands below a panel, to leave room for the ticks and the label of the axis."""
_NO_DEPTH = 1e-15
"""m. A depth below this is round-off: it is far less than an atom."""


def draw_flanks(result: Result) -> Iterator[Drawing | Missing]:
    """Figures of the pairs at the shown point; sentences where the file does not hold what they need."""
    yield from draw_wear(result)
    if result.has("mean_pressure"):
        if _are_placed(result) or result.dataset.sizes["contact"] > _FEW_PAIRS:
            yield draw_pressure(result)
        elif len(result.cycles) > 1:
            yield draw_pressure_history(result)
    else:
        yield Missing("mean_pressure", "Mean pressure on the flanks", result.lacks("mean_pressure"))


def draw_wear(result: Result) -> Iterator[Drawing | Missing]:
    """Figures of the wear depth at the shown point; a sentence where the file does not hold what they need."""
    if not tells_depth(result):
        yield Missing("wear_depth", "Wear depth of the pairs", result.lacks("wear_depth"))
        return
    if len(result.cycles) == 1 or float(last_depth(result, result.shown_point()).max()) <= _NO_DEPTH:
        return
    if result.dataset.sizes["contact"] > 1:
        yield draw_depths(result)
    # Without positions there is nothing that the wear depth per pair does not show.
    if _are_placed(result):
        yield draw_profile(result)


def _are_placed(result: Result) -> bool:
    """Whether the file has the positions of all pairs."""
    return all(flank.seen is not None for flank in find_flanks(result))


def draw_depths(result: Result) -> Drawing:
    """Wear depth per pair at the last cycle count, one series a scheme (Fig. 5)."""
    shown = result.shown_point()
    course = result.course_axis
    choice = choose(result, [course] if course else [], _MOST_SERIES)
    pairs, last = result.dataset["contact"].values, result.last_kept(shown)
    series = [(last_depth(result, {**shown, **point}), label) for point, label in choice]
    series = [(depth, label) for depth, label in series if not np.isnan(depth).all()]
    scale = scale_for("m", *(depth for depth, _ in series))
    highest = max(float(np.nanmax(depth)) for depth, _ in series)
    figure = new_figure(3.4)
    panel: Axes = figure.subplots()
    apart = 0.8 / len(series) if len(pairs) <= _MANY_PAIRS else 0.0
    for number, (depth, label) in enumerate(series):
        at = pairs + (number - 0.5 * (len(series) - 1)) * apart
        style = line_style(number)
        panel.vlines(at, 0.0, scale(depth), color=style["color"], linewidth=1.2)
        panel.plot(
            at, scale(depth), linestyle="none", marker=style["marker"], color=style["color"], label=label or None
        )
    set_from_zero(panel, scale(highest).item())
    panel.set_xlim(pairs[0] - 0.8, pairs[-1] + 0.8)
    panel.set_xlabel("contact pair")
    panel.set_ylabel(scale.label(f"wear depth {result.when(last)}"))
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    panel.grid(visible=False, axis="x")
    _shade_surfaces(panel, result, pairs)
    if len(series) > 1:
        add_legend(figure)
    deepest = [
        f"{scale.show(float(np.nanmax(d)))} at pair {pairs[np.nanargmax(d)]}{f' ({k})' if k else ''}" for d, k in series
    ]
    text = as_sentences(
        f"Wear depth of each contact pair {result.when(last, 'after')}"
        + (f" at {result.describe(shown, [course])}" if course else ""),
        f"Deepest: {', '.join(deepest)}",
        choice.sentence,
        "Fig. 5 of the paper",
    )
    return Drawing("wear_depth", "Wear depth of the pairs", text, figure)


def _shade_surfaces(panel: Axes, result: Result, pairs: NDArray[np.int_]) -> None:
    """Name the surfaces above their pairs and shade every other one; nothing where pairs of one are not in a row."""
    if "contact_surface" not in result.dataset.coords:
        return
    labels = result.dataset["contact_surface"].values.astype(str)
    starts = np.flatnonzero(np.r_[True, labels[1:] != labels[:-1]])
    if len(starts) != len(np.unique(labels)) or len(starts) < 2:
        return
    ends = np.r_[starts[1:], len(labels)]
    for number, (start, end) in enumerate(zip(starts, ends, strict=True)):
        left, right = pairs[start] - 0.5, pairs[end - 1] + 0.5
        if number % 2:
            panel.axvspan(left, right, color="0.93", zorder=0)
        panel.text(
            0.5 * (left + right), 1.01, labels[start], transform=panel.get_xaxis_transform(), ha="center", va="bottom"
        )


def draw_pressure(result: Result) -> Drawing:
    """Mean pressure on each flank at the first and the last cycle count (Figs. 10, 11)."""
    shown = result.shown_point()
    kept = sorted({0, result.last_kept(shown)})
    values = [result.at("mean_pressure", shown, cycle).values for cycle in kept]
    scale = scale_for("Pa", *values)
    flanks, left_out = _choose_flanks(result, values)
    labels = [result.cycle_label(cycle) for cycle in kept]
    figure = _draw_fields(flanks, values, labels, scale, "mean pressure")
    largest = [
        f"{scale.show(float(np.nanmax(value)))} at pair {int(result.dataset['contact'].values[np.nanargmax(value)])}"
        f" ({label})"
        for value, label in zip(values, labels, strict=True)
    ]
    text = as_sentences(
        f"Contact pressure, mean over a period, of {_surfaces(flanks)} at {result.describe(shown)}",
        f"Largest: {', '.join(largest)}",
        _how_drawn(flanks),
        left_out,
        "Figs. 10 and 11 of the paper",
    )
    return Drawing("mean_pressure", "Mean pressure on the flanks", text, figure)


def draw_pressure_history(result: Result) -> Drawing:
    """Mean pressure over cycles of a few pairs that have no positions, one line a pair (Figs. 10, 11)."""
    shown = result.shown_point()
    values, last = result.at("mean_pressure", shown).values, result.last_kept(shown)
    scale, cycles = scale_for("Pa", values), scale_for("cycles", result.cycles)
    figure = new_figure(3.2)
    panel: Axes = figure.subplots()
    counted = np.isfinite(result.cycles)
    for number, (pair, pressure) in enumerate(zip(result.dataset["contact"].values, values[counted].T, strict=True)):
        at = cycles(result.cycles[counted])
        panel.plot(at, scale(pressure), label=f"pair {pair}", **line_style(number, pressure.size))
    set_from_zero(panel, scale(np.nanmax(values, initial=0.0)).item())
    panel.set_xlim(0.0, cycles(result.cycles[counted][-1]).item())
    panel.set_xlabel(cycles.label("vibration cycles"))
    panel.set_ylabel(scale.label("mean pressure"))
    if values.shape[1] > 1:
        add_legend(figure)
    text = as_sentences(
        f"Contact pressure, mean over a period, at {result.describe(shown)}",
        f"Largest: {scale.show(float(np.nanmax(values[0])))} ({result.cycle_label(0)}),"
        f" {scale.show(float(np.nanmax(values[last])))} ({result.cycle_label(last)})",
        "The file has no positions of the pairs, hence no map. In place of Figs. 10 and 11 of the paper",
    )
    return Drawing("mean_pressure", "Mean contact pressure", text, figure)


def draw_profile(result: Result) -> Drawing:
    """Wear depth on each flank at the last cycle count: map, and lines along the flank (Fig. 12)."""
    shown = result.shown_point()
    last = result.last_kept(shown)
    depth = last_depth(result, shown)
    scale = scale_for("m", depth)
    flanks, left_out = _choose_flanks(result, [depth])
    label = result.cycle_label(last)
    on_grid = all(flank.grid is not None for flank in flanks)
    figure = (
        _draw_profiles(flanks, depth, scale) if on_grid else _draw_fields(flanks, [depth], [label], scale, "wear depth")
    )
    mean = [
        f"{flank.surface} {scale.show(float(np.average(depth[flank.pairs], weights=flank.area)))}" for flank in flanks
    ]
    deepest = int(result.dataset["contact"].values[np.nanargmax(depth)])
    text = as_sentences(
        f"Wear depth of {_surfaces(flanks)} {result.when(last, 'after')} at {result.describe(shown)}",
        f"Deepest: {scale.show(float(np.nanmax(depth)))} at pair {deepest}",
        f"Mean over the area: {', '.join(mean)}",
        "Below, the depth along the flank, one line for each row of pairs" if on_grid else "",
        _how_drawn(flanks),
        left_out,
        "Fig. 12 of the paper",
    )
    return Drawing("worn_profile", "Worn profile", text, figure)


def _choose_flanks(result: Result, values: Sequence[NDArray[np.float64]]) -> tuple[tuple[Flank, ...], str]:
    """Surfaces with the largest values, as many as fit side by side, and a sentence about the others."""
    flanks = find_flanks(result)
    largest = [max(float(np.nanmax(value[flank.pairs])) for value in values) for flank in flanks]
    kept = sorted(np.argsort(largest)[::-1][:_MOST_FLANKS])
    others = len(flanks) - len(kept)
    sentence = f"{count(others, 'more surface')} with lower values in the file" if others else ""
    return tuple(flanks[number] for number in kept), sentence


def _surfaces(flanks: Sequence[Flank]) -> str:
    return " and ".join(flank.surface for flank in flanks)


def _how_drawn(flanks: Sequence[Flank]) -> str:
    if all(flank.grid is not None for flank in flanks):
        return "One cell is one contact pair"
    if all(flank.seen is not None for flank in flanks):
        return "The pairs lie on no grid: one dot is one contact pair"
    return "The file has no positions of the pairs: they stand by their index"


def _draw_fields(
    flanks: Sequence[Flank], values: Sequence[NDArray[np.float64]], labels: Sequence[str], scale: Scale, text: str
) -> Figure:
    """One row of panels a field, one column a flank, all in one colour scale."""
    if all(flank.seen is None for flank in flanks):
        return _draw_bars(flanks, values, labels, scale, text)
    n_columns = len(flanks)
    n_rows = len(values)
    cells = [(flank, value, label) for value, label in zip(values, labels, strict=True) for flank in flanks]
    inches = 6.0 / n_columns * min(1.2, max(0.28, max(flank.height_over_width for flank in flanks)))
    figure, panels = new_panels(n_rows, n_columns, n_rows * (inches + 0.62))
    largest = max(float(np.nanmax(value, initial=0.0)) for value in values)
    norm = Normalize(0.0, scale(largest).item() or 1.0)
    for panel, (flank, value, label) in zip(panels.flat, cells, strict=True):
        _draw_field(panel, flank, scale(value[flank.pairs]), norm)
        panel.set_title(f"{flank.surface}, {label}")
    for inner in panels[:, 1:].flat:
        inner.set_ylabel("")
    for inner in panels[:-1].flat:
        inner.set_xlabel("")
    add_colour_bar(figure, panels, norm, scale.label(text), fraction=0.05)
    return figure


def _draw_field(panel: Axes, flank: Flank, values: NDArray[np.float64], norm: Normalize) -> None:
    """One field of a flank: cells of its grid, or dots at its pairs."""
    panel.grid(visible=False)
    if flank.grid is not None:
        grid = flank.grid
        panel.pcolormesh(
            *(edges * 1e3 for edges in flank.edges),
            values[grid.pair],
            norm=norm,
            rasterized=values.size > _MANY_CELLS,
        )
        panel.set_xlabel("along the flank (mm)")
        panel.set_ylabel("across (mm)")
        panel.invert_yaxis()
        # Cells as they are in the flank, unless it is so slender that nothing would be seen.
        panel.set_aspect("equal" if flank.height_over_width > _SLENDER else "auto")
        add_isolines(panel, grid.along * 1e3, grid.across * 1e3, values[grid.pair], norm)
    elif flank.seen is not None:
        panel.scatter(
            flank.seen[:, 0] * 1e3, flank.seen[:, 1] * 1e3, c=values, norm=norm, s=60, edgecolors="0.3", linewidths=0.4
        )
        panel.set_xlabel("in the surface (mm)")
        panel.set_ylabel("in the surface (mm)")
        panel.margins(0.12)
        panel.set_aspect("equal", adjustable="datalim")
    else:
        panel.bar(np.arange(values.size), values, color=COLOURS[0])
        panel.set_xlabel("contact pair of the surface")


def _draw_bars(
    flanks: Sequence[Flank], values: Sequence[NDArray[np.float64]], labels: Sequence[str], scale: Scale, text: str
) -> Figure:
    """Values of pairs without a position, by index; one series a field."""
    figure, panels = new_panels(1, len(flanks), 3.0, sharey=True)
    for panel, flank in zip(panels[0], flanks, strict=True):
        for number, (value, label) in enumerate(zip(values, labels, strict=True)):
            at = flank.pairs + (number - 0.5 * (len(values) - 1)) * 0.4
            style = line_style(number)
            panel.vlines(at, 0.0, scale(value[flank.pairs]), color=style["color"], linewidth=2.0)
            panel.plot(
                at,
                scale(value[flank.pairs]),
                linestyle="none",
                marker=style["marker"],
                color=style["color"],
                label=label,
            )
        panel.set_xlabel("contact pair")
        panel.set_title(flank.surface)
        panel.set_xlim(flank.pairs[0] - 1.0, flank.pairs[-1] + 1.0)
        panel.set_xticks(flank.pairs if flank.pairs.size <= 20 else flank.pairs[:: flank.pairs.size // 10])
    panels[0, 0].set_ylabel(scale.label(text))
    set_from_zero(panels[0, 0], scale(max(float(np.nanmax(value, initial=0.0)) for value in values)).item())
    if len(values) > 1:
        add_legend(figure)
    return figure


def _draw_profiles(flanks: Sequence[Flank], depth: NDArray[np.float64], scale: Scale) -> Figure:
    """A map of each flank, and under it the depth along the flank, downwards as the surface sinks."""
    inches = 6.0 / len(flanks) * min(1.2, max(0.28, max(flank.height_over_width for flank in flanks)))
    figure = new_figure(inches + 3.3)
    panels = figure.subplots(2, len(flanks), squeeze=False, sharex="col", height_ratios=(inches, 2.0))
    deepest = scale(float(np.nanmax(depth))).item() or 1.0
    norm = Normalize(0.0, deepest)
    for column, flank in enumerate(flanks):
        values = scale(depth[flank.pairs])
        _draw_field(panels[0, column], flank, values, norm)
        panels[0, column].set_title(flank.surface)
        panels[0, column].set_xlabel("")
        grid = flank.grid
        assert grid is not None
        rows = np.unique(
            np.linspace(0, grid.across.size - 1, min(grid.across.size, _MOST_PROFILES)).round().astype(int)
        )
        panel = panels[1, column]
        for number, row in enumerate(rows):
            label = f"across {grid.across[row] * 1e3:.3g} mm"
            panel.plot(grid.along * 1e3, values[grid.pair[row]], label=label, **line_style(number))
        panel.set_ylim(1.06 * deepest, -0.04 * deepest)
        panel.set_xlabel("along the flank (mm)")
        if len(rows) > 1:
            # The rows of pairs lie elsewhere on each flank: each has a legend of its own, below its axis.
            panel.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), borderaxespad=_BELOW_AXIS, ncols=2)
        if column > 0:
            panels[0, column].set_ylabel("")
    panels[1, 0].set_ylabel(scale.label("wear depth"))
    add_colour_bar(figure, panels, norm, scale.label("wear depth"), fraction=0.05)
    return figure

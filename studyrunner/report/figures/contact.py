"""Wear depth and pressure of the pairs: by number, on their surfaces, over a scar (Figs. 3, 5, 10, 11, 12)."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from studyrunner.report.drawing import Drawn
from studyrunner.report.figures.flanks import Flank, find_flanks
from studyrunner.report.figures.scar import draw_scar_depth, draw_scar_pressure
from studyrunner.report.panels import (
    FloatArray,
    add_colour_bar,
    add_legend,
    add_map,
    is_narrow,
    label_outer,
    line_style,
    new_panel,
    new_panels,
    set_from_zero,
)
from studyrunner.report.selection import choose, labelled
from studyrunner.result.scars import find_scar
from studyrunner.result.scene_pairs import NO_DEPTH, last_depth, tells_depth
from studyrunner.result.units import Scale, scale_for
from studyrunner.result.view import Result, as_sentences
from studyrunner.system.progress import count

_MOST_SERIES, _MOST_PROFILES, _MOST_FLANKS = 4, 5, 3
_MANY_PAIRS, _MOST_NUMBERED, _MOST_NUMBERS = 150, 4, 120
_SLENDER, _LOW, _LABEL_WIDTH, _LONGEST_NAME = 0.12, 0.4, 14, 20


def _worn_depth(result: Result) -> FloatArray | None:
    """Wear depths (n_contact,), m, of the shown point at its last count; None where nothing is worn."""
    depth = last_depth(result, result.shown_point())
    return depth if len(result.cycles) > 1 and float(depth.max()) > NO_DEPTH else None


def draw_depths(result: Result) -> Drawn:
    """Wear depth per pair at the last cycle count, one series a scheme (Fig. 5)."""
    if not tells_depth(result):
        return result.lacks("wear_depth")
    if _worn_depth(result) is None or result.dataset.sizes["contact"] == 1:
        return None
    shown, course = result.shown_point(), result.course_axis
    choice = choose(result, [course] if course else [], _MOST_SERIES)
    series = {label: last_depth(result, {**shown, **point}) for point, label in choice}
    series = {label: depth for label, depth in series.items() if not np.isnan(depth).all()}
    scale, (figure, panel) = scale_for("m", *series.values()), new_panel(3.4)
    _draw_stems(panel, result, {label: scale(depth) for label, depth in series.items()})
    panel.set_ylabel(scale.label(f"wear depth {result.when(result.last_kept(shown))}"))
    _name_surfaces(panel, result)
    add_legend(figure)
    deepest = [labelled(_largest(result, depth, scale), label) for label, depth in series.items()]
    return figure, as_sentences(f"Deepest: {', '.join(deepest)}", choice.sentence)


def _largest(result: Result, values: FloatArray, scale: Scale) -> str:
    return f"{scale.show(float(np.nanmax(values)))} at pair {result.dataset['contact'].values[np.nanargmax(values)]}"


def _draw_stems(panel: Axes, result: Result, series: dict[str, FloatArray]) -> None:
    """Values by the number of the pair, one series beside the other."""
    pairs = result.dataset["contact"].values
    apart = 0.8 / len(series) if len(pairs) <= _MANY_PAIRS else 0.0
    for number, (label, values) in enumerate(series.items()):
        at = pairs + (number - 0.5 * (len(series) - 1)) * apart
        style = line_style(number) | {"linestyle": "none", "markevery": 1}
        panel.vlines(at, 0.0, values, color=style["color"], linewidth=1.2)
        panel.plot(at, values, label=label or "computed", **style)
    set_from_zero(panel, max(float(np.nanmax(values, initial=0.0)) for values in series.values()))
    panel.set_xlim(pairs[0] - 0.8, pairs[-1] + 0.8)
    panel.set_xlabel("contact pair")
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    panel.grid(visible=False, axis="x")


def _name_surfaces(panel: Axes, result: Result) -> None:
    """Name the surfaces above their pairs and shade every other one; nothing where pairs of one are not in a row."""
    if "contact_surface" not in result.dataset.coords:
        return
    pairs, labels = result.dataset["contact"].values, result.dataset["contact_surface"].values.astype(str)
    starts = np.flatnonzero(np.r_[True, labels[1:] != labels[:-1]])
    if len(starts) != len(np.unique(labels)) or len(starts) < 2:
        return
    for number, (start, end) in enumerate(zip(starts, np.r_[starts[1:], len(labels)], strict=True)):
        left, right = pairs[start] - 0.5, pairs[end - 1] + 0.5
        if number % 2:
            panel.axvspan(left, right, color="0.93", zorder=0)
        over = panel.get_xaxis_transform()
        # a name that is wider than its figure would leave its panel no room
        name = labels[start][:_LONGEST_NAME]
        panel.text(0.5 * (left + right), 1.01, name, transform=over, ha="center", va="bottom")


def draw_pressure(result: Result) -> Drawn:
    """Mean pressure on each flank at the first and the last cycle count (Figs. 10, 11)."""
    scar = find_scar(result)
    if scar is not None:
        return draw_scar_pressure(result, scar)
    if result.dataset.sizes["contact"] == 1:
        return None
    shown = result.shown_point()
    kept = sorted({0, result.last_kept(shown)})
    fields = {result.cycle_label(cycle): result.at("mean_pressure", shown, cycle).values for cycle in kept}
    scale = scale_for("Pa", *fields.values())
    flanks, left_out = _choose_flanks(result, list(fields.values()))
    if all(flank.seen is None for flank in flanks):
        figure, panel = new_panel(3.2)
        _draw_stems(panel, result, {label: scale(values) for label, values in fields.items()})
        panel.set_ylabel(scale.label("mean pressure"))
        add_legend(figure)
    else:
        figure = _draw_fields(flanks, fields, scale, "mean pressure")
    largest = [labelled(_largest(result, values, scale), label) for label, values in fields.items()]
    return figure, as_sentences(f"Mean over a period. Largest: {', '.join(largest)}", _how_drawn(flanks), left_out)


def draw_profile(result: Result) -> Drawn:
    """Wear depth on each flank at the last cycle count: map, and lines along it (Fig. 12); or the scar."""
    depth = _worn_depth(result) if tells_depth(result) else None
    if depth is None:
        return None
    scar = find_scar(result)
    if scar is not None:
        return draw_scar_depth(result, scar)
    # without positions there is nothing that the wear depth per pair does not show
    if any(flank.seen is None for flank in find_flanks(result)):
        return None
    last, scale = result.last_kept(result.shown_point()), scale_for("m", depth)
    flanks, left_out = _choose_flanks(result, [depth])
    on_grid = all(flank.cells is not None for flank in flanks)
    if on_grid:
        figure = _draw_profiles(flanks, depth, scale)
    else:
        figure = _draw_fields(flanks, {result.cycle_label(last): depth}, scale, "wear depth")
    means = (float(np.average(depth[flank.pairs], weights=flank.area)) for flank in flanks)
    named = ", ".join(f"{flank.surface} {scale.show(mean)}" for flank, mean in zip(flanks, means, strict=True))
    return figure, as_sentences(
        f"Wear depth {result.when(last, 'after')}. Deepest: {_largest(result, depth, scale)}",
        f"Mean over the area: {named}",
        "Below each map, the same along each row of pairs" if on_grid else "",
        _how_drawn(flanks),
        left_out,
    )


def draw_numbers(result: Result) -> Drawn:
    """The number of each pair where it lies on its surface (Fig. 3b); nothing without positions, or with many pairs."""
    flanks, names = find_flanks(result), result.dataset["contact"].values
    placed = all(flank.seen is not None for flank in flanks)
    if not placed or len(names) == 1 or len(flanks) > _MOST_NUMBERED or len(names) > _MOST_NUMBERS * len(flanks):
        return None
    height = 0.6 + 6.0 * min(1.2, max(_SLENDER, max(flank.height_over_width for flank in flanks)))
    figure, panels = new_panels(len(flanks), 1, min(height * len(flanks), 8.0))
    for panel, flank in zip(panels[:, 0], flanks, strict=True):
        # the colour says nothing: cells without one
        plain, own = ListedColormap(["#ffffff00"]), names[flank.pairs].astype(float)
        _draw_field(panel, flank, own, Normalize(0.0, max(own.max(), 1.0)), cmap=plain, edgecolors="0.6")
        places = np.asarray(flank.seen)
        if flank.cells is not None:
            middles = [0.5 * (edges[1:] + edges[:-1]) for edges in (flank.cells.x_edges, flank.cells.y_edges)]
            places[flank.cells.pair] = np.stack(np.meshgrid(*middles), axis=-1)
        for name, (x, y) in zip(own, 1e3 * places, strict=True):
            panel.text(x, y, f"{name:.0f}", ha="center", va="center", fontsize=8, clip_on=False)
        panel.set_title(flank.surface)
    label_outer(panels)
    return figure, as_sentences(f"As along the dimension contact: {len(names)} pairs", flanks[0].origin)


def _choose_flanks(result: Result, values: Sequence[FloatArray]) -> tuple[tuple[Flank, ...], str]:
    """Surfaces with the largest values, as many as fit side by side, and a sentence about the others."""
    flanks = find_flanks(result)
    largest = [max(float(np.nanmax(value[flank.pairs])) for value in values) for flank in flanks]
    kept = sorted(np.argsort(largest)[::-1][:_MOST_FLANKS])
    others = len(flanks) - len(kept)
    sentence = f"{count(others, 'more surface')} with lower values in the file" if others else ""
    return tuple(flanks[number] for number in kept), sentence


def _how_drawn(flanks: Sequence[Flank]) -> str:
    if all(flank.cells is not None for flank in flanks):
        return "One cell is one contact pair, as large as its area"
    if all(flank.seen is not None for flank in flanks):
        return "The pairs lie on no grid: one dot is one contact pair"
    return "The file has no positions of the pairs: they stand by their index"


def _inches(flanks: Sequence[Flank]) -> float:
    """Height of a row of maps of flanks side by side."""
    return 6.0 / len(flanks) * min(1.2, max(0.28, max(flank.height_over_width for flank in flanks)))


def _draw_fields(flanks: Sequence[Flank], fields: dict[str, FloatArray], scale: Scale, text: str) -> Figure:
    """One row of panels a field, one column a flank, all in one colour scale."""
    figure, panels = new_panels(len(fields), len(flanks), len(fields) * (_inches(flanks) + 0.62))
    largest = max(float(np.nanmax(values, initial=0.0)) for values in fields.values())
    norm = Normalize(0.0, scale(largest).item() or 1.0)
    for row, (label, values) in zip(panels, fields.items(), strict=True):
        for panel, flank in zip(row, flanks, strict=True):
            _draw_field(panel, flank, scale(values[flank.pairs]), norm)
            panel.set_title(f"{flank.surface}, {label}")
    label_outer(panels)
    add_colour_bar(figure, panels, norm, scale.label(text), fraction=0.05)
    return figure


def _draw_field(panel: Axes, flank: Flank, values: NDArray[Any], norm: Normalize, **look: Any) -> None:
    """One field of a flank: cells of its grid, or dots at its pairs."""
    if flank.cells is not None:
        cells = flank.cells
        add_map(panel, 1e3 * cells.x_edges, 1e3 * cells.y_edges, values[cells.pair], norm, **look)
        # cells as they are in the flank, unless it is so slender that too little would be seen
        panel.set_aspect("equal" if flank.height_over_width > (_LOW if is_narrow() else _SLENDER) else "auto")
    elif flank.seen is not None:
        dots: dict[str, Any] = {"edgecolors": "0.3", "linewidths": 0.4}
        panel.grid(visible=False)
        x, y = 1e3 * flank.seen.T
        panel.scatter(x, y, 160 if look else 60, values, norm=norm, label="pairs", **(dots | look))
        panel.margins(0.12)
        panel.set_aspect("equal", adjustable="datalim")
    panel.set_xlabel(f"{flank.directions[0]} (mm)")
    panel.set_ylabel(textwrap.fill(f"{flank.directions[1]} (mm)", _LABEL_WIDTH, break_on_hyphens=False))


def _draw_profiles(flanks: Sequence[Flank], depth: FloatArray, scale: Scale) -> Figure:
    """A map of each flank, and under it the depth along its first direction, downwards as the surface sinks."""
    inches = _inches(flanks)
    figure, panels = new_panels(2, len(flanks), inches + 3.3, sharex="col", height_ratios=(inches, 2.0))
    deepest = scale(float(np.nanmax(depth))).item() or 1.0
    norm = Normalize(0.0, deepest)
    rows = [flank.cells.y for flank in flanks if flank.cells is not None]
    same = all(len(y) == len(rows[0]) and np.allclose(y, rows[0]) for y in rows)
    for (above, panel), flank in zip(panels.T, flanks, strict=True):
        values, cells = scale(depth[flank.pairs]), flank.cells
        assert cells is not None
        _draw_field(above, flank, values, norm)
        above.set_title(flank.surface)
        n_rows, own = len(cells.y), "" if same else f"{flank.surface}: "
        for number, row in enumerate(np.unique(np.linspace(0, n_rows - 1, min(n_rows, _MOST_PROFILES)).round())):
            label = f"{own}{1e3 * cells.y[int(row)]:.3g} mm {flank.directions[1]}"
            panel.plot(1e3 * cells.x, values[cells.pair[int(row)]], label=label, **line_style(number))
        panel.set_ylim(1.06 * deepest, -0.04 * deepest)
        panel.set_xlabel(f"{flank.directions[0]} (mm)")
        panel.set_ylabel(scale.label("wear depth"))
    label_outer(panels)
    add_colour_bar(figure, panels, norm, scale.label("wear depth"), fraction=0.05)
    add_legend(figure)
    return figure

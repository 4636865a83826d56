"""Contact pairs on their surfaces: numbers, wear depth and pressure, also over a scar (Figs. 3, 5, 10, 11, 12)."""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from studyrunner.report import drawing as plot
from studyrunner.report.drawing import COLOURS, Drawn, FloatArray
from studyrunner.report.selection import choose, course_axis, labelled
from studyrunner.result import pairs as contact
from studyrunner.result.view import Result
from studyrunner.system.progress import count
from studyrunner.units import Scale, scale_for

_MOST_FLANKS, _SLENDER, _LOW, _LABEL_WIDTH = 3, 0.12, 0.4, 14
_MOST_SERIES, _MOST_PROFILES = 4, 5
_MANY_PAIRS, _MOST_NUMBERED, _MOST_NUMBERS, _LONGEST_NAME = 150, 4, 120, 20


# --- maps ---


def most_of_flanks(result: Result, *values: FloatArray) -> tuple[tuple[contact.Flank, ...], str]:
    """Surfaces with the largest values (n_contact,), as many as fit, none without positions; how they are drawn."""
    flanks = contact.find_flanks(result)
    if any(flank.seen is None for flank in flanks):
        return (), ""
    largest = [max(float(np.nanmax(value[flank.pairs])) for value in values) for flank in flanks]
    drawn = tuple(flanks[number] for number in sorted(np.argsort(largest)[::-1][:_MOST_FLANKS]))
    on_grid = all(flank.grid is not None for flank in drawn)
    how = "One cell is one contact pair, as large as its area"
    how = how if on_grid else "The pairs lie on no grid: one dot is one contact pair"
    others = len(flanks) - len(drawn)
    return drawn, f"{how}. {count(others, 'more surface')} with lower values in the file" if others else how


def largest_pair(result: Result, values: FloatArray, scale: Scale) -> str:
    """The largest of values (n_contact,) in words, with its pair."""
    return f"{scale.show(float(np.nanmax(values)))} at pair {result.dataset['contact'].values[np.nanargmax(values)]}"


def map_height(flanks: Sequence[contact.Flank]) -> float:
    """Height of a row of maps of flanks side by side, inches."""
    return 6.0 / len(flanks) * min(1.2, max(0.28, max(flank.height_over_width for flank in flanks)))


def draw_fields(flanks: Sequence[contact.Flank], fields: Mapping[str, FloatArray], scale: Scale, text: str) -> Figure:
    """One row of maps a field (n_contact,), one column a flank, all in one colour scale."""
    figure, panels = plot.new_panels(len(fields), len(flanks), len(fields) * (map_height(flanks) + 0.62))
    largest = max(float(np.nanmax(values, initial=0.0)) for values in fields.values())
    norm = Normalize(0.0, scale(largest).item() or 1.0)
    for row, (label, values) in zip(panels, fields.items(), strict=True):
        for panel, flank in zip(row, flanks, strict=True):
            draw_field(panel, flank, scale(values[flank.pairs]), norm)
            panel.set_title(f"{flank.surface}, {label}")
    plot.label_outer(panels)
    plot.add_colour_bar(figure, panels, norm, scale.label(text), fraction=0.05)
    return figure


def draw_field(panel: Axes, flank: contact.Flank, values: NDArray[Any], norm: Normalize, **look: Any) -> None:
    """One field (n,) of a flank: cells of its grid, or dots at its pairs."""
    if flank.grid is not None and flank.edges is not None:
        x_edges, y_edges = flank.edges
        plot.add_map(panel, 1e3 * x_edges, 1e3 * y_edges, values[flank.grid.pair], norm, **look)
        # cells as they are in the flank, unless it is so slender that too little would be seen
        panel.set_aspect("equal" if flank.height_over_width > (_LOW if plot.is_narrow() else _SLENDER) else "auto")
    elif flank.seen is not None:
        look = {"edgecolors": "0.3", "linewidths": 0.4, "s": 160 if look else 60, **look}
        panel.grid(visible=False)
        x, y = 1e3 * flank.seen.T
        panel.scatter(x, y, c=values, norm=norm, label="pairs", **look)
        panel.margins(0.12)
        panel.set_aspect("equal", adjustable="datalim")
    panel.set_xlabel(f"{flank.directions[0]} (mm)")
    panel.set_ylabel(textwrap.fill(f"{flank.directions[1]} (mm)", _LABEL_WIDTH, break_on_hyphens=False))


# --- depth and pressure ---


def _worn_depth(result: Result) -> FloatArray | None:
    """Wear depths (n_contact,), m, of the shown point at its last count; None where nothing is worn."""
    depth = contact.last_depth(result, result.shown)
    return depth if len(result.cycles) > 1 and float(depth.max()) > contact.NO_DEPTH else None


def draw_depths(result: Result) -> Drawn:
    """Wear depth per pair at the last cycle count, one series a scheme (Fig. 5)."""
    if not contact.has_depths(result):
        return result.lacks("wear_depth")
    if _worn_depth(result) is None or result.dataset.sizes["contact"] == 1:
        return None
    course, pairs = course_axis(result), result.dataset["contact"].values
    choice = choose(result, [course] if course else [], _MOST_SERIES)
    series = {label: contact.last_depth(result, point) for point, label in choice}
    series = {label: depth for label, depth in series.items() if not np.isnan(depth).all()}
    figure, panel = plot.new_panel(3.3)
    scale, apart = scale_for("m", *series.values()), 0.8 / len(series) if len(pairs) <= _MANY_PAIRS else 0.0
    for number, (label, depth) in enumerate(series.items()):
        at = pairs + (number - 0.5 * (len(series) - 1)) * apart
        style = plot.line_style(number) | {"linestyle": "none", "markevery": 1}
        panel.vlines(at, 0.0, scale(depth), color=style["color"], linewidth=1.2)
        panel.plot(at, scale(depth), label=label or "computed", **style)
    plot.set_from_zero(panel)
    panel.set(xlim=(pairs[0] - 0.8, pairs[-1] + 0.8), xlabel="contact pair")
    panel.set_ylabel(scale.label(f"wear depth at {result.cycle_label(result.last_reached(result.shown))}"))
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    panel.grid(visible=False, axis="x")
    if "contact_surface" in result.dataset.coords:
        _name_surfaces(panel, result)
    deepest = [labelled(largest_pair(result, depth, scale), label) for label, depth in series.items()]
    return figure, f"Deepest: {', '.join(deepest)}", choice.sentence


def _name_surfaces(panel: Axes, result: Result) -> None:
    """Name the surfaces above their pairs, with a line between them; nothing where pairs of one are not in a row."""
    pairs, labels = result.dataset["contact"].values, result.dataset["contact_surface"].values.astype(str)
    starts = np.flatnonzero(np.r_[True, labels[1:] != labels[:-1]])
    if len(starts) == len(np.unique(labels)) > 1:
        for start, end in zip(starts, np.r_[starts[1:], len(labels)], strict=True):
            panel.axvline(pairs[start] - 0.5, color="0.8", linewidth=0.8, zorder=0)
            # a name that is wider than its figure would leave its panel no room
            name, middle = labels[start][:_LONGEST_NAME], 0.5 * (pairs[start] + pairs[end - 1])
            panel.text(middle, 1.01, name, transform=panel.get_xaxis_transform(), ha="center", va="bottom")


def draw_pressure(result: Result) -> Drawn:
    """Mean pressure on each flank at the first and the last cycle count (Figs. 10, 11)."""
    shown, scar = result.shown, contact.find_scar(result)
    if scar is None and result.dataset.sizes["contact"] == 1:
        return None
    ends = sorted({0, result.last_reached(shown)})
    fields = {result.cycle_label(cycle): result.at("mean_pressure", shown, cycle).values for cycle in ends}
    scale = scale_for("Pa", *fields.values())
    flanks, how = most_of_flanks(result, *fields.values())
    if scar is not None:
        figure, panel, how = _draw_scar(scar, fields, scale, "mean pressure")
        plot.set_from_zero(panel)
    elif flanks:
        figure = draw_fields(flanks, fields, scale, "mean pressure")
    else:
        return "The file has no positions of the contact pairs."
    largest = [labelled(largest_pair(result, values, scale), label) for label, values in fields.items()]
    return figure, f"Mean over a period. Largest: {', '.join(largest)}", how


def draw_profile(result: Result) -> Drawn:
    """Wear depth on each flank at the last cycle count: map, and lines along it (Fig. 12); or the scar."""
    depth, scar = _worn_depth(result), contact.find_scar(result)
    if depth is None:
        return None
    if scar is not None:
        return _draw_scar_depth(result, scar, depth)
    flanks, how = most_of_flanks(result, depth)
    if not flanks:
        # without positions there is nothing that the wear depth per pair does not show
        return None
    when, scale = result.cycle_label(result.last_reached(result.shown)), scale_for("m", depth)
    if all(flank.grid is not None for flank in flanks):
        figure = _draw_profiles(flanks, depth, scale)
    else:
        figure = draw_fields(flanks, {when: depth}, scale, "wear depth")
    return figure, f"After {when}. Deepest: {largest_pair(result, depth, scale)}", how


def _draw_profiles(flanks: tuple[contact.Flank, ...], depth: FloatArray, scale: Scale) -> Figure:
    """A map of each flank, and under it the depth along its first direction, downwards as the surface sinks."""
    inches = map_height(flanks)
    figure, panels = plot.new_panels(2, len(flanks), inches + 3.3, sharex="col", height_ratios=(inches, 2.0))
    deepest = scale(float(np.nanmax(depth))).item() or 1.0
    norm = Normalize(0.0, deepest)
    for (above, panel), flank in zip(panels.T, flanks, strict=True):
        values, grid = scale(depth[flank.pairs]), flank.grid
        assert grid is not None
        draw_field(above, flank, values, norm)
        above.set_title(flank.surface)
        n_rows = len(grid.across)
        for number, row in enumerate(np.unique(np.linspace(0, n_rows - 1, min(n_rows, _MOST_PROFILES)).round())):
            label = f"{1e3 * grid.across[int(row)]:.3g} mm {flank.directions[1]}"
            panel.plot(1e3 * grid.along, values[grid.pair[int(row)]], label=label, **plot.line_style(number))
        panel.set(xlim=above.get_xlim(), ylim=(1.06 * deepest, -0.04 * deepest))
        panel.set(xlabel=f"{flank.directions[0]} (mm)", ylabel=scale.label("wear depth"))
    plot.label_outer(panels)
    plot.add_colour_bar(figure, panels, norm, scale.label("wear depth"), fraction=0.05)
    return figure


def _draw_scar(
    scar: contact.Scar, fields: Mapping[str, FloatArray], scale: Scale, text: str, error: FloatArray | None = None
) -> tuple[Figure, Axes, str]:
    """Fields (n_contact,) along x through the middle, the last with its errors; the panel, and a sentence."""
    (x, pairs), (figure, panel) = scar, plot.new_panel(3.4)
    along = scale_for("m", x)
    at = along(x)
    for number, (label, values) in enumerate(fields.items()):
        wrong = scale(error[pairs]) if error is not None and number == len(fields) - 1 else None
        plot.add_line(panel, at, scale(values[pairs]), wrong, band=True, label=label, **plot.line_style(number))
    panel.set(xlabel=along.label("x"), ylabel=scale.label(text), xlim=(1.02 * at.min(), 1.02 * at.max()))
    return figure, panel, "The contact is symmetric: one part is computed, the whole is drawn, along x"


def _draw_scar_depth(result: Result, scar: contact.Scar, after: FloatArray) -> Drawn:
    """Depth over x before and after wear, downwards as the surface sinks, with a measured one where there is one."""
    shown, measured, last = result.shown, result.measured, result.last_reached(result.shown)
    scale, known = scale_for("m", after, *([measured.depth] if measured else [])), result.has("wear_depth_error")
    error = result.at("wear_depth_error", shown, last).values if known else None
    fields = {"before": np.nan_to_num(contact.depths(result, shown)[0]), f"after {result.cycle_label(last)}": after}
    figure, panel, how = _draw_scar(scar, fields, scale, "depth", error)
    if measured is not None:
        # a measured profile may have piled-up edges above the surface
        at, depth = scale_for("m", scar[0])(measured.x), scale(measured.depth)
        panel.plot(at, depth, color=COLOURS[2], linewidth=1.2, label="measured")
    panel.invert_yaxis()
    deepest = f"After {result.cycle_label(last)}. Deepest: {scale.show(float(np.nanmax(after)))}"
    return figure, deepest, how, f"Measured: {measured.name}" if measured else ""


def draw_numbers(result: Result) -> Drawn:
    """The number of each pair where it lies on its surface (Fig. 3b); nothing without positions, or with many pairs."""
    flanks, names = contact.find_flanks(result), result.dataset["contact"].values
    placed = all(flank.seen is not None for flank in flanks)
    if not placed or len(names) == 1 or len(flanks) > _MOST_NUMBERED or len(names) > _MOST_NUMBERS * len(flanks):
        return None
    height = 0.6 + 6.0 * min(1.2, max(_SLENDER, max(flank.height_over_width for flank in flanks)))
    figure, panels = plot.new_panels(len(flanks), 1, min(height * len(flanks), 8.0))
    for panel, flank in zip(panels[:, 0], flanks, strict=True):
        # the colour says nothing: cells without one
        plain, numbers = ListedColormap(["#ffffff00"]), names[flank.pairs].astype(float)
        draw_field(panel, flank, numbers, Normalize(0.0, max(numbers.max(), 1.0)), cmap=plain, edgecolors="0.6")
        places = np.asarray(flank.seen)
        if flank.grid is not None and flank.edges is not None:
            middles = [0.5 * (edges[1:] + edges[:-1]) for edges in flank.edges]
            places[flank.grid.pair] = np.stack(np.meshgrid(*middles), axis=-1)
        for name, (x, y) in zip(numbers, 1e3 * places, strict=True):
            panel.text(x, y, f"{name:.0f}", ha="center", va="center", fontsize=8, clip_on=False)
        panel.set_title(flank.surface)
    plot.label_outer(panels)
    origin = str(result.dataset.attrs.get("contact_origin", ""))
    return figure, f"As along the dimension contact: {len(names)} pairs", origin

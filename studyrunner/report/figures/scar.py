"""Pressure and wear scar of a cylinder or a sphere on a flat, over x."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from numpy.typing import NDArray

from studyrunner.report.drawing import (
    COLOURS,
    Drawing,
    add_colour_bar,
    add_legend,
    line_style,
    new_panel,
    new_panels,
    set_from_zero,
    title_at,
)
from studyrunner.result.scars import Scar
from studyrunner.result.scene_pairs import depths, last_depth
from studyrunner.result.units import scale_for
from studyrunner.result.view import Result, as_sentences

_NO_DEPTH = 1e-15
"""m. A depth below this is round-off: it is far less than an atom."""


def draw_scar_pressure(result: Result, scar: Scar) -> Drawing:
    """Mean pressure over x at the first and the last cycle count."""
    shown = result.shown_point()
    kept = sorted({0, result.last_kept(shown)})
    values = [np.asarray(result.at("mean_pressure", shown, cycle).values, dtype=float) for cycle in kept]
    scale, along = scale_for("Pa", *values), scale_for("m", scar.x)
    figure, panel = new_panel(3.2)
    for number, (cycle, pressure) in enumerate(zip(kept, values, strict=True)):
        at = scar.x[scar.line]
        panel.plot(
            along(at), scale(pressure[scar.pairs[scar.line]]), label=result.cycle_label(cycle), **line_style(number)
        )
    set_from_zero(panel, scale(max(float(np.nanmax(each)) for each in values)).item())
    panel.set_xlabel(along.label("x"))
    panel.set_ylabel(scale.label("mean pressure"))
    add_legend(figure)
    largest = [
        f"{scale.show(float(np.nanmax(each)))} ({result.cycle_label(cycle)})"
        for cycle, each in zip(kept, values, strict=True)
    ]
    text = as_sentences(
        f"Mean over a period. Largest: {', '.join(largest)}",
        _how_much(scar),
    )
    return Drawing("mean_pressure", title_at(result, "Mean pressure over x"), text, figure)


def draw_scar_depth(result: Result, scar: Scar) -> Drawing:
    """Depth over x before and after wear, downwards as the surface sinks, with a measured one where there is one; of a
    sphere a map on the left.
    """
    shown = result.shown_point()
    last, after = result.last_kept(shown), last_depth(result, shown)
    measured = result.measured
    scale = scale_for("m", after, *([measured.depth] if measured else []))
    along = scale_for("m", scar.x)
    if scar.width:
        figure, panels = new_panels(1, 2, 3.4, width_ratios=(1.0, 1.2))
        beside, panel = panels[0]
        norm = Normalize(0.0, scale(float(np.nanmax(after))).item())
        _draw_map(beside, scar, scale(after), norm, along.factor)
        beside.set_xlabel(along.label("x"))
        beside.set_ylabel(along.label("y"))
        add_colour_bar(figure, np.array([beside]), norm, scale.label("wear depth"), fraction=0.05)
    else:
        figure, panel = new_panel(3.4)
    at = along(scar.x[scar.line])
    pairs = scar.pairs[scar.line]
    before = depths(result, shown)[0]
    unworn = np.zeros_like(after) if np.isnan(before).all() else before
    panel.plot(at, scale(unworn[pairs]), color="0.4", linewidth=1.0, linestyle="--", label="before")
    if result.has("wear_depth_error"):
        wrong = np.asarray(result.at("wear_depth_error", shown, last).values, dtype=float)
        low, high = scale(np.maximum(after - wrong, 0.0)[pairs]), scale((after + wrong)[pairs])
        panel.fill_between(at, low, high, color=COLOURS[0], alpha=0.25, linewidth=0.0, label="estimated error")
    panel.plot(at, scale(after[pairs]), label=f"after {result.cycle_label(last)}", **line_style(0))
    if measured is not None:
        panel.plot(along(measured.x), scale(measured.depth), color=COLOURS[1], linewidth=1.2, label="measured")
    # a measured profile has piled-up edges above the surface
    panel.set_xlim(1.02 * float(np.min(at)), 1.02 * float(np.max(at)))
    panel.invert_yaxis()
    panel.set_xlabel(along.label("x"))
    panel.set_ylabel(scale.label("depth"))
    add_legend(figure)
    worn = np.abs(scar.x[scar.line][after[pairs] > _NO_DEPTH])
    text = as_sentences(
        f"{result.when(last, 'after').capitalize()}. Deepest: {scale.show(float(np.nanmax(after)))}",
        f"Worn from x = {along.show(float(worn.min()))} to {along.show(float(worn.max()))} on both sides",
        "The depth is the sum of both bodies",
        _how_much(scar),
        "" if measured is None else f"Measured: {measured.name}",
    )
    return Drawing("worn_profile", title_at(result, "Wear scar"), text, figure)


def _draw_map(panel: Axes, scar: Scar, values: NDArray[np.float64], norm: Normalize, milli: float) -> None:
    """Square patches at their places; nothing where there is none."""
    columns, rows = (np.round(each / scar.width - 0.5).astype(int) for each in (scar.x, scar.y))
    low = int(min(columns.min(), rows.min()))
    grid = np.full((1 - 2 * low - 1, 1 - 2 * low - 1), np.nan)
    grid[rows - low, columns - low] = values[scar.pairs]
    edges = np.arange(low, -low + 1) * scar.width * milli
    panel.grid(visible=False)
    panel.pcolormesh(edges, edges, np.ma.masked_invalid(grid), norm=norm)
    panel.set_aspect("equal")


def _how_much(scar: Scar) -> str:
    part = "a quarter" if scar.width else "one half"
    through = ", here along x through the middle" if scar.width else ""
    return f"The contact is symmetric: {part} is computed, the whole is drawn{through}"

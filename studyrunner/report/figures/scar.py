"""Pressure and wear scar of a cylinder or a sphere on a flat, over x."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from studyrunner.report.panels import (
    COLOURS,
    FloatArray,
    add_colour_bar,
    add_legend,
    line_style,
    new_panel,
    new_panels,
    set_from_zero,
)
from studyrunner.result.scars import Scar
from studyrunner.result.scene_pairs import NO_DEPTH, depths, last_depth
from studyrunner.result.units import scale_for
from studyrunner.result.view import Result, as_sentences


def draw_scar_pressure(result: Result, scar: Scar) -> tuple[Figure, str]:
    """Mean pressure over x at the first and the last cycle count."""
    shown = result.shown_point()
    states = {cycle: result.at("mean_pressure", shown, cycle).values for cycle in (0, result.last_kept(shown))}
    scale, along, (figure, panel) = scale_for("Pa", *states.values()), scale_for("m", scar.x), new_panel(3.2)
    for number, (cycle, pressure) in enumerate(states.items()):
        drawn = scale(pressure[scar.pairs[scar.line]])
        panel.plot(along(scar.x[scar.line]), drawn, label=result.cycle_label(cycle), **line_style(number))
    set_from_zero(panel, panel.dataLim.ymax)
    panel.set_xlabel(along.label("x"))
    panel.set_ylabel(scale.label("mean pressure"))
    add_legend(figure)
    largest = [f"{scale.show(float(np.nanmax(each)))} ({result.cycle_label(cycle)})" for cycle, each in states.items()]
    return figure, as_sentences(f"Mean over a period. Largest: {', '.join(largest)}", _how_much(scar))


def draw_scar_depth(result: Result, scar: Scar) -> tuple[Figure, str]:
    """Depth over x before and after wear, downwards as the surface sinks, with a measured one where there is one; of a
    sphere a map on the left.
    """
    shown, measured = result.shown_point(), result.measured
    last, after = result.last_kept(shown), last_depth(result, shown)
    scale, along = scale_for("m", after, *([measured.depth] if measured else [])), scale_for("m", scar.x)
    figure, panels = new_panels(1, 2 if scar.width else 1, 3.4)
    panel = panels[0, -1]
    if scar.width:
        norm = Normalize(0.0, scale(float(np.nanmax(after))).item())
        _draw_map(panels[0, 0], scar, scale(after), norm, along.factor)
        panels[0, 0].set(xlabel=along.label("x"), ylabel=along.label("y"))
        add_colour_bar(figure, panels[0, :1], norm, scale.label("wear depth"), fraction=0.05)
    at, pairs = along(scar.x[scar.line]), scar.pairs[scar.line]
    before = np.nan_to_num(depths(result, shown)[0])
    panel.plot(at, scale(before[pairs]), color="0.4", linewidth=1.0, linestyle="--", label="before")
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
    panel.set(xlabel=along.label("x"), ylabel=scale.label("depth"))
    add_legend(figure)
    worn = np.abs(scar.x[scar.line][after[pairs] > NO_DEPTH])
    return figure, as_sentences(
        f"{result.when(last, 'after').capitalize()}. Deepest: {scale.show(float(np.nanmax(after)))}",
        f"Worn from x = {along.show(float(worn.min()))} to {along.show(float(worn.max()))} on both sides",
        "The depth is the sum of both bodies",
        _how_much(scar),
        "" if measured is None else f"Measured: {measured.name}",
    )


def _draw_map(panel: Axes, scar: Scar, values: FloatArray, norm: Normalize, factor: float) -> None:
    """Square patches at their places; nothing where there is none."""
    columns, rows = (np.round(each / scar.width - 0.5).astype(int) for each in (scar.x, scar.y))
    low = int(min(columns.min(), rows.min()))
    grid = np.full((-2 * low, -2 * low), np.nan)
    grid[rows - low, columns - low] = values[scar.pairs]
    edges = np.arange(low, -low + 1) * scar.width * factor
    panel.grid(visible=False)
    panel.pcolormesh(edges, edges, np.ma.masked_invalid(grid), norm=norm)
    panel.set_aspect("equal")


def _how_much(scar: Scar) -> str:
    part, through = ("a quarter", ", here along x through the middle") if scar.width else ("one half", "")
    return f"The contact is symmetric: {part} is computed, the whole is drawn{through}"

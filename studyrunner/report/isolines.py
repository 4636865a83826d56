"""Lines of equal value over maps, at levels that the maps of a figure and their colour bar share.

By hand: `clabel` of matplotlib puts labels over the border of a map and over other lines.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Transform
from numpy.typing import NDArray

_MOST_STEPS = 5
_MIDDLE = 0.5
_SIZE = 7.0
"""Points of the text of a level."""
_CHARACTER = 0.62
"""Width of a character over its height."""
_GAP = 1.5
_APART = 3.0
"""Pixels between points of a line."""
_AIR = 1.35
"""Room of a label over its size: panels become smaller when labels of axes are laid out around them."""


def add_isolines(
    panel: Axes, x: NDArray[np.float64], y: NDArray[np.float64], values: NDArray[np.float64], norm: Normalize
) -> None:
    """Lines of equal value over a map whose axes are set, with their levels where there is room for these.

    x (n_x,), y (n_y,): centres of the cells, rising. values (n_y, n_x): as shown; NaN where there is none. norm: from
    zero to the largest value of all maps of the figure. A map of a single row or column has no lines.
    """
    if min(values.shape) < 2 or not np.isfinite(values).any():
        return
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    levels = [level for level in find_levels(norm) if low < level < high]
    if not levels:
        return
    colours = [_colour(norm, level) for level in levels]
    lines = panel.contour(x, y, np.ma.masked_invalid(values), levels, colors=colours, linewidths=0.7)
    panel.apply_aspect()
    figure = panel.figure
    assert figure is not None
    scale = 72.0 / figure.dpi
    border = np.array(panel.get_window_extent().get_points()) * scale
    drawn = [_points_on(path, panel.transData) * scale for path in lines.get_paths()]
    taken: list[NDArray[np.float64]] = []
    for number, level in enumerate(levels):
        text = f"{level:.4g}"
        others = np.concatenate([np.empty((0, 2)), *drawn[:number], *drawn[number + 1 :]])
        place = _find_room(drawn[number], len(text), border, others, taken)
        if place is not None:
            taken.append(place)
            x_text, y_text = panel.transData.inverted().transform(place / scale)
            halo = [withStroke(linewidth=1.6, foreground="white")]
            panel.text(x_text, y_text, text, fontsize=_SIZE, ha="center", va="center", path_effects=halo, zorder=5)


def add_colour_bar(figure: Figure, panels: Any, norm: Normalize, label: str, **options: Any) -> None:
    """The colour bar of maps with isolines: ticks and lines at their levels. panels, options: as for `colorbar`."""
    bar = figure.colorbar(ScalarMappable(norm), ax=panels, label=label, **options)
    levels = find_levels(norm)
    bar.set_ticks([norm.vmin or 0.0, *levels], labels=[f"{level:.4g}" for level in (norm.vmin or 0.0, *levels)])
    for level in levels:
        bar.ax.axhline(level, color=_colour(norm, level), linewidth=0.7)


def find_levels(norm: Normalize) -> list[float]:
    """Levels inside a range of colours, in few digits."""
    low, high = norm.vmin or 0.0, norm.vmax or 1.0
    return [float(level) for level in MaxNLocator(_MOST_STEPS).tick_values(low, high) if low < level < high]


def _colour(norm: Normalize, level: float) -> str:
    """Dark on the bright half of the colour map, bright on the dark one."""
    return "black" if norm(level) > _MIDDLE else "white"


def _points_on(path: Path, transform: Transform) -> NDArray[np.float64]:
    """Points (n, 2) close to each other on a path of several lines, in pixels."""
    found = [np.empty((0, 2))]
    for polygon in path.to_polygons(transform, closed_only=False):
        line = np.asarray(polygon)
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
        at = np.linspace(0.0, along[-1], 2 + int(along[-1] / _APART))
        found.append(np.stack([np.interp(at, along, axis) for axis in line.T], axis=1))
    return np.concatenate(found)


def _find_room(
    line: NDArray[np.float64],
    n_characters: int,
    border: NDArray[np.float64],
    others: NDArray[np.float64],
    taken: list[NDArray[np.float64]],
) -> NDArray[np.float64] | None:
    """Centre (2,) of a label on or beside a line (n, 2), far from others; None where it would cover one of these.

    All in points. border (2, 2): lower left and upper right corner of the panel. others (n_others, 2): points of the
    other lines. taken: centres of the labels so far.
    """
    size = _SIZE * np.array([_CHARACTER * n_characters, 1.0])
    sideways = np.array([0.5 * size[0] + _GAP, 0.0])
    at = np.concatenate([line, line + sideways, line - sideways])
    inside = np.minimum(at - border[0], border[1] - at) - 0.5 * _AIR * size
    free = (inside >= 0.0).all(axis=1)
    # nor may another line pass between a label and its own
    near = np.abs(at[:, None] - others) < 0.5 * size + np.array([2.0 * _GAP, 0.0])
    covers = np.logical_and.reduce(near, axis=2).any(axis=1)
    # a border is as good as another label at twice its distance
    distance = 2.0 * inside.min(axis=1)
    for other in taken:
        away = np.abs(at - other)
        free &= (away >= _AIR * size).any(axis=1)
        distance = np.minimum(distance, np.hypot(*away.T))
    free &= ~covers
    if not free.any():
        return None
    found: NDArray[np.float64] = at[int(np.argmax(np.where(free, distance, -np.inf)))]
    return found

"""Where the contact pairs of each surface lie: on a grid, in a plane, or nowhere that the file says; maps of them."""

from __future__ import annotations

import contextlib
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from studyrunner.report.panels import FloatArray, add_colour_bar, add_map, is_narrow, label_outer, new_panels
from studyrunner.result.pairs import Grid, contact_pairs, find_grid
from studyrunner.result.view import Result
from studyrunner.system.progress import count
from studyrunner.units import Scale

JOINT_WORDS = {"dovetail_sector": ("axial", "up the flank")}
"""The two directions in a contact surface in words, by the model of the scene: those of its tangents, too."""

_ORIGIN = "Axial 0 is the leading edge, up the flank 0 the inner end"
_LONE, _SLIM = 1e-3, 0.2  # m; width of a single row of pairs, or this part of its length where that is less
_STRAIGHT = 0.999
_MOST_FLANKS, _SLENDER, _LOW, _LABEL_WIDTH = 3, 0.12, 0.4, 14


@dataclass(frozen=True)
class Cells:
    """A grid of pairs. x (n_x,), y (n_y,): m, rising from 0; y towards the line farther from the origin. pair (n_y,
    n_x): index along the pairs of the flank. x_edges (n_x + 1,), y_edges (n_y + 1,): of the cells, m.
    """

    x: FloatArray
    y: FloatArray
    pair: NDArray[np.intp]
    x_edges: FloatArray
    y_edges: FloatArray


@dataclass(frozen=True)
class Flank:
    """One contact surface. pairs (n,): indices along `contact`. area (n,): m2.

    cells: of the grid on which they lie; None where they lie on none. seen (n, 2): positions in the plane of the
    surface, m; None where the file has no positions. directions: what the two directions are called.
    """

    surface: str
    pairs: NDArray[np.intp]
    area: FloatArray
    cells: Cells | None = None
    seen: FloatArray | None = None
    directions: tuple[str, str] = ("", "")

    @property
    def origin(self) -> str:
        """Where the two directions begin; empty where this is not known."""
        return _ORIGIN if self.directions in JOINT_WORDS.values() else ""

    @property
    def height_over_width(self) -> float:
        """Of the surface as it is drawn."""
        return 0.75 if self.cells is None else float(np.ptp(self.cells.y_edges) / np.ptp(self.cells.x_edges))


def find_flanks(result: Result) -> tuple[Flank, ...]:
    """The contact surfaces of a file, in order of first appearance; a single one where the file has no labels."""
    found = contact_pairs(result, result.shown)
    area = np.where(np.isfinite(found.area), found.area, 1.0)
    words, flanks = JOINT_WORDS.get(str(result.study.get("scene", {}).get("model"))), []
    for surface in dict.fromkeys(found.surface.tolist()):
        pairs = np.flatnonzero(found.surface == surface)
        flank, own = Flank(surface or "contact", pairs, area[pairs]), found.position[pairs]
        if np.isfinite(own).all():
            centred, cells = own - own.mean(axis=0), None
            _, _, plane = np.linalg.svd(np.vstack([centred, np.zeros((3, 3))]), full_matrices=False)
            largest = np.argmax(np.abs(np.round(plane, 6)), axis=1)[:, None]
            plane = plane * np.sign(np.take_along_axis(plane, largest, axis=1))
            seen = centred @ plane[:2].T
            with contextlib.suppress(ValueError):
                cells = _build_cells(find_grid(own), flank.area) if len(own) > 1 else None
            if cells is not None:
                first, across = own[cells.pair[0]], own[cells.pair[:, 0]]
                plane = np.stack([first[-1] - first[0], across[-1] - across[0]])
            named = words if words and (cells is None or len(cells.x) > 1) else (_name(plane[0]), _name(plane[1]))
            flank = replace(flank, cells=cells, seen=seen, directions=named)
        flanks.append(flank)
    return tuple(flanks)


def _name(direction: FloatArray) -> str:
    """An axis of the mesh, or the components of a direction."""
    unit = direction / (float(np.linalg.norm(direction)) or 1.0)
    axis = int(np.argmax(np.abs(unit)))
    along = f"along ({', '.join(f'{each + 0.0:.2g}' for each in unit)})" if unit.any() else "across"
    return "xyz"[axis] if unit[axis] > _STRAIGHT else along


def _build_cells(grid: Grid, area: FloatArray) -> Cells:
    """Cells about halfway between the pairs, as wide as the areas of their lines say."""
    x, y, pair = grid.along, grid.across[-1] - grid.across[::-1], grid.pair[::-1]
    total, lone = float(area.sum()), min(_LONE, _SLIM * float(max(x[-1], y[-1])))
    x_share, y_share = (np.r_[0.0, np.cumsum(area[pair].sum(axis=axis))] / total for axis in (0, 1))
    x_length, y_length = _length(x, x_share), _length(y, y_share)
    if len(x) == len(y) == 2:
        x_length, y_length = np.sqrt(total / (x[1] * y[1])) * np.array([x[1], y[1]])
    elif 2 in (len(x), len(y)):
        x_length, y_length = np.fmin([x_length, y_length], [total / y_length, total / x_length])
    return Cells(x, y, pair, _edges(x, x_share, x_length, lone), _edges(y, y_share, y_length, lone))


def _length(at: FloatArray, share: FloatArray) -> float:
    """Length, m, of lines at rising positions (n,) whose cells have shares (n + 1,) of the area up to them; or NaN."""
    return float(np.polyfit(share[1:-1], 0.5 * (at[1:] + at[:-1]), 1)[0]) if len(at) > 2 else np.nan


def _edges(at: FloatArray, share: FloatArray, length: float, lone: float) -> FloatArray:
    """Edges (n + 1,) of cells. lone: width of a single one, m."""
    if len(at) == 1:
        return lone * np.array([-0.5, 0.5])
    if len(at) == 2:
        # at most as if a third line stood on each side
        length = float(np.clip(np.nan_to_num(length, nan=np.inf), at[1], 2.0 * at[1]))
    start = float(np.mean(0.5 * (at[1:] + at[:-1]) - length * share[1:-1]))
    return np.asarray(start + length * share)


# --- maps ---


def most_of_flanks(result: Result, *values: FloatArray) -> tuple[tuple[Flank, ...], str]:
    """Surfaces with the largest values (n_contact,), as many as fit, none without positions; how they are drawn."""
    flanks = find_flanks(result)
    if any(flank.seen is None for flank in flanks):
        return (), ""
    largest = [max(float(np.nanmax(value[flank.pairs])) for value in values) for flank in flanks]
    kept = tuple(flanks[number] for number in sorted(np.argsort(largest)[::-1][:_MOST_FLANKS]))
    others, on_grid = len(flanks) - len(kept), all(flank.cells is not None for flank in kept)
    said = "One cell is one contact pair, as large as its area"
    said = said if on_grid else "The pairs lie on no grid: one dot is one contact pair"
    return kept, f"{said}. {count(others, 'more surface')} with lower values in the file" if others else said


def largest_pair(result: Result, values: FloatArray, scale: Scale) -> str:
    """The largest of values (n_contact,) in words, with its pair."""
    return f"{scale.show(float(np.nanmax(values)))} at pair {result.dataset['contact'].values[np.nanargmax(values)]}"


def map_height(flanks: Sequence[Flank]) -> float:
    """Height of a row of maps of flanks side by side, inches."""
    return 6.0 / len(flanks) * min(1.2, max(0.28, max(flank.height_over_width for flank in flanks)))


def draw_fields(flanks: Sequence[Flank], fields: Mapping[str, FloatArray], scale: Scale, text: str) -> Figure:
    """One row of maps a field (n_contact,), one column a flank, all in one colour scale."""
    figure, panels = new_panels(len(fields), len(flanks), len(fields) * (map_height(flanks) + 0.62))
    largest = max(float(np.nanmax(values, initial=0.0)) for values in fields.values())
    norm = Normalize(0.0, scale(largest).item() or 1.0)
    for row, (label, values) in zip(panels, fields.items(), strict=True):
        for panel, flank in zip(row, flanks, strict=True):
            draw_field(panel, flank, scale(values[flank.pairs]), norm)
            panel.set_title(f"{flank.surface}, {label}")
    label_outer(panels)
    add_colour_bar(figure, panels, norm, scale.label(text), fraction=0.05)
    return figure


def draw_field(panel: Axes, flank: Flank, values: NDArray[Any], norm: Normalize, **look: Any) -> None:
    """One field (n,) of a flank: cells of its grid, or dots at its pairs."""
    if flank.cells is not None:
        cells = flank.cells
        add_map(panel, 1e3 * cells.x_edges, 1e3 * cells.y_edges, values[cells.pair], norm, **look)
        # cells as they are in the flank, unless it is so slender that too little would be seen
        panel.set_aspect("equal" if flank.height_over_width > (_LOW if is_narrow() else _SLENDER) else "auto")
    elif flank.seen is not None:
        look = {"edgecolors": "0.3", "linewidths": 0.4, "s": 160 if look else 60, **look}
        panel.grid(visible=False)
        x, y = 1e3 * flank.seen.T
        panel.scatter(x, y, c=values, norm=norm, label="pairs", **look)
        panel.margins(0.12)
        panel.set_aspect("equal", adjustable="datalim")
    panel.set_xlabel(f"{flank.directions[0]} (mm)")
    panel.set_ylabel(textwrap.fill(f"{flank.directions[1]} (mm)", _LABEL_WIDTH, break_on_hyphens=False))

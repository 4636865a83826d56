"""Where the contact pairs of each surface lie: on a grid, in a plane, or nowhere that the file says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studyrunner.result.grid import Grid, find_grid
from studyrunner.result.view import Result

JOINT_WORDS = {"dovetail_sector": ("axial", "up the flank")}
"""The two directions in a contact surface in words, by the model of the scene: those of its tangents, too."""

_ORIGIN = "Axial 0 is the leading edge, up the flank 0 the inner end"

_LONE, _SLIM = 1e-3, 0.2
"""Width that a single row of pairs is drawn with, m; that of its length where this is less, as under a cylinder."""
_STRAIGHT = 0.999


@dataclass(frozen=True)
class Cells:
    """A grid of pairs. x (n_x,), y (n_y,): m, rising from 0; y towards the line farther from the origin. pair (n_y,
    n_x): index along the pairs of the flank. x_edges (n_x + 1,), y_edges (n_y + 1,): of the cells, m.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    pair: NDArray[np.intp]
    x_edges: NDArray[np.float64]
    y_edges: NDArray[np.float64]


@dataclass(frozen=True)
class Flank:
    """One contact surface. pairs (n,): indices along `contact`. area (n,): m2.

    cells: of the grid on which they lie; None where they lie on none. seen (n, 2): positions in the plane of the
    surface, m; None where the file has no positions. directions: what the two directions are called.
    """

    surface: str
    pairs: NDArray[np.intp]
    area: NDArray[np.float64]
    cells: Cells | None
    seen: NDArray[np.float64] | None
    directions: tuple[str, str]

    @property
    def origin(self) -> str:
        """Where the two directions begin; empty where this is not known."""
        return _ORIGIN if self.directions in JOINT_WORDS.values() else ""

    @property
    def height_over_width(self) -> float:
        """Of the surface as it is drawn."""
        if self.cells is not None:
            return float(np.ptp(self.cells.y_edges) / np.ptp(self.cells.x_edges))
        return 0.75


def find_flanks(result: Result) -> tuple[Flank, ...]:
    """The contact surfaces of a file, in order of first appearance; a single one where the file has no labels."""
    coordinates = result.dataset.coords
    n_pairs = result.dataset.sizes["contact"]
    labels = np.full(n_pairs, "contact")
    if "contact_surface" in coordinates:
        labels = coordinates["contact_surface"].values.astype(str)
    area = np.ones(n_pairs)
    if "contact_area" in coordinates:
        area = np.asarray(coordinates["contact_area"].values, dtype=float)
    positions = np.full((n_pairs, 3), np.nan)
    if all(f"contact_{axis}" in coordinates for axis in "xyz"):
        positions = np.stack([coordinates[f"contact_{axis}"].values for axis in "xyz"], axis=1)
    words = JOINT_WORDS.get(str(result.study.get("scene", {}).get("model")))
    return tuple(
        _build_flank(surface or "contact", np.flatnonzero(labels == surface), area, positions, words)
        for surface in dict.fromkeys(labels.tolist())
    )


def _build_flank(
    surface: str,
    pairs: NDArray[np.intp],
    area: NDArray[np.float64],
    positions: NDArray[np.float64],
    words: tuple[str, str] | None,
) -> Flank:
    own = positions[pairs]
    if not np.isfinite(own).all():
        return Flank(surface, pairs, area[pairs], None, None, ("", ""))
    centred = own - own.mean(axis=0)
    _, _, plane = np.linalg.svd(np.vstack([centred, np.zeros((3, 3))]), full_matrices=False)
    largest = np.argmax(np.abs(np.round(plane, 6)), axis=1)[:, None]
    plane = plane * np.sign(np.take_along_axis(plane, largest, axis=1))
    seen, cells = centred @ plane[:2].T, None
    try:
        grid = find_grid(own) if len(own) > 1 else None
    except ValueError:
        grid = None
    if grid is not None:
        cells = _build_cells(grid, area[pairs])
        across = own[cells.pair[:, 0]]
        plane = np.stack([own[cells.pair[0, -1]] - own[cells.pair[0, 0]], across[-1] - across[0]])
        if len(cells.x) == 1:
            words = None
    return Flank(surface, pairs, area[pairs], cells, seen, words or (_name(plane[0]), _name(plane[1])))


def _name(direction: NDArray[np.float64]) -> str:
    """An axis of the mesh, or the components of a direction."""
    size = float(np.linalg.norm(direction))
    if size == 0.0:
        return "across"
    unit = direction / size
    axis = int(np.argmax(np.abs(unit)))
    if unit[axis] > _STRAIGHT:
        return "xyz"[axis]
    return f"along ({', '.join(f'{each:.2g}' for each in np.round(unit, 2) + 0.0)})"


def _build_cells(grid: Grid, area: NDArray[np.float64]) -> Cells:
    """Cells whose edges are halfway between the pairs; those at the border are as wide as their areas say."""
    x, y, pair = grid.along, grid.across[-1] - grid.across[::-1], grid.pair[::-1]
    sums, total = (area[pair].sum(axis=0), area[pair].sum(axis=1)), float(area.sum())
    x_edges, y_edges = (_edges(at, own) for at, own in zip((x, y), sums, strict=True))
    # of two lines the areas say how far they reach where the length across them is known
    if len(y) == 2 and len(x) > 2:
        y_edges = _stretch(y, total / float(np.ptp(x_edges)))
    elif len(x) == 2 and len(y) > 2:
        x_edges = _stretch(x, total / float(np.ptp(y_edges)))
    elif len(x) == len(y) == 2:
        stretch = np.sqrt(total / (x[1] * y[1]))
        x_edges, y_edges = _stretch(x, stretch * x[1]), _stretch(y, stretch * y[1])
    lone = max(min(_LONE, _SLIM * float(max(np.ptp(x), np.ptp(y)))), 1e-9)
    x_edges, y_edges = (
        np.array([-0.5 * lone, 0.5 * lone]) if len(edges) == 2 else edges for edges in (x_edges, y_edges)
    )
    return Cells(x, y, pair, x_edges, y_edges)


def _edges(at: NDArray[np.float64], sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Edges (n + 1,) of cells at rising positions (n,), by the areas (n,) of the lines of cells."""
    middle = 0.5 * (at[1:] + at[:-1])
    beyond = np.zeros(2)
    if len(at) > 2:
        gaps = np.array([at[1] - at[0], at[-1] - at[-2]])
        per_length = sums[1:-1].sum() / (middle[-1] - middle[0])
        beyond = np.clip(sums[[0, -1]] / per_length - 0.5 * gaps, 0.0, 0.5 * gaps)
    return np.concatenate([[at[0] - beyond[0]], middle, [at[-1] + beyond[1]]])


def _stretch(at: NDArray[np.float64], length: float) -> NDArray[np.float64]:
    """Edges (3,) of two cells that are so long together, m; at most as if a third one stood on each side."""
    beyond = 0.5 * float(np.clip(length - at[1], 0.0, at[1]))
    return np.array([at[0] - beyond, 0.5 * (at[0] + at[1]), at[1] + beyond])

"""Contact pairs of one scene: where they lie, how deep they are worn, the grid and the cells of those of a surface.

Where the scenes of a study differ in their pairs, a figure shows one scene.
"""

import contextlib
import math
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy  # whose parts are loaded at their first use
from numpy.typing import NDArray

from studyrunner.coordinates import COORDINATES, SCENE
from studyrunner.result.view import Point, Result

NO_DEPTH = 1e-15
"""Wear depth, m, below which it is round-off: far less than an atom."""

Floats = NDArray[np.float64]
Places = NDArray[np.intp]
Scar = tuple[Floats, Places]
"""Places x (n,), m, ascending, and the pairs (n,) at them, index along `contact`."""

OF_PAIRS = (*(name for name, entry in COORDINATES.items() if entry.dimensions == ("contact",)), *SCENE["mesh"])
"""Variables that say where the pairs are."""

_EXISTS, _SECTOR = "contact_exists", "contact_sector"
_ALIGNED = 0.05  # of the smallest distance between two pairs: pairs are on a line of the grid if they miss it by less
_LONE, _SLIM = 1e-3, 0.2  # m; width of a single row of pairs, or this part of its length where that is less
_STRAIGHT = 0.999


@dataclass(frozen=True)
class Pairs:
    """The contact pairs of one point. position (n, 3): m, area (n,): m2, surface (n,): labels; NaN, or "contact", where
    the file has none.
    """

    position: Floats
    area: Floats
    surface: NDArray[np.str_]


@dataclass(frozen=True)
class Grid:
    """The pairs of a surface as a grid. pair (n_across, n_along): positions in the list of pairs.

    across (n_across,), along (n_along,): m, distances from the first line of the grid, which is at 0.
    """

    pair: Places
    across: Floats
    along: Floats


@dataclass(frozen=True)
class Flank:
    """One contact surface. pairs (n,): indices along `contact`. area (n,): m2.

    grid: on which they lie, the line farthest from the origin last; None where they lie on none. edges: of its cells
    along (n_along + 1,) and across (n_across + 1,), m. seen (n, 2): positions in the plane of the surface, m; None
    where the file has no positions. directions: what the two directions, along and across, are called.
    """

    surface: str
    pairs: Places
    area: Floats
    grid: Grid | None = None
    edges: tuple[Floats, Floats] | None = None
    seen: Floats | None = None
    directions: tuple[str, str] = ("", "")

    @property
    def height_over_width(self) -> float:
        """Of the surface as it is drawn."""
        return 0.75 if self.edges is None else float(np.ptp(self.edges[1]) / np.ptp(self.edges[0]))


# --- the pairs of one scene ---


def contact_pairs(result: Result, point: Point) -> Pairs:
    """Where the pairs of a point are."""

    def read(name: str, missing: object) -> NDArray[Any]:
        values = result.at(name, point).values if result.has(name) else missing
        return np.broadcast_to(np.asarray(values), (result.dataset.sizes["contact"],))

    position = np.stack([read(f"contact_{axis}", np.nan) for axis in "xyz"], axis=1).astype(float)
    surface = read("contact_surface", "contact").astype(np.str_)
    return Pairs(position, read("contact_area", np.nan).astype(float), surface)


def axes_of_scenes(result: Result, names: Collection[str] = OF_PAIRS) -> tuple[str, ...]:
    """Axes along which variables of the scene differ; none where the file has one scene."""
    differ = {axis for name in names if result.has(name) for axis in result.dataset[name].dims}
    return tuple(axis for axis in result.axes if axis in differ)


def of_shown_scene(result: Result, names: Collection[str] = OF_PAIRS) -> Result:
    """The points whose scene is that of the shown point as far as these variables say, with its contact pairs alone; of
    a ring those of `worst_sector`.
    """
    axes, point = axes_of_scenes(result, names), result.shown
    if not axes and not result.has(_EXISTS) and not result.has(_SECTOR):
        return result
    dataset = result.dataset.isel({axis: [point[axis]] for axis in axes})
    for name in filter(result.has, names):
        variable = dataset[name]
        dataset[name] = variable.isel({axis: 0 for axis in axes if axis in variable.dims}, drop=True)
    if _EXISTS in names and result.has(_EXISTS):
        dataset = dataset.isel(contact=pairs_of_scene(result, point)).drop_vars(_EXISTS)
    if _SECTOR in names and result.has(_SECTOR):
        # pairs of all sectors stand at the same places
        dataset = dataset.isel(contact=np.flatnonzero(dataset[_SECTOR].values == worst_sector(result)))
    return replace(result, dataset=dataset, fixed=(*result.fixed, *(axis for axis in axes if axis in result.varying)))


def worst_sector(result: Result) -> int:
    """The sector of a ring that wears most at the shown point, or where none does the one that vibrates most."""
    last = result.last_reached(result.shown)
    names = [name for name in ("sector_worn_volume", "sector_amplitude") if result.has(name)]
    values = [np.nan_to_num(result.at(name, result.shown, last).values) for name in names]
    return int(next((each for each in values if each.any()), values[0]).argmax())


def pairs_of_scene(result: Result, point: Point) -> Places:
    """Places along `contact` of the pairs that the scene of a point has."""
    if not result.has(_EXISTS):
        return np.arange(result.dataset.sizes["contact"])
    return np.flatnonzero(result.at(_EXISTS, point).values)


def has_depths(result: Result) -> bool:
    """Whether the file holds wear depths of the pairs, be it of the last count only."""
    return result.has("wear_depth") or result.has("wear_depth_last")


def depths(result: Result, point: Point) -> Floats:
    """Wear depth (n_cycles, n_contact), m, of one point; NaN at the counts of which the file holds none."""
    if result.has("wear_depth"):
        return np.asarray(result.at("wear_depth", point).values, dtype=float)
    depth = np.full((len(result.cycles), result.dataset.sizes["contact"]), np.nan)
    depth[result.last_reached(point)] = result.at("wear_depth_last", point).values
    return depth


def last_depth(result: Result, point: Point) -> Floats:
    """Wear depth (n_contact,), m, of one point at the last count that it has reached; 0 where the file has none."""
    if not has_depths(result):
        return np.zeros(result.dataset.sizes["contact"])
    return np.asarray(depths(result, point)[result.last_reached(point)])


# --- the grid in which the pairs of a flank lie ---


def find_grid(position: Floats) -> Grid:
    """The grid in which points (n, 3), m, lie, in any order and any orientation: equal straight lines side by side.

    The lines may be unequally spaced, shifted and on a curved surface. ValueError: the points are no such grid.
    """
    if not np.isfinite(position).all():
        raise ValueError("the positions of its contact pairs are not known.")
    if len(position) == 1:
        return Grid(np.zeros((1, 1), dtype=np.intp), np.zeros(1), np.zeros(1))
    spacing = scipy.spatial.cKDTree(position).query(position, k=2)[0][:, 1].min()
    if spacing <= 1e-9 * np.ptp(position, axis=0).max():
        raise ValueError("two of its contact pairs are in one place.")
    away = position - position[0]
    grids: list[tuple[float, float, int, Floats, Places]] = []
    # A line of the grid through the first point passes through others. Far ones give its direction best and come first.
    tried = np.zeros(len(away), dtype=np.bool_)
    for other in np.argsort(-np.linalg.norm(away, axis=1), kind="stable")[:-1]:
        if tried[other]:
            continue
        direction = away[other] / np.linalg.norm(away[other])
        direction *= np.sign(direction[np.argmax(np.round(np.abs(direction), 6))])
        tried |= np.linalg.norm(np.cross(away, direction), axis=1) <= _ALIGNED * spacing
        lines = _parallel_lines(position, direction, _ALIGNED * spacing)
        if lines is not None:
            length = np.ptp(position[lines[0]] @ direction) / spacing
            grids.append((round(float(length), 1), round(abs(float(direction[2])), 6), -len(grids), direction, lines))
    if not grids:
        raise ValueError("its contact pairs do not lie on a grid.")
    *_, direction, lines = max(grids, key=lambda each: each[:3])
    decimals = 6 - math.floor(math.log10(spacing))  # two flanks of one shape get the same coordinates
    centre = position[lines].mean(axis=1)
    centre -= np.outer(centre @ direction, direction)
    order = np.argsort((centre - centre.mean(axis=0)) @ np.linalg.svd(centre - centre.mean(axis=0))[2][0])
    inwards = np.linalg.norm(centre[order[0]]) - np.linalg.norm(centre[order[-1]])
    if abs(inwards) <= _ALIGNED * spacing:  # both ends are equally far: the larger component of the way decreases
        way = centre[order[0]] - centre[order[-1]]
        inwards = way[np.argmax(np.round(np.abs(way), decimals))]
    order = order if inwards >= 0 else order[::-1]
    steps = np.diff(centre[order], axis=0)
    if np.any(np.sum(steps[1:] * steps[:-1], axis=1) <= 0):
        raise ValueError("its contact pairs do not lie on a grid: their lines are not side by side.")
    along = position[lines] @ direction
    return Grid(
        lines[order],
        np.round(np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps, axis=1))]), decimals),
        np.round((along - along[:, :1]).mean(axis=0), decimals),
    )


def _parallel_lines(position: Floats, direction: Floats, tolerance: float) -> Places | None:
    """Points (n_lines, n_points_a_line) on lines of a direction, in its order; None if the lines are not all equal."""
    along = position @ direction
    across = position - np.outer(along, direction)
    # Most directions fail for a few points already: this saves the search for all.
    some = across[:: max(1, len(across) // 6)]
    alike = np.sum(np.linalg.norm(across[None] - some[:, None], axis=2) <= tolerance, axis=1)
    if len(across) % alike[0] or np.any(alike != alike[0]):
        return None
    tree = scipy.spatial.cKDTree(across)
    first = np.array([min(near) for near in tree.query_ball_point(tree.data, tolerance)])
    counts = np.unique(first, return_counts=True)[1]
    if np.any(counts != counts[0]):
        return None
    lines: Places = np.lexsort((along, first)).reshape(len(counts), counts[0])
    from_first = along[lines] - along[lines[:, :1]]
    return lines if np.all(np.ptp(from_first, axis=0) <= tolerance) else None


# --- the surfaces, and the cells of their pairs ---


def find_flanks(result: Result) -> tuple[Flank, ...]:
    """The contact surfaces of a file, in order of first appearance; a single one where the file has no labels."""
    pairs = contact_pairs(result, result.shown)
    area = np.where(np.isfinite(pairs.area), pairs.area, 1.0)
    words, flanks = directions_in_words(result), []
    for surface in dict.fromkeys(pairs.surface.tolist()):
        members = np.flatnonzero(pairs.surface == surface)
        flank, position = Flank(surface or "contact", members, area[members]), pairs.position[members]
        if np.isfinite(position).all():
            centred, grid, edges = position - position.mean(axis=0), None, None
            _, _, plane = np.linalg.svd(np.vstack([centred, np.zeros((3, 3))]), full_matrices=False)
            largest = np.argmax(np.abs(np.round(plane, 6)), axis=1)[:, None]
            plane = plane * np.sign(np.take_along_axis(plane, largest, axis=1))
            seen = centred @ plane[:2].T
            with contextlib.suppress(ValueError):
                grid = find_grid(position) if len(position) > 1 else None
            if grid is not None:
                # from its last line on
                grid = Grid(grid.pair[::-1], grid.across[-1] - grid.across[::-1], grid.along)
                first, across = position[grid.pair[0]], position[grid.pair[:, 0]]
                plane, edges = np.stack([first[-1] - first[0], across[-1] - across[0]]), _cell_edges(grid, flank.area)
            named = words if words and (grid is None or len(grid.along) > 1) else (_name(plane[0]), _name(plane[1]))
            flank = replace(flank, grid=grid, edges=edges, seen=seen, directions=named)
        flanks.append(flank)
    return tuple(flanks)


def directions_in_words(result: Result) -> tuple[str, str] | None:
    """What the two directions in a contact surface, those of its tangents, are called; None where nobody has said."""
    words = str(result.dataset.attrs.get("contact_directions", "")).split(", ")
    return (words[0], words[1]) if len(words) == 2 else None


def _name(direction: Floats) -> str:
    """An axis of the mesh, or the components of a direction."""
    unit = direction / (float(np.linalg.norm(direction)) or 1.0)
    axis = int(np.argmax(np.abs(unit)))
    along = f"along ({', '.join(f'{each + 0.0:.2g}' for each in unit)})" if unit.any() else "across"
    return "xyz"[axis] if unit[axis] > _STRAIGHT else along


def _cell_edges(grid: Grid, area: Floats) -> tuple[Floats, Floats]:
    """Edges of cells about halfway between the pairs, as wide as the areas of their lines say."""
    x, y = grid.along, grid.across
    total, lone = float(area.sum()), min(_LONE, _SLIM * float(max(x[-1], y[-1])))
    x_share, y_share = (np.r_[0.0, np.cumsum(area[grid.pair].sum(axis=axis))] / total for axis in (0, 1))
    x_length, y_length = _length(x, x_share), _length(y, y_share)
    if len(x) == len(y) == 2:
        x_length, y_length = np.sqrt(total / (x[1] * y[1])) * np.array([x[1], y[1]])
    elif 2 in (len(x), len(y)):
        x_length, y_length = np.fmin([x_length, y_length], [total / y_length, total / x_length])
    return _edges(x, x_share, x_length, lone), _edges(y, y_share, y_length, lone)


def _length(at: Floats, share: Floats) -> float:
    """Length, m, of lines at rising positions (n,) whose cells have shares (n + 1,) of the area up to them; or NaN."""
    return float(np.polyfit(share[1:-1], 0.5 * (at[1:] + at[:-1]), 1)[0]) if len(at) > 2 else np.nan


def _edges(at: Floats, share: Floats, length: float, lone: float) -> Floats:
    """Edges (n + 1,) of cells. lone: width of a single one, m."""
    if len(at) == 1:
        return lone * np.array([-0.5, 0.5])
    if len(at) == 2:
        # at most as if a third line stood on each side
        length = float(np.clip(np.nan_to_num(length, nan=np.inf), at[1], 2.0 * at[1]))
    start = float(np.mean(0.5 * (at[1:] + at[:-1]) - length * share[1:-1]))
    return np.asarray(start + length * share)


# --- the whole contact of a cylinder or a sphere on a flat ---


def find_scar(result: Result) -> Scar | None:
    """The line along x through the middle of a contact whose pairs are those of one side, x > 0; None of others.

    Of a contact that is symmetric along y as well the pairs are those of a quarter.
    """
    x, y, _ = contact_pairs(result, result.shown).position.T
    if "x" not in str(result.dataset.attrs.get("contact_mirrored", "")) or not np.isfinite([x, y]).all():
        return None
    row = np.flatnonzero(y <= y.min() + 0.5 * x.min())
    row = row[np.argsort(x[row], kind="stable")]
    return np.r_[-x[row[::-1]], x[row]], np.r_[row[::-1], row]

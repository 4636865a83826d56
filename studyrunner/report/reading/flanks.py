"""Where the contact pairs of each surface lie: on a grid, in a plane, or nowhere that the file says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studyrunner.report.reading.grid import Grid, find_grid
from studyrunner.report.reading.result import Result

_LONE, _SLIM = 1e-3, 0.2
"""Width that a single row of pairs is drawn with, m; that of its length where this is less, as under a cylinder."""


@dataclass(frozen=True)
class Flank:
    """One contact surface. pairs (n,): indices along `contact`. area (n,): m2.

    grid: of them, its `pair` counting along `pairs`; None where they lie on none. seen (n, 2): positions in the plane
    of the surface, m; None where the file has no positions.
    """

    surface: str
    pairs: NDArray[np.intp]
    area: NDArray[np.float64]
    grid: Grid | None
    seen: NDArray[np.float64] | None

    @property
    def edges(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Edges of the cells of the grid along and across, m. Raises ValueError where there is no grid."""
        if self.grid is None:
            raise ValueError(f"the pairs of {self.surface} lie on no grid")
        length = max(float(np.ptp(self.grid.along)), float(np.ptp(self.grid.across)))
        width = min(_LONE, _SLIM * length) if length > 0.0 else _LONE
        return cell_edges(self.grid.along, width), cell_edges(self.grid.across, width)

    @property
    def height_over_width(self) -> float:
        """Of the surface as it is drawn."""
        if self.grid is not None:
            along, across = self.edges
            return float(np.ptp(across) / np.ptp(along))
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
    if all(name in coordinates for name in ("contact_x", "contact_y", "contact_z")):
        positions = np.stack([coordinates[f"contact_{axis}"].values for axis in "xyz"], axis=1)
    found = []
    for surface in dict.fromkeys(labels.tolist()):
        pairs = np.flatnonzero(labels == surface)
        known = bool(np.isfinite(positions[pairs]).all())
        grid = _find_grid(positions[pairs]) if known else None
        found.append(
            Flank(surface or "contact", pairs, area[pairs], grid, _flatten(positions[pairs]) if known else None)
        )
    return tuple(found)


def cell_edges(positions: NDArray[np.float64], width: float = 1.0) -> NDArray[np.float64]:
    """Edges (n + 1,) of cells around rising positions (n,): halfway between them; of this width around a single one."""
    if positions.size == 1:
        return np.array([positions[0] - 0.5 * width, positions[0] + 0.5 * width])
    middle = 0.5 * (positions[1:] + positions[:-1])
    first, last = 2.0 * positions[0] - middle[0], 2.0 * positions[-1] - middle[-1]
    return np.concatenate([[first], middle, [last]])


def _find_grid(positions: NDArray[np.float64]) -> Grid | None:
    """The grid of the pairs of a surface, None where they lie on none or in a single spot."""
    try:
        return find_grid(positions) if len(positions) > 1 else None
    except ValueError:
        return None


def _flatten(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Positions (n, 3) in the plane that fits them best (n, 2); the longest direction first."""
    centred = positions - positions.mean(axis=0)
    _, _, directions = np.linalg.svd(centred, full_matrices=False)
    flat = np.zeros((len(positions), 2))
    kept = min(2, len(directions))
    flat[:, :kept] = centred @ directions[:kept].T
    return flat

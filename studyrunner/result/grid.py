"""The grid in which the pairs of a flank lie."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

_ALIGNED = 0.05  # of the smallest distance between two pairs: pairs are on a line of the grid if they miss it by less


class Grid(NamedTuple):
    """The pairs of a surface as a grid. pair (n_across, n_along): positions in the list of pairs.

    across (n_across,), along (n_along,): m, distances from the first line of the grid, which is at 0.
    """

    pair: NDArray[np.intp]
    across: NDArray[np.float64]
    along: NDArray[np.float64]


def find_grid(position: NDArray[np.float64]) -> Grid:
    """The grid in which points (n, 3), m, lie, in any order and any orientation: equal straight lines side by side.

    The lines may be unequally spaced, shifted and on a curved surface. ValueError: the points are no such grid.
    """
    if not np.isfinite(position).all():
        raise ValueError("the positions of its contact pairs are not known.")
    if len(position) == 1:
        return Grid(np.zeros((1, 1), dtype=np.intp), np.zeros(1), np.zeros(1))
    spacing = cKDTree(position).query(position, k=2)[0][:, 1].min()
    if spacing <= 1e-9 * np.ptp(position, axis=0).max():
        raise ValueError("two of its contact pairs are in one place.")
    away = position - position[0]
    found: list[tuple[float, float, int, NDArray[np.float64], NDArray[np.intp]]] = []
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
            found.append((round(float(length), 1), round(abs(float(direction[2])), 6), -len(found), direction, lines))
    if not found:
        raise ValueError("its contact pairs do not lie on a grid.")
    *_, direction, lines = max(found, key=lambda each: each[:3])
    centre = position[lines].mean(axis=1)
    centre -= np.outer(centre @ direction, direction)
    order = np.argsort((centre - centre.mean(axis=0)) @ np.linalg.svd(centre - centre.mean(axis=0))[2][0])
    inwards = np.linalg.norm(centre[order[0]]) - np.linalg.norm(centre[order[-1]])
    if abs(inwards) <= _ALIGNED * spacing:  # both ends are equally far: the larger component of the way decreases
        way = centre[order[0]] - centre[order[-1]]
        inwards = way[np.argmax(np.round(np.abs(way), 6 - math.floor(math.log10(spacing))))]
    order = order if inwards >= 0 else order[::-1]
    steps = np.diff(centre[order], axis=0)
    if np.any(np.sum(steps[1:] * steps[:-1], axis=1) <= 0):
        raise ValueError("its contact pairs do not lie on a grid: their lines are not side by side.")
    along = position[lines] @ direction
    decimals = 6 - math.floor(math.log10(spacing))  # two flanks of one shape get the same coordinates
    return Grid(
        lines[order],
        np.round(np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps, axis=1))]), decimals),
        np.round((along - along[:, :1]).mean(axis=0), decimals),
    )


def _parallel_lines(
    position: NDArray[np.float64], direction: NDArray[np.float64], tolerance: float
) -> NDArray[np.intp] | None:
    """Points (n_lines, n_points_a_line) on lines of a direction, in its order; None if the lines are not all equal."""
    along = position @ direction
    across = position - np.outer(along, direction)
    # Most directions fail for a few points already: this saves the search for all.
    some = across[:: max(1, len(across) // 6)]
    alike = np.sum(np.linalg.norm(across[None] - some[:, None], axis=2) <= tolerance, axis=1)
    if len(across) % alike[0] or np.any(alike != alike[0]):
        return None
    tree = cKDTree(across)
    first = np.array([min(near) for near in tree.query_ball_point(tree.data, tolerance)])
    counts = np.unique(first, return_counts=True)[1]
    if np.any(counts != counts[0]):
        return None
    lines: NDArray[np.intp] = np.lexsort((along, first)).reshape(len(counts), counts[0])
    from_first = along[lines] - along[lines[:, :1]]
    return lines if np.all(np.ptp(from_first, axis=0) <= tolerance) else None

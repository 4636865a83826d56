"""Contact pairs of one scene, where the scenes of a study differ in them; how deep they are worn."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studyrunner.coordinates import COORDINATES, SCENE
from studyrunner.result.view import Point, Result

EXISTS = "contact_exists"
NO_DEPTH = 1e-15
"""Wear depth, m, below which it is round-off: far less than an atom."""

OF_PAIRS = (*(name for name, entry in COORDINATES.items() if entry.dimensions == ("contact",)), *SCENE["mesh"])
"""Variables that say where the pairs are."""


@dataclass(frozen=True)
class Pairs:
    """The contact pairs of one point. position (n, 3): m, and area (n,): m2, NaN where the file has none. surface (n,):
    labels, "contact" where the file has none.
    """

    position: NDArray[np.float64]
    area: NDArray[np.float64]
    surface: NDArray[np.str_]


def contact_pairs(result: Result, point: Point) -> Pairs:
    """Where the pairs of a point are."""

    def read(name: str, missing: object) -> NDArray[Any]:
        found = result.at(name, point).values if result.has(name) else missing
        return np.broadcast_to(np.asarray(found), (result.dataset.sizes["contact"],))

    position = np.stack([read(f"contact_{axis}", np.nan) for axis in "xyz"], axis=1).astype(float)
    surface = read("contact_surface", "contact").astype(np.str_)
    return Pairs(position, read("contact_area", np.nan).astype(float), surface)


def axes_of_scenes(result: Result, names: Collection[str] = OF_PAIRS) -> tuple[str, ...]:
    """Axes along which variables of the scene differ; none where the file has one scene."""
    found = {axis for name in names if result.has(name) for axis in result.dataset[name].dims}
    return tuple(axis for axis in result.axes if axis in found)


def of_scene(result: Result, point: Point, names: Collection[str] = OF_PAIRS) -> Result:
    """The points whose scene is the one of `point` as far as these variables tell, with its contact pairs alone."""
    axes = axes_of_scenes(result, names)
    if not axes and not result.has(EXISTS):
        return result
    dataset = result.dataset.isel({axis: [point[axis]] for axis in axes})
    for name in names:
        if result.has(name):
            variable = dataset[name]
            dataset[name] = variable.isel({axis: 0 for axis in axes if axis in variable.dims}, drop=True)
    fixed = {axis: result.dataset.sizes[axis] for axis in axes if axis in result.varying}
    if EXISTS in names and EXISTS in dataset.coords:
        dataset = dataset.isel(contact=pairs_of_scene(result, point)).drop_vars(EXISTS)
    return replace(result, dataset=dataset, fixed={**result.fixed, **fixed})


def of_shown_scene(result: Result, names: Collection[str] = OF_PAIRS) -> Result:
    """As `of_scene`, of the point that figures of a single point show."""
    return of_scene(result, result.shown_point(), names)


def pairs_of_scene(result: Result, point: Point) -> NDArray[np.intp]:
    """Places along `contact` of the pairs that the scene of a point has."""
    if not result.has(EXISTS):
        return np.arange(result.dataset.sizes["contact"])
    return np.flatnonzero(result.at(EXISTS, point).values)


def tells_depth(result: Result) -> bool:
    """Whether the file holds wear depths of the pairs, be it of the last count only."""
    return result.has("wear_depth") or result.has("wear_depth_last")


def depths(result: Result, point: Point) -> NDArray[np.float64]:
    """Wear depth (n_cycles, n_contact), m, of one point; NaN at the counts of which the file holds none."""
    if result.has("wear_depth"):
        return np.asarray(result.at("wear_depth", point).values, dtype=float)
    found = np.full((len(result.cycles), result.dataset.sizes["contact"]), np.nan)
    found[result.last_kept(point)] = last_depth(result, point)
    return found


def last_depth(result: Result, point: Point) -> NDArray[np.float64]:
    """Wear depth (n_contact,), m, of one point at the last count that it has reached."""
    if result.has("wear_depth"):
        return np.asarray(result.at("wear_depth", point, result.last_kept(point)).values, dtype=float)
    return np.asarray(result.at("wear_depth_last", point).values, dtype=float)

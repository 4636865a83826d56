"""What another mesh changes, from a result with an axis `mesh`: worn volumes at equal distance to the resonance alone.

The resonance moves with the mesh. At one frequency two meshes are compared at two different distances to it, where one
wears a multiple of the other or nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from studyrunner.result.view import NO_VOLUME, Result

_MESH = "mesh"
_ORDERS = (0.5, 4.0)
"""Orders of convergence, in 1/mesh, with which is extrapolated: 2 for smooth stresses, 1 and less at a sharp edge."""


@dataclass(frozen=True)
class MeshChange:
    """How far the worn volumes of the two finest meshes are apart, relative: in the median and at most.

    meshes: these two. at: "at the resonance", "at equal frequency ratio". limit, order: worn volume, m3, of an
    infinitely fine mesh and order of convergence at the point that wears most; None where three meshes do not show one.
    """

    meshes: tuple[float, float]
    at: str
    median: float
    largest: float
    limit: tuple[float, float] | None


def compare_meshes(result: Result) -> MeshChange | None:
    """The comparison; None without one at equal distance to the resonance."""
    at = f"at the {result.followed}" if result.followed else ""
    at = at or ("at equal frequency ratio" if "frequency_ratio" in result.axes else "")
    if not at or _MESH not in result.varying or not result.wears or not result.has("worn_volume"):
        return None
    meshes = result.dataset[_MESH].values.astype(float)
    order = np.argsort(meshes)
    rows = [
        np.moveaxis(each, result.axes.index(_MESH), -1)[..., order].reshape(-1, len(meshes))
        for each in (np.where(result.best_known, result.worn, np.nan), result.errors)
    ]
    volumes, errors = rows
    fine = np.fmax(volumes[:, -1], volumes[:, -2])
    apart = np.abs(volumes[:, -1] - volumes[:, -2]) / np.where(fine > NO_VOLUME, fine, np.nan)
    if np.isnan(apart).all():
        return None
    most = int(np.nanargmax(np.where(np.isnan(apart), np.nan, fine)))
    found = [(float(meshes[k]), (float(volumes[most, i]), float(errors[most, i]))) for i, k in enumerate(order)]
    known = [each for each in found if math.isfinite(sum(each[1]))]
    two = float(meshes[order[-2]]), float(meshes[order[-1]])
    return MeshChange(two, at, float(np.nanmedian(apart)), float(np.nanmax(apart)), extrapolate(known))


def extrapolate(volumes: list[tuple[float, tuple[float, float]]]) -> tuple[float, float] | None:
    """Worn volume of an infinitely fine mesh and the order of convergence; None where the meshes do not show one.

    The last three meshes have V = limit + c / mesh^order. Their differences must have one sign, fall with an order
    within `_ORDERS`, and be larger than the errors of the volumes, or they say nothing of the mesh.

    Parameters
    ----------
    volumes
        Mesh densities, ascending, each with worn volume, m3, and its relative error.
    """
    if len(volumes) < 3:
        return None
    (first, (coarse, e1)), (second, (middle, e2)), (third, (fine, e3)) = volumes[-3:]
    steps = coarse - middle, middle - fine
    unsure = e1 * coarse + e2 * middle, e2 * middle + e3 * fine
    if steps[0] * steps[1] <= 0.0 or any(abs(step) <= error for step, error in zip(steps, unsure, strict=True)):
        return None

    def excess(order: float) -> float:
        return float((first**-order - second**-order) / (second**-order - third**-order)) - steps[0] / steps[1]

    if excess(_ORDERS[0]) > 0.0 or excess(_ORDERS[1]) < 0.0:
        return None
    from scipy.optimize import brentq  # where it is used: it takes a while to load

    order = float(brentq(excess, *_ORDERS))
    limit = fine - steps[1] * third**-order / (second**-order - third**-order)
    return (limit, order) if limit >= 0.0 else None

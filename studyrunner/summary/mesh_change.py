"""What another mesh changes: the errors of a result are those of the reduced model, and the mesh is not among them.

With an axis `mesh` the worn volumes of neighbouring meshes are compared, and extrapolated where they converge.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from solver.outcome import COMPLETE
from studyrunner.percent import show_percent
from studyrunner.plan.point_text import describe_value
from studyrunner.plan.sharing import Index
from studyrunner.study.sections import names_model
from studyrunner.study.study import Study
from studyrunner.system.progress import count

_MESH = "mesh"
_ORDERS = (0.5, 4.0)
"""Orders of convergence, in 1/mesh, with which is extrapolated: 2 for smooth stresses, 1 and less at a sharp edge."""
_NOT_KNOWN = "errors are those of the reduced model; what another mesh changes is not known"
_BUNDLED = (
    "errors are those of the reduced model; another mesh moves worn volumes of the dovetail by 2 to 30 %:"
    " axes.mesh compares meshes"
)
_REMEDY = "compare frequencies at one distance to the resonance, or bands of [scatter]"


class MeshChange:
    """Collects last worn volumes from records of histories; their order does not matter."""

    def __init__(self, study: Study) -> None:
        self._study = study
        self._names = list(study.dimensions)
        self._volumes: dict[Index, dict[float, tuple[float, float]]] = {}

    def add(self, points: Sequence[tuple[Index, ...]], records: NDArray[np.void]) -> None:
        """Records (n,) as in `records`, and the points that each of them is of."""
        if _MESH not in self._names or "worn_volume" not in (records.dtype.names or ()):
            return
        axis = self._names.index(_MESH)
        meshes = self._study.dimensions[_MESH]
        for row in np.flatnonzero(np.isin(records["outcome"], list(COMPLETE))).tolist():
            volumes, error = records["worn_volume"][row], float(records["error_estimate"][row])
            volume = float(volumes[np.isfinite(volumes)][-1])
            for point in points[row]:
                mesh = float(meshes[point[axis]])
                self._volumes.setdefault((*point[:axis], 0, *point[axis + 1 :]), {})[mesh] = volume, error

    def rows(self) -> list[tuple[str, str]]:
        """Label and text of one line; none for a scene without a mesh, or where nothing wears."""
        scene, text = self._study.scene, ""
        if self._study.cycles_kept[-1] == 0.0:
            return []
        if len(self._study.dimensions.get(_MESH, ())) > 1:
            text = self._compare() if self._volumes else ""
        elif names_model(scene.model):
            text = _NOT_KNOWN
        elif scene.is_bundled and hasattr(scene.parameters, _MESH):
            text = _BUNDLED
        return [(_MESH, text)] if text else []

    def _compare(self) -> str:
        """How far the finest two meshes are apart, where most, and how many points converge."""
        found = {point: sorted(by_mesh.items()) for point, by_mesh in self._volumes.items()}
        apart = {point: _apart(volumes) for point, volumes in found.items()}
        known = {point: value for point, value in apart.items() if math.isfinite(value)}
        if not known:
            return "no point wears with two meshes"
        worst = max(sorted(known), key=known.__getitem__)
        at = f" at {self._where(worst)}" if self._where(worst) else ""
        middle = show_percent(float(np.median(list(known.values()))))
        text = f"the two finest differ by {middle} in the median, at most {show_percent(known[worst])}{at}"
        if max(map(len, found.values())) < 3:
            return f"{text}; three meshes show whether they converge"
        limits = {point: limit for point in sorted(known) if (limit := extrapolate(found[point])) is not None}
        if not limits:
            return f"{text}; no point converges: {_REMEDY}"
        first, (volume, order) = next(iter(limits.items()))
        at = f" at {self._where(first)}" if self._where(first) else ""
        n_points = count(len(known), "point")
        return f"{text}; {len(limits)} of {n_points} converge{at}: {1e9 * volume:.4g} mm3, order {order:.1f}"

    def _where(self, point: Index) -> str:
        """The point without its mesh."""
        dimensions = self._study.dimensions
        shown = [(name, values[index]) for (name, values), index in zip(dimensions.items(), point, strict=True)]
        return ", ".join(
            describe_value(self._study, name, value)
            for name, value in shown
            if name != _MESH and len(dimensions[name]) > 1
        )


def _apart(volumes: list[tuple[float, tuple[float, float]]]) -> float:
    """Relative difference of the worn volumes of the two finest meshes; NaN where nothing wears."""
    if len(volumes) < 2:
        return math.nan
    (_, (coarse, _)), (_, (fine, _)) = volumes[-2:]
    largest = max(coarse, fine)
    return abs(fine - coarse) / largest if largest > 0.0 else math.nan


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

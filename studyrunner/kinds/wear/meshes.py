"""What worn volumes of several meshes say of the error by the mesh: differences, and the observed order."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from studyrunner.result.view import NO_VOLUME, Result
from studyrunner.summary.findings import Finding
from studyrunner.system.progress import count
from studyrunner.units import show_number, show_percent

SAFETY = 1.25
"""Factor on the difference to the limit of three meshes whose order is observed (Roache 1998; ASME V&V 20, 2-4.1)."""

COVERAGE = 1.15
"""A grid convergence index over its standard uncertainty (ASME V&V 20, Eq. 2-4-8)."""

LARGEST_ORDER = 6.0
"""Observed order above which meshes agree by chance: linear elements have 1 to 2."""


class Convergence(NamedTuple):
    """order: observed; NaN where values of the meshes do not converge. limit: of the mesh without size. u_mesh:
    standard uncertainty of the finest value, relative; inf where there is no order.
    """

    order: float
    limit: float
    u_mesh: float


def converge(sizes: NDArray[np.float64], values: NDArray[np.float64]) -> Convergence:
    """Richardson's extrapolation of values (3,) at sizes of elements (3,), descending, in any ratios.

    The order p solves (v1 - v2) / (v2 - v3) = (h1^p - h2^p) / (h2^p - h3^p).
    """
    none = Convergence(math.nan, math.nan, math.inf)
    first, second = np.diff(values)
    if not np.isfinite(values).all() or second == 0.0 or first / second <= 0.0:
        # they oscillate
        return none
    ratio, logarithms = float(first / second), np.log(sizes / sizes[1])

    def beyond(order: float) -> float:
        coarse, fine = math.expm1(order * logarithms[0]), -math.expm1(order * logarithms[2])
        return coarse / fine - ratio

    if beyond(1e-6) >= 0.0 or beyond(LARGEST_ORDER) <= 0.0:
        return none
    order = float(brentq(beyond, 1e-6, LARGEST_ORDER, xtol=1e-12))
    left = float(second) / math.expm1(order * math.log(sizes[1] / sizes[2]))
    return Convergence(order, float(values[2] + left), SAFETY * abs(left / float(values[2])) / COVERAGE)


def compare_meshes(result: Result) -> Finding | None:
    """How far worn volumes of the two finest meshes are apart, at equal distance to the resonance; of three meshes the
    observed order and the uncertainty by the mesh, where it is largest; else None.

    The resonance moves with the mesh: at one frequency one mesh may wear a multiple of the other.
    """
    at = f"at the {result.followed}" if result.followed else ""
    at = at or ("at equal frequency ratio" if "frequency_ratio" in result.axes else "")
    if not at or "mesh" not in result.varying or not result.wears or not result.has("worn_volume"):
        return None
    meshes, axis = result.dataset["mesh"].values.astype(float), result.axes.index("mesh")
    order = np.argsort(meshes)
    volumes = np.moveaxis(np.where(result.best_known, result.worn, np.nan).take(order, axis=axis), axis, -1)
    two = volumes[..., -2:]
    larger = np.fmax.reduce(two, axis=-1)
    apart = np.abs(np.diff(two, axis=-1)[..., 0]) / np.where(larger > NO_VOLUME, larger, np.nan)
    if np.isnan(apart).all():
        return None
    median, largest = float(np.nanmedian(apart)), float(np.nanmax(apart))
    coarse, fine = (show_number(each) for each in meshes[order][-2:].tolist())
    text = f"worn volumes of meshes {coarse} and {fine} differ by {show_percent(median)} {at}"
    text += f", at most {show_percent(largest)}" if largest > median else ""
    values = {"meshes": meshes[order][-2:].tolist(), "median": median, "largest": largest}
    if len(meshes) > 2:
        rows = volumes[..., -3:].reshape(-1, 3)
        found = [converge(1.0 / meshes[order][-3:], row) for row in rows if (row > NO_VOLUME).all()]
        said, more = _describe(found)
        text, values = text + said, values | more
    return Finding("mesh", "mesh", text, values)


def _describe(found: list[Convergence]) -> tuple[str, dict[str, float]]:
    """The observed orders of the points in words, and the largest uncertainty, inf without an order."""
    known = [each for each in found if math.isfinite(each.u_mesh)]
    n_without = len(found) - len(known)
    u_mesh = max((each.u_mesh for each in found), default=math.inf)
    if not known:
        return "; the last three have no order of convergence: u_mesh is not known", {"u_mesh": math.inf}
    worst = max(known, key=lambda each: each.u_mesh)
    text = f"; u_mesh {show_percent(worst.u_mesh)} by the observed order {worst.order:.2g}"
    text += f", {count(n_without, 'point')} without an order" if n_without else ""
    return text, {"u_mesh": u_mesh, "order": worst.order}

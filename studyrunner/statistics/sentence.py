"""The statistics of worn volumes in sentences, one for each point, as the last lines of a run show them."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from studyrunner.percent import show_percent
from studyrunner.statistics.ranking import describe_ranking
from studyrunner.statistics.samples_of_result import CYCLE

_MM3 = 1e9
_OWN_DIMS = ("quantile", "bound", "exceeded_volume", "exceeded_depth", "input", "grid", "group")


def sentences(statistics: xr.Dataset) -> list[str]:
    """A sentence for each point of the result of `worn_volume_statistics`, of the last cycle count.

    "211.5 Hz: 90 % of 128 samples wear 1.4 to 2.4 mm3, median 2.1 mm3 (numerical error 1 %); friction coefficient
    decides most (rank correlation 0.80, interval 0.71 to 0.86)".
    """
    last = statistics.isel({CYCLE: -1}, missing_dims="ignore")
    axes = [name for name in last["worn_volume_quantile"].dims if name not in _OWN_DIMS]
    varying = [name for name in axes if last.sizes[name] > 1 or name == "frequency"]
    lines = []
    for place in np.ndindex(*(last.sizes[name] for name in axes)):
        point = last.isel(dict(zip(axes, place, strict=True)))
        where = ", ".join(_show(point[name]) for name in varying)
        lines.append(f"{where}: {sentence(point)}" if where else sentence(point))
    return lines


def sentence(point: xr.Dataset) -> str:
    """What the samples of one point say: range, median, numerical error, two groups, the input that decides."""
    return "; ".join(filter(None, (describe_volumes(point), describe_ranking(point))))


def describe_volumes(point: xr.Dataset) -> str:
    """Range, median and numerical error of the worn volumes of one point, and two groups where there are."""
    ends = point["worn_volume_quantile"].values * _MM3
    probabilities, n_without = point["quantile"].values, int(point["n_without_value"])
    share = 100.0 * (probabilities[-1] - probabilities[0])
    text = f"{share:.4g} % of {int(point['n_samples'])} samples wear {_range(ends[0, 0], ends[-1, 1])} mm3"
    if 0.5 in probabilities:
        middle = int(np.flatnonzero(probabilities == 0.5)[0])
        text += f", median {_range(*ends[middle])} mm3 ({_error(point, middle)})"
    if n_without:
        text += f"; {n_without} without a value to be trusted"
    return text + _groups(point)


def _range(low: float, high: float) -> str:
    if math.isinf(high):
        return f"above {low:.3g}"
    first, last = f"{low:.3g}", f"{high:.3g}"
    return first if first == last else f"{first} to {last}"


def _error(point: xr.Dataset, middle: int) -> str:
    """Numerical error of the median: how far its ends move, apart from what samples without a value may have."""
    ends = point["worn_volume_quantile"].values[middle]
    finite = np.isfinite(ends)
    moved = np.abs(point["worn_volume_quantile_error"].values[middle][finite] - ends[finite])
    if not (finite.any() and np.isfinite(moved).all()):
        return "numerical error not known"
    return f"numerical error {show_percent(float(moved.sum() / ends[finite].sum()) if moved.any() else 0.0)}"


def _groups(point: xr.Dataset) -> str:
    n_lower, n_upper = (int(number) for number in point["group_size"].values)
    if n_upper == 0:
        return ""
    lower, upper = point["group_gap"].values * _MM3
    text = f"; two groups, {n_lower} samples up to {lower:.3g} mm3 and {n_upper} from {upper:.3g} mm3"
    contact = int(point["deciding_contact"])
    return text if contact < 0 else f"{text}, which differ in the wear depth of contact pair {contact}"


def _show(coordinate: xr.DataArray) -> str:
    units = str(coordinate.attrs.get("units", "1"))
    value = coordinate.values[()]
    if coordinate.dtype.kind not in "iuf":
        return str(value)
    return f"{float(value):.10g} {units}" if units != "1" else f"{coordinate.name} {float(value):.10g}"

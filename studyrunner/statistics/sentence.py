"""The statistics of worn volumes in sentences: range, median, groups, and which input decides, with its uncertainty."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from studyrunner.statistics.samples import FEWEST, Array
from studyrunner.units import show_percent

_MM3 = 1e9
_MEASURES = ("first_index", "rank_correlation")


def describe_volumes(point: xr.Dataset) -> str:
    """Range, median and numerical error of the worn volumes of one point, and two groups where there are."""
    ends = point["worn_volume_quantile"].values * _MM3
    probabilities, n_without = point["quantile"].values, int(point["n_without_value"])
    share = 100.0 * (probabilities[-1] - probabilities[0])
    text = f"{share:.4g} % of {int(point['n_samples'])} samples wear {_range(ends[0, 0], ends[-1, 1])} mm3"
    (n_lower, n_upper), (lower, upper) = point["group_size"].values.tolist(), point["group_gap"].values * _MM3
    if 0.5 in probabilities:
        middle = ends[probabilities == 0.5][0]
        moved = point["worn_volume_quantile_error"].values[probabilities == 0.5][0] * _MM3
        # how far the ends move, apart from what samples without a value may have
        finite = np.isfinite(middle)
        by = np.abs(moved[finite] - middle[finite])
        error = "not known"
        if finite.any() and np.isfinite(by).all():
            error = show_percent(float(by.sum() / middle[finite].sum()) if by.any() else 0.0)
        between = "between two groups, " if n_upper and lower < middle.mean() < upper else ""
        text += f", median {_range(*middle)} mm3 ({between}numerical error {error})"
    text += f"; {n_without} have no volume that can be trusted" if n_without else ""
    if n_upper:
        rest = int(point["n_samples"]) - n_without - n_lower - n_upper
        text += f"; two groups, {n_lower} samples up to {lower:.3g} mm3 and {n_upper} from {upper:.3g} mm3"
        text += f" ({rest} known too badly to tell)" if rest > 0 else ""
        contact = int(point["deciding_contact"])
        text += "" if contact < 0 else f", which differ in the wear depth of contact pair {contact}"
    return text


def _range(low: float, high: float, *, digits: str = ".3g") -> str:
    first, last = f"{low:{digits}}", f"{high:{digits}}"
    return f"above {first}" if math.isinf(high) else first if first == last else f"{first} to {last}"


def measure_of(statistics: xr.Dataset) -> str | None:
    """Name of the statistic by which the inputs are ranked; None where there is none."""
    return next((name for name in _MEASURES if name in statistics), None)


def _measured(point: xr.Dataset) -> tuple[Array, Array]:
    """Estimates and intervals (n_inputs, 2) of the statistic by which the inputs are ranked."""
    name = measure_of(point)
    value, interval = (point[f"{name}{each}"].transpose("input", "bound").values for each in ("", "_interval"))
    return value, interval


def leading_input(point: xr.Dataset) -> int:
    """Place of the input with the largest estimate, whatever its uncertainty; the first where there is none."""
    return int(np.argmax(np.abs(np.nan_to_num(_measured(point)[0])).max(axis=1))) if measure_of(point) else 0


def deciding_input(point: xr.Dataset) -> int | None:
    """Place along `input` of the input that decides most; None where the samples do not tell.

    They tell where the interval of the strength of one input, a share or a correlation without its sign, is above those
    of all others.
    """
    if measure_of(point) is None:
        return None
    ends = np.nan_to_num(_measured(point)[1])
    least = np.where((ends[:, 0] < 0.0) & (ends[:, 1] > 0.0), 0.0, np.abs(ends).min(axis=1))
    most = int(np.argmax(least))
    others = np.delete(np.abs(ends).max(axis=1), most)
    return most if least[most] > others.max(initial=0.0) else None


def describe_ranking(point: xr.Dataset) -> str:
    """The deciding input in words, or why none is known; "" where no input varies."""
    name = measure_of(point)
    if name is None:
        return ""
    n_samples, words = int(point["n_samples"]), [str(each).replace("_", " ") for each in point["input"].values]
    values, intervals = _measured(point)
    if np.isnan(values).all():
        # two independent samples for each base sample
        too_few = n_samples < FEWEST * (2 if name == "first_index" else 1)
        return f"{n_samples} samples are too few to say which input decides" if too_few else ""
    without = [word for word, row in zip(words, values, strict=True) if np.isnan(row).all()]
    inputs = "input" if len(without) == 1 else "inputs"
    more = f"; {inputs} not ranked: {', '.join(without)}" if without else ""
    most = leading_input(point)
    low, high = intervals[most]
    if name == "first_index":
        share = _range(*(100.0 * values[most]).tolist(), digits=".0f")
        shown = f"{share} % of the variance, interval {100.0 * low:.0f} to {100.0 * high:.0f} %"
    else:
        shown = f"rank correlation {_range(*values[most].tolist(), digits='.2f')}, interval {low:.2f} to {high:.2f}"
    if deciding_input(point) is None:
        return f"which input decides is not known: {words[most]} has the largest estimate ({shown}){more}"
    return f"{words[most]} decides most ({shown}){more}"

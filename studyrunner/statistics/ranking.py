"""Which input decides most, from the statistics of a point, and in words with its uncertainty."""

from __future__ import annotations

import numpy as np
import xarray as xr

from studyrunner.statistics.bands import Array

MEASURES = ("first_index", "rank_correlation")


def measure_of(statistics: xr.Dataset) -> str | None:
    """Name of the statistic by which the inputs are ranked; None where there is none."""
    return next((name for name in MEASURES if name in statistics), None)


def deciding_input(point: xr.Dataset) -> int | None:
    """Place along `input` of the input that decides most; None where the samples do not tell.

    They tell where the interval of the strength of one input is above those of all others.
    """
    strength = _strengths(point)
    if strength is None:
        return None
    most = int(np.argmax(strength[:, 0]))
    others = np.delete(strength[:, 1], most)
    return most if strength[most, 0] > others.max(initial=0.0) else None


def leading_input(point: xr.Dataset) -> int:
    """Place of the input with the largest estimate, whatever its uncertainty; the first where there is none."""
    name = measure_of(point)
    if name is None:
        return 0
    values = point[name].fillna(0.0).transpose("input", "bound").values
    return int(np.argmax(np.abs(values).max(axis=1)))


def describe_ranking(point: xr.Dataset) -> str:
    """The deciding input in words, or why none is known; "" where no input varies."""
    name = measure_of(point)
    if name is None:
        return ""
    words = [str(each).replace("_", " ") for each in point["input"].values]
    values, intervals = (point[each].transpose("input", "bound").values for each in (name, f"{name}_interval"))
    if np.isnan(values).all():
        if int(point["n_samples"]) < int(point[name].attrs["fewest"]):
            return f"{int(point['n_samples'])} samples are too few to say which input decides"
        return ""
    untold = [word for word, row in zip(words, values, strict=True) if np.isnan(row).all()]
    more = f"; {' and '.join(untold)} {'is' if len(untold) == 1 else 'are'} not ranked" if untold else ""
    most, decides = leading_input(point), deciding_input(point) is not None
    low, high = intervals[most]
    if name == "first_index":
        shown = f"{_range(100.0 * values[most])} %, interval {100.0 * low:.0f} to {100.0 * high:.0f} %"
        says = f"{words[most]} decides {shown}"
    else:
        shown = f"rank correlation {_range(values[most], 2)}, interval {low:.2f} to {high:.2f}"
        says = f"{words[most]} decides most ({shown})"
    return (
        f"{says}{more}"
        if decides
        else f"which input decides is not known: {words[most]} has the largest estimate ({shown}){more}"
    )


def _strengths(point: xr.Dataset) -> Array | None:
    """Least and largest strength (n_inputs, 2) within the intervals: the share, or the correlation without sign."""
    name = measure_of(point)
    if name is None or not point[name].notnull().any():
        return None
    ends = np.nan_to_num(point[f"{name}_interval"].transpose("input", "bound").values.astype(float))
    crosses = (ends[:, 0] < 0.0) & (ends[:, 1] > 0.0)
    return np.stack([np.where(crosses, 0.0, np.abs(ends).min(axis=1)), np.abs(ends).max(axis=1)], axis=1)


def _range(values: Array, digits: int = 0) -> str:
    first, last = f"{values.min():.{digits}f}", f"{values.max():.{digits}f}"
    return first if first == last else f"{first} to {last}"

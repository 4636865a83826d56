"""Statistics of the worn volumes of a result with samples, as a labelled dataset."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from studyrunner.scatter.design import SaltelliLayout
from studyrunner.statistics.estimates import exceedance, quantiles, rank_correlations, saltelli_indices
from studyrunner.statistics.samples import (
    CYCLE,
    SAMPLE,
    Array,
    Band,
    SampleValues,
    depth_samples,
    inputs_of,
    is_of_pairs,
    scatter_of,
    volume_samples,
)
from studyrunner.statistics.two_groups import deciding_pair, density, two_groups

_N_THRESHOLDS = 41
_N_DENSITY = 101
_FEWEST = 2
_MOST_VALUES, _MOST_OF_ALL = 10**6, 10**7
"""Worn volumes of a file from which on only some of the cycle counts are used, and none: a million take some 30 s."""


def worn_volume_statistics(
    dataset: xr.Dataset,
    quantiles: Sequence[float] = (0.05, 0.5, 0.95),
    confidence: float = 0.95,
    exceed: ArrayLike | None = None,
    depth: ArrayLike | None = None,
) -> xr.Dataset:
    """What the samples of a result say of worn volume and depth, over all its other dimensions.

    Each statistic has a dimension `bound`: its lowest and highest value over all that samples without a value may have,
    which are equal where all have one. NAME_interval is the confidence interval, NAME_error are the ends with every
    value less or more its numerical error. With saltelli, indices are of the whole design, all others of its
    independent rows.

    dataset: with the dimension `sample`, drawn values as coordinates `sample_NAME`, and `worn_volume`. quantiles:
    probabilities, ascending. confidence: of the intervals. exceed, depth: worn volumes, m3, and depths, m, whose
    probability of exceedance is wanted; by default 41 up to the largest.

    Returns worn_volume_quantile (m3), worn_volume_exceedance, wear_depth_exceedance, and of each input first_index and
    total_index (1) with saltelli, else rank_correlation (1), each with _interval and _error; n_samples,
    n_without_value; of the last count worn_volume_density (1/m3) over worn_volume_grid (m3), group_size (2), group_gap
    (m3, two ends; NaN for one group), deciding_contact (-1: none). Raises ValueError where the result has no samples or
    no worn volume, or a probability is not between 0 and 1.
    """
    for name in ("worn_volume", "outcome"):
        if name not in dataset or SAMPLE not in dataset[name].dims:
            raise ValueError(f"The result holds no {name} of samples: run a study with [scatter].")
    if not all(0.0 < each < 1.0 for each in (*quantiles, confidence)):
        raise ValueError(f"Give probabilities between 0 and 1, not {tuple(quantiles)} and {confidence}.")
    if "mission" in dataset.dims:
        # missions count slow time in place of cycles
        in_cycles = dataset.drop_dims("block", errors="ignore").rename(mission=CYCLE)
        return worn_volume_statistics(in_cycles, quantiles, confidence, exceed, depth).rename({CYCLE: "mission"})
    if "cycle_count" in dataset:
        # each point has counts of its own: they share the last one only
        dataset = dataset.isel({CYCLE: [-1]})
    section = scatter_of(dataset)
    layout = SaltelliLayout(len(section.inputs)) if section is not None and section.method == "saltelli" else None
    everything, dims = volume_samples(dataset)
    rows = np.arange(dataset.sizes[SAMPLE])
    if layout is not None:
        # A and B are independent samples
        rows = rows[rows % layout.rows_per_base < 2]
    values, names = everything.at((..., rows)), list(dims)
    found = _of_values(values, names, quantiles, confidence, exceed)
    depths = depth_samples(dataset)
    if depths is not None:
        of_depth = depths[0].at((..., rows))
        axis = _axis("exceeded_depth", _thresholds(depth, of_depth), "m", "wear depth")
        words = "probability that a pair is worn deeper before this count"
        band = exceedance(of_depth, axis.values, confidence)
        found |= _band_arrays("wear_depth_exceedance", words, "1", band, list(depths[1]), axis)
    found |= _of_inputs(dataset, everything, layout, confidence, names)
    found |= _of_groups(dataset, values, rows, dims)
    kept = {name: array for name, array in dataset.coords.items() if set(array.dims) <= set(dims)}
    return xr.Dataset(found, kept, {"title": f"Statistics of {len(rows)} samples", "confidence": confidence})


def _of_values(
    values: SampleValues,
    names: list[Hashable],
    probabilities: Sequence[float],
    confidence: float,
    exceed: ArrayLike | None,
) -> dict[str, xr.DataArray]:
    axis = _axis("quantile", probabilities, "1", "probability")
    band = quantiles(values, probabilities, confidence)
    found = _band_arrays("worn_volume_quantile", "quantile of worn volume", "m3", band, names, axis)
    axis = _axis("exceeded_volume", _thresholds(exceed, values), "m3", "worn volume")
    band = exceedance(values, axis.values, confidence)
    found |= _band_arrays("worn_volume_exceedance", "probability of a larger worn volume", "1", band, names, axis)
    found["n_samples"] = _array(np.int32(values.low.shape[-1]), [], "1", "samples")
    n_without = (~values.is_known).sum(axis=-1)
    return found | {"n_without_value": _array(n_without, names, "1", "samples without a value to be trusted")}


def _thresholds(given: ArrayLike | None, values: SampleValues) -> Array:
    if given is not None:
        return np.sort(np.atleast_1d(np.asarray(given, dtype=np.float64)))
    return np.linspace(0.0, float(values.low.max()) or 1.0, _N_THRESHOLDS)


def _axis(name: str, values: Sequence[Any] | Array, units: str, long_name: str) -> xr.DataArray:
    along = xr.Variable(name, np.asarray(values), {"units": units, "long_name": long_name})
    return xr.DataArray(along, coords={name: along})


def _band_arrays(
    name: str, long_name: str, units: str, band: Band, dims: list[Hashable], axis: xr.DataArray
) -> dict[str, xr.DataArray]:
    """NAME, NAME_interval and NAME_error. axis: of the last dimension but `bound`."""
    found = {}
    for suffix, low, high, words in (
        ("", band.lowest, band.highest, ""),
        ("_interval", band.interval_low, band.interval_high, ", confidence interval"),
        ("_error", band.error_low, band.error_high, ", with numerical error"),
    ):
        ends = np.stack([low, high], axis=-1)
        if not name.endswith("correlation"):
            # no other quantity here is below 0
            ends = np.maximum(ends, 0.0)
        array = _array(ends, [*dims, *axis.dims, "bound"], units, long_name + words)
        found[name + suffix] = array.assign_coords({**axis.coords, "bound": ["lowest", "highest"]})
    return found


def _of_inputs(
    dataset: xr.Dataset, values: SampleValues, layout: SaltelliLayout | None, confidence: float, dims: list[Hashable]
) -> dict[str, xr.DataArray]:
    """What each input decides; nothing where nothing scatters."""
    inputs = inputs_of(dataset)
    if not inputs:
        return {}
    table = np.stack(list(inputs.values()), axis=1)
    axis = _axis("input", list(inputs), "1", "input that scatters")
    if layout is None:
        words = "rank correlation of the worn volume with the input"
        band = rank_correlations(table, values, confidence)
        found = _band_arrays("rank_correlation", words, "1", band, dims, axis)
        of_one_draw = xr.DataArray([not is_of_pairs(dataset, each) for each in inputs], dims="input")
        # the mean over the pairs says nothing of what their own draws decide
        return {name: array.where(of_one_draw) for name, array in found.items()}
    words = "share of the variance that the input decides"
    first, total = saltelli_indices(layout, table, values, confidence)
    found = _band_arrays("first_index", f"{words} alone", "1", first, dims, axis)
    return found | _band_arrays("total_index", f"{words}, with the others", "1", total, dims, axis)


def _of_groups(
    dataset: xr.Dataset, values: SampleValues, rows: NDArray[np.intp], dims: Mapping[Hashable, int]
) -> dict[str, xr.DataArray]:
    """Density and groups at the last count."""
    axes = [name for name in dims if name != CYCLE]
    shape = tuple(dims[name] for name in axes)
    at_last = values.at(tuple(-1 if name == CYCLE else slice(None) for name in dims))
    name = next((name for name in ("wear_depth_last", "wear_depth") if name in dataset), "")
    depths = None
    if name:
        depths = dataset[name].isel({CYCLE: -1}, missing_dims="ignore").isel({SAMPLE: rows})
        depths = depths.transpose(*axes, SAMPLE, "contact")
    grid, curve = np.full((2, *shape, _N_DENSITY), np.nan)
    sizes, gap = np.zeros((*shape, 2), dtype=np.int32), np.full((*shape, 2), np.nan)
    contact = np.full(shape, -1, dtype=np.int32)
    for point in np.ndindex(shape):
        samples = at_last.at(point)
        groups, known = two_groups(samples), samples.low[samples.is_known]
        sizes[point] = (known.size, 0) if groups is None else groups.sizes
        if known.size:
            margin = 0.1 * float(np.ptp(known))
            grid[point] = np.linspace(max(known.min() - margin, 0.0), known.max() + margin, _N_DENSITY)
            curve[point] = density(samples, groups, grid[point])
        if groups is not None:
            gap[point] = groups.lower_end, groups.upper_end
            pair = None if depths is None else deciding_pair(depths.values[point], groups)
            contact[point] = -1 if pair is None else dataset["contact"].values[pair]
    return {
        "worn_volume_grid": _array(grid, [*axes, "grid"], "m3", "worn volume"),
        "worn_volume_density": _array(curve, [*axes, "grid"], "1/m3", "density of the samples at the last count"),
        "group_size": _array(sizes, [*axes, "group"], "1", "samples below and above the gap; all, 0: one group"),
        "group_gap": _array(gap, [*axes, "group"], "m3", "ends of the gap between two groups"),
        "deciding_contact": _array(contact, axes, "1", "contact pair that separates the groups best, -1: none"),
    }


def _array(values: NDArray[Any] | np.int32, dims: Sequence[Hashable], units: str, long_name: str) -> xr.DataArray:
    return xr.DataArray(values, dims=list(dims), attrs={"units": units, "long_name": long_name})


def statistics_of_file(dataset: xr.Dataset, quantiles: Sequence[float]) -> xr.Dataset | None:
    """`worn_volume_statistics` at all counts, or at some of these, evenly spaced, where a file has many.

    None without samples, without worn volumes, or with too many of them.
    """
    if dataset.sizes.get(SAMPLE, 0) < _FEWEST or "worn_volume" not in dataset:
        return None
    counts = dataset.sizes[CYCLE]
    per_count = dataset["worn_volume"].size // counts
    if 2 * per_count > _MOST_OF_ALL:
        return None
    kept = min(counts, max(2, _MOST_VALUES // per_count))
    places = np.unique(np.linspace(0, counts - 1, kept).astype(int))
    return worn_volume_statistics(dataset.isel({CYCLE: places}), quantiles)

"""The statistics of a result with samples, as a labelled dataset."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from studyrunner.statistics.samples import (
    CYCLE,
    DRAWN,
    SAMPLE,
    Array,
    SampleValues,
    exceedance,
    quantiles,
    rank_correlations,
    read_inputs,
    read_samples,
    saltelli_indices,
    scatter_of,
)
from studyrunner.statistics.two_groups import deciding_pair, density, two_groups

_N_THRESHOLDS = 41
_N_DENSITY = 101
_FEWEST = 2
_MOST_VALUES, _MOST_OF_ALL = 10**6, 10**7
"""Worn volumes of a file from which on only some of the cycle counts are used, and none: a million take some 30 s."""

_Arrays = dict[str, tuple[tuple[str, ...], Any, dict[str, str]]]
"""For each name dimensions, values and attributes, as xarray takes them."""


def worn_volume_statistics(
    dataset: xr.Dataset,
    quantiles: Sequence[float] = (0.05, 0.5, 0.95),
    confidence: float = 0.95,
    exceed: ArrayLike | None = None,
    depth: ArrayLike | None = None,
) -> xr.Dataset:
    """What the samples of a result say of worn volume and depth, over all its other dimensions.

    Each statistic has a dimension `bound`: its lowest and highest value over all that samples without a value may have,
    which are equal where all have one. NAME_interval is the confidence interval. With saltelli, indices are of the
    whole design, all others of its independent rows.

    dataset: with the dimension `sample`, drawn values as coordinates `sample_NAME`, and `worn_volume`. quantiles:
    probabilities, ascending. confidence: of the intervals. exceed, depth: worn volumes, m3, and depths, m, whose
    probability of exceedance is wanted; by default 41 up to the largest.

    Returns worn_volume_quantile (m3), worn_volume_exceedance, wear_depth_exceedance, and of each input first_index and
    total_index (1) with saltelli, else rank_correlation (1), each with _interval; worn_volume_quantile_error (m3), the
    ends with every value less or more its numerical error; n_samples, n_without_value; of the last count
    worn_volume_density (1/m3) over worn_volume_grid (m3), group_size (2), group_gap (m3, two ends; NaN for one group),
    deciding_contact (-1: none). Raises ValueError where the result has no samples or no worn volume, or a probability
    is not between 0 and 1.
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
    rows = np.arange(dataset.sizes[SAMPLE])
    is_saltelli = section is not None and section.method == "saltelli"
    if section is not None and is_saltelli:
        # A and B are independent samples
        rows = rows[rows % section.rows_a_sample < 2]
    everything, names = read_samples(dataset, "worn_volume")
    values = everything.at((..., rows))
    found, coords = _of_values(dataset, values, rows, names, quantiles, confidence, (exceed, depth))
    if inputs := read_inputs(dataset):
        found |= _of_inputs(dataset, everything, confidence, names, is_saltelli=is_saltelli)
        coords["input"] = ("input", list(inputs), _about("1", "input that scatters"))
    found |= _of_groups(dataset.isel({SAMPLE: rows}), values, names)
    kept = {name: array for name, array in dataset.coords.items() if set(array.dims) <= set(names)}
    return xr.Dataset(found, kept | coords, {"title": f"Statistics of {len(rows)} samples", "confidence": confidence})


def _about(units: str, long_name: str) -> dict[str, str]:
    return {"units": units, "long_name": long_name}


def _bands(name: str, long_name: str, units: str, band: tuple[Array, Array], dims: tuple[str, ...]) -> _Arrays:
    """NAME and NAME_interval, with the last dimension `bound`."""
    words = (long_name, f"{long_name}, confidence interval")
    # a correlation alone may be below 0
    ends = band if name.endswith("correlation") else [np.maximum(each, 0.0) for each in band]
    both = zip((name, f"{name}_interval"), ends, words, strict=True)
    return {each: ((*dims, "bound"), values, _about(units, shown)) for each, values, shown in both}


def _of_values(
    dataset: xr.Dataset,
    values: SampleValues,
    rows: np.ndarray,
    names: tuple[str, ...],
    probabilities: Sequence[float],
    confidence: float,
    thresholds: tuple[ArrayLike | None, ArrayLike | None],
) -> tuple[_Arrays, dict[str, Any]]:
    """Quantiles of worn volumes, probabilities of larger volumes and depths, and their coordinates."""
    coords: dict[str, Any] = {"bound": ["lowest", "highest"]}
    coords["quantile"] = ("quantile", np.asarray(probabilities), _about("1", "probability"))
    band = quantiles(values, probabilities, confidence)
    found = _bands("worn_volume_quantile", "quantile of worn volume", "m3", band, (*names, "quantile"))
    moved = np.maximum(quantiles(values.widened, probabilities, confidence)[0], 0.0)
    about_error = _about("m3", "quantile of worn volume, with numerical error")
    found["worn_volume_quantile_error"] = ((*names, "quantile", "bound"), moved, about_error)
    found["n_samples"] = ((), np.int32(len(rows)), _about("1", "samples"))
    n_without = (~values.is_known).sum(axis=-1)
    found["n_without_value"] = (names, n_without, _about("1", "samples without a value to be trusted"))
    of_depth = next((name for name in ("wear_depth", "wear_depth_max") if name in dataset), None)
    for variable, quantity, units, given, words in (
        ("worn_volume", "volume", "m3", thresholds[0], "probability of a larger worn volume"),
        (of_depth, "depth", "m", thresholds[1], "probability that a pair is worn deeper before this count"),
    ):
        if variable is not None:
            whole, own_names = read_samples(dataset, variable)
            own = whole.at((..., rows))
            even = np.linspace(0.0, float(own.low.max()) or 1.0, _N_THRESHOLDS)
            above = even if given is None else np.sort(np.atleast_1d(np.asarray(given, dtype=np.float64)))
            name, shown = variable.removesuffix("_max"), f"exceeded_{quantity}"
            band = exceedance(own, above, confidence)
            found |= _bands(f"{name}_exceedance", words, "1", band, (*own_names, shown))
            coords[shown] = (shown, above, _about(units, name.replace("_", " ")))
    return found, coords


def _of_inputs(
    dataset: xr.Dataset, values: SampleValues, confidence: float, names: tuple[str, ...], *, is_saltelli: bool
) -> _Arrays:
    """What each input decides."""
    inputs, dims = read_inputs(dataset), (*names, "input")
    table = np.stack(list(inputs.values()), axis=1)
    if is_saltelli:
        words = "share of the variance that the input decides"
        first, total = saltelli_indices(table, values, confidence)
        found = _bands("first_index", f"{words} alone", "1", first, dims)
        return found | _bands("total_index", f"{words}, with the others", "1", total, dims)
    words = "rank correlation of the worn volume with the input"
    found = _bands("rank_correlation", words, "1", rank_correlations(table, values, confidence), dims)
    # the mean over the pairs says nothing of what their own draws decide
    of_pairs = ["contact" in dataset[f"{DRAWN}{name}"].dims for name in inputs]
    for _, ends, _ in found.values():
        ends[..., of_pairs, :] = np.nan
    return found


def _of_groups(dataset: xr.Dataset, values: SampleValues, names: tuple[str, ...]) -> _Arrays:
    """Density and groups at the last count."""
    axes = tuple(name for name in names if name != CYCLE)
    shape = tuple(dataset.sizes[name] for name in axes)
    at_last = values.at(tuple(-1 if name == CYCLE else slice(None) for name in names))
    depths = next((dataset[name] for name in ("wear_depth_last", "wear_depth") if name in dataset), None)
    if depths is not None:
        depths = depths.isel({CYCLE: -1}, missing_dims="ignore").transpose(*axes, SAMPLE, "contact")
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
    words = "density of the samples at the last count"
    return {
        "worn_volume_grid": ((*axes, "grid"), grid, _about("m3", "worn volume")),
        "worn_volume_density": ((*axes, "grid"), curve, _about("1/m3", words)),
        "group_size": ((*axes, "group"), sizes, _about("1", "samples below and above the gap; all, 0: one group")),
        "group_gap": ((*axes, "group"), gap, _about("m3", "ends of the gap between two groups")),
        "deciding_contact": (axes, contact, _about("1", "contact pair that separates the groups best, -1: none")),
    }


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

"""The statistics of a result with samples, as a labelled dataset and in sentences."""

import math
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from studyrunner.coordinates import SAMPLE
from studyrunner.scatter import ScatterSection
from studyrunner.statistics import samples
from studyrunner.statistics.samples import CYCLE, DRAWN, FEWEST, Array, SampleValues
from studyrunner.units import show_percent

_QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)  # of the bands that figures show
_N_THRESHOLDS, _N_DENSITY = 41, 101
_MOST_VALUES, _MOST_OF_ALL = 10**6, 10**7
"""Worn volumes of a file from which on only some of the cycle counts are used, and none: a million take some 30 s."""

_MM3 = 1e9
_MEASURES = ("first_index", "rank_correlation")

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

    Each statistic has a dimension `bound`: lowest and highest over all that samples without a value may have, equal
    where all have one; NAME_interval: its confidence interval. With saltelli, indices are of the whole design, all
    others of its independent rows.

    dataset: with the dimension `sample`, drawn values as coordinates `sample_NAME`, and `worn_volume`. quantiles:
    probabilities, ascending. confidence: of the intervals. exceed, depth: worn volumes, m3, and depths, m, for the
    probabilities of exceedance; by default 41 up to the largest.

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
    section, rows = _scatter_of(dataset), np.arange(dataset.sizes[SAMPLE])
    is_saltelli = section is not None and section.method == "saltelli"
    if section is not None and is_saltelli:
        # A and B are independent samples
        rows = rows[rows % section.rows_a_sample < 2]
    everything, names = _read_samples(dataset, "worn_volume")
    values = everything.at((..., rows))
    found, coords = _of_values(dataset, values, rows, names, quantiles, confidence, (exceed, depth))
    order = sorted(str(name).removeprefix(DRAWN) for name in dataset.coords if str(name).startswith(DRAWN))
    if inputs := [*section.inputs] if section is not None else order:
        found |= _of_inputs(dataset, inputs, everything, confidence, names, is_saltelli=is_saltelli)
        coords["input"] = ("input", inputs, _about("1", "input that scatters"))
    found |= _of_groups(dataset.isel({SAMPLE: rows}), values, names)
    kept = {name: array for name, array in dataset.coords.items() if set(array.dims) <= set(names)}
    return xr.Dataset(found, kept | coords, {"title": f"Statistics of {len(rows)} samples", "confidence": confidence})


def statistics_of_file(dataset: xr.Dataset) -> xr.Dataset | None:
    """`worn_volume_statistics` of a file, at some counts where it has many; None without samples, or with too many."""
    if dataset.sizes.get(SAMPLE, 0) < 2 or "worn_volume" not in dataset:
        return None
    counts = dataset.sizes[CYCLE]
    per_count = dataset["worn_volume"].size // counts
    if 2 * per_count > _MOST_OF_ALL:
        return None
    kept = min(counts, max(2, _MOST_VALUES // per_count))
    places = np.unique(np.linspace(0, counts - 1, kept).astype(int))
    return worn_volume_statistics(dataset.isel({CYCLE: places}), _QUANTILES)


def _scatter_of(dataset: xr.Dataset) -> ScatterSection | None:
    """[scatter] of the study of a result; None where there is none that fits the samples of the file."""
    try:
        section = ScatterSection.model_validate(tomllib.loads(str(dataset.attrs.get("study", ""))).get("scatter"))
    except ValueError:
        return None
    has_all = all(f"{DRAWN}{name}" in dataset.coords for name in section.inputs)
    return section if has_all and dataset.sizes[SAMPLE] % section.rows_a_sample == 0 else None


def _read_samples(dataset: xr.Dataset, name: str) -> tuple[SampleValues, tuple[str, ...]]:
    """Samples of a variable of a result, and the dimensions before them: worn_volume, m3, wear_depth_max, m, or
    wear_depth, m, of which the deepest pair counts, with the largest error of any pair.

    What was not computed lies above the last value that was, without upper bound. What is `sensitive`, or known to have
    no known error, lies within its error, which may be infinite. An error that is not in the file is infinite.
    """
    values = dataset[name].astype(float)
    errors = dataset.get(f"{name}_error", xr.full_like(values, np.inf))
    if "contact" in values.dims:
        values, errors = values.max("contact"), errors.max("contact")
    values, outcome = values.transpose(..., SAMPLE), dataset["outcome"]
    words = dict(zip(outcome.attrs["flag_meanings"].split(), np.atleast_1d(outcome.attrs["flag_values"]), strict=False))
    value, missing = values.values, values.isnull().values
    low, high = np.where(missing, 0.0, value), np.where(missing, np.inf, value)
    if CYCLE in values.dims:
        # wear never falls
        low = np.where(missing, np.maximum.accumulate(low, axis=values.dims.index(CYCLE)), low)
    error = errors.fillna(np.inf).broadcast_like(values).transpose(*values.dims).values.copy()
    # nothing worn is known to be nothing
    error[missing | (value == 0.0)] = 0.0
    if name == "worn_volume":
        # its error is relative
        error *= low
    sensitive = (outcome == words.get("sensitive", -1)).broadcast_like(values).transpose(*values.dims).values
    unknown = np.isinf(error) & (f"{name}_error" in dataset)
    found = SampleValues(low, high, error).widened((sensitive | unknown) & ~missing)
    return replace(found, low=np.maximum(found.low, 0.0)), tuple(map(str, values.dims[:-1]))


def _about(units: str, long_name: str) -> dict[str, str]:
    return {"units": units, "long_name": long_name}


def _bands(name: str, long_name: str, units: str, band: tuple[Array, Array], dims: tuple[str, ...]) -> _Arrays:
    """NAME and NAME_interval, with the last dimension `bound`."""
    # a correlation alone may be below 0
    value, interval = band if name.endswith("correlation") else (np.maximum(each, 0.0) for each in band)
    return {
        name: ((*dims, "bound"), value, _about(units, long_name)),
        f"{name}_interval": ((*dims, "bound"), interval, _about(units, f"{long_name}, confidence interval")),
    }


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
    band = samples.quantiles(values, probabilities, confidence)
    found = _bands("worn_volume_quantile", "quantile of worn volume", "m3", band, (*names, "quantile"))
    moved = np.maximum(samples.quantiles(values.widened(), probabilities, confidence)[0], 0.0)
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
            whole, own_names = _read_samples(dataset, variable)
            own = whole.at((..., rows))
            even = np.linspace(0.0, float(own.low.max()) or 1.0, _N_THRESHOLDS)
            above = even if given is None else np.sort(np.atleast_1d(np.asarray(given, dtype=np.float64)))
            name, shown = variable.removesuffix("_max"), f"exceeded_{quantity}"
            band = samples.exceedance(own, above, confidence)
            found |= _bands(f"{name}_exceedance", words, "1", band, (*own_names, shown))
            coords[shown] = (shown, above, _about(units, name.replace("_", " ")))
    return found, coords


def _of_inputs(
    dataset: xr.Dataset,
    inputs: Sequence[str],
    values: SampleValues,
    confidence: float,
    names: tuple[str, ...],
    *,
    is_saltelli: bool,
) -> _Arrays:
    """What each input decides, in the order of the columns of the design; of an input of pairs the mean counts."""
    drawn, dims = [dataset[f"{DRAWN}{name}"] for name in inputs], (*names, "input")
    table = np.stack([each.mean([d for d in each.dims if d != SAMPLE]).values for each in drawn], axis=1)
    if is_saltelli:
        words, d = "share of the variance that the input decides", len(inputs)
        both = samples.saltelli_indices(table, values, confidence)
        first, total = ((both[0][..., part, :], both[1][..., part, :]) for part in (slice(d), slice(d, None)))
        found = _bands("first_index", f"{words} alone", "1", first, dims)
        return found | _bands("total_index", f"{words}, with the others", "1", total, dims)
    words = "rank correlation of the worn volume with the input"
    found = _bands("rank_correlation", words, "1", samples.rank_correlations(table, values, confidence), dims)
    # the mean over the pairs says nothing of what their own draws decide
    for _, ends, _ in found.values():
        ends[..., ["contact" in each.dims for each in drawn], :] = np.nan
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
        own = at_last.at(point)
        groups, known = samples.two_groups(own), own.low[own.is_known]
        sizes[point] = (known.size, 0) if groups is None else groups.sizes
        if known.size:
            margin = 0.1 * float(np.ptp(known))
            grid[point] = np.linspace(max(known.min() - margin, 0.0), known.max() + margin, _N_DENSITY)
            curve[point] = samples.density(own, groups, grid[point])
        if groups is not None:
            gap[point] = groups.lower_end, groups.upper_end
            pair = None if depths is None else samples.deciding_pair(depths.values[point], groups)
            contact[point] = -1 if pair is None else dataset["contact"].values[pair]
    words = "density of the samples at the last count"
    return {
        "worn_volume_grid": ((*axes, "grid"), grid, _about("m3", "worn volume")),
        "worn_volume_density": ((*axes, "grid"), curve, _about("1/m3", words)),
        "group_size": ((*axes, "group"), sizes, _about("1", "samples below and above the gap; all, 0: one group")),
        "group_gap": ((*axes, "group"), gap, _about("m3", "ends of the gap between two groups")),
        "deciding_contact": (axes, contact, _about("1", "contact pair that separates the groups best, -1: none")),
    }


# --- in sentences ---


def describe_volumes(point: xr.Dataset) -> str:
    """Range, median and numerical error of the worn volumes of one point, and two groups where there are."""
    ends, error = (point[name].values * _MM3 for name in ("worn_volume_quantile", "worn_volume_quantile_error"))
    probabilities, n_without = point["quantile"].values, int(point["n_without_value"])
    share = 100.0 * (probabilities[-1] - probabilities[0])
    text = f"{share:.4g} % of {int(point['n_samples'])} samples wear {_range(ends[0, 0], ends[-1, 1])} mm3"
    for middle, moved in zip(ends[probabilities == 0.5], error[probabilities == 0.5], strict=True):
        # how far the ends move, apart from what samples without a value may have
        finite = np.isfinite(middle)
        by = np.abs(moved - middle)[finite]
        relative = float(by.sum() / middle[finite].sum()) if by.any() else 0.0
        shown = show_percent(relative) if finite.any() and math.isfinite(relative) else "not known"
        text += f", median {_range(*middle)} mm3 (numerical error {shown})"
    text += f"; {n_without} have no volume that can be trusted" if n_without else ""
    (n_lower, n_upper), (lower, upper) = point["group_size"].values.tolist(), point["group_gap"].values * _MM3
    if n_upper:
        text += f"; two groups, {n_lower} samples up to {lower:.3g} mm3 and {n_upper} from {upper:.3g} mm3"
        contact = int(point["deciding_contact"])
        text += "" if contact < 0 else f", which differ in the wear depth of contact pair {contact}"
    return text


def _range(low: float, high: float, digits: str = ".3g") -> str:
    first, last = f"{low:{digits}}", f"{high:{digits}}"
    return f"above {first}" if math.isinf(high) else first if first == last else f"{first} to {last}"


def measure_of(statistics: xr.Dataset) -> str | None:
    """Name of the statistic by which the inputs are ranked; None where there is none."""
    return next((name for name in _MEASURES if name in statistics), None)


def describe_ranking(point: xr.Dataset) -> str:
    """The deciding input in words, or why none is known; "" where no input varies.

    One decides where the interval of its strength, a correlation without sign, is above those of all others.
    """
    name = measure_of(point)
    if name is None:
        return ""
    n_samples, words = int(point["n_samples"]), [str(each).replace("_", " ") for each in point["input"].values]
    values, intervals = (point[f"{name}{each}"].transpose("input", "bound").values for each in ("", "_interval"))
    if np.isnan(values).all():
        # two independent samples for each base sample
        too_few = n_samples < FEWEST * (2 if name == "first_index" else 1)
        return f"{n_samples} samples are too few to say which input decides" if too_few else ""
    without = ", ".join(word for word, row in zip(words, values, strict=True) if np.isnan(row).all())
    more = f"; not ranked: {without}" if without else ""
    most = int(np.argmax(np.abs(np.nan_to_num(values)).max(axis=1)))
    (low, high), (lowest, highest) = intervals[most], values[most].tolist()
    if name == "first_index":
        share = _range(100.0 * lowest, 100.0 * highest, ".0f")
        shown = f"{share} % of the variance, interval {100.0 * low:.0f} to {100.0 * high:.0f} %"
    else:
        shown = f"rank correlation {_range(lowest, highest, '.2f')}, interval {low:.2f} to {high:.2f}"
    others = np.abs(np.nan_to_num(np.delete(intervals, most, axis=0))).max(initial=0.0)
    if low < 0.0 < high or min(abs(low), abs(high)) <= others:
        return f"which input decides is not known: {words[most]} has the largest estimate ({shown}){more}"
    return f"{words[most]} decides most ({shown}){more}"

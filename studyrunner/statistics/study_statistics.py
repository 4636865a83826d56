"""The statistics of a result with samples, as a labelled dataset."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from studyrunner.coordinates import SAMPLE
from studyrunner.scatter import ScatterSection
from studyrunner.statistics import samples
from studyrunner.statistics.read_samples import (
    LIFE,
    RESPONSE,
    come_to,
    in_cycles_of,
    read_samples,
    study_of,
    with_responses,
)
from studyrunner.statistics.samples import CYCLE, DRAWN, Array, SampleValues

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)  # of the bands that figures show
CONFIDENCE = 0.95
_N_THRESHOLDS, _N_DENSITY = 41, 101
_MOST_VALUES, _MOST_OF_ALL = 10**6, 10**7
"""Worn volumes of a file from which on only some of the cycle counts are used, and none: a million take some 30 s."""


_Arrays = dict[str, tuple[tuple[str, ...], Any, dict[str, str]]]
"""For each name dimensions, values and attributes, as xarray takes them."""


class _Quantity(NamedTuple):
    """What samples are asked about. variables: of a result that hold it. exceeded: dimension of what is exceeded.

    factor, shown: unit for a reader. at_least: whether a limit is the least that is allowed.
    """

    words: str
    units: str
    variables: tuple[str, ...]
    exceeded: str
    factor: float
    shown: str
    at_least: bool = False


QUANTITIES = {
    "worn_volume": _Quantity("worn volume", "m3", ("worn_volume",), "exceeded_volume", 1e9, "mm3"),
    "wear_depth": _Quantity(
        "wear depth of the deepest pair", "m", ("wear_depth", "wear_depth_max"), "exceeded_depth", 1e6, "um"
    ),
    RESPONSE: _Quantity("largest amplitude of any response so far", "m", (RESPONSE,), "exceeded_amplitude", 1e3, "mm"),
    LIFE: _Quantity("life", "cycles", (LIFE,), "exceeded_life", 1.0, "cycles", at_least=True),
}
"""The response only where it has a limit, the life where points end at a target."""


@dataclass(frozen=True)
class _Asked:
    """Arguments of `worn_volume_statistics`. thresholds, limits: by quantity; of a limit only those that are given."""

    quantiles: Sequence[float]
    confidence: float
    thresholds: Mapping[str, ArrayLike | None]
    limits: Mapping[str, float]


def worn_volume_statistics(
    dataset: xr.Dataset,
    quantiles: Sequence[float] = (0.05, 0.5, 0.95),
    confidence: float = 0.95,
    exceed: ArrayLike | None = None,
    depth: ArrayLike | None = None,
    limits: Mapping[str, float] | None = None,
) -> xr.Dataset:
    """What the samples of a result say of worn volume and depth, over all its other dimensions.

    Each statistic has a dimension `bound`: lowest and highest over all that samples without a value may have, equal
    where all have one; NAME_interval: its confidence interval. With saltelli, indices are of the whole design, all
    others of its independent rows.

    dataset: with the dimension `sample`, drawn values as coordinates `sample_NAME`, and `worn_volume`. quantiles:
    probabilities, ascending. confidence: of the intervals. exceed, depth: worn volumes, m3, and depths, m, for the
    probabilities of exceedance; by default 41 up to the largest. limits: of worn_volume, m3, wear_depth, m,
    response_amplitude, m, and cycles_to_target or missions_to_target, above 0; by default those of the study.

    Returns worn_volume_quantile (m3), worn_volume_exceedance, and of each input first_index and total_index (1) with
    saltelli, else rank_correlation (1), each with _interval; worn_volume_quantile_error (m3), the ends with every value
    less or more its numerical error. With a limit: worn_volume_limit (m3); worn_volume_within_limit, the probability up
    to it, with _interval; worn_volume_not_placed: samples that are not known to be on one side, with numerical errors,
    which count as beyond in the lowest and as within in the highest probability. The same of wear_depth (m), of the
    deepest pair, where the file has it; with a limit of response_amplitude (m), the largest of all responses up to the
    count; where points end at a target of cycles_to_target, whose limit is the least, and which inputs then decide.
    Samples that a run has not come to, at any of the other axes, are left out, of a Saltelli design with their base
    sample: n_not_computed. n_samples, n_without_value; of the last count worn_volume_density (1/m3) over
    worn_volume_grid (m3), group_size (2), group_gap (m3, two ends; NaN for one group), deciding_contact (-1: none).

    Raises ValueError where the result has no samples, or none is computed, or no worn volume, a probability is not
    between 0 and 1, or a limit is not above 0 or of what the file does not have.
    """
    for name in ("worn_volume", "outcome"):
        if name not in dataset or SAMPLE not in dataset[name].dims:
            raise ValueError(f"The result holds no {name} of samples: run a study with [scatter].")
    if not all(0.0 < each < 1.0 for each in (*quantiles, confidence)):
        raise ValueError(f"Give probabilities between 0 and 1, not {tuple(quantiles)} and {confidence}.")
    for slow in map(str, {*dataset["worn_volume"].dims} - {*dataset["outcome"].dims, CYCLE}):
        # in place of cycles, as missions
        in_cycles = limits and {name.replace(f"{slow}s_", "cycles_"): each for name, each in limits.items()}
        counted = worn_volume_statistics(in_cycles_of(dataset), quantiles, confidence, exceed, depth, in_cycles)
        of_lives = [name for name in map(str, counted.data_vars) if name.startswith(LIFE)]
        return counted.rename({CYCLE: slow, **{name: name.replace("cycles_", f"{slow}s_") for name in of_lives}})
    if "cycle_count" in dataset:
        # each point has counts of its own: they share the last one only
        dataset = dataset.isel({CYCLE: [-1]})
    (section, there), n_rows = come_to(dataset), dataset.sizes[SAMPLE]
    if not there.size:
        raise ValueError("No sample of the result is computed yet.")
    is_saltelli = section is not None and section.method == "saltelli"
    dataset, rows = dataset.isel({SAMPLE: there}), np.arange(there.size)
    if section is not None and is_saltelli:
        # A and B are independent samples
        rows = rows[rows % section.rows_a_sample < 2]
    own = everything, names = read_samples(dataset, "worn_volume")
    values = everything.at((..., rows))
    given = _limits_of(dataset, section, limits)
    asked = _Asked(quantiles, confidence, {"worn_volume": exceed, "wear_depth": depth}, given)
    about_missing = _about("1", "samples without a value to be trusted")
    n_left, about_left = n_rows * len(rows) // there.size - len(rows), _about("1", "samples that are not computed yet")
    found: _Arrays = {
        "n_samples": ((), np.int32(len(rows)), _about("1", "samples")),
        "n_not_computed": ((), np.int32(n_left), about_left),
        "n_without_value": (names, (~values.is_known).sum(axis=-1), about_missing),
    }
    coords: dict[str, Any] = {"bound": ["lowest", "highest"]}
    coords["quantile"] = ("quantile", np.asarray(quantiles), _about("1", "probability"))
    for name in QUANTITIES:
        variable = _variable_of(dataset, name)
        has_lives = name == LIFE and bool(study_of(dataset).get("slow_time", {}).get("until"))
        has_lives &= "allowable_amplitude" not in dataset
        if variable and (name in given or has_lives or name not in (RESPONSE, LIFE)):
            whole, own_names = read_samples(dataset, variable)
            of_values, of_coords = _of_values(name, whole.at((..., rows)), own_names, asked)
            found, coords = found | of_values, coords | of_coords
    order = sorted(str(name).removeprefix(DRAWN) for name in dataset.coords if str(name).startswith(DRAWN))
    if inputs := [*section.inputs] if section is not None else order:
        of, decided = ("life", read_samples(dataset, LIFE)) if f"{LIFE}_quantile" in found else ("worn volume", own)
        found |= _of_inputs(dataset, inputs, of, decided, confidence, is_saltelli=is_saltelli)
        coords["input"] = ("input", inputs, _about("1", "input that scatters"))
    found |= _of_groups(dataset.isel({SAMPLE: rows}), values, names)
    kept = {name: array for name, array in dataset.coords.items() if set(array.dims) <= set(names)}
    return xr.Dataset(found, kept | coords, {"title": f"Statistics of {len(rows)} samples", "confidence": confidence})


def _limits_of(
    dataset: xr.Dataset, section: ScatterSection | None, limits: Mapping[str, float] | None
) -> Mapping[str, float]:
    """Limits that are asked for, else those of the study. Raises ValueError where one is of what the file lacks."""
    given = {} if limits is None else limits
    if limits is None and section is not None:
        own = {name.replace("missions_", "cycles_"): limit for name, limit in section.given_limits.items()}
        given = {name: limit for name, limit in own.items() if _variable_of(dataset, name)}
    if wrong := [name for name, limit in given.items() if not (_variable_of(dataset, name) and limit > 0.0)]:
        raise ValueError(f"Give limits above 0 of what the file has, not {wrong[0]} = {given[wrong[0]]}.")
    return given


def statistics_of_file(dataset: xr.Dataset, blocks: xr.Dataset | None = None) -> xr.Dataset | None:
    """`worn_volume_statistics` of a file, at some counts where it has many; None without samples, or with too many.

    blocks: variables of blocks of missions, over cycles as those of the dataset.
    """
    if dataset.sizes.get(SAMPLE, 0) < 2 or "worn_volume" not in dataset or come_to(dataset)[1].size < 2:
        return None
    dataset = dataset if blocks is None else with_responses(dataset, blocks)
    counts = dataset.sizes[CYCLE]
    per_count = dataset["worn_volume"].size // counts
    if 2 * per_count > _MOST_OF_ALL:
        return None
    kept = min(counts, max(2, _MOST_VALUES // per_count))
    places = np.unique(np.linspace(0, counts - 1, kept).astype(int))
    return worn_volume_statistics(dataset.isel({CYCLE: places}), QUANTILES, CONFIDENCE)


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


def _variable_of(dataset: xr.Dataset, name: str) -> str | None:
    """The variable of a result with a quantity; None where it has none."""
    of = QUANTITIES[name].variables if name in QUANTITIES else ()
    return next((each for each in of if each in dataset), None)


def _of_values(
    name: str, values: SampleValues, names: tuple[str, ...], asked: _Asked
) -> tuple[_Arrays, dict[str, Any]]:
    """Quantiles of a quantity, also with numerical errors, probabilities of more and up to its limit; coordinates."""
    words, units, dims, confidence = *QUANTITIES[name][:2], (*names, "quantile"), asked.confidence
    band = samples.quantiles(values, asked.quantiles, confidence)
    found = _bands(f"{name}_quantile", f"quantile of the {words}", units, band, dims)
    moved = np.maximum(samples.quantiles(values.widened(), asked.quantiles, confidence)[0], 0.0)
    about_error = _about(units, f"quantile of the {words}, with numerical error")
    found[f"{name}_quantile_error"] = ((*dims, "bound"), moved, about_error)
    given, shown = asked.thresholds.get(name), QUANTITIES[name].exceeded
    even = np.linspace(0.0, float(values.low.max()) or 1.0, _N_THRESHOLDS)
    above = even if given is None else np.sort(np.atleast_1d(np.asarray(given, dtype=np.float64)))
    band = samples.exceedance(values, above, confidence)
    found |= _bands(f"{name}_exceedance", f"probability of a larger {words}", "1", band, (*names, shown))
    if (limit := asked.limits.get(name)) is not None:
        at_least = QUANTITIES[name].at_least
        *each, n_unknown = samples.within(values, limit, confidence, at_least=at_least)
        side = "from the limit on" if at_least else "up to the limit"
        found |= _bands(f"{name}_within_limit", f"probability {side}, {words}", "1", (each[0], each[1]), names)
        found[f"{name}_limit"] = ((), limit, _about(units, f"limit of the {words}"))
        about_unknown = _about("1", "samples not known to be on one side of the limit")
        found[f"{name}_not_placed"] = (names, n_unknown, about_unknown)
    return found, {shown: (shown, above, _about(units, words))}


def _of_inputs(
    dataset: xr.Dataset,
    inputs: Sequence[str],
    of: str,
    decided: tuple[SampleValues, tuple[str, ...]],
    confidence: float,
    *,
    is_saltelli: bool,
) -> _Arrays:
    """What each input decides, in the order of the columns of the design; of an input of pairs the mean counts.

    of, decided: worn volume or life, in words; its samples, and the dimensions before them.
    """
    drawn = [dataset[f"{DRAWN}{name}"] for name in inputs]
    values, names = decided
    table = np.stack([each.mean([d for d in each.dims if d != SAMPLE]).values for each in drawn], axis=1)
    dims = (*names, "input")
    if is_saltelli:
        words, d = f"share of the variance of the {of} that the input decides", len(inputs)
        both = samples.saltelli_indices(table, values, confidence)
        first, total = ((both[0][..., part, :], both[1][..., part, :]) for part in (slice(d), slice(d, None)))
        found = _bands("first_index", f"{words} alone", "1", first, dims)
        return found | _bands("total_index", f"{words}, with the others", "1", total, dims)
    words = f"rank correlation of the {of} with the input"
    found = _bands("rank_correlation", words, "1", samples.rank_correlations(table, values, confidence), dims)
    # the mean over pairs or sectors says nothing of what their own draws decide
    for _, ends, _ in found.values():
        ends[..., [not {"contact", "sector"}.isdisjoint(each.dims) for each in drawn], :] = np.nan
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

"""Inputs from measurements: samples of a study weighed by how well they agree with what was measured.

The weight of a sample is the likelihood of the measured values, each normally distributed about the computed one with a
variance of three parts: of the measurement, of the discrepancy of the model, and a third of the square of the numerical
error, as of a uniform one. Importance weights of independent samples (Owen, Monte Carlo theory, chapter 9).

A history depends on the product of wear coefficient and cycles alone, but with the law "power" and with a contact that
changes with the energy. So each history stands for every drawn wear coefficient, at other counts of its own.
"""

import math
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from studyrunner.coordinates import SAMPLE
from studyrunner.measured import QUANTITIES, MeasuredSection, Measurement
from studyrunner.statistics.read_samples import scatter_of
from studyrunner.statistics.samples import CYCLE, DRAWN, FEWEST, Array

FEWEST_EFFECTIVE = 20.0
"""Effective samples below which nothing is identified: a quantile of 5 % then rests on one sample."""

CONFIDENCE = 0.9
COEFFICIENT = "wear_coefficient"
_FEWEST_COEFFICIENTS, _MOST_COMBINED, _MOST_ROUNDS = 64, 2**14, 8  # of a history, of all; of closing in
_NEGLIGIBLE = 1e-6  # weight over the largest one
_RELATIVE = ("worn_volume", "response_amplitude")  # whose errors in a file are relative


class TooFewSamplesError(ValueError):
    """Too few samples agree with what was measured. The sentence proposes what to draw from next."""


@dataclass(frozen=True)
class Computed:
    """What the samples of a result say of one measurement.

    name: of the quantity. at, measured, deviation (m,): where, and what was measured, SI. slow (m,): cycle count of
    each value. counts (k,): of the result. values, error (n, k, m or 1): of each sample at each count.
    """

    name: str
    at: Array
    measured: Array
    deviation: Array
    slow: Array
    counts: Array
    values: Array
    error: Array

    def read(self, sample: int, ratio: Array) -> tuple[Array, Array]:
        """Values and errors (r, m) of a sample, with the count of each times a ratio (r,); NaN beyond its history."""

        def at_counts(series: Array) -> Array:
            columns = np.broadcast_to(series, (len(self.counts), len(self.slow))).T
            rows = zip(self.slow, columns, strict=True)
            return np.stack([np.interp(slow * ratio, self.counts, row, np.nan, np.nan) for slow, row in rows], axis=1)

        return at_counts(self.values[sample]), at_counts(self.error[sample])


def compute_measured(dataset: xr.Dataset, section: MeasuredSection) -> tuple[Computed, ...]:
    """What a result says of everything measured. dataset: with one value of each axis but samples, and the one that is
    measured over.

    Raises ValueError where the result does not hold what was measured, or has further axes.
    """
    return tuple(_compute(dataset, name, each) for name, each in section.all)


def _compute(dataset: xr.Dataset, name: str, measurement: Measurement) -> Computed:
    at, measured, deviation = measurement.numbers
    values = _variable(dataset, name, measurement)
    of_error = QUANTITIES[name].variables[1] if values.name != "wear_depth" else "wear_depth_error"
    if of_error not in dataset:
        raise ValueError(f"measured.{name}: the result holds no {of_error}, ask for it by outputs.variables")
    error = dataset[of_error].astype(float)
    # an error that is not known: the value says nothing; of nothing worn it is none
    size = np.abs(values) if values.name in _RELATIVE else xr.ones_like(values)
    error = (error.fillna(math.inf) * size).where(size != 0.0, 0.0)
    along = {"x": "contact", "cycle": CYCLE}.get(measurement.over, measurement.over)
    wanted, arrays = [each for each in (SAMPLE, CYCLE, along) if each in values.dims], []
    for array in (values, error):
        reduced = array.max("contact") if "contact" in array.dims and along != "contact" else array
        reduced = reduced.isel(response=0) if "response" in reduced.dims else reduced
        if extra := [str(each) for each in reduced.dims if each not in wanted and reduced.sizes[each] > 1]:
            raise ValueError(f"measured.{name}: select one value of {', '.join(extra)} first")
        alone = reduced.squeeze([each for each in reduced.dims if each not in wanted], drop=True)
        arrays.append(measurement.share * alone)
    counts = dataset[CYCLE].values.astype(float) if CYCLE in values.dims else np.zeros(1)
    slow = at if measurement.over == "cycle" else np.full(at.shape, _count_of(measurement, name, counts))
    if slow.max() > counts[-1] * (1.0 + 1e-12):
        remedy = f"the study ends at {counts[-1]:g} cycles, {slow.max():g} were measured: raise slow_time.cycles"
        raise ValueError(f"measured.{name}: {remedy}")
    both = (_placed(dataset, array, along, at, measurement) for array in arrays)
    return Computed(name, at, measured, deviation, slow, counts, *both)


def _count_of(measurement: Measurement, name: str, counts: Array) -> float:
    default = counts[-1] if name == "profile" else counts[0]
    return float(default if measurement.cycle is None else measurement.cycle)


def _variable(dataset: xr.Dataset, name: str, measurement: Measurement) -> xr.DataArray:
    """The variable of a result with a measured quantity, of the pairs or the response that are meant."""
    names = {"profile": ("wear_depth",), "wear_depth": ("wear_depth_max", "wear_depth")}.get(name, (name,))
    found = next((dataset[each] for each in names if each in dataset), None)
    if found is None:
        raise ValueError(f"measured.{name}: the result holds no {names[0]}, ask for it by outputs.variables")
    if measurement.response:
        if measurement.response not in dataset["response"].values.tolist():
            raise ValueError(f"measured.{name}.response: the result has no response {measurement.response!r}")
        found = found.sel(response=[measurement.response])
    return found


def _placed(dataset: xr.Dataset, array: xr.DataArray, along: str, at: Array, measurement: Measurement) -> Array:
    """Values (n, k, m or 1) along the samples, the counts, and where a quantity was measured."""
    for name in (SAMPLE, CYCLE):
        array = array if name in array.dims else array.expand_dims(name)
    if along == CYCLE:
        return np.asarray(array.transpose(SAMPLE, CYCLE).values[..., None], dtype=float)
    places = dataset[along].values.astype(float) if along != "contact" else dataset["contact_x"].values.astype(float)
    whole = np.asarray(array.transpose(SAMPLE, CYCLE, along).values, dtype=float)
    if along == "contact":
        labels = dataset["contact_surface"].values.astype(str) if "contact_surface" in dataset else None
        kept = np.full(len(places), fill_value=True)
        if measurement.surface:
            kept = kept if labels is None else labels == measurement.surface
        if not kept.any():
            raise ValueError(f"measured.profile.surface: the result has no surface {measurement.surface!r}")
        # pairs side by side across the profile count as one
        places, inverse = np.unique(places[kept], return_inverse=True)
        rows = [whole[..., kept][..., inverse == each].mean(axis=-1) for each in range(len(places))]
        whole = np.stack(rows, axis=-1)
        mirrored = "x" in str(dataset.attrs.get("contact_mirrored", ""))
        at = np.abs(at) if mirrored else at
    if along == "modal_amplitude":
        places, at = np.log(places), np.log(at)
    order = np.argsort(places)
    flat = whole[..., order].reshape(-1, len(places))
    # beyond the pairs nothing is worn, beyond other ranges nothing is known
    beyond = 0.0 if along == "contact" else math.nan
    first = None if along == "contact" and mirrored else beyond
    inside = [np.interp(at, places[order], row, first, beyond) for row in flat]
    return np.array(inside).reshape(*whole.shape[:2], len(at))


def identify(
    dataset: xr.Dataset, measured: MeasuredSection | None = None, confidence: float = CONFIDENCE
) -> xr.Dataset:
    """Inputs and predictions of a study with samples, given what was measured.

    dataset: a result with `[scatter]`, with one value of every other axis. measured: by default [measured] of its
    study. confidence: of the intervals.

    Returns over `quantile` (the ends of the interval and the median): prior_quantile and posterior_quantile (input),
    in SI; prior_volume and posterior_volume (cycle), m3; besides weight (sample) of each history, n_effective, the
    least number of effective samples of histories and of wear coefficients, n_without_value, samples of which the file
    does not hold what was measured, and misfit, the root mean square distance of the best sample from the measured
    values, in standard deviations.

    Raises TooFewSamplesError, a ValueError, below `FEWEST_EFFECTIVE` effective samples; ValueError where the result has
    no samples, or does not hold what was measured.
    """
    study = tomllib.loads(str(dataset.attrs.get("study", "")))
    section = measured or MeasuredSection.model_validate(study.get("measured") or {}, strict=False)
    inputs = [str(name).removeprefix(DRAWN) for name in dataset.coords if str(name).startswith(DRAWN)]
    inputs = [name for name in inputs if dataset[f"{DRAWN}{name}"].dims == (SAMPLE,)]
    if SAMPLE not in dataset.dims or not inputs:
        raise ValueError("The result holds no samples of inputs: run a study with [scatter].")
    if not section.all:
        raise ValueError("Nothing was measured: give [measured] in the study, or an argument.")
    scatter = scatter_of(dataset)
    if scatter is not None and scatter.method == "saltelli":
        # of a base sample two rows are independent
        dataset = dataset.isel({SAMPLE: np.arange(dataset.sizes[SAMPLE]) % scatter.rows_a_sample < 2})
    drawn = {name: dataset[f"{DRAWN}{name}"].values.astype(float) for name in inputs}
    computed = compute_measured(dataset, section)
    levels, log_likelihood, misfit = _weigh(study, drawn, computed, section.discrepancy)
    known = np.isfinite(log_likelihood)
    if not known.any():
        raise TooFewSamplesError("No sample holds what was measured: raise slow_time.cycles, or look at the outcomes.")
    weight = _normalised(log_likelihood)
    of_histories, of_levels = weight.sum(axis=1), weight.sum(axis=0)
    effective = min(1.0 / float((each**2).sum()) for each in (of_histories, of_levels) if each.size > 1)
    # each input with its values and weights
    own = {name: (values, of_histories) for name, values in drawn.items()}
    if levels is not None:
        own[COEFFICIENT] = (levels, of_levels)
    if effective < FEWEST_EFFECTIVE:
        raise TooFewSamplesError(_next_round(own, effective))
    quantile = np.array([0.5 - 0.5 * confidence, 0.5, 0.5 + 0.5 * confidence])
    posterior = [weighted_quantiles(*own[name], quantile) for name in inputs]
    prior = [weighted_quantiles(values, np.ones(values.shape), quantile) for values in drawn.values()]
    units = [str(dataset[f"{DRAWN}{name}"].attrs.get("units", "")) for name in inputs]
    found: dict[str, Any] = {
        "prior_quantile": (("input", "quantile"), np.array(prior)),
        "posterior_quantile": (("input", "quantile"), np.array(posterior)),
        "weight": ((SAMPLE,), of_histories),
        "n_effective": effective,
        "n_without_value": int((~known).all(axis=1).sum()),
        "misfit": misfit,
    }
    ratio = np.ones((len(of_histories), 1)) if levels is None else levels / drawn[COEFFICIENT][:, None]
    found |= _predicted(dataset, ratio, weight, quantile)
    coords = {"input": inputs, "quantile": quantile, "input_units": ("input", units)}
    coords |= {name: dataset[name] for name in (CYCLE, SAMPLE) if name in dataset.coords}
    return xr.Dataset(found, coords, {"title": "Inputs identified by what was measured", "confidence": confidence})


def _weigh(
    study: dict[str, Any], drawn: dict[str, Array], computed: tuple[Computed, ...], discrepancy: float
) -> tuple[Array | None, Array, float]:
    """Wear coefficients (r,) for which each history stands, 1/Pa, None where it is its own; logarithm of the likelihood
    (n, r); misfit of the best.

    The coefficients have equal prior probabilities between two of them, which close in on what was measured.
    """
    wear, n = study.get("wear", {}), len(next(iter(drawn.values())))
    if COEFFICIENT not in drawn or wear.get("law") == "power" or wear.get("evolution"):
        return None, *_likelihood(computed, discrepancy, np.ones((n, 1)))
    own, number = drawn[COEFFICIENT], max(_MOST_COMBINED // n, _FEWEST_COEFFICIENTS)
    begin, end = 0.0, 1.0
    for _ in range(_MOST_ROUNDS):
        middles = begin + (end - begin) * (np.arange(number) + 0.5) / number
        levels = np.quantile(own, middles)
        found = _likelihood(computed, discrepancy, levels / own[:, None])
        if not np.isfinite(found[0]).any():
            break
        weight = _normalised(found[0]).sum(axis=0)
        inside = np.flatnonzero(weight > _NEGLIGIBLE * weight.max())
        if inside[-1] - inside[0] >= number // 2:
            break
        width = (end - begin) / number
        begin, end = begin + width * max(inside[0] - 1, 0), begin + width * min(inside[-1] + 2, number)
    return levels, *found


def _normalised(log_likelihood: Array) -> Array:
    """Weights (n, r), whose sum is 1; 0 where the likelihood is that of nothing.

    Whether a history is long enough for a wear coefficient depends on its own one alone, which is independent of all
    else: so each coefficient has the mean of the histories that are.
    """
    known = np.isfinite(log_likelihood)
    highest = log_likelihood[known].max()
    weight = np.exp(log_likelihood - highest, where=known, out=np.zeros(known.shape))
    weight /= np.maximum(known.sum(axis=0), 1)
    return np.asarray(weight / weight.sum())


def _likelihood(computed: Iterable[Computed], discrepancy: float, ratio: Array) -> tuple[Array, float]:
    """Logarithm of the likelihood (n, r), -inf where a sample does not hold what was measured; the least misfit."""
    total, squares, number = np.zeros(ratio.shape), np.zeros(ratio.shape), 0
    for each in computed:
        own = each.deviation**2 + (discrepancy * each.measured) ** 2
        for sample, of_sample in enumerate(ratio):
            value, error = each.read(sample, of_sample)
            variance = own + error**2 / 3.0
            with np.errstate(invalid="ignore"):
                part = -0.5 * ((value - each.measured) ** 2 / variance + np.log(variance))
            total[sample] += np.where(np.isfinite(part), part, -np.inf).sum(axis=1)
            squares[sample] += ((value - each.measured) ** 2 / own).sum(axis=1)
        number += len(each.measured)
    best = np.nanmin(squares, initial=math.inf)
    return total, math.sqrt(float(best) / number)


def weighted_quantiles(values: Array, weight: Array, quantile: Array) -> Array:
    """Quantiles (q,) of values (n,) with weights (n,); between values linear in the weight up to their middles."""
    order = np.argsort(values)
    share = weight[order] / weight.sum()
    return np.asarray(np.interp(quantile, np.cumsum(share) - 0.5 * share, values[order]))


def _next_round(own: dict[str, tuple[Array, Array]], effective: float) -> str:
    """What to draw from next: the ranges of the samples that agree best, half as wide again."""
    ranges = []
    for name, (values, weight) in own.items():
        mean = float(values @ weight)
        spread = math.sqrt(float((values - mean) ** 2 @ weight))
        # of one sample the spread is nothing: as far as its neighbours
        least = float(np.ptp(values)) / len(values)
        low, high = mean - 3.0 * max(spread, least), mean + 3.0 * max(spread, least)
        ranges.append(f"{name} = {{uniform = {{low = {max(low, 0.0):.4g}, high = {high:.4g}}}}}")
    text = f"only {effective:.2g} effective samples agree with what was measured, {FEWEST_EFFECTIVE:g} are needed"
    return f"{text}: draw more, or next from {', '.join(ranges)}"


def _predicted(dataset: xr.Dataset, ratio: Array, weight: Array, quantile: Array) -> dict[str, Any]:
    """Worn volume at the counts of the file, before and with what was measured; nothing of modes."""
    if "worn_volume" not in dataset or CYCLE not in dataset["worn_volume"].dims:
        return {}
    volumes = dataset["worn_volume"].squeeze(drop=True).transpose(SAMPLE, CYCLE).values.astype(float)
    counts = dataset[CYCLE].values.astype(float)
    rows = zip(ratio, volumes, strict=True)
    moved = np.array([np.interp(counts * own[:, None], counts, row, np.nan, np.nan) for own, row in rows])
    own_weight = np.full((len(volumes), 1), 1.0 / len(volumes))
    found: dict[str, Any] = {}
    for name, all_of, of in (("prior", volumes[:, None], own_weight), ("posterior", moved, weight)):
        bands = np.full((len(counts), len(quantile)), np.nan)
        for place, column in enumerate(np.moveaxis(all_of, -1, 0)):
            known = np.isfinite(column)
            held = (of * known).sum(axis=0)
            # of a coefficient whose histories end earlier those that are long enough stand for all, if they are some
            enough = known.sum(axis=0) >= FEWEST if of.shape[1] > 1 else held > 1.0 - 0.5 * quantile[0]
            if of.sum(axis=0)[~enough].sum() < 0.5 * quantile[0]:
                scale = np.divide(of.sum(axis=0), held, out=np.zeros(held.shape), where=enough & (held > 0.0))
                bands[place] = weighted_quantiles(column[known], (of * scale)[known], quantile)
        found[f"{name}_volume"] = ((CYCLE, "quantile"), bands)
    return found

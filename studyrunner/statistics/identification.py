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
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from studyrunner.coordinates import SAMPLE
from studyrunner.measured import MeasuredSection
from studyrunner.statistics.computed import Computed, compute_measured
from studyrunner.statistics.read_samples import scatter_of
from studyrunner.statistics.samples import CYCLE, DRAWN, FEWEST, Array

FEWEST_EFFECTIVE = 20.0
"""Effective samples below which nothing is identified: a quantile of 5 % then rests on one sample."""

CONFIDENCE = 0.9
COEFFICIENT = "wear_coefficient"
_FEWEST_COEFFICIENTS, _MOST_COMBINED, _MOST_ROUNDS = 64, 2**14, 8  # of a history, of all; of closing in
_NEGLIGIBLE = 1e-6  # weight over the largest one


class TooFewSamplesError(ValueError):
    """Too few samples agree with what was measured. The sentence proposes what to draw from next."""


@dataclass(frozen=True)
class Weighed:
    """Samples of a result, weighed by what was measured.

    dataset: with the samples that count. drawn: values (n,) of each input. computed: of each measurement. levels (r,):
    wear coefficients, 1/Pa, for which each history stands; None where it is its own. weight (n, r): sum 1.
    n_without_value: samples of which the file does not hold what was measured. misfit: see `identify`.
    """

    dataset: xr.Dataset
    drawn: dict[str, Array]
    computed: tuple[Computed, ...]
    levels: Array | None
    weight: Array
    n_without_value: int
    misfit: float

    @property
    def ratio(self) -> Array:
        """Counts (n, r) of a history over those for which it stands."""
        n = len(self.weight)
        return np.ones((n, 1)) if self.levels is None else self.levels / self.drawn[COEFFICIENT][:, None]

    def bands(self, quantile: Array) -> tuple[Array, ...]:
        """Quantiles (k, q) of each measured quantity: at its places, or over the counts of the file."""
        found = []
        for each in self.computed:
            if each.values.shape[2] == 1:
                each = replace(each, slow=each.counts)
            values = np.array([each.read(sample, own)[0] for sample, own in enumerate(self.ratio)])
            found.append(_bands(values, self.weight, quantile))
        return tuple(found)


def weigh_samples(dataset: xr.Dataset, section: MeasuredSection) -> Weighed:
    """The samples of a result by what was measured; arguments and errors as `identify`."""
    study = tomllib.loads(str(dataset.attrs.get("study", "")))
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
    weight, without = _normalised(log_likelihood), int((~known).all(axis=1).sum())
    return Weighed(dataset, drawn, computed, levels, weight, without, misfit)


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
    return describe_posterior(weigh_samples(dataset, section), confidence)


def describe_posterior(weighed: Weighed, confidence: float = CONFIDENCE) -> xr.Dataset:
    """What `identify` returns. Raises TooFewSamplesError."""
    dataset, drawn, weight = weighed.dataset, weighed.drawn, weighed.weight
    of_histories, of_levels = weight.sum(axis=1), weight.sum(axis=0)
    effective = min(1.0 / float((each**2).sum()) for each in (of_histories, of_levels) if each.size > 1)
    # each input with its values and weights
    own = {name: (values, of_histories) for name, values in drawn.items()}
    if weighed.levels is not None:
        own[COEFFICIENT] = (weighed.levels, of_levels)
    if effective < FEWEST_EFFECTIVE:
        raise TooFewSamplesError(_next_round(own, effective))
    quantile = np.array([0.5 - 0.5 * confidence, 0.5, 0.5 + 0.5 * confidence])
    posterior = [weighted_quantiles(*own[name], quantile) for name in drawn]
    prior = [weighted_quantiles(values, np.ones(values.shape), quantile) for values in drawn.values()]
    units = [str(dataset[f"{DRAWN}{name}"].attrs.get("units", "")) for name in drawn]
    found: dict[str, Any] = {
        "prior_quantile": (("input", "quantile"), np.array(prior)),
        "posterior_quantile": (("input", "quantile"), np.array(posterior)),
        "weight": ((SAMPLE,), of_histories),
        "n_effective": effective,
        "n_without_value": weighed.n_without_value,
        "misfit": weighed.misfit,
    }
    found |= _predicted(weighed, quantile)
    coords = {"input": [*drawn], "quantile": quantile, "input_units": ("input", units)}
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


def _predicted(weighed: Weighed, quantile: Array) -> dict[str, Any]:
    """Worn volume at the counts of the file, before and with what was measured; nothing of modes."""
    dataset = weighed.dataset
    if "worn_volume" not in dataset or CYCLE not in dataset["worn_volume"].dims:
        return {}
    volumes = dataset["worn_volume"].squeeze(drop=True).transpose(SAMPLE, CYCLE).values.astype(float)
    counts = dataset[CYCLE].values.astype(float)
    rows = zip(weighed.ratio, volumes, strict=True)
    moved = np.array([np.interp(counts * own[:, None], counts, row, np.nan, np.nan) for own, row in rows])
    alike = np.full((len(volumes), 1), 1.0 / len(volumes))
    both = (("prior", volumes[:, None], alike), ("posterior", moved, weighed.weight))
    return {f"{name}_volume": ((CYCLE, "quantile"), _bands(values, of, quantile)) for name, values, of in both}


def _bands(values: Array, weight: Array, quantile: Array) -> Array:
    """Quantiles (k, q) of values (n, r, k), NaN beyond a history, with weights (n, r)."""
    bands = np.full((values.shape[-1], len(quantile)), np.nan)
    for place, column in enumerate(np.moveaxis(values, -1, 0)):
        known = np.isfinite(column)
        held = (weight * known).sum(axis=0)
        # of a coefficient whose histories end earlier those that are long enough stand for all, if they are some
        enough = known.sum(axis=0) >= FEWEST if weight.shape[1] > 1 else held > 1.0 - 0.5 * quantile[0]
        if weight.sum(axis=0)[~enough].sum() < 0.5 * quantile[0]:
            scale = np.divide(weight.sum(axis=0), held, out=np.zeros(held.shape), where=enough & (held > 0.0))
            bands[place] = weighted_quantiles(column[known], (weight * scale)[known], quantile)
    return bands

"""What came out of a search for allowable amplitudes: the least one, the range, and of samples what decides it."""

import math
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from studyrunner.coordinates import SAMPLE
from studyrunner.result.view import Point, Result
from studyrunner.statistics.samples import DRAWN, FEWEST, SampleValues, rank_correlations
from studyrunner.statistics.study_statistics import CONFIDENCE
from studyrunner.summary.findings import Finding, show, where_is, with_error
from studyrunner.system.progress import count
from studyrunner.units import show_cycles

_FOR_TAILS = 72
"""Samples from which on quantiles of 5 and 95 % lie between samples (`what_samples_tell`)."""


def find_allowable(result: Result) -> Finding:
    """The least amplitude at which a point meets its target, and those of the others."""
    until: dict[str, float] = cast("Any", result.study["slow_time"])["until"]
    (quantity, target), *_ = until.items()
    amplitudes, errors = (result.of_points(f"allowable_amplitude{end}") for end in ("", "_error"))
    known = result.computed & np.isfinite(amplitudes)
    met = f"{quantity.replace('_', ' ')} {show(target, {'wear_depth': 'm', 'worn_volume': 'm3'}[quantity])}"
    met += f" after {show_cycles(float(result.cycles[-1]), result.counted)}"
    values = {"target": target, "n_known": int(known.sum()), "amplitude": math.nan}
    if not known.any():
        return Finding("allowable", "allowable", f"no point is known to meet {met}", values)
    point = result.largest(-np.where(known, amplitudes, np.inf))
    amplitude, error = (float(each[result.place(point)]) for each in (amplitudes, errors))
    text = f"{with_error(amplitude, error, 'N')} at {where_is(result, point)}: {met}"
    if known.sum() > 1:
        text += f"; the least of {count(int(known.sum()), 'point')}, the largest {show(amplitudes[known].max(), 'N')}"
    if SAMPLE in result.varying:
        text += _of_samples(result, point, amplitudes, errors)
    if not known.all():
        text += f"; not known of {count(int((~known).sum()), 'point')}"
    return Finding("allowable", "allowable", text, values | {"amplitude": amplitude, "error": error, "point": point})


def _of_samples(result: Result, point: Point, amplitudes: NDArray[np.float64], errors: NDArray[np.float64]) -> str:
    """Quantiles of the samples at a point, and the input with the largest rank correlation."""
    there = tuple(slice(None) if name == SAMPLE else point[name] for name in result.axes)
    own, wrong = amplitudes[there], errors[there]
    text, n = "", own.size
    if n >= _FOR_TAILS:
        low, middle, high = np.nanquantile(own, [0.05, 0.5, 0.95], method="inverted_cdf")
        text = f"; 5, 50, 95 % of {n} samples allow less than {show(low, 'N')}, {show(middle, 'N')}, {show(high, 'N')}"
    drawn = {str(name): each for name, each in result.dataset.coords.items() if str(name).startswith(DRAWN)}
    names = [name for name, each in drawn.items() if each.dims == (SAMPLE,)]
    if not names or n < FEWEST:
        return text + f"; {n} samples are too few to say which input decides" * bool(names)
    inputs = np.stack([drawn[name].values for name in names], axis=1)
    is_known = np.isfinite(own)
    low, high = np.where(is_known, own, 0.0), np.where(is_known, own, np.inf)
    ranks, _ = rank_correlations(inputs, SampleValues(low, high, np.where(is_known, wrong, 0.0)), CONFIDENCE)
    middles = np.nan_to_num(ranks.mean(axis=-1))
    order = np.argsort(-np.abs(middles))
    words = [f"{names[place].removeprefix(DRAWN).replace('_', ' ')} {middles[place]:.2f}" for place in order]
    return text + f"; rank correlations: {', '.join(words)}"

"""What came out of a study, as data, from its result alone.

`summary(dataset)` is for the command, the page and notebooks; `lines.summary_lines` writes it. Only results are in it:
a history that was not computed to the end, or is known to a factor of two only, has no number here.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from studyrunner.result.certainty import Certainty, advise_ended, certainty_of, list_ended
from studyrunner.result.opening import as_history
from studyrunner.result.pairs import contact_pairs
from studyrunner.result.view import COMPLETE_WORDS, Result
from studyrunner.statistics.samples import SAMPLE
from studyrunner.statistics.study_statistics import describe_ranking, describe_volumes
from studyrunner.summary.wear import (
    Life,
    MeshChange,
    MostWear,
    NothingWore,
    Vibration,
    compare_meshes,
    most_wear,
    shortest_life,
    vibration_of,
    where_is,
)
from studyrunner.system.progress import count
from studyrunner.units import show_number

SMALL = 0.1
"""Largest depth over the width of the contact that is called small: slopes and stiffness change by that order."""


@dataclass(frozen=True)
class Samples:
    """What the samples say, at the point of the other axes where their median is largest."""

    where: str  # this point in words
    n_points: int
    volumes: str  # range and median of the worn volumes
    ranking: str  # which input decides


@dataclass(frozen=True)
class ModeRange:
    """Natural frequency, Hz, and damping ratio of a mode: ends of their ranges over the points that were found."""

    number: int
    over: str  # what varies, in words
    frequency: tuple[float, float]
    damping: tuple[float, float]
    n_found: int
    n_points: int


@dataclass(frozen=True)
class Failure:
    """Points that ended in one way but `converged`."""

    word: str
    is_complete: bool  # computed to the end, and uncertain only
    n_points: int
    sentence: str
    advice: str
    where: str  # the first of these points in words, empty where the study has one point
    reason: str  # its message


@dataclass(frozen=True)
class Summary:
    """What came out."""

    n_points: int
    n_complete: int  # computed to the end
    counted: str  # "cycles" or "missions"
    failures: tuple[Failure, ...]  # of each way to fail
    certainty: Certainty | None
    wear: MostWear | NothingWore | None = None  # None where it is not known or not asked for
    samples: Samples | None = None  # with [scatter]
    vibration: Vibration | None = None
    life: Life | None = None  # with a target
    mesh: MeshChange | None = None  # where meshes can be compared
    modes: tuple[ModeRange, ...] = ()
    stuck_frequency: float = np.nan  # Hz, of the joint that sticks; NaN where there is none, or several
    doubts: tuple[str, ...] = ()  # sentences on values that are hardly what was meant

    def __str__(self) -> str:
        """The summary as text."""
        from studyrunner.summary.lines import summary_lines

        return "\n".join(summary_lines(self))


def summary(dataset: xr.Dataset) -> Summary:
    """The summary of a result, as `open_result` gives it; variables are read some points at a time."""
    history, blocks = as_history(dataset)
    return summarise(Result(Path(str(dataset.encoding.get("source", "result"))), history, blocks=blocks))


def summarise(result: Result) -> Summary:
    """The summary of a result that is opened for the report."""
    numbers = result.computed.size, int(result.computed.sum()), result.counted, _failures(result)
    if result.has_modes:
        return Summary(*numbers, certainty_of(result), modes=_modes(result))
    wear = most_wear(result)
    of_scenes = result.dataset["stuck_frequency"].values if result.has("stuck_frequency") else np.array(math.nan)
    stuck = float(of_scenes) if of_scenes.ndim == 0 else math.nan
    return Summary(
        *numbers,
        certainty_of(result, wore=not isinstance(wear, NothingWore)),
        wear,
        _samples(result) if isinstance(wear, MostWear) else None,
        vibration_of(result, wear),
        shortest_life(result),
        compare_meshes(result),
        stuck_frequency=stuck,
        doubts=tuple(filter(None, (_not_small(result), _in_radians(result, stuck), _too_few_counts(result)))),
    )


def _samples(result: Result) -> Samples | None:
    statistics = result.statistics
    if statistics is None:
        return None
    last = statistics.isel(cycle=-1, missing_dims="ignore")
    medians = last["worn_volume_quantile"].sel(quantile=0.5).isel(bound=0)
    place = np.unravel_index(int(np.argmax(medians.values)), medians.shape)
    point = dict(zip(map(str, medians.dims), map(int, place), strict=True))
    where = result.describe(point, [name for name in result.varying if name != SAMPLE])
    of_all = last.isel(point)
    return Samples(where, int(medians.size), describe_volumes(of_all), describe_ranking(of_all))


def _modes(result: Result) -> tuple[ModeRange, ...]:
    numbers = [name for name in result.varying if name != "mode" and result.dataset[name].dtype.kind in "iuf"]
    ends = {name: [show_number(float(result.dataset[name].values[place])) for place in (0, -1)] for name in numbers}
    over = ", ".join(f"{name.replace('_', ' ')} {' to '.join(each)}" for name, each in ends.items())
    axis, found = result.axes.index("mode"), []
    for index, number in enumerate(result.dataset["mode"].values.tolist()):
        computed = result.computed.take(index, axis=axis)
        ranges = {}
        for name in ("natural_frequency", "damping_ratio"):
            values = result.dataset[name].values.take(index, axis=axis) if result.has(name) else np.zeros(0)
            values = values[computed] if values.size else values
            ranges[name] = (float(values.min()), float(values.max())) if values.size else (math.nan, math.nan)
        frequency, damping = ranges.values()
        found.append(ModeRange(int(number), over, frequency, damping, int(computed.sum()), computed.size))
    return tuple(found)


def _failures(result: Result) -> tuple[Failure, ...]:
    numbers, counts = np.unique(result.dataset["outcome"].values, return_counts=True)
    found = []
    for number, n_points in zip(numbers.tolist(), counts.tolist(), strict=True):
        ending = result.endings[number]
        if ending.word == "converged":
            continue
        reason, (point, *_) = next(iter(list_ended(result, number).items()))
        sentence = re.split(r"[.:](?:\s|$)", ending.sentence)[0]
        advice = " ".join(advise_ended(result, number)[:1]).rstrip(".")
        where = where_is(result, point) if result.varying else ""
        # what the message of a sensitive one holds is no result
        reason = "" if ending.word == "sensitive" else reason
        is_complete = ending.word in COMPLETE_WORDS
        found.append(Failure(ending.word, is_complete, n_points, sentence, advice, where, reason))
    found.sort(key=lambda each: (each.is_complete, -each.n_points))
    return tuple(found)


def _not_small(result: Result) -> str:
    """Where wear is not small against the contact, as the method assumes.

    The reference takes the depth of the wear for "very small compared with the dimension of the structures in contact",
    so that mass, stiffness and the places of the pairs stay as they were designed. The width is the side of a square as
    large as the smallest contact surface.
    """
    if not result.has("largest_wear_depth"):
        return ""
    pairs = contact_pairs(result, result.shown_point())
    areas = [float(np.nansum(pairs.area[pairs.surface == surface])) for surface in np.unique(pairs.surface)]
    width = math.sqrt(min((area for area in areas if area > 0.0), default=math.inf))
    ratios = np.nan_to_num(np.where(result.computed, result.dataset["largest_wear_depth"].values, 0.0) / width)
    if ratios.max() <= SMALL:
        return ""
    return (
        f"the method assumes shallow wear, but the depth is {ratios.max():.2g} of the contact width at"
        f" {where_is(result, result.largest(ratios))}: take fewer cycles, and check that wear_coefficient is in 1/Pa"
    )


def _in_radians(result: Result, first: float) -> str:
    """Frequencies that are all far above the first resonance, Hz, and near it if they are in rad/s."""
    if math.isnan(first) or "frequency" not in result.axes:
        return ""
    values = result.dataset["frequency"].values / (2.0 * math.pi)
    if not (2.0 * math.pi * values.min() > 2.0 * first and 0.5 * first < values.max() and values.min() < 2.0 * first):
        return ""
    return f"all frequencies are far above the first resonance, {first:.6g} Hz: are they in rad/s?"


def _too_few_counts(result: Result) -> str:
    """Points that reach their target before the first count at which the file could hold wear."""
    if not result.has("cycles_to_target", "worn_volume") or result.dataset.sizes["cycle"] < 2:
        return ""
    at_second = result.dataset["worn_volume"].isel(cycle=1).transpose(*result.axes).values
    early = result.computed & np.isfinite(result.dataset["cycles_to_target"].values) & np.isnan(at_second)
    if not early.any():
        return ""
    points = count(int(np.count_nonzero(early)), "point")
    return f"no worn volume is stored for {points}: the target comes before the second of slow_time.outputs: give more"

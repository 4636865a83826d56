"""What a result file says about the settings it compares: its points, read whole once."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import xarray as xr

from studyrunner.report.precision.errors import FloatArray, Point
from studyrunner.report.precision.settings import KEYS, list_settings, varying_keys
from studyrunner.report.reading.result import Result

_NUMBERS = ("run_time", "error_estimate", "step_limit")
_LAST_NUMBERS = ("response_error", "harmonics_used", "samples_used")


@dataclass(frozen=True)
class Precision:
    """What a result file says about the settings it compares.

    keys: settings of several values. points: in the order of the file. schemes: of the settings that are measured, in
    the order of the file. shared: whether the time of some point may be that of a march which computed other points,
    too.
    """

    keys: tuple[str, ...]
    points: tuple[Point, ...]
    schemes: tuple[str | None, ...]
    shared: bool

    @property
    def outcomes(self) -> Counter[str]:
        """How many settings failed at how many points, by the word of their outcome."""
        return Counter(word for point in self.points for word in point.failures.values())


def study_precision(result: Result) -> Precision | None:
    """What the settings of a file cost and how wrong they are; None where it does not compare at least two with a third
    one, or with the exact answer; schemes alone are compared with that only.
    """
    keys = varying_keys(result)
    of_schemes = all(key == "scheme" for key in keys) and not result.has("exact_worn_volume")
    if of_schemes or not (result.has("worn_volume") or result.has("response_amplitude")):
        return None
    points = tuple(_read_points(result))
    if max(np.count_nonzero(point.compared) for point in points) < 2:
        return None
    wears = result.dataset.sizes.get("wear_coefficient", 1) > 1 and result.cycles[-1] > 0.0
    shortcuts = bool(result.study.get("solver", {}).get("shortcuts", True))
    compared = np.any([point.compared for point in points], axis=0)
    present = {setting.scheme for setting, row in points[0].settings.items() if compared[row]}
    named = result.dataset["scheme"].values.tolist() if "scheme" in result.axes else []
    schemes = tuple(name for name in (*named, None) if name in present)
    return Precision(keys, points, schemes, shared=shortcuts and wears)


def _read_points(result: Result) -> Iterator[Point]:
    """All points of the axes that are no settings."""
    others = [name for name in result.axes if name not in KEYS]
    varying = [name for name in others if name in result.varying]
    order = [*others, *(name for name in result.axes if name in KEYS)]
    shape = [result.dataset.sizes[name] for name in others]
    settings = list_settings(result)

    def by_setting(values: xr.DataArray) -> FloatArray:
        """Values (axes...) or (axes..., more) as (point, setting) or (point, setting, more)."""
        sorted_in = values.transpose(*order, ...).values
        found = sorted_in.reshape(math.prod(shape), -1, *sorted_in.shape[len(order) :])
        return np.asarray(found[:, list(settings.values())], dtype=float)

    def read(name: str, *more: int) -> FloatArray:
        """Values (point, setting, more), NaN where the file has none."""
        return by_setting(result.read(name)) if result.has(name) else np.full((*outcome.shape, *more), np.nan)

    outcome = by_setting(result.dataset["outcome"])
    computed = by_setting(result.dataset["outcome"].copy(data=result.computed)) == 1.0
    courses, amplitudes = [len(result.cycles)], [len(result.cycles), len(result.responses)]
    values = {name: read(name) for name in _NUMBERS}
    values |= {name: read(name, *courses)[..., -1] for name in _LAST_NUMBERS}
    values["worn_volume"] = read("worn_volume", *courses)
    values["response_amplitude"] = read("response_amplitude", *amplitudes)
    rtol = [each.rtol or result.study_number("solver", "rtol") for each in settings]
    values["rtol"] = np.broadcast_to(rtol, outcome.shape)
    exact_worn, exact_response = read("exact_worn_volume", *courses), read("exact_response_amplitude", *amplitudes)
    rows = {setting: row for row, setting in enumerate(settings)}
    for number, kept in enumerate(computed):
        ended = outcome[number].astype(int)
        words = {setting: result.endings[ended[row]].word for setting, row in rows.items() if not kept[row]}
        exact = exact_worn[number, 0], exact_response[number, 0]
        known = all(np.isfinite(each).all() for each in exact)
        at = map(int, np.unravel_index(number, shape))
        label = result.describe(dict(zip(others, at, strict=True)), varying) if varying else ""
        own = {name: array[number] for name, array in values.items()}
        yield Point(label, float(result.cycles[-1]), rows, kept, own, words, exact if known else None)

"""What the errors of the settings tell: orders of convergence, the cheapest setting."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from studyrunner.report.precision.errors import QUANTITIES, RESOLVED, Point
from studyrunner.report.precision.settings import ADAPTIVE, EXPLICIT, OF_TIME, Setting, family

TARGETS = (0.05, 0.01, 0.001)
"""Relative errors that a setting is recommended for."""

CLEAR = 5.0
"""An error enters a slope from so many times that of the finest setting on, where this is the reference or tells what
else is wrong.
"""


@dataclass(frozen=True)
class Order:
    """How the error falls with one key, all others held.

    key: "step", "harmonics" or "samples". setting: the others. errors: by the value of the key, ascending. used: those
    values that the slope is fitted to. order: exponent of the step, or of one over the number; NaN where it cannot be
    measured, and `reason` says why.
    """

    key: str
    setting: Setting
    quantity: str
    errors: Mapping[float, float]
    used: tuple[float, ...]
    order: float
    reason: str


@dataclass(frozen=True)
class Recommendation:
    """The cheapest setting for a target. Errors: the largest over the points, relative.

    setting: None where there is none. certain: whether its error and the uncertainty of the reference together are
    below the target; else only the error is. reference: largest uncertainty of the reference.
    """

    target: float
    setting: Setting | None
    run_time: float
    volume: float
    response: float
    certain: bool
    reference: float


def find_orders(point: Point) -> tuple[Order, ...]:
    """Orders in the step, for each scheme of given steps, and in harmonics and samples, at one point.

    Those in the step hold for the finest harmonics and samples of the file, so that only the step matters; those in
    harmonics and samples for the wear steps of the reference, or the finest where that is exact.
    """
    finest = point.finest
    if finest is None or point.reference is None:
        return ()
    found: list[Order] = []
    for scheme in dict.fromkeys(setting.scheme for setting in point.results):
        own = [each for each in family(point.results, finest, *OF_TIME) if each.scheme == scheme]
        if scheme != ADAPTIVE and len({each.step for each in own} - {None}) > 1:
            found += _fit_orders(point, "step", own, *_limit_of_small_steps(point, finest))
    for key in ("harmonics", "samples"):
        own = [each for each in family(point.results, finest, key) if isinstance(getattr(each, key), float)]
        least = {name: RESOLVED * point.uncertainty(name) for name in QUANTITIES}
        if point.reference.setting is None:
            # what is left with the finest setting has other causes
            least = {name: CLEAR * point.measured.at[finest, name] for name in QUANTITIES}
        if len(own) > 1:
            found += _fit_orders(point, key, own, point.reference.setting, least)
    return tuple(found)


def recommend(points: Sequence[Point], target: float) -> Recommendation:
    """The cheapest setting whose errors are below a target at all of these points; time is summed over them.

    A setting counts where it has a result at all points that have a reference.
    """
    compared = [point for point in points if point.compared.any()]
    known = [point.uncertainty(name) for point in compared for name in point.quantities]
    nothing = Recommendation(target, None, math.nan, math.nan, math.nan, False, max(known, default=math.nan))
    if not known:
        return nothing
    errors, bounds = {name: np.zeros(len(points[0].settings)) for name in QUANTITIES}, np.zeros(len(points[0].settings))
    for point in compared:
        for name in point.quantities:
            error = np.nan_to_num(point.errors[name], nan=np.inf)
            errors[name] = np.maximum(errors[name], error)
            bounds = np.maximum(bounds, error + point.uncertainty(name))
    usable = np.all([point.compared for point in compared], axis=0)
    good = usable & np.all([error <= target for error in errors.values()], axis=0)
    if not good.any():
        return nothing
    certain = bool((good & (bounds <= target)).any())
    time = np.sum([point.values["run_time"] for point in compared], axis=0)
    row = int(np.argmin(np.where(good & (bounds <= target) if certain else good, time, np.inf)))
    volume, response = (float(errors[name][row]) for name in QUANTITIES)
    setting = list(points[0].settings)[row]
    return Recommendation(target, setting, float(time[row]), volume, response, certain, nothing.reference)


def log_slope(values: Sequence[float], errors: Sequence[float]) -> float:
    """Slope of log(error) over log(value) by least squares; at least two values."""
    return float(np.polyfit(np.log(values), np.log(errors), 1)[0])


def show_percent(value: float) -> str:
    """A relative number as percent; a dash where it is not a number."""
    if math.isnan(value):
        return "\N{EN DASH}"
    percent = 100.0 * value
    if percent == 0.0 or 1e-3 <= abs(percent) < 1e3:
        return f"{percent:.2g} %"
    return f"{percent:.0e} %" if math.isfinite(percent) else "not known"


def _limit_of_small_steps(point: Point, finest: Setting) -> tuple[Setting | None, dict[str, float]]:
    """What errors by the step are measured against, and the least that counts: the adaptive scheme with the same
    harmonics and samples, so that only the step matters, whatever these are worth; else the exact answer; else the
    smallest step.
    """
    adaptive = [each for each in family(point.results, finest, *OF_TIME) if each.scheme == ADAPTIVE]
    if adaptive:
        against = min(adaptive, key=lambda setting: setting.rtol or 0.0)
        return against, dict.fromkeys(QUANTITIES, point.number("rtol", against))
    if point.exact is not None:
        known = [point.number(name, finest) for name in ("error_estimate", "response_error")]
        return None, dict(zip(QUANTITIES, CLEAR * np.nan_to_num(known, posinf=0.0), strict=True))
    steps = [each for each in family(point.results, finest, "step") if each != finest]
    nearest = sorted(steps, key=lambda setting: setting.step or 0.0)[:1]
    return finest, {name: CLEAR * point.measured[name][nearest].max() for name in QUANTITIES}


def _fit_orders(
    point: Point, key: str, settings: list[Setting], against: Setting | None, least: Mapping[str, float]
) -> Iterator[Order]:
    """Orders by the slope of log(error), of each quantity.

    against: None for the exact answer. least: smaller errors do not enter the slope, nor do those of explicit steps
    beyond their limit, which follow no order; NaN where it is not known.
    """
    own = [setting for setting in settings if setting != against]
    errors = pd.DataFrame(point.compare(against), index=pd.Index(list(point.settings), dtype=object)).loc[own]
    errors["_value"] = [getattr(setting, key) for setting in own]
    explicit = np.array([key == "step" and setting.scheme == EXPLICIT for setting in own])
    errors["_beyond"] = explicit & (errors["_value"] > [point.number("step_limit", setting) for setting in own])
    errors = errors.sort_values("_value")
    for name in QUANTITIES:
        sizes = errors[name]
        used = errors[~errors["_beyond"] & np.isfinite(sizes) & (sizes > 0.0) & (sizes >= least[name])]
        order, reason = math.nan, ""
        if len(used) > 1:
            order = log_slope(used["_value"], used[name]) * (1.0 if key == "step" else -1.0)
        elif not math.isfinite(least[name]):
            reason = "the uncertainty of the reference is not known"
        else:
            found = f"{len(used) or 'no'} value with a clear error"
            reason = f"{found}, of {show_percent(least[name])} at least; two are needed"
        if np.isfinite(sizes).any():
            by_value = dict(zip(errors["_value"], sizes, strict=True))
            yield Order(key, settings[0].without(key), name, by_value, tuple(used["_value"]), order, reason)

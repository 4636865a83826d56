"""What the errors of the settings tell: orders of convergence, the largest stable step, the cheapest setting."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from studyrunner.report.precision.errors import (
    QUANTITIES,
    RESOLVED,
    RESPONSE,
    VOLUME,
    Measured,
    Point,
    Precision,
    difference,
    finest_in_time,
    finest_reference,
)
from studyrunner.report.precision.settings import ADAPTIVE, EXPLICIT, IMPLICIT, Run, Setting

TARGETS = (0.05, 0.01, 0.001)
"""Relative errors that a setting is recommended for."""

CLEAR = 5.0
"""An error enters a slope from so many times that of the finest setting on, where this is the reference or tells what
else is wrong.
"""

_OF_TIME = ("scheme", "step", "rtol")

FAITHFUL = 2.0
"""Both Euler schemes are equally wrong as long as both are stable."""

STEPS_TO_OSCILLATE = 4
"""Fewer steps cannot show that the wear rate oscillates."""


@dataclass(frozen=True)
class Order:
    """How the error falls with one key, all others held.

    key: "step", "harmonics" or "samples". setting: the others. values, errors: ascending in `values`. used: those
    values that the slope is fitted to. order: exponent of the step, or of one over the number; NaN where it cannot be
    measured, and `reason` says why.
    """

    key: str
    setting: Setting
    quantity: str
    values: tuple[float, ...]
    errors: tuple[float, ...]
    used: tuple[float, ...]
    order: float
    reason: str


@dataclass(frozen=True)
class StableStep:
    """The explicit steps of one family of settings, cycles; NaN where there is none.

    setting: the others of its settings. largest: longest step up to which all are stable. smallest_unstable: the first
    that oscillates or fails. predicted: largest stable step at cycle 0. unjudged: steps so long that too few of them
    were taken to tell. faithful: longest step up to which the worn volume is at most `FAITHFUL` times as wrong as by
    the implicit scheme of the same step.
    """

    setting: Setting
    largest: float
    smallest_unstable: float
    predicted: float
    unjudged: tuple[float, ...]
    faithful: float


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
    finest = _finest(point)
    if finest is None:
        return ()
    found = []
    for scheme in dict.fromkeys(run.setting.scheme for run in point.runs.runs):
        if scheme == ADAPTIVE:
            continue
        family = [run for run in _family(point, finest, *_OF_TIME) if run.setting.scheme == scheme]
        if len({run.setting.step for run in family} - {None}) > 1:
            found += [_order_in_step(point, finest, family, quantity) for quantity in QUANTITIES]
    for key in ("harmonics", "samples"):
        family = [run for run in _family(point, finest, key) if isinstance(getattr(run.setting, key), int)]
        if len(family) > 1:
            found += [_order_in_number(point, finest, family, key, quantity) for quantity in QUANTITIES]
    return tuple(order for order in found if any(math.isfinite(error) for error in order.errors))


def find_stable_step(point: Point) -> StableStep | None:
    """The explicit steps at one point, with the finest harmonics and samples; None where the file compares none."""
    finest = _finest(point)
    if finest is None:
        return None
    like = finest.setting.without(*_OF_TIME)
    explicit = [run for run in _family(point, finest, *_OF_TIME) if run.setting.scheme == EXPLICIT]
    steps = {run.setting.step: not run.oscillates for run in explicit if run.setting.step is not None}
    for failure in point.failures:
        own = failure.setting
        if own.scheme == EXPLICIT and own.step is not None and own.without(*_OF_TIME) == like:
            steps[own.step] = False
    if len(steps) < 2:
        return None
    cycles = float(finest.cycles[-1])
    enough = {step: stable for step, stable in steps.items() if not stable or cycles >= STEPS_TO_OSCILLATE * step}
    unstable = min((step for step, stable in enough.items() if not stable), default=math.nan)
    stable = [step for step in enough if math.isnan(unstable) or step < unstable]
    limits = [run.step_limit for run in explicit if not math.isnan(run.step_limit)]
    return StableStep(
        setting=like,
        largest=max(stable, default=math.nan),
        smallest_unstable=unstable,
        predicted=limits[0] if limits else math.nan,
        unjudged=tuple(sorted(set(steps) - set(enough))),
        faithful=_faithful_step(point, explicit),
    )


def _faithful_step(point: Point, explicit: Sequence[Run]) -> float:
    """Longest explicit step up to which all are about as exact as implicit ones; NaN where there is none to compare."""
    errors = {item.setting: item.volume for item in point.measured}
    found = math.nan
    for run in sorted(explicit, key=lambda run: run.setting.step or 0.0):
        own, other = (errors.get(replace(run.setting, scheme=scheme), math.nan) for scheme in (EXPLICIT, IMPLICIT))
        if not own <= FAITHFUL * other or run.setting.step is None:
            break
        found = run.setting.step
    return found


def recommend(points: Sequence[Point], target: float) -> Recommendation:
    """The cheapest setting whose errors are below a target at all of these points; time is summed over them.

    A setting counts where it has a result at all points that have a reference. One that oscillates never does.
    """
    compared = [point for point in points if point.reference is not None and point.measured]
    uncertainties = [
        point.reference.uncertainty(quantity)
        for point in compared
        for quantity in point.quantities
        if point.reference is not None
    ]
    reference = max(uncertainties, default=math.nan)
    best: dict[bool, Recommendation] = {}
    for setting in _common_settings(compared):
        entries = [(point, _of(point, setting)) for point in compared]
        time = sum(item.run_time for _, item in entries)
        errors = {
            quantity: max(
                (item.error(quantity) for point, item in entries if quantity in point.quantities), default=0.0
            )
            for quantity in QUANTITIES
        }
        bounds = [
            item.error(quantity) + point.reference.uncertainty(quantity)
            for point, item in entries
            for quantity in point.quantities
            if point.reference is not None
        ]
        if not bounds or any(item.oscillates for _, item in entries) or not max(errors.values()) <= target:
            continue
        certain = max(bounds) <= target
        if certain not in best or time < best[certain].run_time:
            found = Recommendation(target, setting, time, errors[VOLUME], errors[RESPONSE], certain, reference)
            best[certain] = found
    nothing = Recommendation(target, None, math.nan, math.nan, math.nan, False, reference)
    return best.get(True) or best.get(False) or nothing


def recommendations(precision: Precision) -> tuple[tuple[str, tuple[Recommendation, ...]], ...]:
    """For each point that is compared, and for all of them together where there are several: label, one a target."""
    compared = [point for point in precision.points if point.measured]
    found = [
        (point.label, tuple(recommend([point], target) for target in TARGETS)) for point in compared if point.differs
    ]
    if len(compared) > 1:
        found.append(("all points", tuple(recommend(compared, target) for target in TARGETS)))
    return tuple(found)


def log_slope(values: Sequence[float], errors: Sequence[float]) -> float:
    """Slope of log(error) over log(value) by least squares; at least two values."""
    slope = np.polyfit(np.log(values), np.log(errors), 1)[0]
    return float(slope)


def _finest(point: Point) -> Run | None:
    """The reference, or the finest setting where that is exact."""
    if point.reference is None or point.reference.setting is not None:
        return None if point.reference is None else point.reference.run
    inner = finest_reference(point.runs)
    return None if inner is None else inner.run


def _family(point: Point, finest: Run, *keys: str) -> list[Run]:
    """Runs that differ from the finest one in these keys only."""
    like = finest.setting.without(*keys)
    return [run for run in point.runs.runs if run.setting.without(*keys) == like]


def _order_in_step(point: Point, finest: Run, family: list[Run], quantity: str) -> Order:
    """Order in the step, against the adaptive scheme with the same harmonics and samples, so that only the step
    matters, whatever these are worth; else against the exact answer; else against the smallest step.
    """
    place = QUANTITIES.index(quantity)
    adaptive = [run for run in _family(point, finest, *_OF_TIME) if run.setting.scheme == ADAPTIVE]
    if adaptive:
        against = finest_in_time(adaptive)
        least = against.rtol
    elif point.runs.exact is not None:
        against = point.runs.exact
        known = (finest.error_estimate, finest.response_error)[place]
        least = CLEAR * known if math.isfinite(known) else 0.0
    else:
        against = finest
        others = [run for run in _family(point, finest, "step") if run is not finest]
        nearest = min(others, key=lambda run: run.setting.step or 0.0, default=None)
        least = math.nan if nearest is None else CLEAR * difference(nearest, finest)[place]
    entries = {
        run.setting.step: (difference(run, against)[place], run.setting.scheme != EXPLICIT or not beyond_limit(run))
        for run in family
        if run.setting.step is not None and run is not against
    }
    return _fit("step", family[0].setting.without("step"), quantity, entries, least)


def _order_in_number(point: Point, finest: Run, family: list[Run], key: str, quantity: str) -> Order:
    """Order in one over the number of harmonics or samples, against the reference."""
    assert point.reference is not None
    place = QUANTITIES.index(quantity)
    against = point.reference.run
    entries = {
        float(getattr(run.setting, key)): (difference(run, against)[place], True)
        for run in family
        if run is not against
    }
    least = RESOLVED * point.reference.uncertainty(quantity)
    if point.reference.setting is None:
        # what is left with the finest setting has other causes
        least = CLEAR * difference(finest, against)[place]
    found = _fit(key, finest.setting.without(key), quantity, entries, least)
    return replace(found, order=-found.order)


def beyond_limit(run: Run) -> bool:
    """Whether the step of an explicit run is longer than the predicted limit; errors follow no order there."""
    return run.setting.step is not None and run.setting.step > run.step_limit


def _fit(key: str, setting: Setting, quantity: str, entries: dict[float, tuple[float, bool]], least: float) -> Order:
    """The order by the slope of log(error).

    entries: for each value its error and whether that may enter the slope. least: smaller errors do not; NaN where it
    is not known.
    """
    values = sorted(entries)
    errors = tuple(entries[value][0] for value in values)
    used = tuple(
        value
        for value, error in zip(values, errors, strict=True)
        if entries[value][1] and math.isfinite(error) and error > 0.0 and error >= least
    )
    order, reason = math.nan, ""
    if len(used) > 1:
        order = log_slope(used, [entries[value][0] for value in used])
    elif not math.isfinite(least):
        reason = "the uncertainty of the reference is not known"
    else:
        reason = f"{len(used) or 'no'} value with a clear error, of {show_percent(least)} at least; two are needed"
    return Order(key, setting, quantity, tuple(values), errors, used, order, reason)


def show_percent(value: float) -> str:
    """A relative number as percent; a dash where it is not a number."""
    if math.isnan(value):
        return "\N{EN DASH}"
    percent = 100.0 * value
    if percent == 0.0 or 1e-3 <= abs(percent) < 1e3:
        return f"{percent:.2g} %"
    return f"{percent:.0e} %" if math.isfinite(percent) else "not known"


def _common_settings(points: Iterable[Point]) -> list[Setting]:
    """Settings that have an error at all points, in the order of the first one."""
    of_points = [[item.setting for item in point.measured] for point in points]
    if not of_points:
        return []
    return [setting for setting in of_points[0] if all(setting in others for others in of_points[1:])]


def _of(point: Point, setting: Setting) -> Measured:
    return next(item for item in point.measured if item.setting == setting)

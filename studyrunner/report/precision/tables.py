"""Error against run time as tables: recommended settings, observed orders, stable steps, all settings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from studyrunner.report.drawing import Table
from studyrunner.report.precision.errors import QUANTITIES, VOLUME, Point, Precision, Reference
from studyrunner.report.precision.findings import (
    FAITHFUL,
    STEPS_TO_OSCILLATE,
    Order,
    Recommendation,
    find_orders,
    find_stable_step,
    recommendations,
    show_percent,
)
from studyrunner.report.precision.settings import KEYS
from studyrunner.report.reading.result import as_sentences
from studyrunner.report.reading.units import show_number

NAMES = {"volume": "final worn volume", "response": "response at the end"}
"""The quantities in words."""

_DASH = "\N{EN DASH}"


def list_precision(precision: Precision, shown: Sequence[Point]) -> Iterator[Table]:
    """All tables; those of orders and of all settings for the points shown only."""
    yield _table_of_recommendations(precision, shown)
    yield from _table_of_orders(precision, shown)
    yield from _table_of_stable_steps(precision)
    for number, point in enumerate(shown, start=1):
        yield _table_of_settings(precision, point, number)


def reference_words(precision: Precision, point: Point) -> str:
    """What the errors at a point are measured against."""
    assert point.reference is not None
    if point.reference.setting is None:
        return "the exact answer"
    return f"the finest setting of the file ({point.reference.setting.describe(precision.keys)})"


def how_known(point: Point) -> str:
    """How well the reference is known; empty where it is exact."""
    reference = point.reference
    assert reference is not None
    if reference.setting is None:
        return ""
    quantities = [name for name in QUANTITIES if name in point.quantities]
    known = " and ".join(f"{show_percent(reference.uncertainty(name))} in the {NAMES[name]}" for name in quantities)
    words = f"The reference{f' at {point.label}' if point.label else ''} is known to {known} by its own estimate"
    if math.isnan(reference.response_difference) and math.isnan(reference.volume_difference):
        return words
    changes = " and ".join(show_percent(_difference(reference, name)) for name in quantities)
    return f"{words}; the next coarser settings differ from it by up to {changes}"


def _difference(reference: Reference, quantity: str) -> float:
    return reference.volume_difference if quantity == VOLUME else reference.response_difference


def _table_of_recommendations(precision: Precision, shown: Sequence[Point]) -> Table:
    others = {point.label for point in precision.points} - {point.label for point in shown}
    rows = [
        (label or _DASH, show_percent(item.target), *_recommended(precision, item))
        for label, items in recommendations(precision)
        for item in items
        if label not in others
    ]
    note = (
        "The cheapest setting whose errors of worn volume and response are both below the target, the uncertainty of"
        " the reference included, out of those that the file compares and whose wear rate oscillates in no pair."
        " Times of all points are summed."
    )
    columns = ("point", "error below", "setting", "CPU time (s)", "worn volume", "response", "remark")
    return Table("precision_recommended", "Recommended settings", columns, tuple(rows), note)


def _recommended(precision: Precision, item: Recommendation) -> tuple[str, str, str, str, str]:
    if item.setting is None:
        remark = "none of the settings"
        if item.reference > item.target:
            remark += f"; the reference is known to {show_percent(item.reference)} only"
        return ("none", _DASH, _DASH, _DASH, remark)
    remark = "" if item.certain else f"not certain: the reference is known to {show_percent(item.reference)} only"
    errors = (show_percent(item.volume), show_percent(item.response))
    return (item.setting.describe(precision.keys), f"{item.run_time:.3g}", *errors, remark)


def _table_of_orders(precision: Precision, shown: Sequence[Point]) -> Iterator[Table]:
    rows = [
        (
            point.label or _DASH,
            order.key,
            order.setting.describe(precision.keys) or _DASH,
            NAMES[order.quantity],
            _DASH if math.isnan(order.order) else f"{order.order:.2f}",
            _used(order) if not math.isnan(order.order) else order.reason,
            ", ".join(
                f"{show_number(v, 4)}: {show_percent(e)}" for v, e in zip(order.values, order.errors, strict=True)
            ),
        )
        for point in shown
        for order in find_orders(point)
    ]
    if rows:
        note = (
            "Slope of log(error) over log(step), or over log(1 / number), by least squares. The error by the step is"
            " that against the adaptive scheme of the same harmonics and samples, where the file has it; explicit steps"
            " beyond the predicted limit are left out."
        )
        columns = ("point", "in", "other settings", "of", "order", "fitted to", "errors")
        yield Table("precision_orders", "Observed orders of convergence", columns, tuple(rows), note)


def _errors(order: Order) -> str:
    pairs = zip(order.values, order.errors, strict=True)
    return ", ".join(f"{show_number(value, 4)}: {show_percent(error)}" for value, error in pairs)


def _used(order: Order) -> str:
    low, high = (show_number(value, 4) for value in (order.used[0], order.used[-1]))
    return f"{low} to {high} ({len(order.used)} values)"


def _table_of_stable_steps(precision: Precision) -> Iterator[Table]:
    rows = []
    for point in precision.points:
        found = find_stable_step(point)
        if found is None or not point.reference or not point.reference.wears:
            continue
        predicted = "no limit" if found.predicted == math.inf else _cycles(found.predicted)
        unjudged = ", ".join(map(_cycles, found.unjudged)) or _DASH
        steps = map(_cycles, (found.largest, found.smallest_unstable, found.faithful))
        row = (point.label or _DASH, predicted, *steps, unjudged)
        rows.append(row)
    if rows:
        note = (
            "Steps in cycles, with the finest harmonics and samples. The limit is predicted at cycle 0 and changes as"
            " the joint wears; a step oscillates where the wear rate of any pair does at any time, also of one that"
            f" wears little. A step of which there are fewer than {STEPS_TO_OSCILLATE} in the march is not judged. As"
            f" exact as implicit: at most {FAITHFUL:.0f} times as wrong in the worn volume with the same step."
        )
        named = ("largest stable", "smallest that oscillates or fails", "as exact as implicit", "not judged")
        columns = ("point", "predicted limit", *named)
        yield Table("precision_stable_steps", "Largest stable explicit step", columns, tuple(rows), note)


def _cycles(value: float) -> str:
    return _DASH if math.isnan(value) else show_number(value, 4)


def _table_of_settings(precision: Precision, point: Point, number: int) -> Table:
    keys = [key for key in KEYS if key in precision.keys]
    fronts = {name: point.front(name) for name in point.quantities}
    rows = []
    for item in point.measured:
        remarks = [f"front of {NAMES[name]}" for name, front in fronts.items() if item in front]
        remarks += [f"{NAMES[name]} not resolved" for name in fronts if not item.resolved(name)]
        remarks += ["oscillates"] * item.oscillates
        errors = (show_percent(item.volume), show_percent(item.course), show_percent(item.response))
        settings = (item.setting.words(key) for key in keys)
        rows.append((*settings, f"{item.run_time:.3g}", *errors, ", ".join(remarks)))
    for failure in point.failures:
        settings = (failure.setting.words(key) for key in keys)
        rows.append((*settings, _DASH, _DASH, _DASH, _DASH, f"failed: {failure.word.replace('_', ' ')}"))
    columns = (*keys, "CPU time (s)", "worn volume", "worn volume, any count", "response", "remark")
    title = "All settings" + (f" at {point.label}" if point.label else "")
    note = as_sentences(f"Relative errors against {reference_words(precision, point)}", how_known(point))
    return Table(f"precision_settings_{number}", title, columns, tuple(rows), note)

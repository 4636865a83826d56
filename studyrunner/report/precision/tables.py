"""Error against run time as tables: recommended settings, observed orders, stable steps, all settings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from studyrunner.report.drawing import Table
from studyrunner.report.precision.comparison import Precision
from studyrunner.report.precision.errors import QUANTITIES, Point
from studyrunner.report.precision.findings import (
    TARGETS,
    Order,
    Recommendation,
    find_orders,
    recommend,
    show_percent,
)
from studyrunner.report.reading.result import as_sentences
from studyrunner.report.reading.units import show_number

_DASH = "\N{EN DASH}"


def list_precision(precision: Precision, shown: Sequence[Point]) -> Iterator[Table]:
    """All tables, of the points shown; the recommended settings also of all points together."""
    yield _table_of_recommendations(precision, shown)
    yield from _table_of_orders(precision, shown)
    for number, point in enumerate(shown, start=1):
        yield _table_of_settings(precision, point, number)


def reference_words(precision: Precision, point: Point) -> str:
    """What the errors at a point are measured against."""
    if point.reference is None or point.reference.setting is None:
        return "the exact answer"
    return f"the finest setting of the file ({point.reference.setting.describe(precision.keys)})"


def how_known(point: Point) -> str:
    """How well the reference is known; empty where it is exact."""
    reference = point.reference
    if reference is None or reference.setting is None:
        return ""
    known = " and ".join(
        f"{show_percent(reference.uncertainty[name])} in the {QUANTITIES[name]}" for name in point.quantities
    )
    words = f"The reference{f' at {point.label}' if point.label else ''} is known to {known} by its own estimate"
    if all(map(math.isnan, reference.difference.values())):
        return words
    changes = " and ".join(show_percent(reference.difference[name]) for name in point.quantities)
    return f"{words}; the next coarser settings differ from it by up to {changes}"


def _table_of_recommendations(precision: Precision, shown: Sequence[Point]) -> Table:
    compared = [point for point in precision.points if point.compared.any()]
    groups = [(point.label or _DASH, [point]) for point in shown]
    groups += [("all points", compared)] if len(compared) > 1 else []
    rows = [
        (label, show_percent(target), *_recommended(precision, recommend(points, target)))
        for label, points in groups
        for target in TARGETS
    ]
    note = (
        "The cheapest setting whose errors of worn volume and response are both below the target, the uncertainty of"
        " the reference included, out of those that the file compares. Times of all points are"
        " summed."
    )
    columns = ("point", "error below", "setting", "CPU time (s)", "worn volume", "response", "remark")
    return Table("precision_recommended", "Recommended settings", columns, tuple(rows), note)


def _recommended(precision: Precision, item: Recommendation) -> tuple[str, str, str, str, str]:
    known = f"the reference is known to {show_percent(item.reference)} only"
    if item.setting is None:
        remark = f"none of the settings; {known}" if item.reference > item.target else "none of the settings"
        return ("none", _DASH, _DASH, _DASH, remark)
    errors = (show_percent(item.volume), show_percent(item.response))
    remark = "" if item.certain else f"not certain: {known}"
    return (item.setting.describe(precision.keys), f"{item.run_time:.3g}", *errors, remark)


def _table_of_orders(precision: Precision, shown: Sequence[Point]) -> Iterator[Table]:
    rows = [
        (
            point.label or _DASH,
            order.key,
            order.setting.describe(precision.keys) or _DASH,
            QUANTITIES[order.quantity],
            *_fitted(order),
            ", ".join(f"{_cycles(value)}: {show_percent(error)}" for value, error in order.errors.items()),
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


def _fitted(order: Order) -> tuple[str, str]:
    if math.isnan(order.order):
        return _DASH, order.reason
    return f"{order.order:.2f}", f"{_cycles(order.used[0])} to {_cycles(order.used[-1])} ({len(order.used)} values)"


def _cycles(value: float) -> str:
    return _DASH if math.isnan(value) else show_number(value, 4)


def _table_of_settings(precision: Precision, point: Point, number: int) -> Table:
    fronts = {name: point.front(name).index for name in point.quantities}
    rows = []
    for item in point.measured.itertuples():
        remarks = [f"front of {QUANTITIES[name]}" for name, front in fronts.items() if item.Index in front]
        remarks += [f"{QUANTITIES[name]} not resolved" for name in fronts if not getattr(item, f"{name}_resolved")]
        errors = map(show_percent, (item.volume, item.course, item.response))
        settings = map(item.Index.words, precision.keys)
        rows.append((*settings, f"{item.run_time:.3g}", *errors, ", ".join(remarks)))
    for setting, word in point.failures.items():
        rows.append((*map(setting.words, precision.keys), *[_DASH] * 4, f"failed: {word.replace('_', ' ')}"))
    columns = (*precision.keys, "CPU time (s)", "worn volume", "worn volume, any count", "response", "remark")
    title = "All settings" + (f" at {point.label}" if point.label else "")
    note = as_sentences(f"Relative errors against {reference_words(precision, point)}", how_known(point))
    return Table(f"precision_settings_{number}", title, columns, tuple(rows), note)

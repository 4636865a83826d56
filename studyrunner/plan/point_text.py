"""Points, cycle counts and errors in words, for what is printed at the end of a run and in messages of points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from studyrunner.advice import Used
from studyrunner.percent import show_percent
from studyrunner.study.study import Study

_SHORT = 1e4


def describe_reach(last: float, end: float, error: float, counted: str = "cycle") -> str:
    """How far a history was computed that ends early, and the relative error of the last worn volume that is known.

    end: count that was asked for, inf where there is none. counted: what is counted, "cycle" or "mission".
    """
    reached = f"computed up to {counted} {show_count(last)}" + (f" of {show_count(end)}" if end < math.inf else "")
    # before the first count that was asked for nothing has worn, and that is known exactly
    known = last > 0.0 and 0.0 < error < math.inf
    return f"{reached}, the worn volume there to {show_percent(error)}" if known else reached


def show_count(cycle: float) -> str:
    """A cycle count: "31 000"; one that is no whole number, or very large, in short."""
    if cycle < 1e12 and cycle == round(cycle):
        text = f"{cycle:,.0f}".replace(",", " ")
        return text if cycle >= _SHORT else text.replace(" ", "")
    return f"{cycle:.6g}"


def describe_point(study: Study, point: Sequence[int]) -> str:
    """A point along those axes that have more than one value: "211.25 Hz, explicit"; empty where none has."""
    texts = []
    for (name, values), index in zip(study.dimensions.items(), point, strict=True):
        if len(values) > 1:
            texts.append(describe_value(study, name, values[index]))
    return ", ".join(texts)


def describe_value(study: Study, name: str, value: float | str) -> str:
    """A value of an axis: the scheme by its word and the frequency by its unit, all others with their name."""
    shown = value if isinstance(value, str) else str(value).lower() if isinstance(value, bool) else f"{value:.8g}"
    units = study.units(name)
    after = f" {units}" if units != "1" and not isinstance(value, str) else ""
    return f"{shown}{after}" if name in ("frequency", "scheme") else f"{name} {shown}{after}"


def settings_of(study: Study, point: Sequence[int]) -> Used:
    """What a point is computed with, for advice on it."""
    axes = study.axes
    at = {name: values[index] for (name, values), index in zip(study.dimensions.items(), point, strict=True)}

    def of(key: str) -> Any:
        return at.get(key, getattr(study.solver, key))

    return Used(
        scheme=str(at.get("scheme", axes.scheme[0])),
        sweep=str(at["sweep"]),
        harmonics=of("harmonics"),
        samples=of("samples"),
        rtol=of("rtol"),
        schemes=axes.scheme,
        # the excitation of a mode is none that could be raised
        sweeps=(*axes.sweep, "ramp") if study.has_modes else axes.sweep,
        by_depth=study.slow_time.largest_depth is not None,
        until=study.until is not None,
    )

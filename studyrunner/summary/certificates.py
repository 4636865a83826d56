"""How right the states of a result are: the largest value of each certificate and its place, for the report."""

from __future__ import annotations

import numpy as np

from studyrunner.percent import show_percent
from studyrunner.report.reading.result import Result
from studyrunner.variables import CERTIFICATE

_ROUND_OFF = float(np.finfo(float).eps)
"""Certificates are relative: less than this is none, wherever it is the most."""


def certificate_rows(result: Result) -> list[tuple[str, str, str]]:
    """Certificate, largest value over all points computed to the end and all counts, and where it is.

    Those alone that the file holds. "not estimated" where no point has a value.
    """
    rows = []
    for name, label in CERTIFICATE.items():
        if not result.has(name) or not result.computed.any():
            continue
        if "cycle" in result.dataset[name].dims:
            largest = result.over_points(name, lambda values: np.fmax.reduce(values, axis=1))
        else:
            largest = result.read(name).transpose(*result.axes).values
        largest = np.where(result.computed, largest, np.nan)
        if np.isnan(largest).all():
            rows.append((label, "not estimated", ""))
            continue
        place = np.unravel_index(int(np.nanargmax(largest)), largest.shape)
        value = float(largest[place])
        point = {axis: int(index) for axis, index in zip(result.axes, place, strict=True)}
        shown = f"{value:.1e}" if not name.endswith("_error") else show_percent(value)
        rows.append((label, shown, result.describe(point)) if value > _ROUND_OFF else (label, "none", ""))
    return rows

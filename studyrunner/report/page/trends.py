"""What the page holds of trends: final worn volume, its error, peak response and shift of the resonance."""

from __future__ import annotations

import numpy as np

from studyrunner.report.page.encoding import encode_floats
from studyrunner.report.reading.result import Result
from studyrunner.report.reading.units import scale_for
from studyrunner.report.trends.quantities import find_error, find_quantities, has_trends


def build_trend_numbers(result: Result) -> list[dict[str, object]] | None:
    """Quantities as the script on the page reads them, the worn volume and its error first; None without trends.

    `label`; `sizes`: of the axes of the study, 1 along `frequency` where the quantity was searched through it; `data`
    and `errors` in SI, in this shape, as `encode_floats` has them, `errors` absolute or null where none is told; times
    `factor` they are in `unit`.
    """
    if not has_trends(result):
        return None
    found = find_quantities(result)
    error = find_error(result)
    if error is not None:
        found.insert(1, error)
    numbers: list[dict[str, object]] = []
    for one in found:
        if not np.isfinite(one.values).any():
            continue
        scale = scale_for(one.units, one.values)
        numbers.append(
            {
                "label": one.label,
                "unit": scale.unit,
                "factor": scale.factor,
                "sizes": list(one.values.shape),
                "data": encode_floats(one.values),
                "errors": encode_floats(one.errors) if np.isfinite(one.errors).any() else None,
            }
        )
    return numbers or None

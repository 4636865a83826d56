"""What trends are told of: final worn volume, peak response and shift of the resonance, each with its error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studyrunner.report.reading.result import Result
from studyrunner.report.reading.sample_statistics import SAMPLE

FloatArray = NDArray[np.float64]

_PLAIN = ("frequency", "scheme", SAMPLE)


@dataclass(frozen=True)
class Quantity:
    """A number of every point in SI, in the shape of the axes; `frequency` has length 1 where it was searched through.

    label: in words. units: as in the file, "%" of an error. values: NaN where it is not known. errors: absolute, NaN
    where none is told.
    """

    label: str
    units: str
    values: FloatArray
    errors: FloatArray


def has_trends(result: Result) -> bool:
    """Whether there is something to tell, and more varies than what other figures show: frequency, scheme, samples."""
    return bool(result.computed.any()) and not all(name in _PLAIN for name in result.varying)


def find_error(result: Result) -> Quantity | None:
    """Estimated error of the final worn volume, %; None where the file tells of none above zero."""
    errors = np.where(result.computed & (result.errors > 0.0), 100.0 * result.errors, np.nan)
    known = result.has("worn_volume") and len(result.cycles) > 1 and np.isfinite(errors).any()
    return Quantity("estimated error", "%", errors, np.full(errors.shape, np.nan)) if known else None


def find_quantities(result: Result) -> list[Quantity]:
    """Those that the file can tell: the worn volume, the peak response, and with several frequencies the shift."""
    found = []
    if result.has("worn_volume") and len(result.cycles) > 1:
        worn = np.where(result.computed, result.worn, np.nan)
        found.append(Quantity(f"worn volume {result.when(-1)}", "m3", worn, result.errors * worn))
    if not result.has("response_amplitude"):
        return found
    amplitude = result.read("response_amplitude").isel(response=0).transpose(*result.axes, "cycle")
    units = str(amplitude.attrs.get("units", "m"))
    name = f" of {result.responses[0]}" if result.responses else ""
    values = np.asarray(amplitude.values, dtype=float)
    values = np.where(result.computed[..., None], values, np.nan)
    if "frequency" not in result.varying:
        errors = np.full(result.computed.shape, np.nan)
        return [*found, Quantity(f"response{name} at the end", units, values[..., -1], errors)]
    axis = result.axes.index("frequency")
    frequency = np.asarray(result.dataset["frequency"].values, dtype=float)
    top, height, top_error, height_error = find_peak(frequency, values[..., -1], axis)
    found.append(Quantity(f"peak response{name} at the end", units, height, height_error))
    if len(result.cycles) > 1:
        first, _, first_error, _ = find_peak(frequency, values[..., 0], axis)
        found.append(Quantity("shift of the resonance", "Hz", top - first, top_error + first_error))
    return found


def find_peak(frequency: FloatArray, amplitude: FloatArray, axis: int) -> tuple[FloatArray, ...]:
    """Largest amplitude along `axis` by a parabola through the largest value and its neighbours.

    Parameters
    ----------
    frequency
        Hz (n,), in any order.
    amplitude
        m; NaN where a point has no state.
    axis
        Along which `frequency` runs.

    Returns
    -------
    tuple
        Frequency, amplitude, and their errors: distances of the parabola's vertex to the largest value. Length 1 along
        `axis`; NaN where fewer than three values are known or the largest stands at an end, so that the peak may lie
        outside.
    """
    order = np.argsort(frequency, kind="stable")
    x, lines = frequency[order], np.moveaxis(amplitude, axis, -1)[..., order]
    found = np.full((4, *lines.shape[:-1]), np.nan)
    for place in np.ndindex(lines.shape[:-1]):
        known = np.isfinite(lines[place])
        f, a = x[known], lines[place][known]
        top = int(np.argmax(a)) if a.size else 0
        if not 0 < top < a.size - 1:
            continue
        left, right = f[top - 1] - f[top], f[top + 1] - f[top]
        below, above = (a[top - 1] - a[top]) / left, (a[top + 1] - a[top]) / right
        curvature = (above - below) / (right - left)
        slope = below - curvature * left
        shift = -0.5 * slope / curvature if curvature < 0.0 else 0.0
        rise = 0.5 * slope * shift
        found[(slice(None), *place)] = f[top] + shift, a[top] + rise, abs(shift), rise
    return tuple(np.expand_dims(each, axis) for each in found)

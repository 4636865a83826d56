"""How a joint responds, new and worn, and how a resonance that is followed moves while it wears."""

import math
from typing import Any

import numpy as np

from solver.outcome import SENSITIVE_ERROR, absolute
from studyrunner.result.view import NO_MOTION, Point, Result
from studyrunner.summary.findings import Finding, show, where_is, with_error
from studyrunner.units import show_cycles


def describe_response(result: Result, point: Point, wears: bool, resonance: str) -> Finding:
    """Amplitudes of the response that is largest at a point, new and worn; NaN where known to a factor of two only."""
    ends = [0, result.last_reached(point)]
    amplitude = result.at("response_amplitude", point, ends).transpose("cycle", "response").values
    of = int(np.argmax(amplitude[0]))
    both = np.where(amplitude[:, of] > NO_MOTION, amplitude[:, of], 0.0)
    has_errors = result.has("response_error")
    wrong = result.at("response_error", point, ends).values if has_errors else np.full(2, np.nan)
    both = np.where((wrong > SENSITIVE_ERROR) & (both > 0.0), np.nan, both)
    errors, name = absolute(wrong, both), result.responses[of]
    both_errors = zip(both.tolist(), errors.tolist(), strict=True)
    new, worn = (with_error(value, error, "m") if has_errors else show(value, "m") for value, error in both_errors)
    values: dict[str, Any] = {"response": name, "amplitude": both.tolist(), "error": errors.tolist()}
    if result.followed and result.has("excitation_frequency"):
        start, end = result.at("excitation_frequency", point, ends).values.tolist()
        has_error = result.has("excitation_frequency_error")
        error = float(result.at("excitation_frequency_error", point, ends[1])) if has_error else math.nan
        shown = f"{end:.6g}" + (f" ± {error:.2g}" if math.isfinite(error) else " (error not known)" * has_error)
        beyond, between = _between(result, point, ends[1])
        moved = f"moved from {start:.6g} to {shown} Hz{beyond}" if wears else f"at {start:.6g} Hz"
        text = f"{moved}; response of {name} {new}" + (f" to {worn}" if wears else "")
        text += "; a study with axes.modal_amplitude and scene.worn gives its damping" if wears else ""
        values |= {"frequency": [start, end], "frequency_error": error, "between": between}
        return Finding("response", result.followed, text, values)
    if not both.any():
        return Finding("response", "response", f"{name} does not move", values)
    case = " at this point" if wears else f", most at {where_is(result, point)}"
    text = f"{name}{case if result.computed.size > 1 else ''}: amplitude {new}"
    if wears:
        text += f" when new, {worn} when worn"
    frequency, peak = _peak(result, point, of)
    if math.isfinite(frequency):
        text += f"; the new joint responds most at {frequency:.6g} Hz ({show(peak, 'm')})"
    if wears and resonance:
        follow = 'the moving resonance was not computed: axes.frequency = "resonance" follows it'
        text += f"; {resonance}; {follow}" if "frequency" in result.axes else f"; {resonance}"
    return Finding("response", "response", text, values | {"peak": frequency})


def _between(result: Result, point: Point, last: int) -> tuple[str, list[tuple[float, float]]]:
    """Highest and lowest followed frequency of a point where they lie outside of both ends by more than their error: in
    words, and each with its count. last: index of the last count.
    """
    if not result.has("excitation_frequency_error"):
        return "", []
    names, counts = ("excitation_frequency", "excitation_frequency_error"), result.counts(point)
    row, error = (result.at(name, point).values[: last + 1] for name in names)
    found = {}
    for word, sign in (("highest", 1.0), ("lowest", -1.0)):
        at = int(np.argmax(sign * row))
        if sign * row[at] - max(sign * row[0], sign * row[-1]) > error[at]:
            found[word] = float(row[at]), float(counts[at])
    texts = (f", {word} {hertz:.6g} Hz after {show_cycles(at, result.counted)}" for word, (hertz, at) in found.items())
    return "".join(texts), [*found.values()]


def _peak(result: Result, point: Point, of: int) -> tuple[float, float]:
    """Frequency, Hz, and amplitude, m, of the largest response of the unworn joint; NaN at the ends of the range."""
    if result.dataset.sizes.get("frequency", 1) < 3:
        return math.nan, math.nan
    others = {name: index for name, index in point.items() if name != "frequency"}
    row = result.at("response_amplitude", others, 0).isel(response=of)
    there = result.has_values[tuple(others.get(name, slice(None)) for name in result.axes)]
    order = np.argsort(row["frequency"].values)
    values = np.where(there, row.values, np.nan)[order]
    top = 0 if np.isnan(values).all() else int(np.nanargmax(values))
    if not 0 < top < len(values) - 1 or np.isnan(values[top - 1 : top + 2]).any():
        return math.nan, math.nan
    return float(row["frequency"].values[order][top]), float(values[top])

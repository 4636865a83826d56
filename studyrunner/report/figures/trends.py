"""Trends of final worn volume, peak response and shift of the resonance along every axis of the study."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from studyrunner.report.drawing import Drawn
from studyrunner.report.panels import COLOURS, FloatArray, add_line, is_narrow, new_panels, set_log
from studyrunner.report.selection import spans_decades
from studyrunner.result.units import scale_for, show_number, units_of
from studyrunner.result.view import Result, as_sentences
from studyrunner.statistics.samples import SAMPLE

_PLAIN = ("frequency", "scheme", SAMPLE)
_MOST_AXES, _SMALL = 6, 7.5
_LONG = 9  # characters that stand side by side under a small panel


@dataclass(frozen=True)
class Quantity:
    """A number of every point in SI, in the shape of the axes; `frequency` has length 1 where it was searched through.

    label: in words. units: as in the file, "%" of an error. values: NaN where it is not known. errors: absolute, NaN
    where there is no estimate.
    """

    label: str
    units: str
    values: FloatArray
    errors: FloatArray


def draw_trends(result: Result) -> Drawn:
    """Small multiples: one row a quantity, one column an axis. Nothing where only frequency and scheme vary."""
    quantities = [one for one in find_quantities(result) if np.isfinite(one.values).any()]
    if not quantities or all(name in _PLAIN for name in result.varying):
        return None
    # the last of many are the first to go
    axes = [name for name in result.varying if name != SAMPLE][:_MOST_AXES]
    left = [name.replace("_", " ") for name in result.varying if name not in (*axes, SAMPLE)]
    figure, panels = new_panels(len(quantities), len(axes), 0.5 + 1.35 * len(quantities), sharey="row")
    for row, quantity in enumerate(quantities):
        scale = scale_for(quantity.units, quantity.values)
        # a quantity that was searched through the frequency has no panel over it
        known = [name for name in axes if quantity.values.shape[result.axes.index(name)] > 1]
        for name, panel in zip(axes, panels[row], strict=True):
            if name not in known:
                panel.remove()
                continue
            _draw_lines(panel, result, quantity, name, scale.factor)
            axis = result.axes.index(name)
            if any(one.values.shape[axis] > 1 for one in quantities[row + 1 :]):
                panel.set_xlabel("")
                panel.tick_params(labelbottom=False)
            if is_narrow() or name == known[0]:
                panel.set_ylabel(f"{quantity.label}\n({scale.unit})")
                panel.tick_params(labelleft=True)
    return figure, as_sentences(
        f"For each axis of the study; blue: through {result.describe(result.shown_point())}, where most is worn; grey:"
        " all other combinations",
        "Bars: estimated error of the worn volume; of the peak, its distance from the nearest frequency of the study",
        "The shift is the frequency of the largest response at the last count less that at the first, of points each"
        " after its own wear. Peaks at an end of the frequency range are left out"
        if "frequency" in result.varying
        else "",
        f"Left out: {', '.join(left)}" if left else "",
    )


def find_quantities(result: Result) -> list[Quantity]:
    """Those that the file has: worn volume, peak response, with several frequencies the shift, and the error."""
    found, wears = [], result.has("worn_volume") and len(result.cycles) > 1
    nothing = np.full(result.computed.shape, np.nan)
    if wears:
        worn = np.where(result.computed, result.worn, np.nan)
        found.append(Quantity("worn volume\nin the end", "m3", worn, result.errors * worn))
    if result.has("response_amplitude"):
        amplitude = result.read("response_amplitude").isel(response=0).transpose(*result.axes, "cycle")
        units, name = str(amplitude.attrs.get("units", "m")), f"response\nof {result.responses[0]}"
        values = np.where(result.computed[..., None], np.asarray(amplitude.values, dtype=float), np.nan)
        if "frequency" not in result.varying:
            found.append(Quantity(f"{name} in the end", units, values[..., -1], nothing))
        else:
            axis, frequency = result.axes.index("frequency"), result.dataset["frequency"].values.astype(float)
            top, height, top_error, height_error = find_peak(frequency, values[..., -1], axis)
            found.append(Quantity(f"peak {name} in the end", units, height, height_error))
            if len(result.cycles) > 1:
                first, _, first_error, _ = find_peak(frequency, values[..., 0], axis)
                found.append(Quantity("shift of\nthe resonance", "Hz", top - first, top_error + first_error))
    if wears:
        errors = np.where(result.computed & (result.errors > 0.0), 100.0 * result.errors, np.nan)
        found.append(Quantity("estimated error", "%", errors, nothing))
    return found


def find_peak(frequency: FloatArray, amplitude: FloatArray, axis: int) -> tuple[FloatArray, ...]:
    """Largest amplitude along `axis` by a parabola through the largest value and its neighbours.

    frequency: Hz (n,), in any order. amplitude: NaN where a point has no state.

    Returns frequency, amplitude, and their errors: distances of the parabola's vertex to the largest value. Length 1
    along `axis`; NaN where fewer than three values are known or the largest stands at an end, so that the peak may lie
    outside.
    """
    order = np.argsort(frequency, kind="stable")
    x, lines = frequency[order], np.moveaxis(amplitude, axis, -1)[..., order]
    found = np.full((4, *lines.shape[:-1]), np.nan)
    for place in np.ndindex(lines.shape[:-1]):
        known = np.isfinite(lines[place])
        f, a = x[known], lines[place][known]
        top = int(np.argmax(a)) if a.size else 0
        if 0 < top < a.size - 1:
            curvature, slope, _ = np.polyfit(f[top - 1 : top + 2] - f[top], a[top - 1 : top + 2] - a[top], 2)
            shift = -0.5 * slope / curvature if curvature < 0.0 else 0.0
            rise = 0.5 * slope * shift
            found[(slice(None), *place)] = f[top] + shift, a[top] + rise, abs(shift), rise
    return tuple(np.expand_dims(each, axis) for each in found)


def _draw_lines(panel: Axes, result: Result, quantity: Quantity, name: str, factor: float) -> None:
    """A quantity along an axis, through the shown point and all others."""
    axis, shown, values = result.axes.index(name), result.shown_point(), result.dataset[name].values
    words = values.dtype.kind not in "fiu"
    order = np.arange(len(values)) if words else np.argsort(values, kind="stable")
    at = order.astype(float) if words else values[order].astype(float)
    drawn, errors = (factor * np.moveaxis(each, axis, 0)[order] for each in (quantity.values, quantity.errors))
    sizes, others = drawn.shape[1:], [shown[other] for other in result.axes if other != name]
    through: Any = (slice(None), *(0 if size == 1 else place for size, place in zip(sizes, others, strict=True)))
    panel.plot(at, drawn.reshape(len(order), -1), color="0.72", linewidth=0.6, zorder=1)
    look: dict[str, Any] = {"color": COLOURS[0], "marker": "o", "markersize": 3.5, "zorder": 3, "label": "shown point"}
    add_line(panel, at, drawn[through], errors[through], **look)
    if quantity.units in ("m3", "m"):
        panel.set_ylim(bottom=0.0)
    units = units_of(result.dataset[name])
    # a word a line: panels are narrow
    panel.set_xlabel(name.replace("_", "\n") + (f"\n({units})" if units else ""))
    panel.tick_params(labelsize=_SMALL)
    if not words and name != "frequency" and spans_decades(at):
        set_log(panel.xaxis, float(at[0]), float(at[-1]))
        return
    room = (0.15 if len(at) <= 3 else 0.05) * float(np.ptp(at))
    panel.set_xlim(at[0] - room, at[-1] + room)
    if words or len(at) <= 3:
        texts = [str(each) if words else show_number(float(each), 4) for each in values[order]]
        turned: dict[str, Any] = {"rotation": 35, "ha": "right", "rotation_mode": "anchor"}
        panel.set_xticks(at, texts, **(turned if sum(map(len, texts)) > _LONG else {}))
    else:
        panel.locator_params(axis="x", nbins=3)

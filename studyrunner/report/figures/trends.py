"""Trends of final worn volume, peak response and shift of the resonance along every axis of the study."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from studyrunner.report.drawing import COLOURS, Drawing, new_panels, set_log
from studyrunner.result.units import scale_for, show_number, units_of
from studyrunner.result.view import Result, as_sentences
from studyrunner.statistics.samples import SAMPLE

FloatArray = NDArray[np.float64]

_PLAIN = ("frequency", "scheme", SAMPLE)
_MOST_AXES = 6
_DECADES = 30.0
_SMALL = 7.5
_LONG = 9
"""Characters that stand side by side under a small panel."""


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


def draw_trends(result: Result) -> Iterator[Drawing]:
    """Small multiples; nothing where only frequency and scheme vary, which other figures show."""
    if not result.computed.any() or all(name in _PLAIN for name in result.varying):
        return
    quantities = [one for one in find_quantities(result) if np.isfinite(one.values).any()]
    if not quantities:
        return
    # the last of many are the first to go
    axes = [name for name in result.varying if name != SAMPLE][:_MOST_AXES]
    left = [name.replace("_", " ") for name in result.varying if name not in (*axes, SAMPLE)]
    left_out = f"Left out: {', '.join(left)}" if left else ""
    yield _draw_multiples(result, quantities, axes, left_out)


def find_quantities(result: Result) -> list[Quantity]:
    """Those that the file can tell: worn volume, peak response, with several frequencies the shift, and the error."""
    found = []
    wears = result.has("worn_volume") and len(result.cycles) > 1
    nothing = np.full(result.computed.shape, np.nan)
    if wears:
        worn = np.where(result.computed, result.worn, np.nan)
        found.append(Quantity(f"worn volume {result.when(-1)}", "m3", worn, result.errors * worn))
    if result.has("response_amplitude"):
        amplitude = result.read("response_amplitude").isel(response=0).transpose(*result.axes, "cycle")
        units, name = str(amplitude.attrs.get("units", "m")), f" of {result.responses[0]}" if result.responses else ""
        values = np.where(result.computed[..., None], np.asarray(amplitude.values, dtype=float), np.nan)
        if "frequency" not in result.varying:
            found.append(Quantity(f"response{name} at the end", units, values[..., -1], nothing))
        else:
            axis, frequency = (
                result.axes.index("frequency"),
                np.asarray(result.dataset["frequency"].values, dtype=float),
            )
            top, height, top_error, height_error = find_peak(frequency, values[..., -1], axis)
            found.append(Quantity(f"peak response{name} at the end", units, height, height_error))
            if len(result.cycles) > 1:
                first, _, first_error, _ = find_peak(frequency, values[..., 0], axis)
                found.append(Quantity("shift of the resonance", "Hz", top - first, top_error + first_error))
    if wears:
        errors = np.where(result.computed & (result.errors > 0.0), 100.0 * result.errors, np.nan)
        found.append(Quantity("estimated error", "%", errors, nothing))
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


def _draw_multiples(result: Result, quantities: list[Quantity], axes: list[str], left_out: str) -> Drawing:
    """One row a quantity, one column an axis."""
    shown = result.shown_point()
    figure, panels = new_panels(len(quantities), len(axes), 0.5 + 1.35 * len(quantities), sharey="row")
    for row, quantity in enumerate(quantities):
        scale = scale_for(quantity.units, quantity.values)
        # a quantity that was searched through the frequency has no panel over it
        known = [name for name in axes if quantity.values.shape[result.axes.index(name)] > 1]
        for column, name in enumerate(axes):
            panel: Axes = panels[row, column]
            if name not in known:
                panel.remove()
                continue
            _draw_lines(panel, result, quantity, name, scale.factor)
            axis = result.axes.index(name)
            if any(one.values.shape[axis] > 1 for one in quantities[row + 1 :]):
                panel.set_xlabel("")
                panel.tick_params(labelbottom=False)
        words = quantity.label.replace(" at ", "\nat ").replace("shift of the", "shift of\nthe")
        words = words.replace("response of", "response\nof")
        first = panels[row, axes.index(known[0])] if known else panels[row, 0]
        first.set_ylabel(f"{words}\n({scale.unit})")
        first.tick_params(labelleft=True)
    caption = as_sentences(
        f"Each column is one axis of the study; blue: through {result.describe(shown)}, where most is worn; grey: all"
        " other combinations",
        "Orange bars: estimated error of the worn volume; of the peak, how far it lies from the nearest frequency of"
        " the study",
        "The shift is the frequency of the largest response at the last count less that at the first, of points each"
        " after its own wear. Peaks at an end of the frequency range are left out"
        if "frequency" in result.varying
        else "",
        left_out,
    )
    return Drawing("trends", "Trends along the axes of the study", caption, figure)


def _draw_lines(panel: Axes, result: Result, quantity: Quantity, name: str, factor: float) -> None:
    """A quantity along an axis, through the shown point and all others."""
    axis, shown = result.axes.index(name), result.shown_point()
    at, order = _positions(result, name)
    values, errors = (factor * np.moveaxis(each, axis, 0)[order] for each in (quantity.values, quantity.errors))
    sizes = np.delete(quantity.values.shape, axis)
    places = [shown[other] for other in result.axes if other != name]
    through: Any = (slice(None), *(0 if size == 1 else place for size, place in zip(sizes, places, strict=True)))
    panel.plot(at, values.reshape(len(order), -1), color="0.72", linewidth=0.6, zorder=1)
    panel.plot(at, values[through], color=COLOURS[0], marker="o", markersize=3.5, zorder=3)
    own, wrong = values[through], errors[through]
    told = np.isfinite(own * wrong)
    if told.any():
        style: dict[str, Any] = {"ecolor": COLOURS[1], "elinewidth": 1.0, "capsize": 2.0, "zorder": 4}
        panel.errorbar(at[told], own[told], yerr=wrong[told], fmt="none", **style)
    if quantity.units in ("m3", "m"):
        panel.set_ylim(bottom=0.0)
    _set_axis(panel, result, name)


def _positions(result: Result, name: str) -> tuple[FloatArray, NDArray[np.intp]]:
    """Where the values of an axis stand on paper, ascending, and their places in the file; words one after another."""
    values = result.dataset[name].values
    if values.dtype.kind not in "fiu":
        return np.arange(len(values), dtype=float), np.arange(len(values))
    order = np.argsort(values, kind="stable")
    return np.asarray(values[order], dtype=float), order


def _set_axis(panel: Axes, result: Result, name: str) -> None:
    """Label, scale and ticks of a horizontal axis: few values are ticks themselves."""
    at, order = _positions(result, name)
    units = units_of(result.dataset[name])
    # a word a line: panels are narrow
    panel.set_xlabel(name.replace("_", "\n") + (f"\n({units})" if units else ""))
    panel.tick_params(labelsize=_SMALL)
    words = result.dataset[name].dtype.kind not in "fiu"
    if not words and name != "frequency" and at[0] > 0.0 and at[-1] / at[0] > _DECADES:
        set_log(panel.xaxis, float(at[0]), float(at[-1]))
        return
    room = (0.15 if len(at) <= 3 else 0.05) * float(np.ptp(at))
    panel.set_xlim(at[0] - room, at[-1] + room)
    if words or len(at) <= 3:
        values = result.dataset[name].values[order]
        texts = [str(each) if words else show_number(float(each), 4) for each in values]
        turned: dict[str, Any] = {"rotation": 35, "ha": "right", "rotation_mode": "anchor"}
        panel.set_xticks(at, texts, **(turned if sum(map(len, texts)) > _LONG else {}))
    else:
        panel.locator_params(axis="x", nbins=3)

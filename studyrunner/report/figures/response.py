"""Response over frequency of the new and of one worn joint (Fig. 9 of the paper), of joints worn differently; modes."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from studyrunner.report import panels as plot
from studyrunner.report.drawing import Drawn
from studyrunner.report.panels import COLOURS, FloatArray
from studyrunner.report.selection import Course, choose, find_course, labelled
from studyrunner.result.view import NO_VOLUME, Result
from studyrunner.units import Scale, scale_for

_MOST_LINES, _MOST_RESPONSES, _MOST_FOLDS, _MOST_MODES = 3, 3, 12, 6
_OF_WEAR = ("wear_coefficient", "step", "scheme")
_BEFORE = "worn_cycle"
_WORN: dict[str, Any] = {"color": COLOURS[1], "linestyle": (0, (5, 1.5)), "marker": "s", "markersize": 4.5}


def draw_responses(result: Result) -> Drawn:
    """Amplitude of the first harmonic over frequency, one panel a response.

    Lines are of the new joint, or of joints that were worn before; with `result.again["response"]` also of the joint
    that is worn as the shown point is.
    """
    course, again = find_course(result, "frequency"), result.again.get("response")
    if course is None and again is None:
        said = "The study has one frequency: give several under [axes] frequency"
        return f"{result.no_worn_response or said}."
    if course is not None and result.cycles[0] != 0.0:
        return "The file holds no new joint: add 0 to slow_time.outputs."
    if again is not None:
        again = again.sel(response=list(result.responses))
    n_panels = min(len(result.responses), _MOST_RESPONSES)
    figure, panels = plot.new_panels(n_panels, 1, 0.5 + 3.1 * n_panels, sharex=True)
    unit = str(result.dataset["response_amplitude"].attrs.get("units", "m"))
    sizes = [each["response_amplitude"].isel(cycle=0).values for each in (result.dataset, again) if each is not None]
    scale, peaks, left_out = scale_for(unit, *sizes), list[str](), ("", "")
    for number, panel in reversed(list(enumerate(panels[:, 0]))):
        new, left_out = _draw_new(result, panel, course, scale, number) if course else ([], left_out)
        peaks = new + (_draw_again(panel, again, scale, number) if again is not None else [])
        plot.set_from_zero(panel)
        panel.set_ylabel(scale.label(f"amplitude of {result.responses[number]}"))
    panels[-1, 0].set_xlabel("excitation frequency (Hz)")
    return (
        figure,
        f"Largest amplitude of the first harmonic of {result.responses[0]}: {'; '.join(filter(None, peaks))}",
        f"One joint, {again.attrs['title']}: its response curve at that wear, without further wear" if again else "",
        f"{again.attrs['how']}" if again else "",
        f"Without the curve of the worn joint: {result.no_worn_response}" if result.no_worn_response else "",
        "More responses are in the file" if len(result.responses) > n_panels else "",
        *left_out,
    )


def _draw_new(
    result: Result, panel: Axes, course: Course, scale: Scale, number: int
) -> tuple[list[str], tuple[str, str]]:
    """Lines of a response of the new joint; their peaks in words, and sentences about what failed or is left out."""
    # how a joint wears makes no difference to the new one: NaN where a scheme has found no state
    alike = [axis for axis in _OF_WEAR if axis in result.axes]
    choice = choose(result, ["frequency", *alike], _MOST_LINES, first=(_BEFORE, "sweep", "excitation_amplitude"))
    own = result.dataset["response_amplitude"].isel(cycle=0, response=number).max(alike)
    lines = [own.isel(point, missing_dims="ignore").values[course.index] for point in choice.points]
    peaks = []
    for place, (line, (point, label)) in enumerate(zip(lines, choice, strict=True)):
        text = label if _BEFORE in result.varying else ", ".join(filter(None, (label, "new joint")))
        full = {**result.shown_point(), **point}
        at, values = course.values, scale(line)
        if result.has("branch"):
            # open where the sweep has jumped
            jumps = np.flatnonzero(np.diff(course.read(result, "branch", full)) != 0) + 1
            at, values = np.insert(at, jumps, np.nan), np.insert(values, jumps, np.nan)
        # the second colour is that of the worn joint
        panel.plot(at, values, **course.line_style(place + (place > 0)), label=text)
        peaks.append(_show_peak(scale, line, course.values, text))
    if result.has("exact_response_amplitude"):
        exact = course.read(result, "exact_response_amplitude", result.shown_point())[:, 0, number]
        if np.isfinite(exact).any():
            panel.plot(course.values, scale(exact), color="0.5", linewidth=5, alpha=0.45, zorder=1, label="exact")
    if result.has("fold_frequency"):
        fold = result.dataset["fold_frequency"]
        sweeps = fold["sweep"].values.tolist() if "sweep" in fold.dims else []
        for style, sweep in zip(("--", ":", "--"), sweeps, strict=False):
            values = fold.sel(sweep=sweep).values
            label = f"fold, sweep {sweep}: jump to another branch"
            for frequency in np.unique(values[np.isfinite(values)])[:_MOST_FOLDS]:
                panel.axvline(frequency, color="0.4", linewidth=0.9, linestyle=style, label=label)
    return peaks, (plot.mark_failed(panel, course.values, np.isnan(lines)), choice.sentence)


def _draw_again(panel: Axes, again: xr.Dataset, scale: Scale, number: int) -> list[str]:
    """Lines of a response computed again, of the worn joint and where it is there of the new one; their peaks."""
    frequency, peaks = again["frequency"].values, []
    for cycle in range(again.sizes["cycle"]):
        is_new = again.sizes["cycle"] > 1 and cycle == 0
        values = again["response_amplitude"].isel(cycle=cycle, response=number).values
        label, look = ("new joint", plot.line_style(0)) if is_new else (str(again.attrs["title"]), _WORN)
        error = again["response_error"].isel(cycle=cycle).values * values
        plot.add_line(panel, frequency, scale(values), scale(error), label=label, **look)
        peaks.append(_show_peak(scale, values, frequency, label))
    return peaks


def _show_peak(scale: Scale, values: FloatArray, frequency: FloatArray, text: str) -> str:
    if np.isnan(values).all():
        return ""
    top = int(np.nanargmax(values))
    return labelled(f"{scale.show(float(values[top]))} at {frequency[top]:.6g} Hz", text)


def draw_after_wear(result: Result) -> Drawn:
    """Amplitude of each point after its own wear, beside that of the new joint; nothing where no point wears."""
    course = find_course(result, "frequency")
    wears = not result.has("worn_volume") or float(np.nanmax(result.worn, initial=0.0)) > NO_VOLUME
    if course is None or len(result.cycles) == 1 or not wears:
        return None
    choice = choose(result, ["frequency"], _MOST_LINES)
    amplitudes = [course.read(result, "response_amplitude", point)[..., 0] for point in choice.points]
    scale, (figure, panel) = scale_for("m", *amplitudes), plot.new_panel(3.4)
    first = "new joint" if result.cycles[0] == 0.0 else f"each after its own {result.cycle_label(0)}"
    panel.plot(course.values, scale(amplitudes[0][:, 0]), color="0.5", linewidth=1.0, label=first)
    for number, (amplitude, label) in enumerate(zip(amplitudes, choice.labels, strict=True)):
        text = ", ".join(filter(None, (label, f"each after its own {result.cycle_label(-1)}")))
        look = course.line_style(number) | {"linestyle": "none"}
        panel.plot(course.values, scale(amplitude[:, -1]), **look, label=text)
    plot.set_from_zero(panel)
    panel.set_ylabel(scale.label(f"amplitude of {result.responses[0]}"))
    course.set_axis(panel)
    return figure, choice.sentence


def draw_mode(result: Result, name: str) -> Drawn:
    """Natural frequency or damping ratio of modes over the amplitude with error bars, a line for each wear state."""
    course = find_course(result, "modal_amplitude")
    if course is None:
        return "The study has one amplitude: give several under [axes] modal_amplitude."
    choice = choose(result, ["modal_amplitude"], _MOST_MODES, first=("cycle", "mode", "sweep"))
    figure, panel = plot.new_panel(3.6)
    values = np.array([course.read(result, name, point) for point in choice.points])
    for number, (point, label) in enumerate(choice):
        error = course.read(result, f"{name}_error", point) if result.has(f"{name}_error") else None
        if np.isfinite(values[number]).any():
            plot.add_line(
                panel, course.values, values[number], error, **course.line_style(number), label=label or "mode"
            )
    panel.set(xlabel=course.label, ylabel="natural frequency (Hz)" if name == "natural_frequency" else "damping ratio")
    plot.set_log(panel.xaxis, float(course.values[0]), float(course.values[-1]))
    low, high = float(np.nanmin(values, initial=np.inf)), float(np.nanmax(values, initial=-np.inf))
    # negative damping, e.g. of the air, has no logarithm
    if name == "damping_ratio" and 0.0 < low <= high:
        plot.set_log(panel.yaxis, low, high, percent=True)
    return figure, plot.mark_failed(panel, course.values, np.isnan(values)), choice.sentence

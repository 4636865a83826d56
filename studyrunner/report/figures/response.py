"""Frequency response of the new joint and of one worn joint (Fig. 9 of the paper), and of joints worn differently."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from studyrunner.report.drawing import (
    COLOURS,
    Drawing,
    FloatArray,
    Missing,
    add_legend,
    add_line,
    line_style,
    mark_failed,
    new_panel,
    new_panels,
    set_from_zero,
)
from studyrunner.report.figures.courses import Course, find_course
from studyrunner.result.choice import choose
from studyrunner.result.units import Scale, scale_for
from studyrunner.result.view import NO_VOLUME, Result, as_sentences

_MOST_LINES, _MOST_RESPONSES, _MOST_FOLDS = 3, 3, 12
_OF_WEAR = ("wear_coefficient", "step", "scheme")
_BEFORE = "worn_cycle"
_RING: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 10, "markerfacecolor": "none"}
_WORN: dict[str, Any] = {"color": COLOURS[1], "linestyle": (0, (5, 1.5)), "marker": "s", "markersize": 4.5}


def draw_responses(result: Result) -> Drawing | Missing:
    """Amplitude of the first harmonic over frequency, one panel a response.

    Lines are of the new joint, or of joints that were worn before; with `result.again["response"]` also of the joint
    that is worn as the shown point is.
    """
    name, title, course = "frequency_response", "Frequency response of the new joint", find_course(result, "frequency")
    again = result.again.get("response")
    if course is None and again is None:
        said = "The study has one frequency: give several under [axes] frequency"
        return Missing(name, title, f"{result.no_worn_response or said}.")
    if course is not None and result.cycles[0] != 0.0:
        return Missing(name, title, "The file holds no new joint: add 0 to slow_time.outputs.")
    n_panels = min(len(result.responses), _MOST_RESPONSES)
    figure, panels = new_panels(n_panels, 1, 0.5 + 3.1 * n_panels, sharex=True)
    unit, told = str(result.dataset["response_amplitude"].attrs.get("units", "m")), ("", "")
    sizes = [each["response_amplitude"].isel(cycle=0).values for each in (result.dataset, again) if each is not None]
    scale, peaks = scale_for(unit, *sizes), []
    for number, panel in enumerate(panels[:, 0]):
        if course is not None:
            new, told = _draw_new(result, panel, course, scale, number)
            peaks += new if number == 0 else []
        if again is not None:
            worn = _draw_again(panel, again, scale, number)
            peaks += worn if number == 0 else []
        set_from_zero(panel, panel.dataLim.ymax)
        panel.set_ylabel(scale.label(f"amplitude of {result.responses[number]}"))
    panels[-1, 0].set_xlabel("excitation frequency (Hz)")
    add_legend(figure)
    text = as_sentences(
        f"Largest amplitude of the first harmonic of {result.responses[0]}: {'; '.join(filter(None, peaks))}",
        f"One joint, {again.attrs['title']}: its response curve at that wear, without further wear" if again else "",
        f"{again.attrs['how']}" if again else "",
        f"Without the curve of the worn joint: {result.no_worn_response}" if result.no_worn_response else "",
        "More responses are in the file" if len(result.responses) > n_panels else "",
        *told,
    )
    if _BEFORE in result.axes:
        title = "Frequency response of one joint, worn before"
    elif again is not None:
        title = f"Frequency response, new and {again.attrs['title']}"
    return Drawing(name, title, text, figure)


def _draw_new(
    result: Result, panel: Axes, course: Course, scale: Scale, number: int
) -> tuple[list[str], tuple[str, str]]:
    """Lines of a response of the new joint; their peaks in words, and sentences about what failed or is left out."""
    # how a joint wears makes no difference to the new one: NaN where a scheme has found no state
    alike = [axis for axis in _OF_WEAR if axis in result.axes]
    choice = choose(result, ["frequency", *alike], _MOST_LINES, first=(_BEFORE, "sweep", "excitation_amplitude"))
    own = result.read("response_amplitude").isel(cycle=0, response=number).max(alike)
    lines = [own.isel(point, missing_dims="ignore").values[course.index] for point in choice.points]
    peaks = []
    for place, (line, (point, label)) in enumerate(zip(lines, choice, strict=True)):
        text = label if _BEFORE in result.varying else ", ".join(filter(None, (label, "new joint")))
        _draw_branch(result, panel, course, {**result.shown_point(), **point}, scale(line), place, text)
        peaks.append(_tell_peak(scale, line, course.values, text))
    if result.has("exact_response_amplitude"):
        _draw_exact(result, panel, course, scale, number)
    _mark_folds(result, panel)
    return peaks, (mark_failed(panel, course.values, np.isnan(lines)), choice.sentence)


def _draw_again(panel: Axes, again: xr.Dataset, scale: Scale, number: int) -> list[str]:
    """Lines of a response computed again, of the worn joint and where it is there of the new one; their peaks."""
    frequency, peaks = again["frequency"].values, []
    for cycle in range(again.sizes["cycle"]):
        is_new = again.sizes["cycle"] > 1 and cycle == 0
        values = again["response_amplitude"].isel(cycle=cycle, response=number).values
        label, look = ("new joint", line_style(0)) if is_new else (str(again.attrs["title"]), _WORN)
        error = again["response_error"].isel(cycle=cycle).values * values
        add_line(panel, frequency, scale(values), scale(error), label=label, **look)
        peaks.append(_tell_peak(scale, values, frequency, label))
    return peaks


def _tell_peak(scale: Scale, values: FloatArray, frequency: FloatArray, text: str) -> str:
    if np.isnan(values).all():
        return ""
    top = int(np.nanargmax(values))
    return f"{scale.show(float(values[top]))} at {frequency[top]:.6g} Hz ({text})"


def _draw_branch(
    result: Result, panel: Axes, course: Course, point: dict[str, int], values: FloatArray, number: int, label: str
) -> None:
    """The line of a new joint, open where the sweep has jumped; its unstable states in rings."""
    at = course.values
    if result.has("stable"):
        unstable = course.read(result, "stable", point)[:, 0] == 0
        if unstable.any():
            named = "unstable" in panel.get_legend_handles_labels()[1]
            panel.plot(at[unstable], values[unstable], color="black", label="_" if named else "unstable", **_RING)
    if result.has("branch"):
        jumps = np.flatnonzero(np.diff(course.read(result, "branch", point)) != 0) + 1
        at, values = np.insert(at, jumps, np.nan), np.insert(values, jumps, np.nan)
    # the second colour is that of the worn joint
    panel.plot(at, values, **course.line_style(number + (number > 0)), label=label)


def _draw_exact(result: Result, panel: Axes, course: Course, scale: Scale, number: int) -> None:
    """The exact answer at the shown point as a broad grey line."""
    exact = course.read(result, "exact_response_amplitude", result.shown_point())[:, 0, number]
    if np.isfinite(exact).any():
        panel.plot(course.values, scale(exact), color="0.5", linewidth=5, alpha=0.45, zorder=1, label="exact")


def _mark_folds(result: Result, panel: Axes) -> None:
    """A line at each fold at which a sweep has left its branch."""
    if not result.has("fold_frequency"):
        return
    fold = result.read("fold_frequency")
    sweeps = result.dataset["sweep"].values.astype(str) if "sweep" in fold.dims else [""]
    for number, sweep in enumerate(sweeps):
        values = (fold.isel(sweep=number) if sweep else fold).values
        for place, frequency in enumerate(np.unique(values[np.isfinite(values)])[:_MOST_FOLDS]):
            label = "_" if place else f"fold, sweep {sweep}: jump to another branch"
            panel.axvline(frequency, color="0.4", linewidth=0.9, linestyle=("--", ":")[number % 2], label=label)


def draw_after_wear(result: Result) -> Drawing | None:
    """Amplitude of each point after its own wear, beside that of the new joint; nothing where no point wears."""
    course = find_course(result, "frequency")
    wears = not result.has("worn_volume") or float(np.nanmax(result.worn, initial=0.0)) > NO_VOLUME
    if course is None or len(result.cycles) == 1 or not wears:
        return None
    choice = choose(result, ["frequency"], _MOST_LINES)
    amplitudes = [course.read(result, "response_amplitude", point)[..., 0] for point in choice.points]
    scale, (figure, panel) = (
        scale_for(str(result.dataset["response_amplitude"].attrs["units"]), *amplitudes),
        new_panel(3.4),
    )
    first = "new joint" if result.cycles[0] == 0.0 else f"each after its own {result.cycle_label(0)}"
    for number, (amplitude, label) in enumerate(zip(amplitudes, choice.labels, strict=True)):
        style = course.line_style(number)
        text = ", ".join(filter(None, (label, f"each after its own {result.cycle_label(-1)}")))
        if number == 0:
            panel.plot(course.values, scale(amplitude[:, 0]), color="0.5", linewidth=1.0, label=first)
        panel.plot(course.values, scale(amplitude[:, -1]), **style | {"linestyle": "none"}, label=text)
    set_from_zero(panel, panel.dataLim.ymax)
    panel.set_ylabel(scale.label(f"amplitude of {result.responses[0]}"))
    course.set_axis(panel)
    add_legend(figure)
    text = as_sentences(
        "Each mark is another joint, which wore at its own frequency: the marks are no response curve",
        "That they are low where the new joint resonates does not mean that wear protects",
        "The response curves of one new and one worn joint are above",
        choice.sentence,
    )
    title = "Response of different joints, each after wear at its own frequency"
    return Drawing("response_after_own_wear", title, text, figure)

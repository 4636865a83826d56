"""Frequency response of the joint, new and worn, on the branches of both sweeps (Fig. 9 of the paper)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from studyrunner.report.drawing import COLOURS, Drawing, Missing, add_legend, mark_failed, new_panels, set_from_zero
from studyrunner.report.figures.courses import Course, find_course
from studyrunner.result.choice import choose
from studyrunner.result.units import Scale, scale_for
from studyrunner.result.view import NO_VOLUME, Point, Result, as_sentences
from studyrunner.system.progress import count

_MOST_LINES, _MOST_RESPONSES, _MOST_FOLDS = 3, 3, 12
_OF_WEAR = ("wear_coefficient", "step", "scheme")
_WORN = "worn_cycle"
_NEW: dict[str, Any] = {"markerfacecolor": "white", "linestyle": (0, (4, 2)), "linewidth": 1.2}
_WORN_POINTS: dict[str, Any] = {"linewidth": 0.5, "linestyle": ":"}
"""No curve: the points are of different joints."""
_RING: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 10, "markerfacecolor": "none"}


def draw_responses(result: Result) -> Iterator[Drawing | Missing]:
    """The frequency response; a sentence where the file has one frequency or no response."""
    course, title = find_course(result, "frequency"), "Frequency response"
    if not result.has("response_amplitude"):
        yield Missing("frequency_response", title, result.lacks("response_amplitude"))
    elif course is None:
        yield Missing("frequency_response", title, "The study has one frequency: give several under [axes] frequency.")
    else:
        yield _draw(result, course)


def _draw(result: Result, course: Course) -> Drawing:
    """Amplitude of the first harmonic over frequency, one panel a response.

    Of a point that wore, the first and the last count: the latter joins points that wore differently.
    """
    # Scheme, step and wear coefficient make no difference at the first cycle: the sweep is what the figure is about.
    choice = choose(result, ["frequency"], _MOST_LINES, first=(_WORN, "sweep", "excitation_amplitude", "scheme"))
    n_panels = min(len(result.responses), _MOST_RESPONSES)
    figure, panels = new_panels(n_panels, 1, 0.5 + 3.1 * n_panels, sharex=True)
    amplitudes = [course.read(result, "response_amplitude", point) for point in choice.points]
    unit = str(result.dataset["response_amplitude"].attrs.get("units", "m"))
    failed = np.array([np.isnan(amplitude[:, 0, 0]) for amplitude in amplitudes])
    wears = not result.has("worn_volume") or bool(np.nanmax(result.worn) > NO_VOLUME)
    ends = [0, -1] if len(result.cycles) > 1 and wears else [0]
    peaks: list[str] = []
    for number, panel in enumerate(panels[:, 0]):
        scale = scale_for(unit, *(amplitude[:, :, number] for amplitude in amplitudes))
        drawn: set[str] = set()
        for line, (point, label) in enumerate(choice):
            for end in ends:
                told = _tell_unworn(result, point, choice.points) if end == 0 and result.cycles[0] == 0 else label
                text = ", ".join(filter(None, (told, _state(result, end))))
                # states at the first count are the same for all that differs in wear alone: NaN where one has none
                same = [each for each, other in enumerate(choice.points) if end or _same_start(result, other, point)]
                values = amplitudes[line][:, end, number]
                for each in [] if end else same:
                    values = np.where(np.isnan(values), amplitudes[each][:, end, number], values)
                if text in drawn or np.isnan(values).all():
                    continue
                drawn.add(text)
                style = course.line_style(line) | {"label": text}
                if len(ends) > 1:
                    style |= _NEW if end == 0 else _WORN_POINTS
                _draw_branch(result, panel, course, point, scale(values), end, style)
                if number == 0:
                    top = int(np.nanargmax(values))
                    peaks.append(f"{scale.show(float(values[top]))} at {course.at(result, top)} ({text})")
            if result.has("exact_response_amplitude"):
                _draw_exact(result, panel, course, point, number, scale, ends)
        set_from_zero(panel, panel.dataLim.ymax)
        panel.set_ylabel(scale.label(f"amplitude of {result.responses[number]}"))
        _mark_folds(result, panel)
        n_failed = mark_failed(panel, course.values, failed)
    add_legend(figure)
    course.set_axis(panels[-1, 0])
    more = len(result.responses) - n_panels
    caption = as_sentences(
        f"Largest amplitude of the first harmonic of {result.responses[0]}: {'; '.join(peaks)}",
        _how_to_read(result, len(ends) > 1),
        _tell_folds(result),
        f"Crosses: at these, {count(n_failed, 'point')} in all without a result" if n_failed else "",
        f"{more} more responses are in the file" if more else "",
        choice.sentence,
    )
    return Drawing("frequency_response", _title(result, len(ends) > 1), caption, figure)


def _title(result: Result, worn: bool) -> str:
    if worn:
        return "Response at each frequency, new and after wear at that frequency"
    if _WORN in result.axes:
        return "Frequency response of one joint, worn before"
    return "Frequency response of the new joint" if result.cycles[0] == 0 else "Frequency response"


def _how_to_read(result: Result, worn: bool) -> str:
    if worn:
        return (
            "After wear, each point shows a joint that wore at its own frequency only: the line through these points is"
            " not the response curve of one worn joint, and a lower peak does not mean that wear protects. For that"
            " curve run the study with [scene] worn = {result = ..., frequency = ..., cycle = [0, ...]} and"
            " slow_time.cycles = 0"
        )
    return "Each line is the response of one joint, worn before as its label says" if _WORN in result.varying else ""


def _state(result: Result, end: int) -> str:
    """What a line shows: the new joint, or the worn one."""
    if end == 0:
        label = "new" if result.cycles[0] == 0 else result.cycle_label(0)
        return "" if _WORN in result.axes else label
    return f"each point after its own {result.cycle_label(end)}"


def _tell_unworn(result: Result, point: Point, points: tuple[dict[str, int], ...]) -> str:
    """Label of an unworn state: nothing that only tells how it wears."""
    told = [
        name
        for name in result.varying
        if name not in _OF_WEAR and len({other.get(name) for other in points}) > 1 and name in point
    ]
    return result.describe(point, told)


def _same_start(result: Result, one: Point, other: Point) -> bool:
    """Whether two points differ in nothing but how they wear."""
    return result.cycles[0] == 0 and all(one[name] == other[name] for name in one if name not in _OF_WEAR)


def _draw_branch(
    result: Result,
    panel: Axes,
    course: Course,
    point: Point,
    values: NDArray[np.float64],
    end: int,
    style: dict[str, Any],
) -> None:
    """One line with its unstable states; that of the first count open where the sweep has jumped."""
    at = course.values
    if result.has("stable"):
        unstable = course.read(result, "stable", point)[:, end] == 0
        named = "unstable" not in panel.get_legend_handles_labels()[1]
        if unstable.any():
            panel.plot(at[unstable], values[unstable], color="black", label="unstable" if named else None, **_RING)
    if end == 0 and result.has("branch"):
        jumps = np.flatnonzero(np.diff(course.read(result, "branch", point)) != 0) + 1
        at, values = np.insert(at, jumps, np.nan), np.insert(values, jumps, np.nan)
    panel.plot(at, values, **style)


def _draw_exact(
    result: Result, panel: Axes, course: Course, point: Point, number: int, scale: Scale, ends: list[int]
) -> None:
    """Exact answers as broad grey lines."""
    exact = course.read(result, "exact_response_amplitude", point)[:, :, number]
    for end in ends:
        if np.isfinite(exact[:, end]).any():
            label = None if "exact" in panel.get_legend_handles_labels()[1] else "exact"
            panel.plot(course.values, scale(exact[:, end]), color="0.5", linewidth=5, alpha=0.45, zorder=1, label=label)


def folds(result: Result) -> list[tuple[str, float]]:
    """Folds at which sweeps left their branch: label of the sweep and Hz, each once, from low to high."""
    if not result.has("fold_frequency"):
        return []
    fold = result.read("fold_frequency")
    sweeps = np.array([""])
    if "sweep" in fold.dims:
        fold, sweeps = fold.transpose(..., "sweep"), result.dataset["sweep"].values.astype(str)
    values = fold.values.reshape(-1, len(sweeps))
    found = {
        (str(sweep), float(frequency))
        for sweep, line in zip(sweeps, values.T, strict=True)
        for frequency in np.unique(line[np.isfinite(line)])
    }
    return sorted(found, key=lambda one: (one[1], one[0]))


def _mark_folds(result: Result, panel: Axes) -> None:
    """A line down at each fold; its triangle points the way of the sweep."""
    named: set[str] = set()
    for sweep, frequency in folds(result)[:_MOST_FOLDS]:
        label = f"fold, sweep {sweep}" if sweep else "fold"
        panel.axvline(frequency, color=COLOURS[3], linewidth=0.9, linestyle=(0, (1, 2)), zorder=1)
        style: dict[str, Any] = {
            "marker": {"up": ">", "down": "<"}.get(sweep, "v"),
            "color": COLOURS[3],
            "markersize": 6,
        }
        label_once = None if label in named else label
        panel.plot(frequency, 0.97, linestyle="none", transform=panel.get_xaxis_transform(), label=label_once, **style)
        named.add(label)


def _tell_folds(result: Result) -> str:
    """Where sweeps jump, in a sentence."""
    found = folds(result)
    if not found:
        return ""
    shown = ", ".join(f"{frequency:.6g} Hz{f' (sweep {sweep})' if sweep else ''}" for sweep, frequency in found[:4])
    more = f" and {len(found) - 4} more" if len(found) > 4 else ""
    return f"Dotted, upright: folds at which a sweep jumps to another branch, at {shown}{more}"

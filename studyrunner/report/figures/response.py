"""Frequency response at the first and the last cycle count, on the branches of both sweeps (Fig. 9 of the paper)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from studyrunner.report.drawing import COLOURS, Drawing, Missing, add_legend, mark_failed, new_panels, set_from_zero
from studyrunner.report.figures.frequency_course import Course, find_course
from studyrunner.report.reading.choice import Choice, choose
from studyrunner.report.reading.result import Point, Result, as_sentences
from studyrunner.report.reading.units import Scale, scale_for
from studyrunner.system.progress import count

_MOST_LINES = 3
_MOST_RESPONSES = 3
_OF_WEAR = ("wear_coefficient", "step", "scheme")
_TITLE = "Frequency response, first and last cycle"


def draw_responses(result: Result) -> Iterator[Drawing | Missing]:
    """The frequency response; a sentence where the file has one frequency or no response."""
    if not result.has("response_amplitude"):
        yield Missing("frequency_response", _TITLE, result.lacks("response_amplitude"))
        return
    course = find_course(result, "frequency")
    if course is None:
        yield Missing("frequency_response", _TITLE, "The study has one frequency: give several under [axes] frequency.")
        return
    yield draw_response(result, course)


def draw_response(result: Result, course: Course) -> Drawing:
    """Amplitude of the first harmonic over frequency, one panel a response (Fig. 9)."""
    # Scheme, step and wear coefficient make no difference at the first cycle: the sweep is what the figure is about.
    choice = choose(result, ["frequency"], _MOST_LINES, first=("sweep", "excitation_amplitude", "scheme"))
    n_panels = min(len(result.responses), _MOST_RESPONSES)
    figure, panels = new_panels(n_panels, 1, 0.5 + 3.1 * n_panels, sharex=True)
    amplitudes = [course.read(result, "response_amplitude", point) for point in choice.points]
    unit = str(result.dataset["response_amplitude"].attrs.get("units", "m"))
    failed = np.array([np.isnan(amplitude[:, 0, 0]) for amplitude in amplitudes])
    peaks: list[str] = []
    exact_drawn = unstable_drawn = False
    for number, panel in enumerate(panels[:, 0]):
        scale = scale_for(unit, *(amplitude[:, :, number] for amplitude in amplitudes))
        unworn: set[str] = set()
        for line, (point, label) in enumerate(choice):
            amplitude = amplitudes[line][:, :, number]
            ends = [0, -1] if len(result.cycles) > 1 else [0]
            for end in ends:
                values, told = amplitude[:, end], label
                if end == 0 and result.cycles[0] == 0:
                    told = _tell_unworn(result, point, choice)
                    if told in unworn:
                        continue
                    unworn.add(told)
                    same = [
                        one for one, other in enumerate(choice.points) if _tell_unworn(result, other, choice) == told
                    ]
                    values = _first_known([amplitudes[one][:, 0, number] for one in same])
                if np.isnan(values).all():
                    continue
                text = ", ".join(part for part in (told, result.cycle_label(end)) if part)
                style = course.line_style(line) | {"label": text}
                if end == 0 and told == "" and len(choice.points) > 1:
                    style["color"] = "0.2"
                _draw_branch(result, panel, course, point, scale(values), end, style)
                unstable_drawn |= _mark_unstable(result, panel, course, point, scale(values), end, not unstable_drawn)
                if number == 0:
                    top = int(np.nanargmax(values))
                    at = result.describe({"frequency": int(course.index[top])}, ["frequency"])
                    peaks.append(f"{scale.show(float(values[top]))} at {at} ({text})")
            if result.has("exact_response_amplitude"):
                exact_drawn |= _draw_exact(result, panel, course, point, number, scale, ends, first=line == 0)
        set_from_zero(panel, panel.dataLim.ymax)
        panel.set_ylabel(scale.label(f"amplitude of {result.responses[number]}"))
        _mark_folds(result, panel)
        n_failed = mark_failed(panel, course.values, failed)
    add_legend(figure)
    course.set_axis(panels[-1, 0])
    more = len(result.responses) - n_panels
    caption = as_sentences(
        f"Amplitude of the first harmonic over frequency. Largest of {result.responses[0]}: {'; '.join(peaks)}",
        "The file holds the unworn states only" if len(result.cycles) == 1 and result.cycles[0] == 0 else "",
        _tell_folds(result),
        "Grey bands: exact answer" if exact_drawn else "",
        "Rings: unstable states" if unstable_drawn else "",
        f"Crosses: at these, {count(n_failed, 'point')} in all without a result" if n_failed else "",
        f"{more} more responses are in the file" if more else "",
        choice.sentence,
        "Fig. 9 of the paper",
    )
    return Drawing("frequency_response", _TITLE, caption, figure)


def _tell_unworn(result: Result, point: Point, choice: Choice) -> str:
    """Label of an unworn state: nothing that only tells how it wears."""
    told = [
        name
        for name in result.varying
        if name not in _OF_WEAR and len({other.get(name) for other in choice.points}) > 1
    ]
    return result.describe(point, told)


def _first_known(lines: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Of lines that agree where they have values, the first value at each place."""
    found = lines[0].copy()
    for line in lines[1:]:
        found = np.where(np.isnan(found), line, found)
    return found


def _draw_branch(
    result: Result,
    panel: Axes,
    course: Course,
    point: Point,
    values: NDArray[np.float64],
    end: int,
    style: dict[str, Any],
) -> None:
    """One line: the first cycle dashed with open markers, open where the sweep has jumped; the last one full."""
    at = course.values
    if end == 0:
        style = style | {"markerfacecolor": "white", "linestyle": (0, (4, 2)), "linewidth": 1.2}
        if result.has("branch"):
            jumps = np.flatnonzero(np.diff(course.read(result, "branch", point)) != 0) + 1
            at, values = np.insert(at, jumps, np.nan), np.insert(values, jumps, np.nan)
    panel.plot(at, values, **style)


def _mark_unstable(
    result: Result, panel: Axes, course: Course, point: Point, values: NDArray[np.float64], end: int, named: bool
) -> bool:
    """Rings around unstable states; whether there are any."""
    if not result.has("stable"):
        return False
    unstable = course.read(result, "stable", point)[:, end] == 0
    if not unstable.any():
        return False
    panel.plot(
        course.values[unstable],
        values[unstable],
        linestyle="none",
        marker="o",
        markersize=10,
        markerfacecolor="none",
        color="black",
        label="unstable" if named else None,
    )
    return True


def _draw_exact(
    result: Result, panel: Axes, course: Course, point: Point, number: int, scale: Scale, ends: list[int], first: bool
) -> bool:
    """Exact answers as broad grey lines; whether there are any."""
    exact = course.read(result, "exact_response_amplitude", point)[:, :, number]
    for end in ends:
        if np.isfinite(exact[:, end]).any():
            label = "exact" if first and end == ends[0] else None
            panel.plot(course.values, scale(exact[:, end]), color="0.5", linewidth=5, alpha=0.45, zorder=1, label=label)
    return bool(np.isfinite(exact).any())


def folds(result: Result) -> list[tuple[str, float]]:
    """Folds at which sweeps left their branch: label of the sweep and Hz, each once, from low to high."""
    if not result.has("fold_frequency"):
        return []
    fold = result.read("fold_frequency")
    sweeps = np.array([""])
    if "sweep" in fold.dims:
        fold = fold.transpose(..., "sweep")
        sweeps = result.dataset["sweep"].values.astype(str)
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
    for sweep, frequency in folds(result)[:12]:
        label = f"fold, sweep {sweep}" if sweep else "fold"
        panel.axvline(frequency, color=COLOURS[3], linewidth=0.9, linestyle=(0, (1, 2)), zorder=1)
        panel.plot(
            frequency,
            0.97,
            marker={"up": ">", "down": "<"}.get(sweep, "v"),
            color=COLOURS[3],
            linestyle="none",
            markersize=6,
            transform=panel.get_xaxis_transform(),
            label=None if label in named else label,
        )
        named.add(label)


def _tell_folds(result: Result) -> str:
    """Where sweeps jump, in a sentence."""
    found = folds(result)
    if not found:
        return ""
    shown = ", ".join(f"{frequency:.6g} Hz{f' (sweep {sweep})' if sweep else ''}" for sweep, frequency in found[:4])
    more = f" and {len(found) - 4} more" if len(found) > 4 else ""
    return f"Dotted: folds at which a sweep jumps to another branch, at {shown}{more}"

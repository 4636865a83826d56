"""Where and why points ended as they did, and how right they are: outcomes, certificates, estimated errors, and what to
beware of: folds and jumps of the branches, steps too long, oscillating wear, unstable states.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from numpy.typing import NDArray

from studyrunner.advice import advise_steps
from studyrunner.percent import show_percent
from studyrunner.report.drawing import Drawing, Table, add_legend, new_figure, set_log
from studyrunner.report.figures.courses import Course, find_course, title_at
from studyrunner.report.figures.response import folds
from studyrunner.report.reading.choice import choose
from studyrunner.report.reading.known_volumes import settings_of, tell_ends, tell_volumes
from studyrunner.report.reading.result import CONVERGED, NO_VOLUME, Result, as_sentences
from studyrunner.report.reading.units import show_cycles, show_number
from studyrunner.system.progress import count
from studyrunner.variables import CERTIFICATE

_MOST_ROWS, _MOST_LISTED, _MOST_CELLS = 24, 20, 400
# What was computed to the end is light, so that what failed stands out.
_CONVERGED_COLOUR = "#dfe7ef"
_OTHER_COLOURS = ("#D55E00", "#0072B2", "#CC79A7", "#009E73", "#56B4E9", "#E69F00", "#7f7f7f", "#000000", "#F0E442")
_HATCHES = ("///", "...", "xx", "\\\\\\", "++", "oo", "--", "||", "**")
_ERRORS = {
    "error_estimate": "last worn volume",
    "response_error": "response, worst cycle",
    "wear_rate_error": "wear rate, worst cycle",
    "energy_error": "energy balance, worst cycle",
}
_FLOOR, _NEGLIGIBLE = 1e-3, 1e-6


def draw_outcomes(result: Result) -> Iterator[Drawing | Table]:
    """Table of the outcomes, with how many of each are known to rtol, and where some are special, a map of them."""
    outcome = result.read("outcome")
    numbers = Counter(outcome.values.ravel().tolist())
    rows = []
    for number in sorted(numbers):
        place = np.argwhere(outcome.values == number)[0]
        point = dict(zip(result.axes, map(int, place), strict=True))
        ending = result.endings[number]
        first = result.describe(point) if number != CONVERGED else ""
        known = [str(np.count_nonzero(result.known & (outcome.values == number)))] if result.tells_volumes else []
        rows.append((ending.word.replace("_", " "), str(numbers[number]), *known, ending.sentence, first))
    without = "" if result.held.all() else "Where there is no result there are gaps in the figures and NaN in the file"
    note = as_sentences(tell_volumes(result), tell_ends(result), without)
    known = ["known to rtol"] if result.tells_volumes else []
    columns = ("outcome", "points", *known, "what it means", "first of them at")
    yield Table("outcomes", "Outcomes of the points", columns, tuple(rows), note)
    course = find_course(result)
    if set(numbers) - {CONVERGED} and course is not None:
        yield draw_outcome_map(result, course)


def draw_outcome_map(result: Result, course: Course) -> Drawing:
    """One cell a point: the course across, a row for each other combination; colour and hatching tell the outcome."""
    choice = choose(result, [course.axis], _MOST_ROWS)
    field = np.array([course.read(result, "outcome", point) for point in choice.points]).astype(int)
    present = sorted(set(field.ravel().tolist()))
    special = [number for number in present if number != CONVERGED]
    colours = {number: _OTHER_COLOURS[i % len(_OTHER_COLOURS)] for i, number in enumerate(special)}
    colours[CONVERGED] = _CONVERGED_COLOUR
    figure = new_figure(1.4 + 0.32 * len(field))
    panel: Axes = figure.subplots()
    edges = np.arange(field.shape[1] + 1) - 0.5, np.arange(field.shape[0] + 1) - 0.5
    cells = ListedColormap([colours[number] for number in present])
    lines = 0.8 if field.size <= _MOST_CELLS else 0.0
    panel.pcolormesh(*edges, np.searchsorted(present, field), cmap=cells, edgecolors="white", linewidth=lines)
    panel.collections[0].set_clim(-0.5, len(present) - 0.5)
    panel.grid(visible=False)
    panel.invert_yaxis()
    kept = np.arange(0, course.values.size, -(-course.values.size // 9))
    panel.set_xticks(kept, [f"{course.values[index]:.6g}" for index in kept])
    panel.set_xlabel(course.label)
    panel.set_yticks(np.arange(len(choice.labels)), choice.labels)
    panel.tick_params(length=0)
    panel.spines[:].set_visible(False)
    words = {number: result.endings[number].word.replace("_", " ") for number in present}
    handles = [
        panel.fill_between([], [], facecolor=colours[number], edgecolor="white", label=words[number], hatch=hatch)
        for number, hatch in [(number, _hatch(special, number)) for number in present]
    ]
    if field.size <= _MOST_CELLS:
        for (row, column), number in np.ndenumerate(field):
            if number != CONVERGED:
                box: dict[str, Any] = {
                    "facecolor": "none",
                    "edgecolor": "white",
                    "linewidth": 0.0,
                    "hatch": _hatch(special, number),
                }
                panel.fill_between([column - 0.5, column + 0.5], row - 0.5, row + 0.5, **box)
    panel.set_xlim(*edges[0][[0, -1]])
    panel.set_ylim(*edges[1][[-1, 0]])
    add_legend(figure, handles)
    meaning = [f"{words[number].capitalize()}: {result.endings[number].sentence}" for number in special]
    return Drawing("outcome_map", "How the points ended", as_sentences(*meaning, choice.sentence), figure)


def _hatch(special: list[int], number: int) -> str:
    return _HATCHES[special.index(number) % len(_HATCHES)] if number in special else ""


def draw_certificates(result: Result) -> Iterator[Drawing | Table]:
    """The worst certificates and where they are, and the estimated errors over the course."""
    rows = []
    for name, words in CERTIFICATE.items():
        if result.has(name) and "cycle" in result.dataset[name].dims:
            values = result.read(name).transpose(*result.axes, "cycle").values
            values = np.where(result.computed[..., None] & np.isfinite(values), values, 0.0)
            *place, cycle = map(int, np.unravel_index(int(np.argmax(values)), values.shape))
            point = dict(zip(result.axes, place, strict=True))
            count_at = show_cycles(float(result.counts(point)[cycle]), result.counted)
            where = ", ".join(filter(None, (result.describe(point), count_at)))
            rows.append((words, f"{values.max():.1e}", where) if values.max() > 0.0 else (words, "0", ""))
    if rows:
        note = "The largest over all points computed to the end and all counts kept; 0 is the best."
        columns = ("certificate", "worst value", "where")
        yield Table("certificates", "Certificates: how right the states are", columns, tuple(rows), note)
    course = find_course(result)
    if course is not None and result.computed.any():
        drawing = draw_errors(result, course)
        if drawing is not None:
            yield drawing


def draw_errors(result: Result, course: Course) -> Drawing | None:
    """Estimated relative errors over the course, else at the shown point; None where there is none above zero."""
    figure = new_figure(3.4)
    panel: Axes = figure.subplots()
    aim = result.study_number("solver", "rtol") if "rtol" not in result.varying else np.nan
    floor = _FLOOR * (aim if aim > 0.0 else _FLOOR)
    worst, drawn = [], [aim] if aim > 0.0 else []
    for number, (name, label) in enumerate(_ERRORS.items()):
        errors = _worst_errors(result, course, name) if result.has(name) else np.zeros(1)
        errors = np.where(errors > floor, errors, np.nan)
        if np.isnan(errors).all():
            continue
        panel.plot(course.values, errors, label=label, **course.line_style(number))
        top = int(np.nanargmax(errors))
        drawn += [float(np.nanmin(errors)), float(errors[top])]
        worst.append(f"{label} {show_percent(errors[top], aim if aim > 0.0 else None)} at {course.at(result, top)}")
    if not worst:
        return None
    if aim > 0.0:
        panel.axhline(aim, color="0.4", linewidth=1.0, zorder=1, label=f"rtol = {aim:g}")
    set_log(panel.yaxis, min(drawn), max(drawn), percent=True)
    course.set_axis(panel)
    panel.set_xlim(course.edges[0], course.edges[-1])
    panel.set_ylabel("estimated relative error")
    add_legend(figure)
    caption = as_sentences(
        f"The largest: {'; '.join(worst)}",
        f"Gaps: no result, errors below {show_percent(floor)} or not estimated, and points that hardly wear",
        "Horizontal line: rtol, what automatic settings aim at" if aim > 0.0 else "",
    )
    return Drawing("estimated_errors", title_at(result, "Estimated errors", course.axis), caption, figure)


def _worst_errors(result: Result, course: Course, name: str) -> NDArray[np.float64]:
    """Largest error over the cycles (n,) of the course; NaN where there is none above zero to show."""
    point = result.shown_point()
    errors = course.read(result, name, point)
    if errors.ndim == 2:
        errors = np.where(np.isnan(errors), -1.0, errors).max(axis=1)
    if name in ("error_estimate", "wear_rate_error") and result.has("worn_volume") and len(result.cycles) > 1:
        # An error relative to next to nothing says nothing.
        worn = course.read(result, "worn_volume", point)[:, -1]
        least = max(NO_VOLUME, _NEGLIGIBLE * float(np.nanmax(result.read("worn_volume").values)))
        errors = np.where(worn > least, errors, np.nan)
    return np.where(errors > 0.0, errors, np.nan)


def list_branches(result: Result) -> Iterator[Table]:
    """Folds that the sweeps jumped over and jumps while wearing; nothing where there are none."""
    rows = [
        ("fold", f"{frequency:.6g} Hz", f"sweep {sweep} jumps to another branch" if sweep else "the sweep jumps")
        for sweep, frequency in folds(result)
    ]
    jumps = result.read("jump_cycle").values if result.has("jump_cycle") else np.zeros(0)
    for place in np.argwhere(np.isfinite(jumps)) if jumps.size else ():
        at = result.describe(dict(zip(result.axes, map(int, place), strict=True)))
        rows.append(("jump while wearing", show_cycles(float(jumps[tuple(place)])), f"branch lost at {at}"))
    if rows:
        columns = ("what", "where", "meaning")
        yield Table("folds_and_jumps", "Folds and jumps", columns, tuple(rows[:_MOST_LISTED]), _tell_rest(len(rows)))


def list_stability(result: Result) -> Iterator[Table]:
    """Points with an explicit step longer than predicted to be stable, an oscillating wear rate, or unstable states."""
    if not result.has("step_limit", "oscillates"):
        return
    limit = result.read("step_limit").values
    # Points that failed count as well: a step too long may be why they failed.
    oscillates = result.read("oscillates").values != 0
    unstable = np.zeros_like(oscillates)
    if result.has("stable"):
        unstable = (result.read("stable") == 0).any("cycle").transpose(*result.axes).values & result.computed
    step = _explicit_steps(result)
    too_long = np.isfinite(limit) & (step > limit)
    rows = []
    for place in np.argwhere(too_long | oscillates | unstable):
        at = tuple(place)
        words = [f"step of {show_number(float(step[at]), 4)}, stable up to {show_number(float(limit[at]), 3)} cycles"]
        words = words if too_long[at] else []
        words += ["wear rate oscillates"] if oscillates[at] else []
        words += ["unstable states"] if unstable[at] else []
        rows.append((result.describe(dict(zip(result.axes, map(int, place), strict=True))), ", ".join(words)))
    if rows:
        counts = [int(np.count_nonzero(what)) for what in (too_long, oscillates, unstable)]
        first = np.argwhere(too_long | oscillates)[:1]
        note = as_sentences(
            f"{count(counts[0], 'point')} with an explicit step longer than step_limit, {counts[1]} with a wear rate"
            f" that oscillates from step to step, {counts[2]} with unstable states",
            f"Against the first two: {advise_steps(settings_of(result, tuple(first[0].tolist())))}"
            if len(first)
            else "",
            _tell_rest(len(rows)),
        )
        yield Table("stability", "Stability in slow time", ("point", "what"), tuple(rows[:_MOST_LISTED]), note)


def _explicit_steps(result: Result) -> NDArray[np.float64]:
    """Longest step in cycles of explicit histories with a fixed step, in the shape of the axes; NaN for all others."""
    outcome = result.read("outcome")
    if not {"step", "scheme"} <= set(outcome.dims) or "largest_depth" in result.study.get("slow_time", {}):
        return np.full(outcome.shape, np.nan)
    # No step is longer than the whole history.
    longest = np.minimum(result.dataset["step"], result.cycles[-1]).where(result.dataset["scheme"] == "explicit")
    return np.asarray(longest.broadcast_like(outcome).transpose(*result.axes).values, dtype=float)


def _tell_rest(number: int) -> str:
    return f"The first {_MOST_LISTED} of {number}; the others are in the file." if number > _MOST_LISTED else ""

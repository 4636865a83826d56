"""Where and why points ended as they did, and how right they are: outcomes, certificates, estimated errors, and what to
beware of: folds and jumps of the branches, steps too long, oscillating wear, unstable states.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from numpy.typing import NDArray

from studyrunner.advice import advise_steps
from studyrunner.percent import show_percent
from studyrunner.report.drawing import Drawing, Missing, Table, add_legend, new_figure
from studyrunner.report.figures.frequency_course import Course, find_course
from studyrunner.report.figures.response import folds
from studyrunner.report.reading.choice import choose
from studyrunner.report.reading.known_volumes import settings_of, tell_ends, tell_volumes
from studyrunner.report.reading.result import CONVERGED, NO_VOLUME, Result, as_sentences
from studyrunner.report.reading.units import show_cycles, show_number, show_power
from studyrunner.summary.certificates import certificate_rows
from studyrunner.system.progress import count

_MOST_ROWS = 24
_MOST_LISTED = 20
_MOST_LETTERS = 400
# Converged is light, so that what failed stands out; the number in the cell tells the rest.
_CONVERGED_COLOUR = "#e8eef4"
_FAILED_COLOURS = ("#D55E00", "#0072B2", "#CC79A7", "#009E73", "#56B4E9", "#E69F00", "#7f7f7f", "#000000", "#F0E442")
_ERRORS = {
    "error_estimate": "last worn volume",
    "response_error": "response, worst cycle",
    "wear_rate_error": "wear rate, worst cycle",
    "energy_error": "energy balance, worst cycle",
}
_NOTE = (
    "Each value of a certificate is the largest over all points computed to the end and all cycle counts kept; 0"
    " is the best. A point ends where its certificates exceed their limits."
)
_FLOOR = 1e-3
_NEGLIGIBLE = 1e-6


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
        rows.append((str(number), ending.word.replace("_", " "), str(numbers[number]), *known, ending.sentence, first))
    n_special = outcome.size - numbers[CONVERGED]
    without = "" if result.held.all() else "Where there is no result there are gaps in the figures and NaN in the file"
    note = as_sentences(tell_volumes(result), tell_ends(result), without)
    known = ["known to rtol"] if result.tells_volumes else []
    columns = ("number", "outcome", "points", *known, "what it means", "first of them at")
    yield Table("outcomes", "Outcomes of the points", columns, tuple(rows), note)
    course = find_course(result)
    if n_special and course is not None:
        yield draw_outcome_map(result, course)


def draw_outcome_map(result: Result, course: Course) -> Drawing:
    """One cell a point: the course across, a row for each other combination; the number of the outcome in the cell."""
    choice = choose(result, [course.axis], _MOST_ROWS)
    field = np.array([course.read(result, "outcome", point) for point in choice.points]).astype(int)
    present = sorted(set(field.ravel().tolist()))
    special = [number for number in present if number != CONVERGED]
    colours = {number: _FAILED_COLOURS[i % len(_FAILED_COLOURS)] for i, number in enumerate(special)}
    colours[CONVERGED] = _CONVERGED_COLOUR
    figure = new_figure(1.4 + 0.32 * len(field))
    panel: Axes = figure.subplots()
    panel.pcolormesh(
        np.arange(field.shape[1] + 1) - 0.5,
        np.arange(field.shape[0] + 1) - 0.5,
        np.searchsorted(present, field),
        cmap=ListedColormap([colours[number] for number in present]),
        vmin=-0.5,
        vmax=len(present) - 0.5,
        edgecolors="white",
        linewidth=0.8 if field.size <= _MOST_LETTERS else 0.0,
        rasterized=field.size > _MOST_LETTERS,
    )
    if field.size <= _MOST_LETTERS and field.shape[1] <= 40:
        for (row, column), number in np.ndenumerate(field):
            if number != CONVERGED:
                panel.text(column, row, str(number), ha="center", va="center", color=_on(colours[number]), fontsize=8.5)
    panel.grid(visible=False)
    panel.invert_yaxis()
    _label_cells(panel, course, choice.labels)
    for number in present:
        label = f"{number} {result.endings[number].word.replace('_', ' ')}"
        panel.plot([], [], linestyle="none", marker="s", markersize=9, color=colours[number], label=label)
    add_legend(figure)
    meaning = [f"{number}: {result.endings[number].sentence}" for number in special]
    caption = as_sentences("How the computation of each point ended", *meaning, choice.sentence)
    return Drawing("outcome_map", "How the points ended", caption, figure)


def _label_cells(panel: Axes, course: Course, labels: tuple[str, ...]) -> None:
    """Values of the course under the cells, as many as fit, and the combinations beside the rows."""
    every = -(-course.values.size // 9)
    kept = np.arange(0, course.values.size, every)
    panel.set_xticks(kept, [f"{course.values[index]:.6g}" for index in kept])
    panel.set_xlabel(course.label)
    panel.set_yticks(np.arange(len(labels)), [label or "all" for label in labels])
    if labels == ("",):
        panel.set_yticks([])
    panel.tick_params(length=0)
    panel.spines[:].set_visible(False)


def _on(colour: str) -> str:
    """Black or white, whichever is read on a colour."""
    red, green, blue = (int(colour[start : start + 2], 16) for start in (1, 3, 5))
    return "white" if 0.3 * red + 0.59 * green + 0.11 * blue < 140 else "black"


def draw_certificates(result: Result) -> Iterator[Drawing | Missing | Table]:
    """The table of the worst certificates, and the estimated errors over the course."""
    rows, title = certificate_rows(result), "Certificates: how right the states are"
    if rows:
        yield Table("certificates", title, ("certificate", "largest value", "where"), tuple(rows), _NOTE)
    elif result.blocks is None:
        yield Missing("certificates", title, "The file holds no certificates: add residual to [outputs] variables.")
    course = find_course(result)
    if course is not None and result.computed.any():
        drawing = draw_errors(result, course)
        if drawing is not None:
            yield drawing


def draw_errors(result: Result, course: Course) -> Drawing | None:
    """Estimated relative errors over the course, else at the shown point; None where there is none above zero."""
    point = result.shown_point()
    figure = new_figure(3.4)
    panel: Axes = figure.subplots()
    worst: list[str] = []
    aim = _aim(result)
    floor = _FLOOR * (aim or _FLOOR)
    for number, (name, label) in enumerate(_ERRORS.items()):
        if not result.has(name):
            continue
        errors = _worst_errors(result, course, name)
        errors = np.where(errors > floor, errors, np.nan)
        if np.isnan(errors).all():
            continue
        panel.plot(course.values, errors, label=label, **course.line_style(number))
        top = int(np.nanargmax(errors))
        at = result.describe({course.axis: int(course.index[top])}, [course.axis])
        worst.append(f"{label} {show_percent(errors[top], aim)} at {at}")
    if not worst:
        return None
    panel.set_yscale("log")
    if aim is not None:
        panel.axhline(aim, color="0.4", linewidth=1.0, zorder=1, label=f"rtol = {aim:g}")
    panel.yaxis.set_major_formatter(show_power)
    panel.yaxis.set_minor_formatter("")
    course.set_axis(panel)
    panel.set_xlim(course.edges[0], course.edges[-1])
    panel.set_ylabel("estimated relative error")
    add_legend(figure)
    others = result.describe(point, [name for name in result.varying if name != course.axis])
    caption = as_sentences(
        f"Estimated relative errors{f' ({others})' if others else ''}; the largest: {'; '.join(worst)}",
        f"Gaps: points without a result, errors below {show_percent(floor)} or not estimated, and for the wear"
        " points that hardly wear",
        "Horizontal line: rtol, what automatic settings aim at" if aim is not None else "",
    )
    return Drawing("estimated_errors", "Estimated errors", caption, figure)


def _worst_errors(result: Result, course: Course, name: str) -> NDArray[np.float64]:
    """Largest error over the cycles (n,) of the course; NaN where there is none above zero to show."""
    point = result.shown_point()
    errors = course.read(result, name, point)
    if errors.ndim == 2:
        errors = np.where(np.isnan(errors), -1.0, errors).max(axis=1)
    if name in ("error_estimate", "wear_rate_error") and result.has("worn_volume"):
        # An error relative to next to nothing says nothing.
        worn = course.read(result, "worn_volume", point)[:, -1]
        least = max(NO_VOLUME, _NEGLIGIBLE * float(np.nanmax(result.read("worn_volume").values)))
        if len(result.cycles) > 1:
            errors = np.where(worn > least, errors, np.nan)
    return np.where(errors > 0.0, errors, np.nan)


def _aim(result: Result) -> float | None:
    """The `rtol` of the study; None where it is an axis or the file does not say."""
    aim = result.study_number("solver", "rtol")
    return aim if aim > 0.0 and "rtol" not in result.varying else None


def list_branches(result: Result) -> Iterator[Table]:
    """Folds that the sweeps jumped over and jumps while wearing; nothing where there are none."""
    rows = [
        ("fold", f"{frequency:.6g} Hz", f"sweep {sweep} jumps to another branch" if sweep else "the sweep jumps")
        for sweep, frequency in folds(result)
    ]
    number = len(rows)
    if result.has("jump_cycle"):
        jumps = result.read("jump_cycle").values
        places = np.argwhere(np.isfinite(jumps))
        number += len(places)
        for place in places[:_MOST_LISTED]:
            at = result.describe(dict(zip(result.axes, map(int, place), strict=True)))
            rows.append(("jump while wearing", show_cycles(float(jumps[tuple(place)])), f"branch lost at {at}"))
    if rows:
        columns = ("what", "where", "meaning")
        yield Table("folds_and_jumps", "Folds and jumps", columns, tuple(rows[:_MOST_LISTED]), _tell_rest(number))


def list_stability(result: Result) -> Iterator[Table]:
    """Points with an explicit step longer than predicted to be stable, an oscillating wear rate, or unstable states."""
    if not result.has("step_limit", "oscillates"):
        return
    limit = result.read("step_limit").values
    # Points that failed count as in the certificates of the run: a step too long may be why they failed.
    oscillates = result.read("oscillates").values != 0
    unstable = np.zeros_like(oscillates)
    if result.has("stable"):
        unstable = (result.read("stable") == 0).any("cycle").transpose(*result.axes).values & result.computed
    step, explicit = _steps(result)
    too_long = explicit & np.isfinite(limit) & (step > limit)
    rows = []
    places = np.argwhere(too_long | oscillates | unstable)
    for place in places[:_MOST_LISTED]:
        at = tuple(place)
        point = dict(zip(result.axes, map(int, place), strict=True))
        rows.append(
            (
                result.describe(point),
                show_number(float(step[at]), 4) if np.isfinite(step[at]) else "",
                show_number(float(limit[at]), 3) if explicit[at] and np.isfinite(limit[at]) else "",
                "yes" if too_long[at] else "",
                "yes" if oscillates[at] else "",
                "yes" if unstable[at] else "",
            )
        )
    if rows:
        counts = [int(np.count_nonzero(what)) for what in (too_long, oscillates, unstable)]
        note = as_sentences(
            f"{count(counts[0], 'point')} with an explicit step longer than step_limit, {counts[1]} with a wear rate"
            f" that oscillates from step to step, {counts[2]} with unstable states",
            _advise_steps(result, too_long | oscillates),
            _tell_rest(len(places)),
        )
        columns = ("point", "step (cycles)", "step_limit (cycles)", "step too long", "oscillates", "unstable states")
        yield Table("stability", "Stability in slow time", columns, tuple(rows), note)


def _advise_steps(result: Result, where: NDArray[np.bool_]) -> str:
    """What may help the first of these points, whose steps are too long."""
    if not where.any():
        return ""
    return f"Against the first two: {advise_steps(settings_of(result, tuple(np.argwhere(where)[0].tolist())))}"


def _steps(result: Result) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Longest step in cycles and whether the scheme is explicit with this fixed step; both in the shape of the axes."""
    outcome = result.read("outcome")
    shape = outcome.shape
    steps = np.full(shape, np.nan)
    if "step" in outcome.dims:
        # No step is longer than the whole history.
        longest = np.minimum(result.dataset["step"], result.cycles[-1])
        steps = longest.broadcast_like(outcome).transpose(*result.axes).values
    explicit = np.zeros(shape, dtype=bool)
    free = "largest_depth" in result.study.get("slow_time", {})
    if "scheme" in outcome.dims and not free:
        explicit = (result.dataset["scheme"] == "explicit").broadcast_like(outcome).transpose(*result.axes).values
    return steps, explicit


def _tell_rest(number: int) -> str:
    return f"The first {_MOST_LISTED} of {number}; the others are in the file." if number > _MOST_LISTED else ""

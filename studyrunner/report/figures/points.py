"""All points of a study at once: trends along its axes, how points ended, how right they are."""

import itertools
import textwrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.patches import Patch

from solver.outcome import Outcome, absolute
from studyrunner.coordinates import POINT, SAMPLE
from studyrunner.kinds.wear.kind import CERTIFICATE
from studyrunner.report import drawing as plot
from studyrunner.report.drawing import COLOURS, Drawn, FloatArray, Table, as_sentences
from studyrunner.report.selection import choose, find_course, spans_decades
from studyrunner.result.opening import describe_outcome
from studyrunner.result.view import Result
from studyrunner.units import Scale, scale_for, show_cycles, show_known, show_number, units_of

_PLAIN = ("frequency", "scheme", SAMPLE, POINT)
_MOST_AXES, _SMALL = 6, 7.5
_MOST_POINTS = 200  # in the table
_LONG = 9  # characters that stand side by side under a small panel
_MOST_ROWS, _MOST_CELLS, _LABEL_WIDTH = 24, 400, 20
# what was computed to the end is light, so that what failed stands out
_CONVERGED_COLOUR, _OTHERS = "#dfe7ef", (COLOURS[1], COLOURS[0], *COLOURS[2:], "#7f7f7f", "#F0E442")


# --- trends along the axes ---


def draw_trends(result: Result) -> Drawn:
    """Small multiples: one row a quantity, one column an axis. Nothing where only frequency and scheme vary, unless
    amplitudes were sought.
    """
    quantities = [each for each in _find_quantities(result) if np.isfinite(each[2]).any()]
    sought = result.has("allowable_amplitude")
    if not quantities or (all(name in _PLAIN for name in result.varying) and not (result.designed or sought)):
        return None
    # the last of many are the first to go
    varying = [*result.designed, *(name for name in result.varying if name not in (POINT, SAMPLE))]
    if not varying:
        return None
    axes, left = varying[:_MOST_AXES], [name.replace("_", " ") for name in varying[_MOST_AXES:]]
    figure, panels = plot.new_panels(len(quantities), len(axes), 0.5 + 1.35 * len(quantities), sharey="row")
    for row, (label, units, values, errors) in zip(panels, quantities, strict=True):
        scale = scale_for(units, values)
        for name, panel in zip(axes, row, strict=True):
            _draw_trend(panel, result, name, scale(values), scale(errors))
            panel.set_ylabel(f"{label}\n({scale.unit})")
        # the panels of a row share their limits
        plot.set_from_zero(row[0], 1.05 * float(np.nanmax(scale(values))))
    plot.label_outer(panels)
    most = "the least allowable amplitude" if sought else "where most is worn"
    through = f"Blue: through {result.describe(result.shown)}, {most}; grey: all other combinations"
    return figure, through, f"Left out: {', '.join(left)}" if left else ""


def list_points(result: Result) -> Drawn:
    """The points of a design, each with its columns, what came out in the end, and how it ended."""
    if not result.designed:
        return None
    choice, n_shown = choose(result, [POINT], 1), min(result.dataset.sizes[POINT], _MOST_POINTS)
    through = tuple(slice(n_shown) if name == POINT else choice.points[0][name] for name in result.axes)
    columns = {POINT: [str(place) for place in range(n_shown)]}
    for name in result.designed:
        array = result.dataset[name]
        texts = [each if isinstance(each, str) else show_number(float(each)) for each in array.values[:n_shown]]
        columns[Scale(1.0, units_of(array)).label(name.replace("_", " "))] = texts
    for label, units, *arrays in _find_quantities(result):
        scale, (values, errors) = scale_for(units, arrays[0]), (each[through].tolist() for each in arrays)
        pairs = zip(values, errors, strict=True)
        texts = [scale.show(value) + (show_known(error / value) if value > 0.0 else "") for value, error in pairs]
        columns[label.replace("\n", " ")] = texts
    columns["ended"] = [describe_outcome(each)[0] for each in result.dataset["outcome"].values[through].tolist()]
    more = f"The first {n_shown} of {result.dataset.sizes[POINT]} points" * (n_shown < result.dataset.sizes[POINT])
    return Table(tuple(columns), tuple(zip(*columns.values(), strict=True)), as_sentences(choice.sentence, more))


def _find_quantities(result: Result) -> list[tuple[str, str, FloatArray, FloatArray]]:
    """Label, unit, values and errors (axes...) in the end of what every point has."""
    quantities = []
    if result.has("allowable_amplitude"):
        sought, unsure = (result.of_points(f"allowable_amplitude{end}") for end in ("", "_error"))
        quantities.append(("allowable\namplitude", "N", np.where(np.isfinite(sought), sought, np.nan), unsure))
    elif result.has("worn_volume") and len(result.cycles) > 1:
        worn = np.where(result.computed, result.worn, np.nan)
        quantities.append(("worn volume\nin the end", "m3", worn, absolute(result.errors, worn)))
    if result.has("response_amplitude"):
        amplitude = np.where(result.computed, result.of_points("response_amplitude", -1)[..., 0], np.nan)
        error = result.of_points("response_error", -1) if result.has("response_error") else np.nan
        units = str(result.dataset["response_amplitude"].attrs.get("units", "m"))
        quantities.append((f"response\nof {result.responses[0]}", units, amplitude, absolute(error, amplitude)))
    return quantities


def _draw_trend(panel: Axes, result: Result, name: str, values: FloatArray, errors: FloatArray) -> None:
    """A quantity (axes...), as shown, along an axis or over a column of a design, at the shown point and all others."""
    along, places = POINT if name in result.designed else name, result.dataset[name].values
    words = places.dtype.kind not in "fiu"
    # the words of an axis differ, those of a column come again
    ticks, at_tick = np.unique(places, return_inverse=True) if along == POINT else (places, np.arange(len(places)))
    order = np.argsort(at_tick if words else places, kind="stable")
    at = (at_tick if words else places)[order].astype(float)
    drawn, wrong = (np.moveaxis(each, result.axes.index(along), 0)[order] for each in (values, errors))
    through: Any = (slice(None), *(result.shown[other] for other in result.axes if other != along))
    marks: dict[str, Any] = {"linestyle": "none", "marker": "."} if along == POINT else {"linewidth": 0.6}
    panel.plot(at, drawn.reshape(len(order), -1), color="0.72", zorder=1, **marks)
    look: dict[str, Any] = {"color": COLOURS[0], "marker": "o", "markersize": 3.5, "zorder": 3, "label": "shown point"}
    look |= {"linestyle": "none"} if along == POINT else {}
    plot.add_line(panel, at, drawn[through], wrong[through], **look)
    units = units_of(result.dataset[name])
    # a word a line: panels are narrow
    panel.set_xlabel(name.replace("_", "\n") + (f"\n({units})" if units else ""))
    panel.tick_params(labelsize=_SMALL)
    if not words and name != "frequency" and spans_decades(at):
        plot.set_log(panel.xaxis, float(at[0]), float(at[-1]))
    elif words or len(ticks) <= 3:
        texts = [str(each) if words else show_number(float(each), 4) for each in ticks]
        turned: dict[str, Any] = {"rotation": 35, "ha": "right", "rotation_mode": "anchor"}
        is_long, where = sum(map(len, texts)) > _LONG, np.arange(len(ticks)) if words else ticks
        if is_long and not words:
            # what lies between two numbers needs none
            texts[1:-1] = [""] * len(texts[1:-1])
        panel.set_xticks(where, texts, **(turned if is_long and words else {}))
        panel.margins(x=0.15)
    else:
        panel.locator_params(axis="x", nbins=3)


# --- how far the points are to be trusted ---


def draw_outcomes(result: Result) -> Drawn:
    """One cell a point: the course across, a row for each other combination; nothing where all points are alike."""
    course = find_course(result)
    if course is None or (result.dataset["outcome"].values == Outcome.CONVERGED).all():
        return None
    choice = course.choose(_MOST_ROWS)
    field = course.read("outcome", *choice.points)
    present = np.unique(field).astype(int).tolist()
    others = itertools.cycle(_OTHERS)
    cells = {number: _CONVERGED_COLOUR if number == Outcome.CONVERGED else next(others) for number in present}
    labels = [textwrap.fill(label, _LABEL_WIDTH) if plot.is_narrow() else label for label in choice.labels]
    height = 1.4 + 0.32 * len(field) + 0.17 * sum(label.count("\n") for label in labels)
    figure, panel = plot.new_panel(height)
    # a narrow figure is lower, its labels are not
    figure.set_figheight(height)
    norm = BoundaryNorm([*(np.array(present) - 0.5), present[-1] + 0.5], len(present))
    look: dict[str, Any] = {"edgecolors": "white", "linewidth": 0.8} if field.size <= _MOST_CELLS else {}
    across, down = (np.arange(size + 1) - 0.5 for size in field.shape[::-1])
    plot.add_map(panel, across, down, field, norm, cmap=ListedColormap(list(cells.values())), **look)
    panel.invert_yaxis()
    kept = np.arange(0, course.values.size, -(-course.values.size // (4 if plot.is_narrow() else 9)))
    panel.set_xticks(kept, [f"{course.values[index]:.6g}" for index in kept])
    panel.set_xlabel(course.label)
    panel.set_yticks(np.arange(len(labels)), labels)
    panel.tick_params(length=0)
    panel.spines[:].set_visible(False)
    words = {number: describe_outcome(number)[0].replace("_", " ") for number in present}
    plot.add_legend(figure, [Patch(facecolor=cells[number], label=words[number]) for number in present])
    meaning = (f"{words[number].capitalize()}: {describe_outcome(number)[1]}" for number in present if number)
    return figure, as_sentences(*meaning), choice.sentence


def list_certificates(result: Result) -> Drawn:
    """The worst certificates and where they are."""
    rows = []
    for name, words in CERTIFICATE.items():
        if result.has(name) and "cycle" in result.dataset[name].dims:
            values = result.of_points(name)
            values = np.where(result.computed[..., None] & np.isfinite(values), values, 0.0)
            *place, cycle = map(int, np.unravel_index(int(np.argmax(values)), values.shape))
            point = result.point_at(place)
            count_at = show_cycles(float(result.counts(point)[cycle]), result.counted)
            where = ", ".join(filter(None, (result.describe(point), count_at)))
            rows.append((words, f"{values.max():.1e}", where) if values.max() > 0.0 else (words, "0", ""))
    if not rows or not result.computed.any():
        return None
    return Table(("certificate", "worst value", "where"), tuple(rows))

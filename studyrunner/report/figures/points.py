"""All points of a study at once: trends along its axes, how the points ended, how right their states are."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.patches import Patch

from studyrunner.report import panels as plot
from studyrunner.report.drawing import Drawn, Table, as_sentences
from studyrunner.report.panels import COLOURS, FloatArray
from studyrunner.report.selection import choose, find_course, spans_decades
from studyrunner.result.view import CONVERGED, Result
from studyrunner.statistics.samples import SAMPLE
from studyrunner.units import scale_for, show_cycles, show_number, units_of
from studyrunner.variables import CERTIFICATE

_PLAIN = ("frequency", "scheme", SAMPLE)
_MOST_AXES, _SMALL = 6, 7.5
_LONG = 9  # characters that stand side by side under a small panel
_MOST_ROWS, _MOST_CELLS, _LABEL_WIDTH = 24, 400, 20
# what was computed to the end is light, so that what failed stands out
_CONVERGED_COLOUR, _OTHERS = "#dfe7ef", (COLOURS[1], COLOURS[0], *COLOURS[2:], "#7f7f7f", "#F0E442")


def draw_trends(result: Result) -> Drawn:
    """Small multiples: one row a quantity, one column an axis. Nothing where only frequency and scheme vary."""
    quantities = [each for each in find_quantities(result) if np.isfinite(each[2]).any()]
    if not quantities or all(name in _PLAIN for name in result.varying):
        return None
    # the last of many are the first to go
    axes = [name for name in result.varying if name != SAMPLE][:_MOST_AXES]
    left = [name.replace("_", " ") for name in result.varying if name not in (*axes, SAMPLE)]
    figure, panels = plot.new_panels(len(quantities), len(axes), 0.5 + 1.35 * len(quantities), sharey="row")
    lowest: dict[str, Axes] = {}
    for row, (label, units, values, errors) in zip(panels, quantities, strict=True):
        scale = scale_for(units, values)
        # a quantity that is the largest over the frequency has no panel over it
        known = [name for name in axes if values.shape[result.axes.index(name)] > 1]
        for name, panel in zip(axes, row, strict=True):
            if name not in known:
                panel.remove()
                continue
            _draw_trend(panel, result, name, scale(values), scale(errors))
            if plot.is_narrow() or name == known[0]:
                panel.set_ylabel(f"{label}\n({scale.unit})")
                panel.tick_params(labelleft=True)
            if above := lowest.get(name):
                above.set_xlabel("")
                above.tick_params(labelbottom=False)
            lowest[name] = panel
    through = f"Blue: through {result.describe(result.shown_point())}, where most is worn; grey: all other combinations"
    return figure, through, f"Left out: {', '.join(left)}" if left else ""


def find_quantities(result: Result) -> list[tuple[str, str, FloatArray, FloatArray]]:
    """Numbers of every point that the file has: label, unit in the file, values and errors in the shape of the axes.

    The worn volume, and the response after wear, of several frequencies the largest, with length 1 along them.
    """
    found = []
    if result.has("worn_volume") and len(result.cycles) > 1:
        worn = np.where(result.computed, result.worn, np.nan)
        found.append(("worn volume\nin the end", "m3", worn, result.errors * worn))
    if result.has("response_amplitude"):
        amplitude = result.dataset["response_amplitude"].isel(response=0, cycle=-1).transpose(*result.axes)
        units, of = str(amplitude.attrs.get("units", "m")), f"response\nof {result.responses[0]}"
        values = np.where(result.computed, amplitude.values, np.nan)
        if "frequency" in result.varying:
            values, of = np.fmax.reduce(values, axis=result.axes.index("frequency"), keepdims=True), f"largest {of}"
        found.append((f"{of} in the end", units, values, np.full(values.shape, np.nan)))
    return found


def _draw_trend(panel: Axes, result: Result, name: str, values: FloatArray, errors: FloatArray) -> None:
    """A quantity, as shown, along an axis, through the shown point and all others."""
    axis, shown, places = result.axes.index(name), result.shown_point(), result.dataset[name].values
    words = places.dtype.kind not in "fiu"
    order = np.arange(len(places)) if words else np.argsort(places, kind="stable")
    at = order.astype(float) if words else places[order].astype(float)
    drawn, wrong = (np.moveaxis(each, axis, 0)[order] for each in (values, errors))
    others = [shown[other] for other in result.axes if other != name]
    through: Any = (slice(None), *(0 if n == 1 else place for n, place in zip(drawn.shape[1:], others, strict=True)))
    panel.plot(at, drawn.reshape(len(order), -1), color="0.72", linewidth=0.6, zorder=1)
    look: dict[str, Any] = {"color": COLOURS[0], "marker": "o", "markersize": 3.5, "zorder": 3, "label": "shown point"}
    plot.add_line(panel, at, drawn[through], wrong[through], **look)
    panel.set_ylim(bottom=0.0)
    units = units_of(result.dataset[name])
    # a word a line: panels are narrow
    panel.set_xlabel(name.replace("_", "\n") + (f"\n({units})" if units else ""))
    panel.tick_params(labelsize=_SMALL)
    if not words and name != "frequency" and spans_decades(at):
        plot.set_log(panel.xaxis, float(at[0]), float(at[-1]))
        return
    room = (0.15 if len(at) <= 3 else 0.05) * float(np.ptp(at))
    panel.set_xlim(at[0] - room, at[-1] + room)
    if words or len(at) <= 3:
        texts = [str(each) if words else show_number(float(each), 4) for each in places[order]]
        turned: dict[str, Any] = {"rotation": 35, "ha": "right", "rotation_mode": "anchor"}
        panel.set_xticks(at, texts, **(turned if sum(map(len, texts)) > _LONG else {}))
    else:
        panel.locator_params(axis="x", nbins=3)


def draw_outcomes(result: Result) -> Drawn:
    """One cell a point: the course across, a row for each other combination; nothing where all points are alike."""
    course = find_course(result)
    if course is None or (result.dataset["outcome"].values == CONVERGED).all():
        return None
    choice = choose(result, [course.axis], _MOST_ROWS)
    field = np.array([course.read(result, "outcome", point) for point in choice.points])
    present = np.unique(field).astype(int)
    special = [number for number in present.tolist() if number != CONVERGED]
    colours = {number: _OTHERS[place % len(_OTHERS)] for place, number in enumerate(special)}
    cells = [colours.get(number, _CONVERGED_COLOUR) for number in present.tolist()]
    labels = [textwrap.fill(label, _LABEL_WIDTH) if plot.is_narrow() else label for label in choice.labels]
    height = 1.4 + 0.32 * len(field)
    figure, panel = plot.new_panel(height)
    figure.set_figheight(height + 0.15 * sum(label.count("\n") for label in labels))
    norm = BoundaryNorm([*(present - 0.5), present[-1] + 0.5], len(present))
    look: dict[str, Any] = {"edgecolors": "white", "linewidth": 0.8} if field.size <= _MOST_CELLS else {}
    across, down = (np.arange(size + 1) - 0.5 for size in field.shape[::-1])
    plot.add_map(panel, across, down, field, norm, cmap=ListedColormap(cells), **look)
    panel.invert_yaxis()
    kept = np.arange(0, course.values.size, -(-course.values.size // (4 if plot.is_narrow() else 9)))
    panel.set_xticks(kept, [f"{course.values[index]:.6g}" for index in kept])
    panel.set_xlabel(course.label)
    panel.set_yticks(np.arange(len(labels)), labels)
    panel.tick_params(length=0)
    panel.spines[:].set_visible(False)
    words = {number: result.endings[number].word.replace("_", " ") for number in present.tolist()}
    plot.add_legend(figure, [Patch(facecolor=cell, label=words[n]) for n, cell in zip(words, cells, strict=True)])
    meaning = [f"{words[number].capitalize()}: {result.endings[number].sentence}" for number in special]
    return figure, as_sentences(*meaning), choice.sentence


def list_certificates(result: Result) -> Drawn:
    """The worst certificates and where they are."""
    rows = []
    for name, words in CERTIFICATE.items():
        if result.has(name) and "cycle" in result.dataset[name].dims:
            values = result.dataset[name].transpose(*result.axes, "cycle").values
            values = np.where(result.computed[..., None] & np.isfinite(values), values, 0.0)
            *place, cycle = map(int, np.unravel_index(int(np.argmax(values)), values.shape))
            point = result.point_at(place)
            count_at = show_cycles(float(result.counts(point)[cycle]), result.counted)
            where = ", ".join(filter(None, (result.describe(point), count_at)))
            rows.append((words, f"{values.max():.1e}", where) if values.max() > 0.0 else (words, "0", ""))
    if not rows or not result.computed.any():
        return None
    return Table(("certificate", "worst value", "where"), tuple(rows))

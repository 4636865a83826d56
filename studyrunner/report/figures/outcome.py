"""Where and why points ended as they did, and how right they are: outcomes and certificates."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.patches import Patch

from studyrunner.report.drawing import Drawn, Table
from studyrunner.report.panels import COLOURS, add_legend, add_map, is_narrow, new_panel
from studyrunner.report.selection import choose, find_course
from studyrunner.result.points import CONVERGED
from studyrunner.result.units import show_cycles
from studyrunner.result.view import Result, as_sentences
from studyrunner.variables import CERTIFICATE

_MOST_ROWS, _MOST_CELLS, _LABEL_WIDTH = 24, 400, 20
# what was computed to the end is light, so that what failed stands out
_CONVERGED_COLOUR, _OTHERS = "#dfe7ef", (COLOURS[1], COLOURS[0], *COLOURS[2:], "#7f7f7f", "#F0E442")


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
    labels = [textwrap.fill(label, _LABEL_WIDTH) if is_narrow() else label for label in choice.labels]
    n_lines = sum(label.count("\n") for label in labels)
    figure, panel = new_panel(1.4 + 0.32 * len(field))
    figure.set_figheight(1.4 + 0.32 * len(field) + 0.15 * n_lines)
    norm = BoundaryNorm([*(present - 0.5), present[-1] + 0.5], len(present))
    look: dict[str, Any] = {"edgecolors": "white", "linewidth": 0.8} if field.size <= _MOST_CELLS else {}
    across, down = (np.arange(size + 1) - 0.5 for size in field.shape[::-1])
    add_map(panel, across, down, field, norm, cmap=ListedColormap(cells), **look)
    panel.invert_yaxis()
    kept = np.arange(0, course.values.size, -(-course.values.size // (4 if is_narrow() else 9)))
    panel.set_xticks(kept, [f"{course.values[index]:.6g}" for index in kept])
    panel.set_xlabel(course.label)
    panel.set_yticks(np.arange(len(labels)), labels)
    panel.tick_params(length=0)
    panel.spines[:].set_visible(False)
    words = {number: result.endings[number].word.replace("_", " ") for number in present.tolist()}
    add_legend(figure, [Patch(facecolor=cell, label=words[n]) for n, cell in zip(words, cells, strict=True)])
    meaning = [f"{words[number].capitalize()}: {result.endings[number].sentence}" for number in special]
    return figure, as_sentences(*meaning, choice.sentence)


def list_certificates(result: Result) -> Drawn:
    """The worst certificates and where they are."""
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
    if not rows or not result.computed.any():
        return None
    note = "The largest over all points computed to the end and all counts in the file; 0 is the best."
    return Table(("certificate", "worst value", "where"), tuple(rows), note)

"""Where and why points ended as they did, and how right they are: outcomes and certificates."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.colors import ListedColormap

from studyrunner.report.drawing import Drawing, Table, add_legend, new_panel
from studyrunner.report.figures.courses import find_course
from studyrunner.result.choice import choose
from studyrunner.result.units import show_cycles
from studyrunner.result.view import CONVERGED, Result, as_sentences
from studyrunner.variables import CERTIFICATE

_MOST_ROWS, _MOST_CELLS = 24, 400
# What was computed to the end is light, so that what failed stands out.
_CONVERGED_COLOUR = "#dfe7ef"
_OTHER_COLOURS = ("#D55E00", "#0072B2", "#CC79A7", "#009E73", "#56B4E9", "#E69F00", "#7f7f7f", "#000000", "#F0E442")
_HATCHES = ("///", "...", "xx", "\\\\\\", "++", "oo", "--", "||", "**")


def draw_outcomes(result: Result) -> Iterator[Drawing]:
    """One cell a point: the course across, a row for each other combination; colour and hatching tell the outcome.

    Nothing where all points are alike, or there is no course.
    """
    course = find_course(result)
    if course is None or (result.dataset["outcome"].values == CONVERGED).all():
        return
    choice = choose(result, [course.axis], _MOST_ROWS)
    field = np.array([course.read(result, "outcome", point) for point in choice.points]).astype(int)
    present = sorted(set(field.ravel().tolist()))
    special = [number for number in present if number != CONVERGED]
    colours = {number: _OTHER_COLOURS[i % len(_OTHER_COLOURS)] for i, number in enumerate(special)}
    colours[CONVERGED] = _CONVERGED_COLOUR
    figure, panel = new_panel(1.4 + 0.32 * len(field))
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
    yield Drawing("outcome_map", "How the points ended", as_sentences(*meaning, choice.sentence), figure)


def _hatch(special: list[int], number: int) -> str:
    return _HATCHES[special.index(number) % len(_HATCHES)] if number in special else ""


def list_certificates(result: Result) -> Iterator[Table]:
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
    if rows and result.computed.any():
        note = "The largest over all points computed to the end and all counts kept; 0 is the best."
        columns = ("certificate", "worst value", "where")
        yield Table("certificates", "Certificates: how right the states are", columns, tuple(rows), note)

"""The frequency of an excitation that follows the resonance, over cycles."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from studyrunner.report.drawing import Drawing, Missing, add_legend, line_style, new_figure
from studyrunner.report.reading.choice import choose
from studyrunner.report.reading.result import Result, as_sentences
from studyrunner.report.reading.units import scale_for, show_number

_MOST_LINES = 6
_NAME = "excitation_frequency"


def draw_excitation(result: Result) -> Iterator[Drawing | Missing]:
    """Frequency over cycles, one line a combination; nothing where the study gives the frequency."""
    if not result.followed or not result.has_history:
        return
    title = "Frequency of the excitation over cycles"
    if not result.has(_NAME):
        yield Missing(_NAME, title, result.lacks(_NAME))
        return
    shown, choice = result.shown_point(), choose(result, [], _MOST_LINES)
    cycles, figure = scale_for("cycles", result.cycles), new_figure(3.4)
    panel = figure.subplots()
    ends = []
    for number, (point, label) in enumerate(choice):
        full = {**shown, **point}
        counts, found = result.counts(full), result.at(_NAME, full).values
        known = np.flatnonzero(np.isfinite(found) & np.isfinite(counts))
        if not known.size:
            continue
        style = line_style(number, found.size)
        panel.plot(cycles(counts[known]), found[known], label=label or "computed", **style)
        if result.has(f"{_NAME}_error"):
            error = np.nan_to_num(result.at(f"{_NAME}_error", full).values[known], posinf=0.0)
            low, high = found[known] - error, found[known] + error
            panel.fill_between(cycles(counts[known]), low, high, color=style["color"], alpha=0.2, gid="error")
        moved = f"from {show_number(float(found[known[0]]))} to {show_number(float(found[known[-1]]))} Hz"
        ends.append(f"{moved} ({label})" if label else moved)
    panel.set_xlabel(cycles.label("vibration cycles"))
    panel.set_ylabel("frequency (Hz)")
    if len(panel.get_lines()) > 1:
        add_legend(figure)
    bands = "Bands: estimated error" if any(each.get_gid() == "error" for each in panel.collections) else ""
    said = f"The excitation follows the {result.followed}: {', '.join(ends)}"
    yield Drawing(_NAME, title, as_sentences(said, bands, choice.sentence), figure)

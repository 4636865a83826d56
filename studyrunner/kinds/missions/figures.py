"""Figures of missions: wear and vibration by block."""

from collections.abc import Mapping

import numpy as np

from studyrunner.report import drawing as plot
from studyrunner.report.contents import AT_THE_END, BANDS, OF_POINTS, OF_RINGS, OF_WEAR, Entry
from studyrunner.report.drawing import Drawn, Table
from studyrunner.result.view import NO_VOLUME, Result
from studyrunner.units import Scale, scale_for, show_known, show_number, show_percent

_LISTED = (
    *("excitation_frequency_begin", "excitation_frequency", "block_cycles", "sweep_rate"),
    *("block_worn_volume", "block_worn_volume_error"),
)
_SHARES = {"block_share": "share of the wear in a mission", "block_worn_volume": "worn volume"}
_RESPONSES = {
    "response_amplitude_begin": "amplitude at the beginning",
    "response_amplitude": "amplitude at the end",
}
"""Variables of the blocks that are drawn, in words."""


def list_blocks(result: Result) -> Drawn:
    """Frequency, cycles, worn volume with its error, and share of each block at the last number of missions."""
    assert result.blocks is not None
    blocks = result.blocks.isel(result.shown, missing_dims="ignore")
    reached = np.flatnonzero(np.isfinite(blocks["block_worn_volume"].values).all(axis=1))
    last, rows = int(reached[-1]) if reached.size else 0, []
    blocks = blocks.isel(cycle=last)
    worn = blocks["block_worn_volume"].values
    scale, total = scale_for("m3", worn), float(worn.sum())
    for name, *values in zip(blocks["block"].values, *(blocks[name].values for name in _LISTED), strict=True):
        begin, end, cycles, rate, volume, error = map(float, values)
        amount = scale.show(volume, 4) + show_known(error) if reached.size else "-"
        share = show_percent(volume / total) if total > NO_VOLUME else "-"
        frequency = " to ".join(dict.fromkeys(map(show_number, (begin, end))))
        passage = f"{rate:.2g}" if rate > 0.0 else "-"
        rows.append((str(name), frequency, show_number(cycles, 4), amount, share, passage))
    columns = ("block", "frequency (Hz)", "cycles", "worn volume", "share", "rate over (zeta f)²")
    return Table(columns, tuple(rows), f"Wear after {result.cycle_label(last)}." if reached.size else "")


def draw_blocks(result: Result, names: Mapping[str, str]) -> Drawn:
    """Variables of the blocks at the shown point over the missions: a panel a variable, a line a block."""
    assert result.blocks is not None
    blocks = result.blocks.isel(result.shown, missing_dims="ignore")
    if len(result.cycles) == 1 or not np.nanmax(blocks[list(names)[-1]].values, initial=0.0) > NO_VOLUME:
        return None
    figure, panels = plot.new_panels(2, 1, 5.6, sharex=True)
    for panel, (name, words) in zip(panels[:, 0], names.items(), strict=True):
        values = blocks[name].isel(response=0, missing_dims="ignore").values
        wrong = "response_error" if "response" in blocks[name].dims else f"{name}_error"
        unit = str(blocks[name].attrs.get("units", "1"))
        scale = Scale(100.0, "%") if unit == "1" else scale_for(unit, values)
        for place, block in enumerate(blocks["block"].values):
            line = scale(values[:, place])
            error = blocks[wrong].values[:, place] * line if wrong in blocks else None
            look = plot.line_style(place, line.size) | {"label": str(block)}
            plot.add_line(panel, result.cycles, line, error, band=True, **look)
        plot.set_from_zero(panel, float(np.nanmax(scale(values), initial=0.0)))
        panel.set_ylabel(scale.label(words))
    panels[-1, 0].set(xlabel="missions", xlim=(0.0, result.cycles[-1]))
    of_first = names is _RESPONSES and len(result.responses) > 1
    return figure, f"Of {result.responses[0]}; the others are in the file" if of_first else ""


_CYCLES = (
    "Cycles of one mission. A passage far below 1 in the last column wears as its steady vibrations do; f: frequency,"
    " zeta: damping ratio of the joint at rest"
)
_WEAR = f"Above, shares of the blocks in the volume worn in one mission. {BANDS}"
_TITLE = "Vibration of each block over the missions"
_VIBRATION = f"Amplitude of the first harmonic in the mission that ends at the number. {BANDS}"

FIGURES = (
    Entry("blocks", "Blocks of the mission with their wear", list_blocks, needs=_LISTED, at="point", caption=_CYCLES),
    Entry("block_shares", "Wear by block over the missions", draw_blocks, _SHARES, at="point", caption=_WEAR),
    Entry("block_responses", _TITLE, draw_blocks, _RESPONSES, at="point", caption=_VIBRATION),
    *OF_WEAR,
    *OF_RINGS,
    *OF_POINTS,
    *AT_THE_END,
)
"""In the order of the page."""

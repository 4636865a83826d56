"""Missions: which block wears how much over the life of a joint, and how the vibration of each block changes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from studyrunner.percent import show_percent
from studyrunner.report.drawing import (
    COLOURS,
    Drawing,
    Missing,
    Table,
    add_legend,
    line_style,
    new_panels,
    set_from_zero,
)
from studyrunner.report.reading.result import NO_VOLUME, Result, as_sentences
from studyrunner.report.reading.units import scale_for, show_number

_MOST_BLOCKS = 12
_TO_ASK = ("block_worn_volume", "block_share", "response_amplitude")
_ENDS = {"response_amplitude_begin": "begin", "response_amplitude": "end"}


def draw_missions(result: Result) -> Iterator[Drawing | Missing | Table]:
    """Table of the blocks, their shares in the wear over the missions, and their vibration; at the shown point."""
    assert result.blocks is not None
    shown = result.shown_point()
    blocks = result.blocks.isel({name: place for name, place in shown.items() if name in result.blocks.dims})
    missing = [name for name in _TO_ASK if name not in blocks]
    yield _list_blocks(result, blocks)
    if missing:
        said = f"Add {' and '.join(missing)} to [outputs] variables."
        yield Missing("blocks", "Wear and vibration by block", said)
    if blocks.sizes["block"] > _MOST_BLOCKS:
        said = f"The mission has {blocks.sizes['block']} blocks, more than the {_MOST_BLOCKS} that are drawn."
        yield Missing("blocks", "Wear and vibration by block", said)
        return
    if len(result.cycles) == 1:
        return
    tells_wear = {"block_worn_volume", "block_share"} <= set(blocks.data_vars)
    if tells_wear and float(blocks["block_worn_volume"].max()) > NO_VOLUME:
        yield _draw_shares(result, blocks)
    if "response_amplitude" in blocks:
        yield _draw_responses(result, blocks)


def _list_blocks(result: Result, blocks: xr.Dataset) -> Table:
    """Frequency, cycles, worn volume with its error, and share of each block at the last number of missions."""
    rows = []
    worn = blocks["block_worn_volume"].values if "block_worn_volume" in blocks else None
    reached = np.arange(0) if worn is None else np.flatnonzero(np.isfinite(worn).all(axis=1))
    for place, name in enumerate(blocks["block"].values):
        begin, end, cycles = (
            float(blocks[key].values[place]) if key in blocks else np.nan
            for key in ("excitation_frequency_begin", "excitation_frequency", "block_cycles")
        )
        frequency = show_number(end) if begin == end else f"{show_number(begin)} to {show_number(end)}"
        amount, share = "-", "-"
        if worn is not None and reached.size:
            of_all = worn[reached[-1]]
            amount = scale_for("m3", of_all).show(float(of_all[place]), 4) + _error(blocks, int(reached[-1]), place)
            share = show_percent(float(of_all[place] / of_all.sum())) if of_all.sum() > NO_VOLUME else "-"
        rate = float(blocks["sweep_rate"].values[place]) if "sweep_rate" in blocks else 0.0
        rows.append((str(name), frequency, show_number(cycles, 4), amount, share, f"{rate:.2g}" if rate else "-"))
    columns = ("block", "frequency (Hz)", "cycles", "worn volume", "share", "rate over (zeta f)²")
    when = f"after {result.cycle_label(int(reached[-1]))}" if reached.size else ""
    note = as_sentences(
        f"At {result.describe(result.shown_point())}, cycles of one mission, wear {when}",
        "A passage whose rate is far below (zeta f)² wears as its steady states do",
    )
    return Table("blocks", "Blocks of the mission", columns, tuple(rows), note)


def _error(blocks: xr.Dataset, row: int, place: int) -> str:
    """Error of the worn volume of a block in words; empty where none is told."""
    if "block_worn_volume_error" not in blocks:
        return ""
    error = float(blocks["block_worn_volume_error"].values[row, place])
    return f" ± {show_percent(error)}" if np.isfinite(error) and error > 0.0 else ""


def _draw_shares(result: Result, blocks: xr.Dataset) -> Drawing:
    """Above, the shares of the blocks in the wear of one mission, on top of each other; below, their worn volumes."""
    figure, panels = new_panels(2, 1, 5.2, sharex=True)
    above, below = panels[:, 0]
    missions = np.asarray(result.cycles, dtype=float)
    scale = scale_for("m3", blocks["block_worn_volume"].values)
    names = [str(name) for name in blocks["block"].values]
    shares = 100.0 * np.nan_to_num(blocks["block_share"].values)
    colours = [COLOURS[place % len(COLOURS)] for place in range(len(names))]
    patches = above.stackplot(missions, shares.T, colors=colours, alpha=0.75)
    for place, patch in enumerate(patches):
        # beyond the colours there are, the same ones with hatches
        patch.set_hatch("" if place < len(COLOURS) else "///")
    above.set_ylabel("share in a mission (%)")
    above.set_ylim(0.0, 100.0)
    above.set_xlim(0.0, missions[-1])
    errors = blocks["block_worn_volume_error"].values.T if "block_worn_volume_error" in blocks else [None] * len(names)
    highest = max(
        _draw_line(below, missions, scale(blocks["block_worn_volume"].values[:, place]), errors[place], place, name)
        for place, name in enumerate(names)
    )
    below.set_ylabel(scale.label("worn volume"))
    below.set_xlabel("flown missions")
    set_from_zero(below, highest)
    add_legend(figure, below.get_lines())
    wears = (np.flatnonzero(np.isfinite(blocks["block_share"].values).all(axis=1)), blocks["block_share"].values)
    said = ""
    if wears[0].size:
        first, last = (wears[1][row] for row in (wears[0][0], wears[0][-1]))
        said = ", ".join(
            f"{name} {show_percent(float(one))} to {show_percent(float(other))}"
            for name, one, other in zip(names, first, last, strict=True)
        )
    caption = as_sentences(
        f"Shares of the blocks in the volume worn in one mission, and worn volumes by block, at"
        f" {result.describe(result.shown_point())}",
        f"From the first mission to the last: {said}" if said else "",
        "Bands: estimated errors" if "block_worn_volume_error" in blocks else "",
    )
    return Drawing("block_shares", "Wear by block", caption, figure)


def _draw_line(
    panel: Axes, missions: np.ndarray, values: np.ndarray, error: np.ndarray | None, place: int, name: str
) -> float:
    """Values of a block, in the unit of the panel, with the band of their relative error; the highest of them."""
    style = line_style(place, values.size)
    panel.plot(missions, values, label=name, **style)
    if error is not None:
        error = np.nan_to_num(error, posinf=0.0)
        panel.fill_between(missions, values * (1 - error), values * (1 + error), color=style["color"], alpha=0.2)
    return float(np.nanmax(values, initial=0.0))


def _draw_responses(result: Result, blocks: xr.Dataset) -> Drawing:
    """Amplitude of the first response over the missions, at the begin of each block and at its end."""
    ends = [name for name in _ENDS if name in blocks]
    figure, panels = new_panels(1, len(ends), 3.6, sharey=True)
    missions = np.asarray(result.cycles, dtype=float)
    amplitudes = [blocks[name].isel(response=0).values for name in ends]
    scale = scale_for("m", *amplitudes)
    name = f" of {result.responses[0]}" if result.responses else ""
    highest = 0.0
    for panel, amplitude, end in zip(panels[0], amplitudes, ends, strict=True):
        for place, block in enumerate(blocks["block"].values):
            error = blocks["response_error"].values[:, place] if "response_error" in blocks else None
            line = _draw_line(panel, missions, scale(amplitude[:, place]), error, place, str(block))
            highest = max(highest, line)
        panel.set_xlim(0.0, missions[-1])
        panel.set_xlabel("flown missions")
        panel.set_title(f"at the {_ENDS[end]} of the block")
    panels[0, 0].set_ylabel(scale.label(f"amplitude{name}"))
    set_from_zero(panels[0, 0], highest)
    add_legend(figure)
    more = len(result.responses) - 1
    caption = as_sentences(
        f"Amplitude of the first harmonic{name} at the {' and the '.join(_ENDS[each] for each in ends)} of each block,"
        f" in the mission that ends at the number, at {result.describe(result.shown_point())}",
        "Bands: estimated errors" if "response_error" in blocks else "",
        f"{more} more responses are in the file" if more > 0 else "",
    )
    return Drawing("block_responses", "Vibration of the blocks", caption, figure)

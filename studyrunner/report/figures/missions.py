"""Missions: which block wears how much over the life of a joint, and how the vibration of each block changes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

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
    title_at,
)
from studyrunner.result.units import scale_for, show_number
from studyrunner.result.view import NO_VOLUME, Result, as_sentences

_MOST_BLOCKS = 12
_TO_ASK = ("block_worn_volume", "block_share", "response_amplitude")
_ENDS = {"response_amplitude_begin": "begin", "response_amplitude": "end"}


def draw_missions(result: Result) -> Iterator[Drawing | Missing | Table]:
    """Table of the blocks, their shares in the wear over the missions, and their vibration; at the shown point."""
    assert result.blocks is not None
    shown = result.shown_point()
    blocks = result.blocks.isel({name: place for name, place in shown.items() if name in result.blocks.dims})
    yield _list_blocks(result, blocks)
    missing = [name for name in _TO_ASK if name not in blocks]
    said = f"Add {' and '.join(missing)} to [outputs] variables." if missing else ""
    if blocks.sizes["block"] > _MOST_BLOCKS:
        said = f"The mission has {blocks.sizes['block']} blocks, more than the {_MOST_BLOCKS} that are drawn."
    if said:
        yield Missing("blocks", "Wear and vibration by block", said)
    if len(result.cycles) == 1 or blocks.sizes["block"] > _MOST_BLOCKS:
        return
    if not {"block_worn_volume", "block_share"} & set(missing) and blocks["block_worn_volume"].max() > NO_VOLUME:
        yield _draw_shares(result, blocks)
    if "response_amplitude" in blocks:
        yield _draw_responses(result, blocks)


def _list_blocks(result: Result, blocks: xr.Dataset) -> Table:
    """Frequency, cycles, worn volume with its error, and share of each block at the last number of missions."""

    def number(name: str, place: int) -> float:
        return float(blocks[name].values[place]) if name in blocks else np.nan

    rows = []
    worn = blocks["block_worn_volume"].values if "block_worn_volume" in blocks else np.empty((0, 0))
    reached = np.flatnonzero(np.isfinite(worn).all(axis=1))
    for place, name in enumerate(blocks["block"].values):
        begin, end = number("excitation_frequency_begin", place), number("excitation_frequency", place)
        frequency = show_number(end) if begin == end else f"{show_number(begin)} to {show_number(end)}"
        amount, share = "-", "-"
        if reached.size:
            volume = worn[reached[-1]]
            amount = scale_for("m3", volume).show(float(volume[place]), 4)
            if "block_worn_volume_error" in blocks:
                error = float(blocks["block_worn_volume_error"].values[reached[-1], place])
                amount += f" ± {show_percent(error)}" if np.isfinite(error) and error > 0.0 else ""
            share = show_percent(float(volume[place] / volume.sum())) if volume.sum() > NO_VOLUME else "-"
        rate = number("sweep_rate", place)
        cycles = show_number(number("block_cycles", place), 4)
        rows.append((str(name), frequency, cycles, amount, share, f"{rate:.2g}" if rate > 0.0 else "-"))
    columns = ("block", "frequency (Hz)", "cycles", "worn volume", "share", "rate over (zeta f)²")
    when = f", wear after {result.cycle_label(int(reached[-1]))}" if reached.size else ""
    note = as_sentences(
        f"Cycles of one mission{when}", "A passage whose rate is far below (zeta f)² wears as its steady states do"
    )
    return Table("blocks", title_at(result, "Blocks of the mission"), columns, tuple(rows), note)


def _draw_shares(result: Result, blocks: xr.Dataset) -> Drawing:
    """Above, the shares of the blocks in the wear of one mission, on top of each other; below, their worn volumes."""
    figure, panels = new_panels(2, 1, 5.2, sharex=True)
    above, below = panels[:, 0]
    missions = np.asarray(result.cycles, dtype=float)
    names = [str(name) for name in blocks["block"].values]
    shares = blocks["block_share"].values
    colours = [COLOURS[place % len(COLOURS)] for place in range(len(names))]
    patches = above.stackplot(missions, 100.0 * np.nan_to_num(shares).T, colors=colours, alpha=0.75)
    for place, patch in enumerate(patches):
        # beyond the colours there are, the same ones with hatches
        patch.set_hatch("" if place < len(COLOURS) else "///")
    above.set_ylabel("share in a mission (%)")
    above.set_ylim(0.0, 100.0)
    above.set_xlim(0.0, missions[-1])
    errors = blocks["block_worn_volume_error"].values if "block_worn_volume_error" in blocks else None
    scale = scale_for("m3", blocks["block_worn_volume"].values)
    _draw_lines(below, missions, scale(blocks["block_worn_volume"].values), errors, names)
    below.set_ylabel(scale.label("worn volume"))
    below.set_xlabel("missions")
    add_legend(figure, below.get_lines())
    known = np.flatnonzero(np.isfinite(shares).all(axis=1))
    said = [
        f"{name} {show_percent(float(shares[known[0], place]))} to {show_percent(float(shares[known[-1], place]))}"
        for place, name in enumerate(names)
        if known.size
    ]
    caption = as_sentences(
        "Above, shares of the blocks in the volume worn in one mission; below, worn volumes by block",
        f"From the first mission to the last: {', '.join(said)}" if said else "",
        "Bands: estimated errors" if errors is not None else "",
    )
    return Drawing("block_shares", title_at(result, "Wear by block"), caption, figure)


def _draw_lines(
    panel: Axes,
    missions: NDArray[np.float64],
    values: NDArray[np.float64],
    errors: NDArray[np.float64] | None,
    names: list[str],
) -> None:
    """Values of the blocks (n_missions, n_blocks), in the unit of the panel, with bands of their relative errors."""
    for place, name in enumerate(names):
        style, own = line_style(place, len(values)), values[:, place]
        panel.plot(missions, own, label=name, **style)
        if errors is not None:
            error = np.nan_to_num(errors[:, place], posinf=0.0)
            panel.fill_between(missions, own * (1 - error), own * (1 + error), color=style["color"], alpha=0.2)
    set_from_zero(panel, float(np.nanmax(values, initial=0.0)))


def _draw_responses(result: Result, blocks: xr.Dataset) -> Drawing:
    """Amplitude of the first response over the missions, at the begin of each block and at its end."""
    ends = [name for name in _ENDS if name in blocks]
    figure, panels = new_panels(1, len(ends), 3.6, sharey=True)
    missions, names = np.asarray(result.cycles, dtype=float), [str(name) for name in blocks["block"].values]
    amplitudes = [blocks[name].isel(response=0).values for name in ends]
    scale = scale_for("m", *amplitudes)
    errors = blocks["response_error"].values if "response_error" in blocks else None
    for panel, amplitude, end in zip(panels[0], amplitudes, ends, strict=True):
        _draw_lines(panel, missions, scale(amplitude), errors, names)
        panel.set_xlim(0.0, missions[-1])
        panel.set_xlabel("missions")
        panel.set_title(f"at the {_ENDS[end]} of the block")
    set_from_zero(panels[0, 0], max(float(np.nanmax(scale(each), initial=0.0)) for each in amplitudes))
    panels[0, 0].set_ylabel(scale.label(f"amplitude of {result.responses[0]}" if result.responses else "amplitude"))
    add_legend(figure)
    caption = as_sentences(
        "Amplitude of the first harmonic in the mission that ends at the number",
        "Bands: estimated errors" if errors is not None else "",
        f"{len(result.responses) - 1} more responses are in the file" if len(result.responses) > 1 else "",
    )
    return Drawing("block_responses", title_at(result, "Vibration of the blocks"), caption, figure)

"""Missions: which block wears how much over the life of a joint, and how the vibration of each block changes."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from studyrunner.percent import show_percent
from studyrunner.report.drawing import Drawn, Table
from studyrunner.report.panels import COLOURS, FloatArray, add_legend, add_line, line_style, new_panels, set_from_zero
from studyrunner.result.units import scale_for, show_number
from studyrunner.result.view import NO_VOLUME, Result, as_sentences

_MOST_BLOCKS = 12
_ENDS = {"response_amplitude_begin": "begin", "response_amplitude": "end"}


def _blocks(result: Result) -> xr.Dataset:
    """What belongs to blocks at the shown point."""
    assert result.blocks is not None
    return result.blocks.isel(result.shown_point(), missing_dims="ignore")


def list_blocks(result: Result) -> Table:
    """Frequency, cycles, worn volume with its error, and share of each block at the last number of missions."""
    blocks = _blocks(result)
    nothing = np.full((1, blocks.sizes["block"]), np.nan)
    worn, wrong = (
        blocks[name].values if name in blocks else nothing for name in ("block_worn_volume", "block_worn_volume_error")
    )
    reached = np.flatnonzero(np.isfinite(worn).all(axis=1))
    last = int(reached[-1]) if reached.size else 0
    scale, total = scale_for("m3", worn[last]), float(worn[last].sum())

    def number(name: str, place: int) -> float:
        return float(blocks[name].values[place]) if name in blocks else np.nan

    rows = []
    for place, name in enumerate(blocks["block"].values):
        begin, end = number("excitation_frequency_begin", place), number("excitation_frequency", place)
        frequency = show_number(end) if begin == end else f"{show_number(begin)} to {show_number(end)}"
        volume, error, rate = worn[last, place], wrong[last, place], number("sweep_rate", place)
        amount = scale.show(float(volume), 4) if reached.size else "-"
        amount += f" ± {show_percent(float(error))}" if np.isfinite(error) and error > 0.0 else ""
        share = show_percent(float(volume / total)) if total > NO_VOLUME else "-"
        cycles = show_number(number("block_cycles", place), 4)
        rows.append((str(name), frequency, cycles, amount, share, f"{rate:.2g}" if rate > 0.0 else "-"))
    columns = ("block", "frequency (Hz)", "cycles", "worn volume", "share", "rate over (zeta f)²")
    note = as_sentences(
        f"Cycles of one mission{f', wear after {result.cycle_label(last)}' if reached.size else ''}",
        "A passage whose rate is far below (zeta f)² wears as its steady states do",
    )
    return Table(columns, tuple(rows), note)


def _lacking(blocks: xr.Dataset, *needs: str) -> str:
    """A sentence where the file lacks variables of blocks, or has too many of them; else empty."""
    lacks, number = [each for each in needs if each not in blocks], blocks.sizes["block"]
    if lacks:
        return f"Add {' and '.join(lacks)} to [outputs] variables."
    said = f"The mission has {number} blocks, more than the {_MOST_BLOCKS} that are drawn."
    return said if number > _MOST_BLOCKS else ""


def draw_shares(result: Result) -> Drawn:
    """Above, the shares of the blocks in the wear of one mission, on top of each other; below, their worn volumes."""
    blocks = _blocks(result)
    if lacking := _lacking(blocks, "block_worn_volume", "block_share"):
        return lacking
    worn, shares = blocks["block_worn_volume"].values, blocks["block_share"].values
    if len(result.cycles) == 1 or not np.nanmax(worn, initial=0.0) > NO_VOLUME:
        return None
    figure, panels = new_panels(2, 1, 5.2, sharex=True)
    above, below = panels[:, 0]
    names = [str(name) for name in blocks["block"].values]
    colours = [COLOURS[place % len(COLOURS)] for place in range(len(names))]
    patches = above.stackplot(result.cycles, 100.0 * np.nan_to_num(shares).T, colors=colours, alpha=0.75)
    for place, patch in enumerate(patches):
        # beyond the colours there are, the same ones with hatches
        patch.set_hatch("" if place < len(COLOURS) else "///")
    above.set(ylabel="share in a mission (%)", ylim=(0.0, 100.0), xlim=(0.0, result.cycles[-1]))
    errors, scale = _errors(blocks, "block_worn_volume_error"), scale_for("m3", worn)
    _draw_lines(below, result.cycles, scale(worn), errors, names)
    below.set(ylabel=scale.label("worn volume"), xlabel="missions")
    add_legend(figure, below.get_lines())
    known = np.flatnonzero(np.isfinite(shares).all(axis=1))
    ends = []
    for place, name in enumerate(names if known.size else []):
        first, last = (show_percent(float(shares[at, place])) for at in known[[0, -1]])
        ends.append(f"{name} {first} to {last}")
    return figure, as_sentences(
        "Above, shares of the blocks in the volume worn in one mission; below, worn volumes by block",
        f"From the first mission to the last: {', '.join(ends)}" if ends else "",
        "Bands: estimated errors" if errors is not None else "",
    )


def _errors(blocks: xr.Dataset, name: str) -> FloatArray | None:
    return np.asarray(blocks[name].values, dtype=float) if name in blocks else None


def _draw_lines(
    panel: Axes, missions: FloatArray, values: FloatArray, errors: FloatArray | None, names: list[str]
) -> None:
    """Values of the blocks (n_missions, n_blocks), in the unit of the panel, with bands of their relative errors."""
    for place, name in enumerate(names):
        own = values[:, place]
        error = None if errors is None else errors[:, place] * own
        add_line(panel, missions, own, error, band=True, label=name, **line_style(place, len(own)))
    set_from_zero(panel, float(np.nanmax(values, initial=0.0)))


def draw_responses(result: Result) -> Drawn:
    """Amplitude of the first response over the missions, at the begin of each block and at its end."""
    blocks = _blocks(result)
    if lacking := _lacking(blocks, "response_amplitude"):
        return lacking
    if len(result.cycles) == 1:
        return None
    ends = [name for name in _ENDS if name in blocks]
    figure, panels = new_panels(1, len(ends), 3.6, sharey=True)
    names = [str(name) for name in blocks["block"].values]
    amplitudes = [blocks[name].isel(response=0).values for name in ends]
    scale, errors = scale_for("m", *amplitudes), _errors(blocks, "response_error")
    for panel, amplitude, end in zip(panels[0], amplitudes, ends, strict=True):
        _draw_lines(panel, result.cycles, scale(amplitude), errors, names)
        panel.set(title=f"at the {_ENDS[end]} of the block", xlabel="missions", xlim=(0.0, result.cycles[-1]))
    set_from_zero(panels[0, 0], max(float(np.nanmax(scale(each), initial=0.0)) for each in amplitudes))
    panels[0, 0].set_ylabel(scale.label(f"amplitude of {result.responses[0]}"))
    add_legend(figure)
    return figure, as_sentences(
        "Amplitude of the first harmonic in the mission that ends at the number",
        "Bands: estimated errors" if errors is not None else "",
        f"{len(result.responses) - 1} more responses are in the file" if len(result.responses) > 1 else "",
    )

"""Missions: which block wears how much over the life of a joint, and how the vibration of each block changes."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from studyrunner.report.drawing import Drawn, Table
from studyrunner.report.panels import COLOURS, FloatArray, add_legend, add_line, line_style, new_panels, set_from_zero
from studyrunner.result.view import NO_VOLUME, Result
from studyrunner.units import Scale, scale_for, show_number, show_percent

_MOST_BLOCKS = 12
_ENDS = {"response_amplitude_begin": "begin", "response_amplitude": "end"}


def _read_blocks(result: Result, *needs: str) -> xr.Dataset | str:
    """What belongs to blocks at the shown point; a sentence where the file lacks variables, or has too many blocks."""
    assert result.blocks is not None
    blocks = result.blocks.isel(result.shown_point(), missing_dims="ignore")
    if lacks := [each for each in needs if each not in blocks]:
        return f"Add {' and '.join(lacks)} to [outputs] variables."
    if needs and blocks.sizes["block"] > _MOST_BLOCKS:
        return f"The mission has {blocks.sizes['block']} blocks, more than the {_MOST_BLOCKS} that are drawn."
    return blocks


def list_blocks(result: Result) -> Drawn:
    """Frequency, cycles, worn volume with its error, and share of each block at the last number of missions."""
    blocks = _read_blocks(result)
    assert isinstance(blocks, xr.Dataset)
    nothing = np.full((len(result.cycles), blocks.sizes["block"]), np.nan)
    worn, wrong = (
        blocks[name].values if name in blocks else nothing for name in ("block_worn_volume", "block_worn_volume_error")
    )
    reached = np.flatnonzero(np.isfinite(worn).all(axis=1))
    last = int(reached[-1]) if reached.size else 0
    scale, total, rows = scale_for("m3", worn[last]), float(worn[last].sum()), []
    names = ("excitation_frequency_begin", "excitation_frequency", "block_cycles", "sweep_rate")
    numbers = [blocks[name].values if name in blocks else nothing[0] for name in names]
    for name, volume, error, begin, end, cycles, rate in zip(
        blocks["block"].values, worn[last].tolist(), wrong[last].tolist(), *numbers, strict=True
    ):
        frequency = " to ".join(dict.fromkeys(map(show_number, (float(begin), float(end)))))
        amount = scale.show(volume, 4) if reached.size else "-"
        amount += f" ± {show_percent(error)}" if error > 0.0 else ""
        share = show_percent(volume / total) if total > NO_VOLUME else "-"
        passage = f"{rate:.2g}" if rate > 0.0 else "-"
        rows.append((str(name), frequency, show_number(float(cycles), 4), amount, share, passage))
    columns = ("block", "frequency (Hz)", "cycles", "worn volume", "share", "rate over (zeta f)²")
    return Table(columns, tuple(rows), f"Wear after {result.cycle_label(last)}." if reached.size else "")


def _draw_lines(result: Result, panel: Axes, blocks: xr.Dataset, values: FloatArray, scale: Scale, error: str) -> None:
    """A line a block of values (n_missions, n_blocks), with bands of their relative errors of this name."""
    for place, name in enumerate(blocks["block"].values):
        own = scale(values[:, place])
        wrong = blocks[error].values[:, place] * own if error in blocks else None
        look = line_style(place, len(own)) | {"label": str(name)}
        add_line(panel, result.cycles, own, wrong, band=True, **look)
    set_from_zero(panel, float(np.nanmax(scale(values), initial=0.0)))


def draw_shares(result: Result) -> Drawn:
    """Above, the shares of the blocks in the wear of one mission, on top of each other; below, their worn volumes."""
    blocks = _read_blocks(result, "block_worn_volume", "block_share")
    if isinstance(blocks, str):
        return blocks
    worn, shares, error = blocks["block_worn_volume"].values, blocks["block_share"].values, "block_worn_volume_error"
    if len(result.cycles) == 1 or not np.nanmax(worn, initial=0.0) > NO_VOLUME:
        return None
    figure, ((above,), (below,)) = new_panels(2, 1, 5.2, sharex=True)
    names = blocks["block"].values
    colours = [COLOURS[place % len(COLOURS)] for place in range(len(names))]
    patches = above.stackplot(result.cycles, 100.0 * np.nan_to_num(shares).T, colors=colours, alpha=0.75)
    for place, patch in enumerate(patches):
        # beyond the colours there are, the same ones with hatches
        patch.set_hatch("" if place < len(COLOURS) else "///")
    above.set(ylabel="share in a mission (%)", ylim=(0.0, 100.0), xlim=(0.0, result.cycles[-1]))
    scale = scale_for("m3", worn)
    _draw_lines(result, below, blocks, worn, scale, error)
    below.set(ylabel=scale.label("worn volume"), xlabel="missions")
    add_legend(figure, below.get_lines())
    return (figure,)


def draw_responses(result: Result) -> Drawn:
    """Amplitude of the first response over the missions, at the begin of each block and at its end."""
    blocks = _read_blocks(result, "response_amplitude")
    if isinstance(blocks, str):
        return blocks
    if len(result.cycles) == 1:
        return None
    ends, error = [name for name in _ENDS if name in blocks], "response_error"
    figure, panels = new_panels(1, len(ends), 3.6, sharey=True)
    amplitudes = [blocks[name].isel(response=0).values for name in ends]
    scale = scale_for("m", *amplitudes)
    for panel, amplitude, end in zip(panels[0], amplitudes, ends, strict=True):
        _draw_lines(result, panel, blocks, amplitude, scale, error)
        panel.set(title=f"at the {_ENDS[end]} of the block", xlabel="missions", xlim=(0.0, result.cycles[-1]))
    set_from_zero(panels[0, 0], max(float(np.nanmax(scale(each), initial=0.0)) for each in amplitudes))
    panels[0, 0].set_ylabel(scale.label(f"amplitude of {result.responses[0]}"))
    return figure, f"{len(result.responses) - 1} more responses are in the file" if len(result.responses) > 1 else ""

"""Bars of what each input decides of the worn volume: Sobol' indices, or rank correlations."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from studyrunner.report.drawing import COLOURS, Drawing, Missing, add_legend
from studyrunner.report.reading.result import Result, as_sentences
from studyrunner.report.scatter.points import HIGHEST, LOWEST, choose_points, ends, last_of, panel_grid
from studyrunner.statistics.ranking import describe_ranking, measure_of

_TITLE = "What decides the worn volume"
_WIDTH = 0.72


def measures_of(statistics: xr.Dataset) -> dict[str, str]:
    """Statistics of the inputs that are drawn, and their words: shares of the variance, or rank correlations."""
    if measure_of(statistics) == "first_index":
        return {"first_index": "alone", "total_index": "with the others"}
    return {"rank_correlation": "rank correlation"}


def draw_indices(result: Result, statistics: xr.Dataset) -> Drawing | Missing:
    """What each input decides at the last cycle count, one panel a combination of the other axes."""
    last, measure = last_of(statistics), measure_of(statistics)
    if measure is None or not last[measure].notnull().any():
        sentence = "The file holds too few samples to say what decides, or samples that do not differ: raise samples."
        return Missing("deciding_inputs", _TITLE, sentence)
    shown, bars = choose_points(result, last), measures_of(last)
    figure, panels = panel_grid(len(shown.points), 2.9, sharex=True, sharey=True)
    for panel, (_, label, point) in zip(panels.flat, shown, strict=True):
        _draw_bars(panel, point, bars)
        panel.set_title(label)
    shares = measure == "first_index"
    for row in panels:
        row[0].set_ylabel("share of the variance" if shares else "rank correlation")
    add_legend(figure)
    told = [f"{f'{label}: ' if label else ''}{says}" for _, label, point in shown if (says := describe_ranking(point))]
    what = (
        f"Share of the variance of the worn volume {result.when(-1)} that each input decides, alone and together with"
        " the other inputs: first and total Sobol' indices"
        if shares
        else f"Rank correlation of the worn volume {result.when(-1)} with each input: 1 or -1 where the volume rises or"
        " falls with this input alone; an effect that rises and falls is not seen"
    )
    text = as_sentences(
        what,
        *told,
        f"Bars of the uncertainty: {100.0 * float(statistics.attrs['confidence']):g} % confidence",
        "Hatched: what samples without a value leave open" if _is_open(last, measure) else "",
        f"Estimate: {last[measure].attrs['method']}",
        str(last[measure].attrs["comment"])
        if any("contact" in result.dataset[f"sample_{name}"].dims for name in last["input"].values)
        else "",
        shown.sentence,
    )
    return Drawing("deciding_inputs", _TITLE, text, figure)


def _draw_bars(panel: Axes, point: xr.Dataset, bars: dict[str, str]) -> None:
    names, width = [str(name) for name in point["input"].values], _WIDTH / len(bars)
    for place, ((name, words), colour) in enumerate(zip(bars.items(), COLOURS, strict=False)):
        value, interval = ends(point, name, "input"), ends(point, f"{name}_interval", "input")
        at = np.arange(len(names)) + (place - 0.5 * (len(bars) - 1)) * 1.1 * width
        known = np.isfinite(value).all(axis=1)
        if not known.any():
            continue
        at, value, interval = at[known], value[known], interval[known]
        panel.bar(at, value[:, LOWEST], width, color=colour, label=words)
        if (value[:, HIGHEST] > value[:, LOWEST]).any():
            more = value[:, HIGHEST] - value[:, LOWEST]
            panel.bar(at, more, width, value[:, LOWEST], fill=False, hatch="////", edgecolor=colour, linewidth=0.0)
        middle = value.mean(axis=1)
        sides = np.maximum(np.stack([middle - interval[:, LOWEST], interval[:, HIGHEST] - middle]), 0.0)
        panel.errorbar(at, middle, yerr=sides, fmt="none", ecolor="0.2", elinewidth=1.0, capsize=3.0)
    panel.set_xticks(range(len(names)), [name.replace("_", "\n") for name in names])
    panel.set_xlim(-0.6, len(names) - 0.4)
    panel.set_ylim(0.0 if "first_index" in bars else -1.02, 1.02)
    panel.grid(visible=False, axis="x")


def _is_open(last: xr.Dataset, measure: str) -> bool:
    value = last[measure]
    return bool((value.isel(bound=HIGHEST) > value.isel(bound=LOWEST)).any())

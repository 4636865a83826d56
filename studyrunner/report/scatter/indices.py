"""Bars of the Sobol' indices: which share of the variance of the worn volume an input decides."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from studyrunner.report.drawing import COLOURS, Drawing, Missing, add_legend
from studyrunner.report.reading.result import Result, as_sentences
from studyrunner.report.scatter.points import HIGHEST, LOWEST, choose_points, ends, last_of, panel_grid

_TITLE = "What decides the worn volume"
_BARS = (("first_index", "alone", -0.2), ("total_index", "with the others", 0.2))
_WIDTH = 0.36


def draw_indices(result: Result, statistics: xr.Dataset) -> Drawing | Missing:
    """First and total indices at the last cycle count, one panel a combination of the other axes."""
    last = last_of(statistics)
    if "first_index" not in last or not last["first_index"].notnull().any():
        sentence = "The file holds too few samples for Sobol' indices, or samples that do not differ: raise samples."
        return Missing("sobol_indices", _TITLE, sentence)
    shown = choose_points(result, last)
    figure, panels = panel_grid(len(shown.points), 2.9, sharex=True, sharey=True)
    for panel, (_, label, point) in zip(panels.flat, shown, strict=True):
        _draw_bars(panel, point)
        panel.set_title(label)
    for row in panels:
        row[0].set_ylabel("share of the variance")
    add_legend(figure)
    told = [
        f"{f'{label}: ' if label else ''}{_tell(point)}"
        for _, label, point in shown
        if point["first_index"].notnull().any()
    ]
    methods = [f"{words}: {last[name].attrs['method']}" for name, words, _ in _BARS]
    text = as_sentences(
        f"Share of the variance of the worn volume {result.when(-1)} that each input decides, alone and together with"
        " the other inputs: first and total Sobol' indices",
        *told,
        f"Bars of the uncertainty: {100.0 * float(statistics.attrs['confidence']):g} % confidence",
        "Hatched: what samples without a value leave open" if _is_open(last) else "",
        f"Estimates: {'; '.join(methods)}",
        "Of an input with a draw for each pair: what the mean over the pairs decides"
        if any("contact" in result.dataset[f"sample_{name}"].dims for name in last["input"].values)
        else "",
        shown.sentence,
    )
    return Drawing("sobol_indices", _TITLE, text, figure)


def _draw_bars(panel: Axes, point: xr.Dataset) -> None:
    names = [str(name) for name in point["input"].values]
    for (name, words, shift), colour in zip(_BARS, COLOURS, strict=False):
        value, interval = ends(point, name, "input"), ends(point, f"{name}_interval", "input")
        at = np.arange(len(names)) + shift
        known = np.isfinite(value).all(axis=1)
        if not known.any():
            continue
        at, value, interval = at[known], value[known], interval[known]
        panel.bar(at, value[:, LOWEST], _WIDTH, color=colour, label=words)
        if (value[:, HIGHEST] > value[:, LOWEST]).any():
            more = value[:, HIGHEST] - value[:, LOWEST]
            panel.bar(at, more, _WIDTH, value[:, LOWEST], fill=False, hatch="////", edgecolor=colour, linewidth=0.0)
        middle = value.mean(axis=1)
        sides = np.maximum(np.stack([middle - interval[:, LOWEST], interval[:, HIGHEST] - middle]), 0.0)
        panel.errorbar(at, middle, yerr=sides, fmt="none", ecolor="0.2", elinewidth=1.0, capsize=3.0)
    panel.set_xticks(range(len(names)), [name.replace("_", "\n") for name in names])
    panel.set_xlim(-0.6, len(names) - 0.4)
    panel.set_ylim(0.0, 1.02)
    panel.grid(visible=False, axis="x")


def _tell(point: xr.Dataset) -> str:
    """Shares of the inputs in words, the largest first."""
    share = np.nan_to_num(ends(point, "first_index", "input"))
    order = np.argsort(-share[:, LOWEST], kind="stable")
    names = [str(name).replace("_", " ") for name in point["input"].values]
    return ", ".join(f"{names[place]} {_percent(*share[place])} alone" for place in order.tolist())


def _percent(low: float, high: float) -> str:
    first, last = f"{100.0 * low:.0f}", f"{100.0 * high:.0f}"
    return f"{first} %" if first == last else f"{first} to {last} %"


def _is_open(last: xr.Dataset) -> bool:
    value = last["first_index"]
    return bool((value.isel(bound=HIGHEST) > value.isel(bound=LOWEST)).any())
